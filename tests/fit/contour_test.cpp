// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/contour.hpp"

#include "lineament/camera/angles.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <set>

namespace lineament {
namespace {

const MorphableModel& model()
{
    static const MorphableModel face = test::make_synthetic_face({.half_columns = 24, .half_rows = 24});
    return face;
}

Eigen::Matrix3Xf mean_vertices()
{
    return model().mesh_of(model().shape.mean).vertices;
}

Camera camera_at(double yaw_deg, double pitch_deg = 0)
{
    Camera camera;
    camera.camera_from_model = rotation_from_angles({radians(yaw_deg), radians(pitch_deg), 0});
    camera.principal_point_px = {320, 240};
    return camera;
}

/// Silhouette vertices by definition: every pair of triangles that share an edge, with normals in camera space.
std::set<int> silhouette_by_definition(const Eigen::Matrix3Xf& shape, const Camera& camera, FaceSide side)
{
    const Eigen::Matrix3Xi& triangles = model().levels.back().triangles;
    const Eigen::Vector3d axis = camera.camera_from_model.row(2);
    const auto faces = [&](Eigen::Index t) {
        const Eigen::Vector3d a = shape.col(triangles(0, t)).cast<double>();
        const Eigen::Vector3d b = shape.col(triangles(1, t)).cast<double>();
        const Eigen::Vector3d c = shape.col(triangles(2, t)).cast<double>();
        return axis.dot((b - a).cross(c - a)) < 0;
    };
    std::map<std::pair<int, int>, std::vector<bool>> edges;
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            const int a = triangles(corner, t);
            const int b = triangles((corner + 1) % 3, t);
            edges[{std::min(a, b), std::max(a, b)}].push_back(faces(t));
        }
    }
    const Eigen::Matrix3Xf mean = mean_vertices();
    const Eigen::Matrix3Xf points = model().landmark_maps[0].points_on(mean);
    const float top = std::max(points(1, 0), points(1, 16)) + 15;
    const float mouth = std::min(points(1, 48), points(1, 54));
    const auto is_inside = [&](int vertex) {
        const float x = side == FaceSide::left ? mean(0, vertex) : -mean(0, vertex);
        return x > 0 && mean(1, vertex) <= top && (mean(1, vertex) <= mouth || x > 30);
    };
    std::set<int> vertices;
    for (const auto& [ends, facing] : edges) {
        if (facing.size() == 2 && facing[0] != facing[1] && is_inside(ends.first) && is_inside(ends.second)) {
            vertices.insert({ends.first, ends.second});
        }
    }
    return vertices;
}

/// Whether a ray from the vertex to the camera meets a coarse triangle more than `depth_mm` in front of it.
bool is_hidden(const Eigen::Matrix3Xf& shape, const Camera& camera, int vertex, double depth_mm)
{
    const Eigen::Matrix3Xd seen = camera.camera_from_model * shape.cast<double>();
    const Eigen::Matrix3Xi& triangles = model().levels.front().triangles;
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        Eigen::Matrix3d corners;
        for (int corner = 0; corner < 3; ++corner) {
            corners.col(corner) << seen.col(triangles(corner, t)).head<2>(), 1.0;
        }
        if (std::abs(corners.determinant()) < 1e-9) {
            continue;
        }
        const Eigen::Vector3d weights = corners.inverse() * Eigen::Vector3d(seen(0, vertex), seen(1, vertex), 1);
        if (weights.minCoeff() >= 0) {
            double depth = 0;
            for (int corner = 0; corner < 3; ++corner) {
                depth += weights[corner] * seen(2, triangles(corner, t));
            }
            if (depth < seen(2, vertex) - depth_mm) {
                return true;
            }
        }
    }
    return false;
}

TEST(ContourModel, SilhouetteIsWhatTheDefinitionSays)
{
    const ContourModel contour(model());
    for (const double yaw_deg : {20.0, 35.0, 50.0, 70.0}) {
        for (const FaceSide side : {FaceSide::left, FaceSide::right}) {
            const Camera camera = camera_at(side == FaceSide::left ? yaw_deg : -yaw_deg, 5);
            const std::set<int> expected = silhouette_by_definition(mean_vertices(), camera, side);
            ASSERT_GE(expected.size(), 10u);
            // No head lies a metre in front of itself: nothing is hidden.
            const std::vector<int> found = contour.silhouette_vertices(mean_vertices(), camera, side, 1000);
            EXPECT_EQ(std::set<int>(found.begin(), found.end()), expected);
        }
    }
}

