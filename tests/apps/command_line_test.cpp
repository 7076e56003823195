// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "apps/run_program.hpp"

#include "lineament/core/version.hpp"

#include <nlohmann/json.hpp>

namespace lineament {
namespace {

namespace fs = std::filesystem;
using test::camera_of_picture;
using test::Outcome;
using test::read_all;
using test::run;
using test::save_synthetic_picture;
using test::save_text;

TEST(CommandLine, VersionAndHelpGoToStdout)
{
    const test::TemporaryFolder folder;
    const Outcome version_outcome = run(folder, "--version");
    EXPECT_EQ(version_outcome.exit_code, 0);
    EXPECT_EQ(version_outcome.out, std::string("lineament ") + version + "\n");
    for (const char* command : {"", "fit", "track", "model", "model info", "model sample", "doctor"}) {
        const Outcome help = run(folder, std::string(command) + " --help");
        EXPECT_EQ(help.exit_code, 0) << command;
        EXPECT_NE(help.out.find("Usage"), std::string::npos) << command;
        EXPECT_EQ(help.error, "") << command;
    }
}

TEST(CommandLine, WrongUseIsExitCode2)
{
    const test::TemporaryFolder folder;
    for (const char* arguments :
         {"", "fit", "frobnicate", "fit a.png --iterations -3", "fit a.png --nonsense", "fit a.png --contour sideways",
          "fit nothing-*.png", "fit a.png --expressions klingon"}) {
        const Outcome outcome = run(folder, arguments);
        EXPECT_EQ(outcome.exit_code, 2) << arguments << "\n" << outcome.error;
        EXPECT_EQ(outcome.error.rfind("lineament: error: ", 0), 0U) << arguments << "\n" << outcome.error;
    }
}

TEST(CommandLine, TwoInputsWithOneOutputNameAreRefusedBeforeAnyWork)
{
    const test::TemporaryFolder folder;
    fs::create_directories(folder / "a");
    fs::create_directories(folder / "b");
    save_png(folder / "a/x.png", ImageU8(64, 64, 3));
    save_png(folder / "b/x.png", ImageU8(64, 64, 3));
    const Outcome outcome = run(folder, "fit a/x.png b/x.png -o out");
    EXPECT_EQ(outcome.exit_code, 4);
    EXPECT_NE(outcome.error.find("both write"), std::string::npos) << outcome.error;
    EXPECT_FALSE(fs::exists(folder / "out"));
}

TEST(CommandLine, EachFailureHasItsExitCodeAndNamesTheFile)
{
    const test::TemporaryFolder folder;
    save_text(folder / "page.jpg", "<!DOCTYPE html><html></html>");
    save_text(folder / "empty.png", "");
    save_png(folder / "blank.png", ImageU8(300, 300, 3, 127));
    fs::create_directories(folder / "folder.png");
    const std::vector<std::pair<std::string, int>> cases = {
        {"fit missing.png", 4},
        {"fit page.jpg", 3},
        {"fit empty.png", 3},
        {"fit blank.png", 6},
        {"fit blank.png --detector dlib --min-face 100", 6},
        {"fit blank.png --min-face 100", 2},
        {"fit blank.png --detector none", 2},
        {"fit blank.png --max-megapixels 0.01", 5},
        {"fit blank.png --landmarks missing.pts", 4},
        {"fit blank.png --model missing.safetensors", 4},
        {"fit blank.png --model page.jpg", 3},
        {"track missing.mp4", 4},
        {"track page.jpg", 3},
        {"model info missing.safetensors", 4},
    };
    for (const auto& [arguments, exit_code] : cases) {
        const Outcome outcome = run(folder, arguments);
        EXPECT_EQ(outcome.exit_code, exit_code) << arguments << "\n" << outcome.error;
        EXPECT_EQ(outcome.error.rfind("lineament: error: ", 0), 0U) << arguments << "\n" << outcome.error;
        EXPECT_EQ(outcome.out, "") << arguments;
    }
    EXPECT_FALSE(fs::exists(folder / "blank/overlay.png")) << "nothing is written where there is no face";
}

TEST(CommandLine, FitWritesEveryPromisedFile)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    const Outcome outcome = run(folder, "fit face.png --landmarks face.json -o out --ply --neutral");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
    EXPECT_EQ(outcome.out, "out/face\n");
    for (const char* name : {"overlay.png", "mesh.glb", "mesh.obj", "mesh.mtl", "mesh.ply", "neutral.obj",
                             "texture.png", "fit.json", "report.html"}) {
        EXPECT_GT(fs::file_size(fs::path(folder / "out/face") / name), 50U) << name;
    }
    const nlohmann::json fit = nlohmann::json::parse(read_all(folder / "out/face/fit.json"));
    EXPECT_EQ(fit["format"], "lineament-fit");
    EXPECT_EQ(fit["faces"][0]["status"], "success");
    EXPECT_NEAR(fit["faces"][0]["pose"]["yaw_deg"].get<double>(), 12.0, 1.5);
    EXPECT_NEAR(fit["faces"][0]["pose"]["pitch_deg"].get<double>(), 4.0, 3.0);
    EXPECT_NEAR(fit["faces"][0]["pose"]["roll_deg"].get<double>(), -3.0, 1.0);
    test::expect_no_temporary_files(folder.path());
}

TEST(CommandLine, FitTakesTheResultFileOfMediapipe)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "x");
    const MorphableModel model = load_model(default_model_path());
    Random random(12);
    const LandmarkSet set = test::project_landmarks(model, "mediapipe478", Eigen::VectorXd::Zero(0),
                                                    Eigen::VectorXd::Zero(0), camera_of_picture(), 0.3, random);
    nlohmann::json points;
    for (const Landmark& landmark : set.landmarks) { // normalised by the size of the picture
        points.push_back({{"x", landmark.point_px.x() / 640}, {"y", landmark.point_px.y() / 480}, {"z", 0.0}});
    }
    save_text(folder / "mesh.json", nlohmann::json{{"faceLandmarks", nlohmann::json::array({points})}}.dump());
    const Outcome outcome = run(folder, "fit x.png --landmarks mesh.json -o out --no-report");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
    const auto fit = nlohmann::json::parse(read_all(folder / "out/x/fit.json"))["faces"][0];
    EXPECT_EQ(fit["status"], "success");
    EXPECT_EQ(fit["landmarks"].size(), 478U);
    EXPECT_NEAR(fit["pose"]["yaw_deg"].get<double>(), 12.0, 1.0);
    EXPECT_NEAR(fit["pose"]["pitch_deg"].get<double>(), 4.0, 1.0);
    points.erase(points.size() - 1); // the twin: 477 points are no result of MediaPipe
    save_text(folder / "mesh.json", nlohmann::json{{"faceLandmarks", nlohmann::json::array({points})}}.dump());
    const Outcome broken = run(folder, "fit x.png --landmarks mesh.json -o out2 --no-report");
    EXPECT_EQ(broken.exit_code, 3) << broken.error;
    EXPECT_NE(broken.error.find("477"), std::string::npos) << broken.error;
}

