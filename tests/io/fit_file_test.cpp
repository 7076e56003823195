// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/fit_file.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/core/error.hpp"
#include "lineament/core/random.hpp"
#include "lineament/fit/gaze.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <nlohmann/json.hpp>

#include <cmath>

namespace lineament {
namespace {

using nlohmann::json;
using test::throws;

FitFile make_file()
{
    Random random(11);
    FitFile file{640, 480, "default", "beyond", {}};
    for (int id = 1; id <= 2; ++id) {
        FitFileFace face;
        face.id = id;
        face.fit.status = id == 1 ? FitStatus::success : FitStatus::implausible;
        face.fit.reason = id == 1 ? "" : "the coefficient 3 is at its bound \"5\"";
        face.fit.method = "beyond";
        face.fit.camera = test::random_camera(random);
        face.fit.camera.phi_per_mm = id == 1 ? 0.0 : 1.0 / 700.0;
        face.fit.shape_coefficients = test::random_normal(random, 5);
        face.fit.expression_set = "ekman6";
        face.fit.expression_names = {"joy", "anger"};
        face.fit.expression_coefficients = Eigen::Vector2d(0.1, 1.0 / 3.0);
        face.fit.landmarks = {{"9", {1.5, 2.25}, {1.1, 1e-17}, 0.0}, {"31", {0.1, 0.2}, {0.3, 0.7}, 1.0}};
        face.fit.rms_px = random.uniform();
        face.fit.chi_square = 120.0 * random.uniform();
        face.fit.iterations = 5;
        face.fit.degrees_of_freedom = 130;
        face.fit.timing = {1.0, 2.0, 3.0, 4.0, 10.5};
        face.shape_standard_deviations = {0.5, 0.25, 0.125, 1.0, 0.1};
        face.unobservable = {"anger"};
        face.expression_standard_deviations = id == 1 ? std::vector{0.1 + 0.2, 1.0 / 7.0} : std::vector<double>{};
        face.predicted_rms_mm = id == 1 ? std::optional(0.1 + 0.2) : std::nullopt;
        file.faces.push_back(face);
    }
    return file;
}

TEST(FitFile, ComesBackBitForBit)
{
    const FitFile file = make_file();
    test::TemporaryFolder folder;
    save_fit_json(folder / "fit.json", file);
    const FitFile back = load_fit_json(folder / "fit.json");
    EXPECT_EQ(back.width, 640);
    EXPECT_EQ(back.height, 480);
    EXPECT_EQ(back.model, "default");
    EXPECT_EQ(back.method, "beyond");
    ASSERT_EQ(back.faces.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
        const FitResult& a = file.faces[i].fit;
        const FitResult& b = back.faces[i].fit;
        EXPECT_EQ(back.faces[i].id, file.faces[i].id);
        EXPECT_EQ(b.status, a.status);
        EXPECT_EQ(b.reason, a.reason);
        EXPECT_EQ(b.method, a.method);
        EXPECT_EQ(b.camera.camera_from_model, a.camera.camera_from_model);
        EXPECT_EQ(b.camera.translation_mm, a.camera.translation_mm);
        EXPECT_EQ(b.camera.scale_px_per_mm, a.camera.scale_px_per_mm);
        EXPECT_EQ(b.camera.phi_per_mm, a.camera.phi_per_mm);
        EXPECT_EQ(b.camera.principal_point_px, a.camera.principal_point_px);
        EXPECT_EQ(b.shape_coefficients, a.shape_coefficients);
        EXPECT_EQ(b.expression_set, a.expression_set);
        EXPECT_EQ(b.expression_names, a.expression_names);
        EXPECT_EQ(b.expression_coefficients, a.expression_coefficients);
        ASSERT_EQ(b.landmarks.size(), 2u);
        EXPECT_EQ(b.landmarks[0].name, "9");
        EXPECT_EQ(b.landmarks[0].fitted_px, a.landmarks[0].fitted_px);
        EXPECT_EQ(b.landmarks[1].weight, 1.0);
        EXPECT_EQ(b.rms_px, a.rms_px);
        EXPECT_EQ(b.chi_square, a.chi_square);
        EXPECT_EQ(b.degrees_of_freedom, 130);
        EXPECT_EQ(b.iterations, 5);
        EXPECT_EQ(b.timing.total_us, 10.5);
        EXPECT_EQ(back.faces[i].shape_standard_deviations, file.faces[i].shape_standard_deviations);
        EXPECT_EQ(back.faces[i].unobservable, file.faces[i].unobservable);
        EXPECT_EQ(back.faces[i].predicted_rms_mm, file.faces[i].predicted_rms_mm);
        EXPECT_EQ(back.faces[i].expression_standard_deviations, file.faces[i].expression_standard_deviations);
    }
    EXPECT_EQ(format_fit_json(back), format_fit_json(file));
}

TEST(FitFile, HasAGazeWhereIrisesWereSeen)
{
    FitFile file = make_file();
    EXPECT_FALSE(json::parse(format_fit_json(file))["faces"][0].contains("gaze"));
    FitResult& fit = file.faces[0].fit;
    fit.camera = Camera{};
    fit.camera.camera_from_model = frontal_rotation();
    fit.landmarks = {{"33", {30, 50}, {30, 50}, 1.0}, {"133", {60, 50}, {60, 50}, 1.0}};
    // Half the pupil's distance to the right in the picture: the subject's left, sin(yaw) = 1/2.
    fit.landmarks.push_back({"468", {45 + 0.5 * pupil_distance_mm, 50}, {45, 50}, 0.0});
    const json gaze = json::parse(format_fit_json(file))["faces"][0]["gaze"];
    EXPECT_NEAR(gaze["right"]["yaw_deg"].get<double>(), 30.0, 1e-9);
    EXPECT_NEAR(gaze["right"]["pitch_deg"].get<double>(), 0.0, 1e-9);
    EXPECT_NEAR(gaze["right"]["offset_mm"][0].get<double>(), 0.5 * pupil_distance_mm, 1e-9);
    EXPECT_FALSE(gaze.contains("left"));
    EXPECT_EQ(parse_fit_json(format_fit_json(file), "fit.json").faces.size(), file.faces.size());
}

TEST(FitFile, HasTheDocumentedMembers)
{
    const json root = json::parse(format_fit_json(make_file()));
    EXPECT_EQ(root["format"], "lineament-fit");
    EXPECT_EQ(root["version"], 1);
    EXPECT_EQ(root["image"], (json{{"width", 640}, {"height", 480}}));
    const json& orthographic = root["faces"][0];
    const json& perspective = root["faces"][1];
    const Camera camera = make_file().faces[1].fit.camera;
    const HeadAngles angles = angles_from_rotation(camera.camera_from_model);
    EXPECT_NEAR(perspective["pose"]["yaw_deg"].get<double>(), degrees(angles.yaw), 1e-12);
    EXPECT_EQ(perspective["pose"]["camera_from_model"][1].get<double>(), camera.camera_from_model(0, 1)) << "row-major";
    EXPECT_NEAR(perspective["pose"]["translation_mm"][2].get<double>(), 700.0, 1e-9);
    EXPECT_NEAR(perspective["camera"]["focal_px"].get<double>(), 700.0 * camera.scale_px_per_mm, 1e-9);
    EXPECT_TRUE(orthographic["pose"]["translation_mm"][2].is_null());
    EXPECT_TRUE(orthographic["camera"]["focal_px"].is_null());
    EXPECT_EQ(orthographic["status"], "success");
    EXPECT_FALSE(orthographic.contains("reason"));
    EXPECT_EQ(orthographic["expression"]["values"]["joy"], 0.1);
    EXPECT_EQ(orthographic["expression"]["standard_deviations"], (json{{"joy", 0.1 + 0.2}, {"anger", 1.0 / 7.0}}));
    EXPECT_EQ(perspective["expression"]["standard_deviations"], json::object()) << "not known";
    EXPECT_EQ(orthographic["expression"]["unobservable"], json::array({"anger"}));
    EXPECT_EQ(orthographic["dof"], 130);
}

TEST(FitFile, NumbersThatAreNotFiniteAreNull)
{
    FitFile file = make_file();
    file.faces[0].fit.chi_square = std::nan("");
    file.faces[0].shape_standard_deviations[1] = INFINITY;
    const std::string text = format_fit_json(file);
    EXPECT_TRUE(json::parse(text)["faces"][0]["chi_square"].is_null());
    EXPECT_EQ(text.find("nan"), std::string::npos);
    EXPECT_TRUE(std::isnan(parse_fit_json(text, "fit.json").faces[0].fit.chi_square));
}

TEST(FitFile, NoFacesIsValid)
{
    EXPECT_TRUE(parse_fit_json(format_fit_json({10, 10, "m", "thesis", {}}), "fit.json").faces.empty());
}

TEST(FitFile, NamesAndCoefficientsMustAgree)
{
    FitFile file = make_file();
    file.faces[0].fit.expression_names.pop_back();
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_fit_json(file); }, "expression_names"));
    file = make_file();
    file.faces[0].expression_standard_deviations.pop_back();
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_fit_json(file); }, "expression_standard_deviations"));
}

