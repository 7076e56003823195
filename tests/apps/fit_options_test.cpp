// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "apps/run_program.hpp"
#include "support/rendered_person.hpp"

#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/io/landmark_file.hpp"

#include "support/gltf_validator.hpp"

#include <nlohmann/json.hpp>

#include <iomanip>
#include <map>
#include <set>
#include <sstream>

namespace lineament {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::Outcome;
using test::read_all;
using test::run;
using test::save_synthetic_picture;
using test::save_text;

/// Fits face.png of the folder; what no test here looks at is left out.
Outcome fit(const test::TemporaryFolder& folder, const std::string& arguments)
{
    return run(folder, "fit face.png --no-report --texture-size 16 " + arguments);
}

/// The whole fit.json that fit() wrote.
json fit_json(const test::TemporaryFolder& folder, const std::string& arguments)
{
    const Outcome outcome = fit(folder, arguments);
    EXPECT_EQ(outcome.exit_code, 0) << arguments << "\n" << outcome.error;
    return outcome.exit_code == 0 ? json::parse(read_all(folder / "face/fit.json")) : json();
}

/// The only face in the fit.json that fit() wrote.
json fitted_face(const test::TemporaryFolder& folder, const std::string& arguments)
{
    const json file = fit_json(folder, arguments);
    EXPECT_EQ(file["faces"].size(), 1U) << arguments;
    return file["faces"][0];
}

Eigen::VectorXd shape_of_face(const json& face)
{
    const auto values = face["shape_coefficients"].get<std::vector<double>>();
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

int num_vertices_of_obj(const std::string& path)
{
    std::istringstream lines(read_all(path));
    int count = 0;
    for (std::string line; std::getline(lines, line);) {
        count += line.rfind("v ", 0) == 0 ? 1 : 0;
    }
    return count;
}

/// The landmarks of save_synthetic_picture() as rows "x y" of a .pts file whose first pixel lies at `origin`.
std::string pts_rows(const test::TemporaryFolder& folder, double origin)
{
    std::ostringstream rows;
    rows << std::setprecision(17);
    const json points = json::parse(read_all(folder / "face.json"))["points"];
    for (int i = 1; i <= 68; ++i) {
        const json& point = points[std::to_string(i)];
        rows << point[0].get<double>() - 0.5 + origin << " " << point[1].get<double>() - 0.5 + origin << "\n";
    }
    return rows.str();
}

TEST(FitOptions, SeveralFacesGetAFolderEachAndOneOfThemCanBeAskedFor)
{
    const test::TemporaryFolder folder;
    const ImageU8 small_left = test::RenderedPerson(1).picture(20, 400, 400, 0.25);
    const ImageU8 large_right = test::RenderedPerson(2).picture(-20, 400, 400, 0.1);
    save_png(folder / "face.png", test::side_by_side(small_left, large_right));
    const json both = fit_json(folder, "")["faces"];
    ASSERT_EQ(both.size(), 2U);
    EXPECT_EQ(both[0]["id"], 1);
    EXPECT_EQ(both[1]["id"], 2);
    EXPECT_NEAR(both[0]["pose"]["yaw_deg"].get<double>(), -20.0, 8.0) << "the largest face comes first";
    EXPECT_NEAR(both[1]["pose"]["yaw_deg"].get<double>(), 20.0, 8.0);
    for (const char* name : {"face_1/mesh.glb", "face_2/mesh.glb", "face_1/texture.png", "face_2/texture.png"}) {
        EXPECT_TRUE(fs::exists(fs::path(folder / "face") / name)) << name;
    }
    EXPECT_FALSE(fs::exists(folder / "face/mesh.glb"));

    fs::remove_all(folder / "face");
    const json second = fitted_face(folder, "--face 2");
    EXPECT_EQ(second["id"], 2);
    EXPECT_EQ(second["shape_coefficients"], both[1]["shape_coefficients"]);
    EXPECT_TRUE(fs::exists(folder / "face/mesh.glb"));
    EXPECT_FALSE(fs::exists(folder / "face/face_1"));
    EXPECT_FALSE(fs::exists(folder / "face/face_2"));

    const Outcome third = fit(folder, "--face 3");
    EXPECT_EQ(third.exit_code, 6);
    EXPECT_NE(third.error.find("--face 3, but only 2 found"), std::string::npos) << third.error;
    EXPECT_EQ(fit(folder, "--face 0").exit_code, 2);
}

TEST(FitOptions, LevelIsTheResolutionOfTheMesh)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    const MorphableModel model = load_model(default_model_path());
    std::set<int> counts;
    for (const std::string level : {"0", "1", "2", "full"}) {
        const json face = fitted_face(folder, "--landmarks face.json --level " + level);
        EXPECT_NEAR(face["pose"]["yaw_deg"].get<double>(), 12.0, 1.5) << level;
        const int expected = model.levels[level == "full" ? 2 : static_cast<std::size_t>(level[0] - '0')].num_vertices;
        EXPECT_EQ(num_vertices_of_obj(folder / "face/mesh.obj"), expected) << level;
        counts.insert(expected);
    }
    EXPECT_EQ(counts.size(), 3U);
    const Outcome outcome = fit(folder, "--landmarks face.json --level 3");
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_NE(outcome.error.find("full or 0 to 2, got 3"), std::string::npos) << outcome.error;
}

TEST(FitOptions, ThePublishedPriorDependsOnTheSizeOfThePictureTheModelsDoesNot)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    LandmarkSet doubled = load_landmarks(folder / "face.json").frames[0].set;
    for (Landmark& landmark : doubled.landmarks) {
        landmark.point_px *= 2.0;
    }
    fs::create_directories(folder / "large");
    save_png(folder / "large/face.png", ImageU8(1280, 960, 3, 128));
    save_landmarks(folder / "large/face.json", doubled, 1280, 960);
    const auto difference = [&](const std::string& prior) {
        const std::string options = " --no-report --texture-size 16 --method thesis --prior " + prior;
        EXPECT_EQ(run(folder, "fit face.png --landmarks face.json" + options).exit_code, 0);
        EXPECT_EQ(run(folder, "fit large/face.png --landmarks large/face.json -o of_large" + options).exit_code, 0);
        const json small = json::parse(read_all(folder / "face/fit.json"))["faces"][0];
        const json large = json::parse(read_all(folder / "of_large/face/fit.json"))["faces"][0];
        return test::max_difference(shape_of_face(small), shape_of_face(large));
    };
    EXPECT_LT(difference("model"), 1e-3);
    EXPECT_GT(difference("published"), 0.05);
}

