// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/vision/dlib_detector.hpp"

#include "annotated_photos.hpp"
#include "lineament/core/error.hpp"
#include "lineament/core/random.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/io/landmark_file.hpp"
#include "lineament/vision/video.hpp"
#include "support/matchers.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>

namespace lineament {
namespace {

using test::inner_difference;
using test::throws;

constexpr const char* landmark_model = "/usr/share/dlib/shape_predictor_68_face_landmarks.dat";

#define REQUIRE_LANDMARK_MODEL()                                                                                       \
    if (!std::filesystem::exists(landmark_model)) {                                                                    \
        GTEST_SKIP() << landmark_model << " not found (apt-get install libdlib-data)";                                 \
    }

DlibDetector& detector()
{
    static DlibDetector instance;
    return instance;
}

/// A landmark set with 68 points on a circle.
LandmarkSet ring(double x, double y, double radius)
{
    LandmarkSet set;
    for (int i = 0; i < 68; ++i) {
        const double angle = i * 2.399963;
        set.landmarks.push_back(
            {.name = std::to_string(i + 1), .point_px = {x + radius * std::cos(angle), y + radius * std::sin(angle)}});
    }
    return set;
}

TEST(DlibDetector, ModelThatIsMissingOrOfAnotherKindIsNamed)
{
    const test::TemporaryFolder folder;
    const auto load = [&](const std::string& name) { DlibDetector({.landmark_model = folder / name}); };
    EXPECT_TRUE(throws<IoError>([&] { load("none.dat"); }, "none.dat", "apt-get install libdlib-data"));
    EXPECT_TRUE(throws<IoError>([&] { load(""); }, "not found"));
    std::ofstream(folder / "empty.dat").flush();
    EXPECT_TRUE(throws<IoError>([&] { load("empty.dat"); }, "an empty file"));
    std::ofstream(folder / "packed.dat") << "BZh91AY&SY and so on";
    EXPECT_TRUE(throws<IoError>([&] { load("packed.dat"); }, "bzip2", "bunzip2"));
    std::ofstream(folder / "pointer.dat") << "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n";
    EXPECT_TRUE(throws<IoError>([&] { load("pointer.dat"); }, "Git LFS"));
    std::ofstream(folder / "text.dat") << "<html>not found</html>";
    EXPECT_TRUE(throws<IoError>([&] { load("text.dat"); }, "text.dat", "68-point shape predictor"));
}

TEST(DlibDetector, CutModelIsNamed)
{
    REQUIRE_LANDMARK_MODEL();
    const test::TemporaryFolder folder;
    std::string start(100'000, '\0');
    std::ifstream(landmark_model, std::ios::binary).read(start.data(), static_cast<std::streamsize>(start.size()));
    std::ofstream(folder / "cut.dat", std::ios::binary) << start;
    EXPECT_TRUE(throws<IoError>([&] { DlibDetector({.landmark_model = folder / "cut.dat"}); }, "cut.dat", "cut file"));
}

TEST(DlibDetector, PicturesWithoutAFaceGiveNone)
{
    REQUIRE_LANDMARK_MODEL();
    EXPECT_TRUE(detector().detect({}).empty());
    for (const auto& [width, height] : {std::pair(1, 1), {3, 5}, {640, 480}, {4000, 2}, {2, 3000}}) {
        EXPECT_TRUE(detector().detect(ImageU8(width, height, 3, 128)).empty()) << width << " x " << height;
    }
    ImageU8 noise(300, 200, 3);
    Random random(7);
    for (std::uint8_t& value : noise.data) {
        value = static_cast<std::uint8_t>(255.0 * random.uniform());
    }
    EXPECT_TRUE(detector().detect(noise).empty());
}

TEST(DlibDetector, BrokenContractsAreRefused)
{
    REQUIRE_LANDMARK_MODEL();
    const ImageU8 picture(100, 100, 3);
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)detector().detect(ImageU8(100, 100, 1)); }, "3 channels"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)detector().detect(picture, {.min_face_size_px = NAN}); },
                                        "min_face_size_px"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)detector().detect(picture, {.max_search_pixels = 0}); },
                                        "max_search_pixels"));
    for (const FaceBox& box : {FaceBox{.left = 0, .top = 0, .width = 0, .height = 10},
                               FaceBox{.left = 200, .top = 0, .width = 50, .height = 50},
                               FaceBox{.left = NAN, .top = 0, .width = 50, .height = 50},
                               FaceBox{.left = 0, .top = 0, .width = 1e300, .height = 50}}) {
        EXPECT_TRUE(throws<InvalidArgument>([&] { (void)detector().landmarks(picture, box); }, "box"));
    }
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)detector().follow(picture, {}); }, "18"));
}

