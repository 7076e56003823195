// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/vision/mesh_detector.hpp"

#include "lineament/core/error.hpp"
#include "lineament/vision/video.hpp"
#include "support/count_allocations.hpp"
#include "support/matchers.hpp"

#include <algorithm>
#include <cmath>
#include <thread>

namespace lineament {
namespace {

using test::throws;

MeshDetector& detector()
{
    static MeshDetector instance;
    return instance;
}

constexpr const char* clip = "video/obama_address.mp4";

ImageU8 real_picture()
{
    VideoReader reader((test::real_data_folder() / clip).string());
    return reader.next()->picture;
}

ImageU8 mirrored(const ImageU8& picture)
{
    ImageU8 result = picture;
    for (int row = 0; row < picture.height; ++row) {
        for (int column = 0; column < picture.width; ++column) {
            std::copy_n(picture.pixel(picture.width - 1 - column, row), 3, result.pixel(column, row));
        }
    }
    return result;
}

ImageU8 doubled(const ImageU8& picture)
{
    ImageU8 result(2 * picture.width, 2 * picture.height, 3);
    for (int row = 0; row < result.height; ++row) {
        for (int column = 0; column < result.width; ++column) {
            for (int channel = 0; channel < 3; ++channel) {
                const float x = 0.5f * (static_cast<float>(column) + 0.5f);
                const float y = 0.5f * (static_cast<float>(row) + 0.5f);
                result.at(column, row, channel) = to_u8(sample_bilinear(picture, x, y, channel) / 255.0f);
            }
        }
    }
    return result;
}

double eye_distance(const MeshFace& face)
{
    return static_cast<double>((face.points.col(33) - face.points.col(263)).head<2>().norm());
}

TEST(MeshDetector, PicturesWithoutAFaceGiveNone)
{
    EXPECT_TRUE(detector().detect({}).empty());
    for (const auto& [width, height] : {std::pair(1, 1), {3, 5}, {640, 480}, {4000, 2}, {2, 3000}}) {
        EXPECT_TRUE(detector().detect(ImageU8(width, height, 3, 128)).empty()) << width << " x " << height;
    }
}

TEST(MeshDetector, BrokenContractsAndMissingNetworksAreRefused)
{
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)detector().detect(ImageU8(9, 9, 1)); }, "3 channels"));
    const ImageU8 picture(100, 100, 3);
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)detector().detect(picture, {.max_faces = 0}); }, "max_faces"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)detector().detect(picture, {.score_threshold = NAN}); },
                                        "score_threshold"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)detector().follow(picture, {}); }, "mediapipe478"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)detector().follow(picture, {.scheme = "mediapipe478"}); }, "467"));
    const test::TemporaryFolder folder;
    EXPECT_TRUE(throws<IoError>([&] { MeshDetector({.network_folder = folder / ""}); }, "models/README.md"));
}

TEST(MeshDetector, FollowingWhereThereIsNoFaceIsLost)
{
    MeshFace face;
    face.points.setRandom(3, 478);
    face.points = 40.0f * face.points.array() + 150.0f;
    const Eigen::Matrix3Xf before = face.points;
    EXPECT_FALSE(detector().follow_in_place(ImageU8(300, 300, 3, 90), face));
    EXPECT_EQ(face.points, before);
}

TEST(MeshDetector, OneDetectorPerThreadFindsTheSameFaces)
{
    LINEAMENT_REQUIRE_REAL_DATA(clip);
    const ImageU8 picture = real_picture();
    const std::vector<MeshFace> alone = detector().detect(picture);
    ASSERT_EQ(alone.size(), 1U);
    std::vector<std::vector<MeshFace>> found(2);
    std::vector<std::thread> threads;
    for (std::vector<MeshFace>& faces : found) {
        threads.emplace_back([&] {
            MeshDetector own;
            for (int repeat = 0; repeat < 3; ++repeat) {
                faces = own.detect(picture);
            }
        });
    }
    for (std::thread& thread : threads) {
        thread.join();
    }
    for (const std::vector<MeshFace>& faces : found) {
        ASSERT_EQ(faces.size(), 1U);
        EXPECT_EQ(faces[0].points, alone[0].points);
    }
}

