// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/fit_file.hpp"

#include "json.hpp"
#include "text.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/core/checks.hpp"
#include "lineament/fit/gaze.hpp"
#include "lineament/io/file.hpp"

#include <cmath>

namespace lineament {

namespace {

using detail::Json;
using detail::JsonReader;

template <typename Vector>
Json json_numbers(const Vector& values)
{
    Json numbers = Json::array();
    for (const double value : values) {
        numbers.push_back(value); // not finite: written as null
    }
    return numbers;
}

Json json_pose(const Camera& camera)
{
    Json rotation = Json::array();
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) {
            rotation.push_back(camera.camera_from_model(row, column));
        }
    }
    const HeadAngles angles = angles_from_rotation(camera.camera_from_model);
    const Json depth_mm = camera.phi_per_mm > 0.0 ? Json(1.0 / camera.phi_per_mm) : Json();
    return {{"camera_from_model", std::move(rotation)},
            {"yaw_deg", degrees(angles.yaw)},
            {"pitch_deg", degrees(angles.pitch)},
            {"roll_deg", degrees(angles.roll)},
            {"translation_mm", Json::array({camera.translation_mm.x(), camera.translation_mm.y(), depth_mm})}};
}

Json json_camera(const Camera& camera)
{
    const bool has_focal = camera.phi_per_mm > 0.0;
    return {{"scale_px_per_mm", camera.scale_px_per_mm},
            {"focal_px", has_focal ? Json(camera.scale_px_per_mm / camera.phi_per_mm) : Json()},
            {"phi_per_mm", camera.phi_per_mm},
            {"principal_point_px", json_numbers(camera.principal_point_px)}};
}

Json json_landmarks(const std::vector<FittedLandmark>& landmarks)
{
    Json items = Json::array();
    for (const FittedLandmark& landmark : landmarks) {
        items.push_back({{"name", landmark.name},
                         {"point_px", json_numbers(landmark.point_px)},
                         {"fitted_px", json_numbers(landmark.fitted_px)},
                         {"weight", landmark.weight}});
    }
    return items;
}

// Empty without the points of an iris.
Json json_gaze(const Gaze& gaze)
{
    Json json = Json::object();
    for (const auto& [name, eye] : {std::pair("right", gaze.right), std::pair("left", gaze.left)}) {
        if (eye) {
            json[name] = {{"offset_mm", json_numbers(eye->offset_mm)},
                          {"yaw_deg", degrees(eye->yaw)},
                          {"pitch_deg", degrees(eye->pitch)}};
        }
    }
    return json;
}

Json json_face(const FitFileFace& face)
{
    const FitResult& fit = face.fit;
    require_size(static_cast<Eigen::Index>(fit.expression_names.size()), fit.expression_coefficients.size(),
                 "format_fit_json", "expression_names");
    const std::vector<double>& deviations = face.expression_standard_deviations;
    require(deviations.empty() || deviations.size() == fit.expression_names.size(), "format_fit_json",
            "expression_standard_deviations", "none or " + std::to_string(fit.expression_names.size()),
            std::to_string(deviations.size()));
    Json values = Json::object();
    for (std::size_t i = 0; i < fit.expression_names.size(); ++i) {
        values[fit.expression_names[i]] = fit.expression_coefficients[static_cast<Eigen::Index>(i)];
    }
    Json named_deviations = Json::object();
    for (std::size_t i = 0; i < deviations.size(); ++i) {
        named_deviations[fit.expression_names[i]] = deviations[i];
    }
    Json json = {{"id", face.id}, {"status", to_string(fit.status)}};
    if (!fit.reason.empty()) {
        json["reason"] = fit.reason;
    }
    json["pose"] = json_pose(fit.camera);
    json["camera"] = json_camera(fit.camera);
    json["shape_coefficients"] = json_numbers(fit.shape_coefficients);
    json["shape_standard_deviations"] = json_numbers(face.shape_standard_deviations);
    if (face.predicted_rms_mm) {
        json["predicted_rms_mm"] = *face.predicted_rms_mm;
    }
    json["expression"] = {{"set", fit.expression_set},
                          {"values", std::move(values)},
                          {"standard_deviations", std::move(named_deviations)},
                          {"unobservable", Json(face.unobservable)}};
    json["landmarks"] = json_landmarks(fit.landmarks);
    if (Json gaze = json_gaze(measure_gaze(fit)); !gaze.empty()) {
        json["gaze"] = std::move(gaze);
    }
    json["rms_px"] = fit.rms_px;
    json["chi_square"] = fit.chi_square;
    json["dof"] = fit.degrees_of_freedom;
    json["iterations"] = fit.iterations;
    json["timing_us"] = {{"pose", fit.timing.pose_us},
                         {"identity", fit.timing.identity_us},
                         {"expression", fit.timing.expression_us},
                         {"contour", fit.timing.contour_us},
                         {"total", fit.timing.total_us}};
    return json;
}

// A number, or NaN for null: what was not finite when it was written.
double read_number(const JsonReader& value)
{
    return value.value().is_null() ? std::nan("") : value.number();
}

Eigen::Vector2d read_point(const JsonReader& value)
{
    if (value.size() != 2) {
        value.fail("[x, y]");
    }
    return {read_number(value.element(0)), read_number(value.element(1))};
}

std::vector<double> read_numbers(const JsonReader& value)
{
    std::vector<double> numbers(value.size());
    for (std::size_t i = 0; i < numbers.size(); ++i) {
        numbers[i] = read_number(value.element(i));
    }
    return numbers;
}