TEST(DlibDetector, FollowingWhereThereIsNoFaceIsLost)
{
    REQUIRE_LANDMARK_MODEL();
    const ImageU8 blank(400, 300, 3, 90);
    EXPECT_EQ(detector().follow(blank, ring(200, 150, 40)), std::nullopt);
    EXPECT_EQ(detector().follow(blank, ring(2000, 150, 40)), std::nullopt);
    EXPECT_EQ(detector().follow(blank, ring(200, 150, 1e-3)), std::nullopt);
}

TEST(BoxOf, MovesAndGrowsWithTheLandmarks)
{
    const FaceBox box = box_of(ring(100, 80, 20));
    const FaceBox other = box_of(ring(300, 40, 60));
    EXPECT_NEAR(other.width, 3.0 * box.width, 1e-9);
    EXPECT_NEAR(other.height, 3.0 * box.height, 1e-9);
    EXPECT_NEAR((other.left - 300.0) / 3.0, box.left - 100.0, 1e-9);
    EXPECT_NEAR((other.top - 40.0) / 3.0, box.top - 80.0, 1e-9);
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)box_of(ring(1, 1, 0)); }, "one point"));
    LandmarkSet bad = ring(1, 1, 1);
    bad.landmarks[30].point_px.x() = NAN;
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)box_of(bad); }, "31"));
}

TEST(DlibDetector, FollowsARealFaceWithTheSameLandmarksAsDetection)
{
    REQUIRE_LANDMARK_MODEL();
    LINEAMENT_REQUIRE_REAL_DATA("video/obama_address.mp4");
    VideoReader reader((test::real_data_folder() / "video/obama_address.mp4").string());
    std::optional<VideoFrame> frame = reader.next();
    std::vector<DetectedFace> faces = detector().detect(frame->picture);
    ASSERT_EQ(faces.size(), 1u);
    DetectedFace face = faces[0];
    for (int i = 0; i < 50; ++i) {
        frame = reader.next();
        const std::optional<DetectedFace> followed = detector().follow(frame->picture, face.landmarks);
        ASSERT_TRUE(followed) << "frame " << frame->index;
        face = *followed;
        EXPECT_GT(face.confidence, 0.8);
        if (i % 10 == 9) {
            faces = detector().detect(frame->picture);
            ASSERT_FALSE(faces.empty());
            EXPECT_LE(inner_difference(faces[0].landmarks, face.landmarks), 0.02);
            EXPECT_NEAR(face.box.width, faces[0].box.width, 0.2 * faces[0].box.width);
        }
    }
}

TEST(DlibDetector, FollowingLosesTheFaceWhenTheSceneChanges)
{
    REQUIRE_LANDMARK_MODEL();
    LINEAMENT_REQUIRE_REAL_DATA("video/no_face.mp4");
    VideoReader reader((test::real_data_folder() / "video/no_face.mp4").string());
    int lost = 0;
    int asked = 0;
    while (const std::optional<VideoFrame> frame = reader.next()) {
        const double x = 100.0 + 7.0 * static_cast<double>(frame->index);
        lost += detector().follow(frame->picture, ring(x, 270, 45)) ? 0 : 1;
        ++asked;
    }
    EXPECT_GE(lost, 0.95 * asked);
}