TEST(MeshDetector, MirroredPictureGivesMirroredPoints)
{
    LINEAMENT_REQUIRE_REAL_DATA(clip);
    const ImageU8 picture = real_picture();
    const std::vector<MeshFace> faces = detector().detect(picture, {.max_faces = 1});
    const std::vector<MeshFace> others = detector().detect(mirrored(picture), {.max_faces = 1});
    ASSERT_EQ(faces.size(), 1u);
    ASSERT_EQ(others.size(), 1u);
    // Pairs of mirrored points and midline points: outer and inner eye corners, mouth corners, brows; nose, chin.
    double bias = 0.0;
    constexpr int pairs[][2] = {{33, 263}, {263, 33}, {133, 362}, {362, 133},
                                {61, 291}, {291, 61}, {70, 300},  {300, 70}};
    for (const auto& [i, j] : pairs) {
        const double x = picture.width - static_cast<double>(others[0].points(0, j));
        bias += (x - static_cast<double>(faces[0].points(0, i))) / 8.0;
        EXPECT_NEAR(x, static_cast<double>(faces[0].points(0, i)), 0.04 * eye_distance(faces[0])) << i;
    }
    // The outer-eye distance spans about 80 of the network's pixels.
    EXPECT_LE(std::abs(bias), 0.25 * eye_distance(faces[0]) / 80.0);
}

TEST(MeshDetector, ScaledPictureGivesScaledPoints)
{
    LINEAMENT_REQUIRE_REAL_DATA(clip);
    const ImageU8 picture = real_picture();
    const std::vector<MeshFace> faces = detector().detect(picture, {.max_faces = 1});
    const std::vector<MeshFace> others = detector().detect(doubled(picture), {.max_faces = 1});
    ASSERT_EQ(faces.size(), 1u);
    ASSERT_EQ(others.size(), 1u);
    EXPECT_GT(faces[0].presence, 0.9);
    const Eigen::Matrix2Xf a = faces[0].points.topRows<2>();
    const Eigen::Matrix2Xf b = 0.5f * others[0].points.topRows<2>();
    EXPECT_LE(static_cast<double>((a - b).colwise().norm().mean()), 0.01 * eye_distance(faces[0]));
}

TEST(MeshDetector, FollowsARealFaceWithThePointsOfDetection)
{
    LINEAMENT_REQUIRE_REAL_DATA(clip);
    VideoReader reader((test::real_data_folder() / clip).string());
    std::vector<MeshFace> faces = detector().detect(reader.next()->picture);
    ASSERT_EQ(faces.size(), 1u);
    MeshFace face = faces[0];
    for (int i = 0; i < 40; ++i) {
        const std::optional<VideoFrame> frame = reader.next();
        const std::optional<MeshFace> copy = detector().follow(frame->picture, face.landmarks);
        ASSERT_TRUE(detector().follow_in_place(frame->picture, face)) << "frame " << frame->index;
        ASSERT_TRUE(copy);
        EXPECT_EQ(copy->points, face.points);
        if (i % 10 == 9) {
            faces = detector().detect(frame->picture);
            ASSERT_FALSE(faces.empty());
            const double distance =
                static_cast<double>((faces[0].points - face.points).topRows<2>().colwise().norm().mean());
            EXPECT_LE(distance, 0.04 * eye_distance(face));
        }
    }
}

TEST(MeshDetector, FollowingAllocatesNothingAfterTheFirstFrame)
{
    LINEAMENT_REQUIRE_REAL_DATA(clip);
    const ImageU8 picture = real_picture();
    std::vector<MeshFace> faces = detector().detect(picture, {.max_faces = 1});
    ASSERT_EQ(faces.size(), 1u);
    bool found = detector().follow_in_place(picture, faces[0]);
    const long before = test::num_allocations();
    for (int i = 0; i < 5; ++i) {
        found = found && detector().follow_in_place(picture, faces[0]);
    }
    const long after = test::num_allocations();
    EXPECT_TRUE(found);
    EXPECT_EQ(after - before, 0);
    // That the counter counts:
    const std::optional<MeshFace> copy = detector().follow(picture, faces[0].landmarks);
    EXPECT_TRUE(copy);
    EXPECT_GT(test::num_allocations(), after);
}

TEST(Ibug68FromMediapipe, NamesTheInnerPointsAndTheChin)
{
    LandmarkSet set = {.scheme = "mediapipe478"};
    for (int i = 0; i < 478; ++i) {
        set.landmarks.push_back(
            {.name = std::to_string(i), .point_px = {i, 2.0 * i}, .confidence = 0.5, .depth_px = -i});
    }
    const LandmarkSet result = ibug68_from_mediapipe(set);
    EXPECT_EQ(result.scheme, "ibug68");
    EXPECT_EQ(result.landmarks.size(), 52u);
    for (int i = 18; i <= 68; ++i) {
        EXPECT_TRUE(result.find(std::to_string(i))) << i;
    }
    EXPECT_EQ(result.find("37")->point_px, Eigen::Vector2d(33, 66));
    EXPECT_EQ(result.find("9")->point_px, Eigen::Vector2d(152, 304));
    EXPECT_EQ(result.find("37")->confidence, 0.5);
    EXPECT_EQ(result.find("37")->depth_px, -33);
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)ibug68_from_mediapipe({}); }, "mediapipe478", "ibug68"));
}

} // namespace
} // namespace lineament