TEST(FitOptions, FocalLengthMakesThePoseThreeDimensional)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    const json flat = fitted_face(folder, "--landmarks face.json");
    EXPECT_TRUE(flat["camera"]["focal_px"].is_null());
    EXPECT_TRUE(flat["pose"]["translation_mm"][2].is_null());
    const json deep = fitted_face(folder, "--landmarks face.json --focal 1500");
    EXPECT_NEAR(deep["camera"]["focal_px"].get<double>(), 1500.0, 1e-6);
    // The scale of the picture at the head's distance: 1.6 px/mm = 1500 px / distance.
    EXPECT_NEAR(deep["pose"]["translation_mm"][2].get<double>(), 1500.0 / 1.6, 100.0);
    EXPECT_EQ(fit(folder, "--landmarks face.json --focal -5").exit_code, 2);
}

TEST(FitOptions, UnknownFocalLengthIsFitted)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face", 0.0025); // at 40 cm, by a camera of 1.6 px/mm / 0.0025 / mm
    const json near = fitted_face(folder, "--landmarks face.json --focal unknown");
    EXPECT_NEAR(near["camera"]["focal_px"].get<double>(), 640.0, 130.0);
    EXPECT_NEAR(near["pose"]["translation_mm"][2].get<double>(), 400.0, 80.0);
    EXPECT_NE(read_all(folder / "face/fit.json").find("joint"), std::string::npos);
    EXPECT_TRUE(fitted_face(folder, "--landmarks face.json")["camera"]["focal_px"].is_null());
    EXPECT_EQ(fit(folder, "--landmarks face.json --focal unknown --method thesis").exit_code, 2);
    const Outcome outcome = fit(folder, "--landmarks face.json --focal near");
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_NE(outcome.error.find("unknown, got near"), std::string::npos) << outcome.error;
}

TEST(FitOptions, JointIsTheMethodUnlessAnotherIsAskedFor)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    EXPECT_EQ(fit_json(folder, "--landmarks face.json")["method"], "joint");
    EXPECT_EQ(fit_json(folder, "--landmarks face.json --method thesis")["method"], "thesis");
}