FitStatus read_status(const JsonReader& value)
{
    const std::string text = value.text();
    for (const FitStatus status : {FitStatus::success, FitStatus::not_converged, FitStatus::too_few_correspondences,
                                   FitStatus::degenerate, FitStatus::implausible}) {
        if (text == to_string(status)) {
            return status;
        }
    }
    value.fail("success, not_converged, too_few_correspondences, degenerate or implausible");
}

Camera read_camera(const JsonReader& face)
{
    Camera camera;
    const JsonReader rotation = face.member("pose").member("camera_from_model");
    if (rotation.size() != 9) {
        rotation.fail("9 numbers");
    }
    for (int i = 0; i < 9; ++i) {
        camera.camera_from_model(i / 3, i % 3) = read_number(rotation.element(static_cast<std::size_t>(i)));
    }
    const JsonReader translation = face.member("pose").member("translation_mm");
    if (translation.size() != 3) {
        translation.fail("[x, y, z or null]");
    }
    camera.translation_mm = {read_number(translation.element(0)), read_number(translation.element(1))};
    const JsonReader values = face.member("camera");
    camera.scale_px_per_mm = read_number(values.member("scale_px_per_mm"));
    camera.phi_per_mm = read_number(values.member("phi_per_mm"));
    camera.principal_point_px = read_point(values.member("principal_point_px"));
    return camera;
}

void read_expression(const JsonReader& expression, FitFileFace& face)
{
    face.fit.expression_set = expression.member("set").text();
    const JsonReader values = expression.member("values");
    if (!values.value().is_object()) {
        values.fail("an object of named numbers");
    }
    face.fit.expression_coefficients.resize(static_cast<Eigen::Index>(values.value().size()));
    for (const auto& [name, unused] : values.value().items()) {
        face.fit.expression_coefficients[static_cast<Eigen::Index>(face.fit.expression_names.size())] =
            read_number(values.member(name));
        face.fit.expression_names.push_back(name);
    }
    if (expression.has("standard_deviations")) {
        const JsonReader deviations = expression.member("standard_deviations");
        const std::size_t count = deviations.value().size();
        if (!deviations.value().is_object() || (count > 0 && count != face.fit.expression_names.size())) {
            deviations.fail("an object of one number for each expression, or an empty one");
        }
        for (std::size_t i = 0; i < count; ++i) {
            face.expression_standard_deviations.push_back(read_number(deviations.member(face.fit.expression_names[i])));
        }
    }
    const JsonReader unobservable = expression.member("unobservable");
    for (std::size_t i = 0; i < unobservable.size(); ++i) {
        face.unobservable.push_back(unobservable.element(i).text());
    }
}

FitFileFace read_face(const JsonReader& json, const std::string& method)
{
    FitFileFace face;
    FitResult& fit = face.fit;
    face.id = json.member("id").integer(0, 1000000);
    fit.status = read_status(json.member("status"));
    fit.reason = json.has("reason") ? json.member("reason").text() : "";
    fit.method = method;
    fit.camera = read_camera(json);
    const std::vector<double> shape = read_numbers(json.member("shape_coefficients"));
    fit.shape_coefficients = Eigen::Map<const Eigen::VectorXd>(shape.data(), static_cast<Eigen::Index>(shape.size()));
    face.shape_standard_deviations = read_numbers(json.member("shape_standard_deviations"));
    if (json.has("predicted_rms_mm")) {
        face.predicted_rms_mm = read_number(json.member("predicted_rms_mm"));
    }
    read_expression(json.member("expression"), face);
    const JsonReader landmarks = json.member("landmarks");
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
        const JsonReader landmark = landmarks.element(i);
        fit.landmarks.push_back({landmark.member("name").text(), read_point(landmark.member("point_px")),
                                 read_point(landmark.member("fitted_px")), read_number(landmark.member("weight"))});
    }
    fit.rms_px = read_number(json.member("rms_px"));
    fit.chi_square = read_number(json.member("chi_square"));
    fit.degrees_of_freedom = json.member("dof").integer(-1000000, 1000000000);
    fit.iterations = json.member("iterations").integer(0, 1000000000);
    const JsonReader timing = json.member("timing_us");
    fit.timing = {read_number(timing.member("pose")), read_number(timing.member("identity")),
                  read_number(timing.member("expression")), read_number(timing.member("contour")),
                  read_number(timing.member("total"))};
    return face;
}

} // namespace

std::string format_fit_json(const FitFile& file)
{
    Json faces = Json::array();
    for (const FitFileFace& face : file.faces) {
        faces.push_back(json_face(face));
    }
    return detail::format_json({{"format", "lineament-fit"},
                                {"version", 1},
                                {"image", {{"width", file.width}, {"height", file.height}}},
                                {"model", file.model},
                                {"method", file.method},
                                {"faces", std::move(faces)}});
}

FitFile parse_fit_json(std::string_view text, const std::string& path)
{
    const Json json = detail::parse_json(text, path);
    const JsonReader root(json, path);
    if (root.member("format").text() != "lineament-fit") {
        root.member("format").fail("\"lineament-fit\"");
    }
    if (root.member("version").integer(1, 1000000) != 1) {
        root.member("version").fail("version 1 (a newer program wrote this?)");
    }
    FitFile file;
    file.width = root.member("image").member("width").integer(0, 1000000000);
    file.height = root.member("image").member("height").integer(0, 1000000000);
    file.model = root.member("model").text();
    file.method = root.member("method").text();
    const JsonReader faces = root.member("faces");
    for (std::size_t i = 0; i < faces.size(); ++i) {
        file.faces.push_back(read_face(faces.element(i), file.method));
    }
    return file;
}

FitFile load_fit_json(const std::string& path)
{
    return parse_fit_json(read_text_file(path), path);
}

void save_fit_json(const std::string& path, const FitFile& file)
{
    write_file(path, format_fit_json(file));
}

} // namespace lineament