TEST(ContourModel, HiddenVerticesAreThoseARayFinds)
{
    // A nose of 120 mm hides part of the far cheek.
    Eigen::Matrix3Xf shape = mean_vertices();
    const Eigen::Vector3f tip = shape.col(model().landmark_maps[0].vertices(0, 30));
    for (Eigen::Index v = 0; v < shape.cols(); ++v) {
        const float squared = (shape.col(v) - tip).head<2>().squaredNorm();
        shape(2, v) += 120 * std::exp(-squared / (2 * 12.0f * 12.0f));
    }
    const ContourModel contour(model());
    int num_hidden = 0, num_all = 0, num_agreed = 0;
    for (const double yaw_deg : {35.0, 50.0, 60.0, 70.0}) {
        const Camera camera = camera_at(yaw_deg);
        const std::vector<int> all = contour.silhouette_vertices(shape, camera, FaceSide::left, 1000);
        const std::vector<int> seen = contour.silhouette_vertices(shape, camera, FaceSide::left, 20);
        for (const int vertex : all) {
            const bool is_seen = std::binary_search(seen.begin(), seen.end(), vertex);
            const bool hidden = is_hidden(shape, camera, vertex, 20);
            num_hidden += hidden;
            num_agreed += hidden != is_seen;
            ++num_all;
        }
    }
    EXPECT_GE(num_hidden, 5);
    EXPECT_GE(num_agreed, 0.93 * num_all); // the rest lies within a cell of the occluder's outline
}

TEST(ContourModel, ReadsOnlyTheVerticesItNames)
{
    const ContourModel contour(model());
    Eigen::Matrix3Xf partial =
        Eigen::Matrix3Xf::Constant(3, model().num_vertices(), std::numeric_limits<float>::quiet_NaN());
    const Eigen::Index count = contour.num_occluder_vertices();
    partial.leftCols(count) = mean_vertices().leftCols(count);
    for (const int vertex : contour.region_vertices(FaceSide::left)) {
        partial.col(vertex) = mean_vertices().col(vertex);
    }
    EXPECT_LT(count + static_cast<Eigen::Index>(contour.region_vertices(FaceSide::left).size()),
              model().num_vertices());
    EXPECT_EQ(contour.silhouette_vertices(partial, camera_at(40), FaceSide::left),
              contour.silhouette_vertices(mean_vertices(), camera_at(40), FaceSide::left));
}

TEST(ContourModel, MirroredPoseGivesTheMirroredSilhouette)
{
    const ContourModel contour(model());
    std::set<int> mirrored;
    for (const int vertex : contour.silhouette_vertices(mean_vertices(), camera_at(40), FaceSide::left)) {
        mirrored.insert(model().mirror[vertex]);
    }
    const std::vector<int> right = contour.silhouette_vertices(mean_vertices(), camera_at(-40), FaceSide::right);
    EXPECT_EQ(std::set<int>(right.begin(), right.end()), mirrored);
}

TEST(ContourView, HasHysteresis)
{
    const auto view = [](double yaw_deg, ContourView before) { return contour_view(radians(yaw_deg), before); };
    EXPECT_EQ(view(0, ContourView::frontal), ContourView::frontal);
    EXPECT_EQ(view(8, ContourView::frontal), ContourView::frontal);
    EXPECT_EQ(view(9, ContourView::frontal), ContourView::shows_right);
    EXPECT_EQ(view(-9, ContourView::frontal), ContourView::shows_left);
    EXPECT_EQ(view(7, ContourView::shows_right), ContourView::shows_right);
    EXPECT_EQ(view(6, ContourView::shows_right), ContourView::frontal);
    EXPECT_EQ(view(-30, ContourView::shows_right), ContourView::shows_left);
}

TEST(OutlineSide, InAnotherSchemeIsNamedByThePrefixAlone)
{
    EXPECT_EQ(outline_side("mediapipe478", "ibug68:1"), FaceSide::right);
    EXPECT_EQ(outline_side("mediapipe478", "ibug68:17"), FaceSide::left);
    for (const char* name : {"1", "17", "ibug68:9", "ibug68:", "ibug68:18"}) {
        EXPECT_EQ(outline_side("mediapipe478", name), std::nullopt) << name;
    }
    EXPECT_EQ(outline_side("ibug68", "ibug68:1"), std::nullopt);
}

TEST(OutlineSide, NamesTheSubjectsSideAndLeavesTheChinAlone)
{
    EXPECT_EQ(outline_side("ibug68", "1"), FaceSide::right);
    EXPECT_EQ(outline_side("ibug68", "8"), FaceSide::right);
    EXPECT_EQ(outline_side("ibug68", "10"), FaceSide::left);
    EXPECT_EQ(outline_side("ibug68", "17"), FaceSide::left);
    for (const char* name : {"9", "18", "68", "0", "01", "", "x", "1x", "117"}) {
        EXPECT_EQ(outline_side("ibug68", name), std::nullopt) << name;
    }
}