TEST(FitOptions, ExpressionsAreThoseOfTheSetAskedFor)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    const MorphableModel model = load_model(default_model_path());
    for (const auto& [name, count] : {std::pair<std::string, std::size_t>{"ekman6", 6}, {"arkit47", 47}, {"none", 0}}) {
        const json expression = fitted_face(folder, "--landmarks face.json --expressions " + name)["expression"];
        ASSERT_EQ(expression["values"].size(), count) << name;
        std::set<std::string> names;
        for (const auto& [key, value] : expression["values"].items()) {
            names.insert(key);
            EXPECT_GE(value.get<double>(), 0.0) << key;
        }
        if (count > 0) {
            const std::vector<std::string>& expected = model.find_expression_set(name)->names;
            EXPECT_EQ(names, std::set<std::string>(expected.begin(), expected.end())) << name;
        }
        if (!test::gltf_validator_modules().empty()) {
            EXPECT_THAT(test::validate_glb(folder / "face/mesh.glb"), testing::HasSubstr("errors 0 warnings 0\n"));
        }
    }
}

TEST(FitOptions, ContourSaysWhatBecomesOfTheOutline)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    std::map<std::string, Eigen::VectorXd> shapes;
    std::map<std::string, int> num_outline_points_used;
    for (const std::string contour : {"ignored", "fixed", "front", "both"}) {
        const json face = fitted_face(folder, "--landmarks face.json --contour " + contour);
        EXPECT_NEAR(face["pose"]["yaw_deg"].get<double>(), 12.0, 2.0) << contour;
        for (const auto& [other, shape] : shapes) {
            EXPECT_GT(test::max_difference(shape, shape_of_face(face)), 1e-3) << contour << " and " << other;
        }
        shapes[contour] = shape_of_face(face);
        for (const json& landmark : face["landmarks"]) {
            const int number = std::stoi(landmark["name"].get<std::string>());
            const bool is_outline = number <= 17 && number != 9;
            const bool is_used = landmark["weight"].get<double>() > 0.0;
            num_outline_points_used[contour] += is_outline && is_used ? 1 : 0;
            EXPECT_TRUE(is_outline || is_used) << contour << ", point " << number;
        }
    }
    EXPECT_EQ(num_outline_points_used["ignored"], 0);
    EXPECT_EQ(num_outline_points_used["fixed"], 16);
    EXPECT_GE(num_outline_points_used["front"], 8);
    EXPECT_GT(num_outline_points_used["both"], num_outline_points_used["front"]);
}

TEST(FitOptions, EitherMethodNamesTheExpressionsThatCannotBeSeen)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    for (const std::string method : {"joint", "thesis"}) {
        const auto unobservable = [&](const std::string& set) {
            const json face = fitted_face(folder, "--landmarks face.json --method " + method + " --expressions " + set);
            return face["expression"]["unobservable"].get<std::set<std::string>>();
        };
        const std::set<std::string> arkit = unobservable("arkit47");
        EXPECT_EQ(arkit.count("cheekPuff"), 1U) << method; // 68 points see nothing of it
        EXPECT_EQ(arkit.count("jawOpen"), 0U) << method;
        EXPECT_TRUE(unobservable("ekman6").empty()) << method;
        EXPECT_TRUE(unobservable("none").empty()) << method;
    }
}

TEST(FitOptions, TheJointMethodSaysHowSureExpressionsAre)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    const json joint = fitted_face(folder, "--landmarks face.json --expressions arkit47")["expression"];
    JointOptions options;
    options.expression_set = "arkit47";
    const JointFitter fitter(load_model(default_model_path()), "ibug68", options);
    const JointFitResult expected =
        fitter.fit(load_landmarks(folder / "face.json").frames.front().set, Eigen::Vector2d(320, 240));
    ASSERT_EQ(joint["standard_deviations"].size(), expected.fit.expression_names.size());
    std::set<std::string> near_the_prior;
    for (std::size_t k = 0; k < expected.fit.expression_names.size(); ++k) {
        const std::string& name = expected.fit.expression_names[k];
        const double deviation = joint["standard_deviations"][name].get<double>();
        EXPECT_NEAR(deviation, expected.expression_deviations[static_cast<Eigen::Index>(k)], 1e-3) << name;
        if (deviation > 0.9 * options.expression_sigma) {
            near_the_prior.insert(name);
        }
    }
    EXPECT_EQ(joint["unobservable"].get<std::set<std::string>>(), near_the_prior);
    const json thesis =
        fitted_face(folder, "--landmarks face.json --method thesis --expressions arkit47")["expression"];
    EXPECT_EQ(thesis["standard_deviations"], json::object()) << "it does not know them";
}