TEST(CommandLine, AFailedInputDoesNotStopTheOthers)
{
    const test::TemporaryFolder folder;
    fs::create_directories(folder / "in");
    save_synthetic_picture(folder, "good");
    fs::rename(folder / "good.png", folder / "in/good.png");
    save_text(folder / "in/bad.png", "not a picture");
    const Outcome outcome = run(folder, "fit in --landmarks good.json -o out --json");
    EXPECT_EQ(outcome.exit_code, 1) << outcome.error;
    EXPECT_TRUE(fs::exists(folder / "out/good/mesh.glb"));
    const nlohmann::json summary = nlohmann::json::parse(outcome.out);
    ASSERT_EQ(summary.size(), 2U);
    EXPECT_EQ(summary[0]["exit_code"], 3);
    EXPECT_EQ(summary[1]["exit_code"], 0);
}

TEST(CommandLine, DegenerateLandmarksAreNoAnswer)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    LandmarkSet set;
    for (int i = 0; i < 68; ++i) {
        set.landmarks.push_back({std::to_string(i + 1), Eigen::Vector2d(100, 100), 1.0});
    }
    save_landmarks(folder / "face.json", set, 640, 480);
    const Outcome outcome = run(folder, "fit face.png --landmarks face.json");
    EXPECT_EQ(outcome.exit_code, 6) << outcome.error;
    EXPECT_NE(outcome.error.find("degenerate"), std::string::npos) << outcome.error;
}

