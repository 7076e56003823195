// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Which faces and landmarks `lineament fit` takes.
#include "apps/run_program.hpp"

#include "support/rendered_person.hpp"

#include <nlohmann/json.hpp>

namespace lineament {
namespace {

using test::Outcome;
using test::read_all;
using test::run;
using test::save_synthetic_picture;
using test::save_text;

nlohmann::json faces_of(const test::TemporaryFolder& folder, const std::string& output)
{
    return nlohmann::json::parse(read_all(folder / (output + "/fit.json")))["faces"];
}

/// Rows of OpenFace's CSV, all with the landmarks of save_synthetic_picture.
std::string openface_rows(const test::TemporaryFolder& folder, const std::vector<int>& frames)
{
    const LandmarkSet set = load_landmarks((folder / "face.json")).frames.front().set;
    std::string header = "frame,face_id,timestamp,confidence,success";
    for (const char* axis : {"x", "y"}) {
        for (int i = 0; i < 68; ++i) {
            header += std::string(",") + axis + "_" + std::to_string(i);
        }
    }
    std::string text = header + "\n";
    for (std::size_t row = 0; row < frames.size(); ++row) {
        text += std::to_string(frames[row]) + "," + std::to_string(row) + ",0.5,0.9,1";
        for (int axis = 0; axis < 2; ++axis) {
            for (const Landmark& landmark : set.landmarks) {
                text += "," + std::to_string(landmark.point_px[axis]);
            }
        }
        text += "\n";
    }
    return text;
}

TEST(FitLandmarks, RowsOfAVideoAreNotTheFacesOfAPicture)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    save_text(folder / "video.csv", openface_rows(folder, {4, 5, 6}));
    const Outcome video = run(folder, "fit face.png --landmarks video.csv --no-report -o video");
    EXPECT_EQ(video.exit_code, 3) << video.error;
    EXPECT_NE(video.error.find("3 rows of a video"), std::string::npos) << video.error;
    save_text(folder / "photo.csv", openface_rows(folder, {4, 4})); // the twin: two faces of one frame
    const Outcome photo = run(folder, "fit face.png --landmarks photo.csv --no-report -o photo");
    EXPECT_EQ(photo.exit_code, 0) << photo.error;
    EXPECT_EQ(faces_of(folder, "photo/face").size(), 2U);
}

TEST(FitLandmarks, TheLargestFaceOfAFileIsTheFirst)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    const MorphableModel model = load_model(default_model_path());
    Random random(12);
    nlohmann::json faces;
    for (const double scale : {0.5, 1.0}) { // the small one first
        Camera camera = test::camera_of_picture();
        camera.scale_px_per_mm *= scale;
        nlohmann::json points;
        for (const Landmark& landmark : test::project_landmarks(model, "mediapipe478", Eigen::VectorXd::Zero(0),
                                                                Eigen::VectorXd::Zero(0), camera, 0.1, random)
                                            .landmarks) {
            points.push_back({{"x", landmark.point_px.x() / 640}, {"y", landmark.point_px.y() / 480}, {"z", 0.0}});
        }
        faces.push_back(points);
    }
    save_text(folder / "mesh.json", nlohmann::json{{"faceLandmarks", faces}}.dump());
    const std::string fit = "fit face.png --landmarks mesh.json --no-report ";
    ASSERT_EQ(run(folder, fit + "-o all").exit_code, 0);
    ASSERT_EQ(run(folder, fit + "--face 1 -o one").exit_code, 0);
    const auto scale = [](const nlohmann::json& face) { return face["camera"]["scale_px_per_mm"].get<double>(); };
    const double full = test::camera_of_picture().scale_px_per_mm;
    EXPECT_NEAR(scale(faces_of(folder, "all/face")[0]), full, 0.05 * full);
    EXPECT_NEAR(scale(faces_of(folder, "all/face")[1]), 0.5 * full, 0.05 * full);
    EXPECT_NEAR(scale(faces_of(folder, "one/face")[0]), full, 0.05 * full);
}

/// The landmarks of save_synthetic_picture, one of them 40 px off and said to be, if any is, as uncertain as that.
void save_with_a_wild_landmark(const test::TemporaryFolder& folder, const std::string& name, bool has_covariances)
{
    LandmarkSet set = load_landmarks(folder / "face.json").frames.front().set;
    std::vector<Eigen::Matrix2d> covariances(set.landmarks.size(), Eigen::Matrix2d::Identity());
    for (std::size_t l = 0; l < set.landmarks.size(); ++l) {
        if (set.landmarks[l].name == "31") {
            set.landmarks[l].point_px += Eigen::Vector2d(40, 0);
            covariances[l] << 1e8, 0, 0, 1e8;
        }
    }
    save_landmarks(folder / name, set, 640, 480, has_covariances ? covariances : std::vector<Eigen::Matrix2d>{});
}