TEST(FitFile, FilesWithoutStandardDeviationsOfExpressionsAreRead)
{
    json old = json::parse(format_fit_json(make_file()));
    old["faces"][0]["expression"].erase("standard_deviations");
    const FitFile file = parse_fit_json(old.dump(), "fit.json");
    EXPECT_TRUE(file.faces[0].expression_standard_deviations.empty());
    EXPECT_EQ(file.faces[0].unobservable, std::vector<std::string>{"anger"});
}

TEST(FitFile, WrongContentIsRefusedWithItsPointer)
{
    const json good = json::parse(format_fit_json(make_file()));
    const auto refused = [&](const char* pointer, const json& value, const char* what) {
        json bad = good;
        bad[json::json_pointer(pointer)] = value;
        EXPECT_TRUE(throws<IoError>([&] { (void)parse_fit_json(bad.dump(), "fit.json"); },
                                    std::string("fit.json:") + pointer, what));
    };
    refused("/format", "other", "lineament-fit");
    refused("/version", 2, "version 1");
    refused("/faces", 3, "an array");
    refused("/faces/1/status", "fine", "not_converged");
    refused("/faces/1/pose/camera_from_model", json::array({1, 2}), "9 numbers");
    refused("/faces/1/camera/scale_px_per_mm", "1", "a number");
    refused("/faces/1/landmarks/0/point_px", json::array({1}), "[x, y]");
    refused("/faces/1/expression/values", json::array(), "an object");
    refused("/faces/0/expression/standard_deviations", json::array({0.1, 0.2}), "an object of one number for each");
    refused("/faces/0/expression/standard_deviations", json{{"joy", 0.1}}, "an object of one number for each");
    refused("/faces/0/expression/standard_deviations/joy", "0.1", "a number");
    for (const char* member :
         {"status", "pose", "camera", "shape_coefficients", "landmarks", "dof", "iterations", "timing_us"}) {
        json bad = good;
        bad["faces"][0].erase(member);
        EXPECT_TRUE(throws<IoError>([&] { (void)parse_fit_json(bad.dump(), "fit.json"); },
                                    std::string("/faces/0/") + member, "found none"));
    }
    const std::string text = good.dump();
    for (std::size_t size = 0; size < text.size(); size += 7) {
        EXPECT_TRUE(throws<IoError>([&] { (void)parse_fit_json(text.substr(0, size), "fit.json"); }, "fit.json"));
    }
}

} // namespace
} // namespace lineament