TEST(CommandLine, AFullStandardOutputIsAnError)
{
    const test::TemporaryFolder folder;
    const int status = std::system("'" LINEAMENT_PROGRAM "' model info > /dev/full 2> /dev/null");
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 4);
}

TEST(CommandLine, ControlCharactersOfFileNamesAreEscaped)
{
    const test::TemporaryFolder folder;
    const Outcome outcome = run(folder, "fit \"$(printf 'a\\033[31mred.png')\"");
    EXPECT_EQ(outcome.exit_code, 4) << outcome.error;
    EXPECT_EQ(outcome.error.find('\x1b'), std::string::npos) << outcome.error;
}

TEST(CommandLine, SamePersonGivesEveryPictureOneIdentity)
{
    const test::TemporaryFolder folder;
    for (const char* stem : {"a", "b", "c"}) {
        save_synthetic_picture(folder, stem);
    }
    save_text(folder / "d.png", "not a picture");
    const auto coefficients = [&](const std::string& output, const std::string& stem) {
        const nlohmann::json fit = nlohmann::json::parse(read_all(folder / (output + "/" + stem + "/fit.json")));
        return fit["faces"][0]["shape_coefficients"];
    };
    for (const std::string method : {"thesis", "joint"}) {
        const Outcome outcome =
            run(folder, "fit --same-person a.png b.png c.png d.png --landmarks . --no-report --method " + method +
                            " -o " + method);
        EXPECT_EQ(outcome.exit_code, 1) << "d.png is no picture: " << outcome.error;
        EXPECT_EQ(outcome.out, method + "/a\n" + method + "/b\n" + method + "/c\n");
        EXPECT_EQ(coefficients(method, "a"), coefficients(method, "b"));
        EXPECT_EQ(coefficients(method, "a"), coefficients(method, "c"));
        ASSERT_EQ(run(folder, "fit a.png --landmarks . --no-report --method " + method + " -o alone").exit_code, 0);
        EXPECT_NE(coefficients(method, "a"), coefficients("alone", "a")) << "three pictures say more than one";
    }
}

TEST(CommandLine, JointMethodStatesItsUncertainty)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    ASSERT_EQ(run(folder, "fit face.png --landmarks face.json --no-report").exit_code, 0);
    const nlohmann::json face = nlohmann::json::parse(read_all(folder / "face/fit.json"))["faces"][0];
    EXPECT_NEAR(face["pose"]["yaw_deg"].get<double>(), 12.0, 1.5);
    ASSERT_EQ(face["shape_standard_deviations"].size(), face["shape_coefficients"].size());
    for (const nlohmann::json& deviation : face["shape_standard_deviations"]) {
        EXPECT_GT(deviation.get<double>(), 0.0);
        EXPECT_LE(deviation.get<double>(), 1.001) << "no more than the prior's";
    }
    EXPECT_LT(face["shape_standard_deviations"][0].get<double>(), 0.9);
    const MorphableModel model = load_model(default_model_path());
    const double prior_mm =
        std::sqrt(model.shape.standard_deviations.squaredNorm() / static_cast<double>(model.num_vertices()));
    EXPECT_LT(face["predicted_rms_mm"].get<double>(), 0.9 * prior_mm);
    EXPECT_GT(face["predicted_rms_mm"].get<double>(), 0.2 * prior_mm);
    EXPECT_EQ(run(folder, "fit face.png --landmarks face.json --method joint --regularization 3").exit_code, 2);
}