TEST(FitLandmarks, CovariancesOfAFileSayHowMuchALandmarkCounts)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    save_with_a_wild_landmark(folder, "stated.json", true);
    save_with_a_wild_landmark(folder, "wild.json", false);
    const std::string end = " --loss none --no-report --no-obj";
    const auto yaw_of = [&](const std::string& landmarks) {
        const Outcome outcome =
            run(folder, "fit face.png --landmarks " + landmarks + end + " -o " + landmarks + ".out");
        EXPECT_EQ(outcome.error, "") << landmarks;
        return faces_of(folder, landmarks + ".out/face")[0]["pose"]["yaw_deg"].get<double>();
    };
    const double clean = yaw_of("face.json");
    EXPECT_NEAR(yaw_of("stated.json"), clean, 0.5);
    EXPECT_GT(std::abs(yaw_of("wild.json") - clean), 2); // the twin

    const std::string fit = "fit face.png --landmarks stated.json --no-report --no-obj ";
    const Outcome thesis = run(folder, fit + "--method thesis -o thesis");
    EXPECT_NE(thesis.error.find("covariances are left out"), std::string::npos) << thesis.error;
    EXPECT_EQ(run(folder, "--strict " + fit + "--method thesis -o strict").exit_code, 3);
    EXPECT_EQ(run(folder, fit + "--noise 1 -o noise").exit_code, 2);
    const Outcome outline = run(folder, fit + "--outline dlib -o outline");
    EXPECT_EQ(outline.exit_code, 2);
    EXPECT_NE(outline.error.find("have no covariance"), std::string::npos) << outline.error;
    std::filesystem::copy_file(folder / "face.png", folder / "again.png");
    const Outcome both = run(folder, "fit face.png again.png --same-person --landmarks stated.json" + end + " -o both");
    EXPECT_EQ(both.error, "");
    EXPECT_NEAR(faces_of(folder, "both/again")[0]["pose"]["yaw_deg"].get<double>(), clean, 0.5);
}

TEST(FitLandmarks, ContourNeedsAnOutline)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    save_png(folder / "person.png", test::RenderedPerson(3).picture(0, 400, 400));
    const Outcome refused = run(folder, "fit person.png --no-report --contour front -o a");
    EXPECT_EQ(refused.exit_code, 2) << refused.error;
    EXPECT_NE(refused.error.find("hold no outline"), std::string::npos) << refused.error;
    EXPECT_EQ(run(folder, "fit person.png --no-report -o b").exit_code, 0);
    EXPECT_EQ(run(folder, "fit face.png --landmarks face.json --no-report --contour front -o c").exit_code, 0);
    EXPECT_EQ(run(folder, "fit person.png --no-report --outline-noise 3 -o d").exit_code, 2);
    const Outcome stated = run(folder, "fit person.png --no-report --noise 1 -o e");
    EXPECT_EQ(stated.exit_code, 2);
    EXPECT_NE(stated.error.find("states the noise of mediapipe478"), std::string::npos) << stated.error;
}

TEST(FitLandmarks, OutlineOfDlibJoinsTheMesh)
{
    const test::TemporaryFolder folder;
    save_png(folder / "person.png", test::RenderedPerson(3).picture(30, 400, 400));
    if (run(folder, "doctor").out.find("absent   dlib detector") != std::string::npos) {
        GTEST_SKIP() << "dlib's landmark model is not installed";
    }
    const Outcome outcome = run(folder, "fit person.png --no-report --outline dlib -o with");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
    ASSERT_EQ(run(folder, "fit person.png --no-report -o without").exit_code, 0);
    ASSERT_EQ(run(folder, "fit person.png --no-report --outline dlib --contour ignored -o ignored").exit_code, 0);
    const nlohmann::json face = faces_of(folder, "with/person")[0];
    int num_outline = 0, num_used = 0;
    for (const nlohmann::json& landmark : face["landmarks"]) {
        if (landmark["name"].get<std::string>().starts_with(outline_prefix)) {
            ++num_outline;
            num_used += landmark["weight"].get<double>() > 0 ? 1 : 0;
        }
    }
    EXPECT_EQ(num_outline, 16);
    EXPECT_GE(num_used, 8);
    EXPECT_NEAR(face["pose"]["yaw_deg"].get<double>(), 30.0, 6.0);
    const auto coefficients = [&](const char* output) { return faces_of(folder, output)[0]["shape_coefficients"]; };
    EXPECT_NE(coefficients("with/person"), coefficients("without/person"));
    EXPECT_EQ(coefficients("ignored/person"), coefficients("without/person"));
    const Outcome fixed = run(folder, "fit person.png --no-report --outline dlib --contour fixed -o fixed");
    EXPECT_EQ(fixed.exit_code, 2);
    EXPECT_NE(fixed.error.find("has no fixed points"), std::string::npos) << fixed.error;
    EXPECT_EQ(run(folder, "fit person.png --no-report --detector dlib --outline dlib -o both").exit_code, 2);
    save_synthetic_picture(folder, "face");
    EXPECT_EQ(run(folder, "fit face.png --landmarks face.json --outline dlib -o file").exit_code, 2) << "68 points";
}

TEST(FitLandmarks, NoFaceOfACrowdIsLeftOut)
{
    constexpr int columns = 5, rows = 4, size = 240;
    const ImageU8 person = test::RenderedPerson(3).picture(0, size, size);
    ImageU8 crowd(columns * size, rows * size, 3);
    for (int row = 0; row < rows * size; ++row) {
        for (int column = 0; column < columns * size; ++column) {
            std::copy_n(person.pixel(column % size, row % size), 3, crowd.pixel(column, row));
        }
    }
    const test::TemporaryFolder folder;
    save_png(folder / "crowd.png", crowd);
    // The networks may miss one or two of twenty small faces, but no round number of them is the most there can be.
    EXPECT_EQ(run(folder, "fit crowd.png --no-report --no-obj --face 18 -o out").exit_code, 0);
    const Outcome one_more = run(folder, "fit crowd.png --no-report --no-obj --face 21 -o out");
    EXPECT_EQ(one_more.exit_code, 6) << one_more.error;
    EXPECT_NE(one_more.error.find("found (the largest is number 1)"), std::string::npos) << one_more.error;
}

} // namespace
} // namespace lineament
