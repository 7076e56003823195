// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Landmark files as other programs wrote them.
#include "lineament/io/landmark_file.hpp"
#include "lineament/io/mesh_file.hpp"

#include "lineament/core/error.hpp"
#include "lineament/io/file.hpp"

#include "support/matchers.hpp"

#include <Eigen/Dense>

#include <sstream>

namespace lineament {
namespace {

std::string real(const std::string& name)
{
    return (test::real_data_folder() / name).string();
}

TEST(RealLandmarkFile, EveryPtsFileIsReadOrRefusedForItsReason)
{
    LINEAMENT_REQUIRE_REAL_DATA("images");
    int num_read = 0;
    int num_headerless = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(test::real_data_folder() / "images")) {
        if (entry.path().extension() != ".pts") {
            continue;
        }
        const std::string path = entry.path().string();
        if (path.find("tongue") != std::string::npos) {
            EXPECT_TRUE(test::throws<IoError>([&] { (void)load_landmarks(path); }, "tongue.pts:2:1", "n_points"));
            continue;
        }
        SCOPED_TRACE(path);
        LandmarkFile file;
        try {
            file = load_landmarks(path);
        } catch (const IoError& error) {
            EXPECT_THAT(error.what(), testing::HasSubstr("header"));
            file = load_landmarks(path, {.pts_header = PtsHeader::optional});
            ++num_headerless;
        }
        ++num_read;
        ASSERT_EQ(file.frames.at(0).set.landmarks.size(), 68u);
        // The nose tip is below the bridge and the chin below the mouth.
        const auto& points = file.frames[0].set.landmarks;
        EXPECT_GT(points[8].point_px.y(), points[27].point_px.y());
    }
    EXPECT_GE(num_read, 80);
    EXPECT_GE(num_headerless, 60);
}

TEST(RealLandmarkFile, ThreeDimensionalPtsOfAnotherProgramIsRefused)
{
    LINEAMENT_REQUIRE_REAL_DATA("landmarks/idav_morpho_landmarks.pts");
    EXPECT_TRUE(test::throws<IoError>([] { (void)load_landmarks(real("landmarks/idav_morpho_landmarks.pts")); }, "IDAV",
                                      "idav_morpho_landmarks.pts:1:1"));
}

TEST(RealLandmarkFile, OpenFaceAndPyFeatTablesAreRead)
{
    LINEAMENT_REQUIRE_REAL_DATA("landmarks/openface_v1_single.csv");
    const LandmarkFile openface = load_landmarks(real("landmarks/openface_v1_single.csv"));
    ASSERT_GE(openface.frames.size(), 99u);
    EXPECT_EQ(openface.frames[0].set.landmarks.size(), 68u);
    EXPECT_EQ(openface.frames[0].frame, 1);
    EXPECT_EQ(openface.frames[0].time_s, 0.0);
    EXPECT_EQ(openface.frames[0].set.landmarks[0].point_px.x(), 277.276 + 0.5);
    EXPECT_EQ(openface.frames[0].set.landmarks[0].confidence, 0.883333);

    const LandmarkFile single = load_landmarks(real("landmarks/feat_single_face.csv"));
    ASSERT_EQ(single.frames.size(), 1u);
    EXPECT_EQ(single.frames[0].set.landmarks.size(), 68u);
    EXPECT_EQ(load_landmarks(real("landmarks/feat_news_001.csv")).frames.size(), 20u);
}

// Largest distance between the named landmarks and the 300-W mean face, both scaled to an outer eye distance of 1 by
// the least-squares scale and shift of each axis.
double distance_to_mean_face(const LandmarkSet& set)
{
    std::istringstream text(read_text_file(real("landmarks/pipnet_meanface_data_300W.txt")));
    std::vector<Eigen::Vector2d> mean(68);
    for (Eigen::Vector2d& point : mean) {
        text >> point.x() >> point.y();
    }
    double largest = 0.0;
    for (int axis = 0; axis < 2; ++axis) {
        Eigen::MatrixXd design(set.landmarks.size(), 2);
        Eigen::VectorXd target(set.landmarks.size());
        for (std::size_t i = 0; i < set.landmarks.size(); ++i) {
            design.row(i) << set.landmarks[i].point_px[axis], 1.0;
            target[i] = mean[std::stoi(set.landmarks[i].name) - 1][axis];
        }
        const Eigen::VectorXd fit = design.colPivHouseholderQr().solve(target);
        largest = std::max(largest, (design * fit - target).cwiseAbs().maxCoeff());
    }
    return largest / (mean[45] - mean[36]).norm();
}

TEST(RealLandmarkFile, MediapipeTableMatchesTheMeanFaceOfTheIbugAnnotations)
{
    LINEAMENT_REQUIRE_REAL_DATA("models/mediapipe/canonical_face_model.obj");
    const Mesh face = load_mesh(real("models/mediapipe/canonical_face_model.obj")).mesh;
    ASSERT_EQ(face.num_vertices(), 468);
    LandmarkSet set;
    for (int i = 0; i < 468; ++i) {
        const std::string name = ibug68_name_of_mediapipe_point(i);
        if (!name.empty()) {
            set.landmarks.push_back({name, {face.vertices(0, i), -face.vertices(1, i)}});
        }
    }
    EXPECT_LE(distance_to_mean_face(set), 0.08) << "the two mean faces differ by up to 7 % of the eye distance";
    std::swap(set.landmarks[0].point_px, set.landmarks[20].point_px);
    EXPECT_GE(distance_to_mean_face(set), 0.08) << "a wrong entry would show";
}

TEST(RealLandmarkFile, MediapipeResultsAreRead)
{
    LINEAMENT_REQUIRE_REAL_DATA("landmarks/mediapipe_sample.json");
    const std::string text = read_text_file(real("landmarks/mediapipe_sample.json"));
    // The sample holds two results under two keys; each is a file of its own.
    const std::size_t second = text.find("\"facelandmarker_result\"");
    const std::size_t first_value = text.find('{', 1);
    const std::string keypoints = text.substr(first_value, text.rfind('}', second) - first_value + 1);
    const std::size_t second_value = text.find('{', second);
    const std::string result = text.substr(second_value, text.rfind('}') - second_value);

    const LandmarkFile pixels = parse_landmarks(keypoints, "keypoints.json");
    ASSERT_EQ(pixels.frames.size(), 1u);
    EXPECT_EQ(pixels.frames[0].set.landmarks.size(), 52u);
    EXPECT_LE(distance_to_mean_face(pixels.frames[0].set), 0.3);

    const LandmarkFile normalized = parse_landmarks(result, "result.json", {.image_width = 640, .image_height = 480});
    ASSERT_EQ(normalized.frames.size(), 1u);
    EXPECT_LE(distance_to_mean_face(normalized.frames[0].set), 0.4);
}

} // namespace
} // namespace lineament