/// Whether every point is finite and at most half the picture's size outside of it.
bool is_sound(const LandmarkSet& set, const ImageU8& picture)
{
    const Eigen::Vector2d size(picture.width, picture.height);
    return set.landmarks.size() == 68 &&
           std::all_of(set.landmarks.begin(), set.landmarks.end(), [&](const auto& point) {
               const Eigen::Array2d part = point.point_px.cwiseQuotient(size).array();
               return part.isFinite().all() && part.minCoeff() > -0.5 && part.maxCoeff() < 1.5;
           });
}

TEST(DlibDetector, FindsAnnotatedFacesNearTheirAnnotation)
{
    REQUIRE_LANDMARK_MODEL();
    LINEAMENT_REQUIRE_REAL_DATA("images/helen_test");
    const test::AnnotationErrors found =
        test::annotation_errors(test::real_data_folder() / "images/helen_test", [](const ImageU8& picture) {
            std::vector<LandmarkSet> faces;
            for (const DetectedFace& face : detector().detect(picture)) {
                EXPECT_TRUE(is_sound(face.landmarks, picture));
                faces.push_back(face.landmarks);
            }
            return faces;
        });
    EXPECT_GE(static_cast<double>(found.errors.size()), 0.95 * found.num_photos);
    EXPECT_LE(found.median(), 0.03); // measured: 0.018, docs/vision.md
}

TEST(DlibDetector, EverySingleFacePhotoHasAFace)
{
    REQUIRE_LANDMARK_MODEL();
    LINEAMENT_REQUIRE_REAL_DATA("images/lfpw_same_person");
    int num_photos = 0;
    for (const char* folder : {"images/lfpw_same_person", "images/aflw2000"}) {
        for (const auto& entry : std::filesystem::directory_iterator(test::real_data_folder() / folder)) {
            if (entry.path().extension() == ".jpg" || entry.path().extension() == ".png") {
                const ImageU8 picture = load_image(entry.path());
                const std::vector<DetectedFace> faces = detector().detect(picture);
                EXPECT_FALSE(faces.empty()) << entry.path();
                for (const DetectedFace& face : faces) {
                    EXPECT_TRUE(is_sound(face.landmarks, picture)) << entry.path();
                }
                ++num_photos;
            }
        }
    }
    EXPECT_GT(num_photos, 0);
}

TEST(DlibDetector, SeveralFacesComeLargestFirst)
{
    REQUIRE_LANDMARK_MODEL();
    LINEAMENT_REQUIRE_REAL_DATA("images/face_recognition/two_people.jpg");
    const ImageU8 picture = load_image(test::real_data_folder() / "images/face_recognition/two_people.jpg");
    const std::vector<DetectedFace> faces = detector().detect(picture);
    ASSERT_EQ(faces.size(), 2u);
    EXPECT_GE(faces[0].box.width * faces[0].box.height, faces[1].box.width * faces[1].box.height);
}

TEST(DlibDetector, SmallAndLargeCopiesOfAPhotoGiveTheSameFace)
{
    REQUIRE_LANDMARK_MODEL();
    LINEAMENT_REQUIRE_REAL_DATA("images/face_recognition/obama.jpg");
    const ImageU8 picture = load_image(test::real_data_folder() / "images/face_recognition/obama.jpg");
    const std::vector<DetectedFace> faces = detector().detect(picture);
    ASSERT_EQ(faces.size(), 1u);
    // A copy enlarged three times by repeating pixels is above the search limit given; the points scale exactly.
    ImageU8 large(3 * picture.width, 3 * picture.height, 3);
    for (int row = 0; row < large.height; ++row) {
        for (int column = 0; column < large.width; ++column) {
            std::copy_n(picture.pixel(column / 3, row / 3), 3, large.pixel(column, row));
        }
    }
    const std::vector<DetectedFace> found = detector().detect(large, {.max_search_pixels = 1'000'000});
    ASSERT_EQ(found.size(), 1u);
    LandmarkSet scaled = found[0].landmarks;
    for (Landmark& landmark : scaled.landmarks) {
        landmark.point_px /= 3.0;
    }
    EXPECT_LE(inner_difference(faces[0].landmarks, scaled), 0.02);
}

} // namespace
} // namespace lineament