TEST(CommandLine, UncertaintyIsDrawnOnRequest)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    const std::string fit = "fit face.png --landmarks face.json ";
    ASSERT_EQ(run(folder, fit + "--method joint -o plain").exit_code, 0);
    EXPECT_FALSE(fs::exists(folder / "plain/face/uncertainty.glb"));
    const Outcome outcome = run(folder, fit + "--method joint --uncertainty -o asked");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
    EXPECT_NE(read_all(folder / "asked/face/uncertainty.glb").find("COLOR_0"), std::string::npos);
    EXPECT_NE(read_all(folder / "asked/face/report.html").find("Certainty"), std::string::npos);
    EXPECT_EQ(read_all(folder / "plain/face/report.html").find("Certainty"), std::string::npos);
    const ImageU8 picture = load_image(folder / "asked/face/uncertainty.png");
    const std::uint8_t* const corner = picture.pixel(0, 0);
    EXPECT_EQ(std::min({corner[0], corner[1], corner[2]}), 255);
    const std::uint8_t* const face = picture.pixel(picture.width / 4, picture.height / 2);
    EXPECT_LT(std::min({face[0], face[1], face[2]}), 200);
    EXPECT_EQ(run(folder, fit + "--method thesis --uncertainty -o refused").exit_code, 2);
    EXPECT_FALSE(fs::exists(folder / "refused"));
}

TEST(CommandLine, FindsTheFaceOfAPhotoWithEitherDetector)
{
    LINEAMENT_REQUIRE_REAL_DATA("images/lfpw_same_person/image_0004.png");
    const std::string photo = (test::real_data_folder() / "images/lfpw_same_person/image_0004.png").string();
    const test::TemporaryFolder folder;
    for (const std::string detector : {"mediapipe", "dlib"}) {
        const Outcome outcome =
            run(folder, "fit '" + photo + "' --no-report --detector " + detector + " -o " + detector);
        ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
        const nlohmann::json fit = nlohmann::json::parse(read_all(folder / (detector + "/image_0004/fit.json")));
        ASSERT_EQ(fit["faces"].size(), 1U);
        EXPECT_EQ(fit["faces"][0]["status"], "success");
        EXPECT_LT(fit["faces"][0]["rms_px"].get<double>(), 12.0) << "of a face 400 px wide";
    }
    EXPECT_EQ(run(folder, "fit '" + photo + "' --detector none").exit_code, 2);
    EXPECT_EQ(run(folder, "fit '" + photo + "' --detector magic").exit_code, 2);
}

TEST(CommandLine, AClipWithoutAFaceIsNoAnswer)
{
    LINEAMENT_REQUIRE_REAL_DATA("video/no_face.mp4");
    const std::string clip = (test::real_data_folder() / "video/no_face.mp4").string();
    const test::TemporaryFolder folder;
    const Outcome outcome = run(folder, "track '" + clip + "' -o out");
    EXPECT_EQ(outcome.exit_code, 6) << outcome.error;
    EXPECT_NE(outcome.error.find("no face found in any of 95 frames"), std::string::npos) << outcome.error;
    EXPECT_FALSE(fs::exists(folder / "out"));
}

TEST(CommandLine, ModelInfoIsReadableByMachines)
{
    const test::TemporaryFolder folder;
    const Outcome outcome = run(folder, "model info --json");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
    const nlohmann::json info = nlohmann::json::parse(outcome.out);
    EXPECT_EQ(info["levels"].size(), 3U);
    EXPECT_EQ(info["shape"]["components"], 60);
    EXPECT_NE(info["license"].get<std::string>(), "");
}

} // namespace
} // namespace lineament