/// Landmarks exactly on vertices of the outline as seen.
LandmarkSet outline_landmarks(const ContourModel& contour, const Camera& camera, FaceSide occluding)
{
    LandmarkSet set;
    const auto add = [&](int number, int vertex) {
        const Eigen::Vector3d point = mean_vertices().col(vertex).cast<double>();
        set.landmarks.push_back({std::to_string(number), camera.project(point), 1.0});
    };
    const std::vector<int> silhouette = contour.silhouette_vertices(mean_vertices(), camera, occluding);
    const FaceSide front = occluding == FaceSide::left ? FaceSide::right : FaceSide::left;
    for (int i = 0; i < 8; ++i) {
        add(occluding == FaceSide::left ? 10 + i : 1 + i, silhouette[i * silhouette.size() / 8]);
        add(front == FaceSide::left ? 10 + i : 1 + i,
            contour.candidates(front)[i * contour.candidates(front).size() / 8]);
    }
    return set;
}

TEST(MatchContour, NamesTheCandidatesThatLandmarksWerePutOn)
{
    const ContourModel contour(model());
    const Camera camera = camera_at(25); // the right side faces the camera
    const std::vector<int>& candidates = contour.candidates(FaceSide::right);
    ASSERT_GE(candidates.size(), 8u);
    LandmarkSet landmarks;
    std::vector<int> planted;
    for (int i = 1; i <= 8; ++i) {
        const int vertex = candidates[static_cast<std::size_t>(i - 1) * (candidates.size() - 1) / 7];
        const Eigen::Vector3d point = mean_vertices().col(vertex).cast<double>();
        landmarks.landmarks.push_back({std::to_string(i), camera.project(point)});
        planted.push_back(vertex);
    }
    ContourOptions options;
    options.occluding_match = OccludingMatch::none;
    const ContourMatches found =
        match_contour(contour, mean_vertices(), camera, landmarks, ContourView::frontal, options);
    ASSERT_EQ(found.matches.size(), 8u);
    for (const ContourMatch& match : found.matches) {
        EXPECT_EQ(match.vertex, planted[static_cast<std::size_t>(match.landmark_index)]);
    }
}

TEST(MatchContour, TiesLandmarksToTheVerticesTheyWereMadeFrom)
{
    const ContourModel contour(model());
    for (const double yaw_deg : {40.0, -40.0}) {
        const Camera camera = camera_at(yaw_deg);
        const LandmarkSet set = outline_landmarks(contour, camera, yaw_deg > 0 ? FaceSide::left : FaceSide::right);
        const ContourMatches matches = match_contour(contour, mean_vertices(), camera, set);
        EXPECT_EQ(matches.view, yaw_deg > 0 ? ContourView::shows_right : ContourView::shows_left);
        ASSERT_EQ(matches.matches.size(), 16u);
        for (const ContourMatch& match : matches.matches) {
            EXPECT_LE(match.distance_px, 1e-3);
        }
        ContourOptions options;
        options.occluding_match = OccludingMatch::none;
        EXPECT_EQ(match_contour(contour, mean_vertices(), camera, set, ContourView::frontal, options).matches.size(),
                  8u);
        options.occluding_match = OccludingMatch::silhouette_to_landmark;
        EXPECT_GT(match_contour(contour, mean_vertices(), camera, set, ContourView::frontal, options).matches.size(),
                  16u);
    }
}

TEST(MatchContour, DropsSilhouetteMatchesBeyondTheDistance)
{
    const ContourModel contour(model());
    const Camera camera = camera_at(40);
    LandmarkSet set = outline_landmarks(contour, camera, FaceSide::left);
    for (Landmark& landmark : set.landmarks) {
        landmark.point_px.x() += outline_side("ibug68", landmark.name) == FaceSide::left ? 100 : 0;
    }
    const ContourMatches matches = match_contour(contour, mean_vertices(), camera, set);
    ASSERT_EQ(matches.matches.size(), 8u);
    for (const ContourMatch& match : matches.matches) {
        EXPECT_EQ(outline_side("ibug68", set.landmarks[match.landmark_index].name), FaceSide::right);
    }
}

TEST(MatchContour, BrokenInputThrows)
{
    const ContourModel contour(model());
    const Eigen::Matrix3Xf few = mean_vertices().leftCols(5);
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)match_contour(contour, few, {}, {}); }, "shape_vertices"));
    MorphableModel bare = model();
    bare.landmark_maps.clear();
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)ContourModel(bare); }, "ibug68"));
}

} // namespace
} // namespace lineament