TEST(FitOptions, NoiseAndLossAreThoseOfTheLibrary)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    LandmarkSet set = load_landmarks(folder / "face.json").frames.front().set;
    set.landmarks[40].point_px.x() += 15; // so that losses differ
    save_landmarks(folder / "face.json", set, 640, 480);
    const Eigen::Vector2d center(320, 240);
    const MorphableModel model = load_model(default_model_path());
    JointOptions joint;
    joint.landmark_sigma_mm = 0.7;
    joint.contour_sigma_mm = 9;
    joint.loss = RobustLoss::none;
    FitOptions thesis;
    thesis.landmark_sigma_mm = 0.7;
    thesis.contour_sigma_mm = 9;
    const Eigen::VectorXd expected_joint = JointFitter(model, "ibug68", joint).fit(set, center).fit.shape_coefficients;
    const Eigen::VectorXd expected_thesis = FaceFitter(model, "ibug68", thesis).fit(set, center).shape_coefficients;
    const auto shape = [&](const std::string& arguments) {
        return shape_of_face(fitted_face(folder, "--landmarks face.json " + arguments));
    };
    const std::string noise = "--noise 0.7 --outline-noise 9 ";
    EXPECT_LT(test::max_difference(shape(noise + "--loss none"), expected_joint), 1e-3);
    EXPECT_LT(test::max_difference(shape(noise + "--method thesis"), expected_thesis), 1e-3);
    for (const char* less : {"--noise 0.7 --loss none", "--outline-noise 9 --loss none",
                             "--noise 0.7 --outline-noise 9", "--noise 0.7 --outline-noise 9 --loss geman_mcclure"}) {
        EXPECT_GT(test::max_difference(shape(less), expected_joint), 5e-3) << less;
    }
    for (const char* wrong : {"--noise 0", "--outline-noise -1", "--noise x", "--loss cauchy",
                              "--method thesis --loss none", "--method thesis --prior published --noise 1"}) {
        EXPECT_EQ(fit(folder, std::string("--landmarks face.json ") + wrong).exit_code, 2) << wrong;
    }
}

TEST(FitOptions, PtsFilesCountFromOneOrFromZero)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    save_text(folder / "one.pts", "version: 1\nn_points: 68\n{\n" + pts_rows(folder, 1.0) + "}\n");
    save_text(folder / "zero.pts", "version: 1\nn_points: 68\n{\n" + pts_rows(folder, 0.0) + "}\n");
    const json truth = fitted_face(folder, "--landmarks face.json");
    for (const char* arguments :
         {"--landmarks one.pts", "--landmarks one.pts --pts-origin one", "--landmarks zero.pts --pts-origin zero"}) {
        const json face = fitted_face(folder, arguments);
        EXPECT_LT(test::max_difference(shape_of_face(face), shape_of_face(truth)), 1e-6) << arguments;
        EXPECT_NEAR(face["pose"]["translation_mm"][0], truth["pose"]["translation_mm"][0], 1e-6) << arguments;
    }
    const json mistaken = fitted_face(folder, "--landmarks zero.pts");
    const double shift_mm = 1.0 / truth["camera"]["scale_px_per_mm"].get<double>();
    for (const int axis : {0, 1}) {
        EXPECT_NEAR(mistaken["pose"]["translation_mm"][axis].get<double>() -
                        truth["pose"]["translation_mm"][axis].get<double>(),
                    -shift_mm, 1e-3)
            << "one pixel to the upper left";
    }
}

TEST(FitOptions, PtsFilesWithoutAHeaderAreTakenOnRequest)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    save_text(folder / "bare.pts", pts_rows(folder, 1.0));
    EXPECT_EQ(fit(folder, "--landmarks bare.pts").exit_code, 3);
    const json face = fitted_face(folder, "--landmarks bare.pts --pts-headerless");
    const json truth = fitted_face(folder, "--landmarks face.json");
    EXPECT_LT(test::max_difference(shape_of_face(face), shape_of_face(truth)), 1e-6);
}

TEST(FitOptions, NormalizedLandmarksAreTakenOnRequest)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    LandmarkSet parts = load_landmarks(folder / "face.json").frames[0].set;
    for (Landmark& landmark : parts.landmarks) {
        landmark.point_px = landmark.point_px.cwiseQuotient(Eigen::Vector2d(640, 480));
    }
    save_landmarks(folder / "parts.json", parts, 640, 480);
    const Outcome mistaken = fit(folder, "--landmarks parts.json");
    EXPECT_NE(mistaken.exit_code, 0);
    EXPECT_NE(mistaken.error.find("--landmark-units"), std::string::npos) << mistaken.error;
    const json face = fitted_face(folder, "--landmarks parts.json --landmark-units normalized");
    const json truth = fitted_face(folder, "--landmarks face.json");
    EXPECT_LT(test::max_difference(shape_of_face(face), shape_of_face(truth)), 1e-6);
}

} // namespace
} // namespace lineament
