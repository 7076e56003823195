// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "json.hpp"
#include "landmark_formats.hpp"
#include "text.hpp"

#include "lineament/core/checks.hpp"

#include <Eigen/LU>

#include <set>

namespace lineament {

namespace detail {

namespace {

double read_coordinate(const JsonReader& value)
{
    const double number = value.number();
    if (!is_coordinate(number)) {
        value.fail("a number within +-1e7");
    }
    return number;
}

bool is_ibug68_name(const std::string& name)
{
    const auto number = parse_integer(name);
    return number && *number >= 1 && *number <= 68 && name == std::to_string(*number);
}

bool is_positive_definite(const Eigen::Matrix2d& covariance)
{
    return covariance.allFinite() && covariance(0, 1) == covariance(1, 0) && covariance(0, 0) > 0.0 &&
           covariance.determinant() > 0.0;
}

/// "covariances_px", which is about each of the points or missing.
void read_covariances(const JsonReader& covariances, const LandmarkFileOptions& options, LandmarkFrame& frame)
{
    if (!covariances.value().is_object()) {
        covariances.fail("an object of named covariances");
    }
    const bool is_normalized = options.units == LandmarkUnits::normalized;
    const Eigen::Vector2d size(is_normalized ? options.image_width : 1.0, is_normalized ? options.image_height : 1.0);
    for (const Landmark& landmark : frame.set.landmarks) {
        const JsonReader entries = covariances.member(landmark.name);
        if (entries.size() != 3) {
            entries.fail("[xx, xy, yy]");
        }
        const double xx = entries.element(0).number(), xy = entries.element(1).number();
        const double yy = entries.element(2).number();
        Eigen::Matrix2d covariance;
        covariance << xx, xy, xy, yy;
        covariance = size.asDiagonal() * covariance * size.asDiagonal();
        if (!is_positive_definite(covariance)) {
            entries.fail("a positive definite covariance [xx, xy, yy]");
        }
        frame.covariances_px.push_back(covariance);
    }
    if (covariances.value().size() == frame.set.landmarks.size()) {
        return; // each name stands once
    }
    for (const auto& [name, unused] : covariances.value().items()) {
        if (!frame.set.find(name)) {
            covariances.member(name).fail("the covariance of one of the points");
        }
    }
}

LandmarkFile read_own(const JsonReader& root, const LandmarkFileOptions& options)
{
    if (root.member("version").integer(1, 1000000) != 1) {
        root.member("version").fail("version 1 (a newer program wrote this?)");
    }
    LandmarkFile file;
    file.format = LandmarkFormat::json;
    const JsonReader image = root.member("image");
    file.image_width = image.member("width").integer(1, static_cast<int>(max_coordinate_px));
    file.image_height = image.member("height").integer(1, static_cast<int>(max_coordinate_px));
    LandmarkFrame frame;
    frame.set.scheme = root.member("scheme").text();
    const JsonReader points = root.member("points");
    if (!points.value().is_object()) {
        points.fail("an object of named points");
    }
    for (const auto& [name, unused] : points.value().items()) {
        const JsonReader point = points.member(name);
        if (frame.set.scheme == "ibug68" && !is_ibug68_name(name)) {
            point.fail("the names \"1\" to \"68\" of the scheme ibug68, found the name " + in_quotes(name) + " with");
        }
        if (name.empty()) {
            point.fail("a named point, found the empty name with");
        }
        if (point.size() < 2 || point.size() > 4) {
            point.fail("[x, y], [x, y, confidence] or [x, y, confidence, depth]");
        }
        Landmark landmark;
        landmark.name = name;
        landmark.point_px =
            to_image_space(read_coordinate(point.element(0)), read_coordinate(point.element(1)), 0.0, options);
        if (point.size() >= 3) {
            landmark.confidence = point.element(2).number();
            if (landmark.confidence < 0.0 || landmark.confidence > 1.0) {
                point.element(2).fail("a confidence in 0 to 1");
            }
        }
        if (point.size() == 4) {
            const double width = options.units == LandmarkUnits::normalized ? options.image_width : 1.0;
            landmark.depth_px = width * read_coordinate(point.element(3));
        }
        frame.set.landmarks.push_back(std::move(landmark));
    }
    if (root.has("covariances_px")) {
        read_covariances(root.member("covariances_px"), options, frame);
    }
    file.frames.push_back(std::move(frame));
    return file;
}

enum class MediapipeUnits
{
    pixels,
    normalized,
};

LandmarkFrame read_mesh(const JsonReader& points, MediapipeUnits units, const LandmarkFileOptions& options)
{
    const std::size_t count = points.size();
    if (count != 468 && count != 478) {
        points.fail("the 468 or 478 points of a MediaPipe face mesh");
    }
    const double width = units == MediapipeUnits::normalized ? options.image_width : 1.0;
    const double height = units == MediapipeUnits::normalized ? options.image_height : 1.0;
    const bool is_ibug68 = options.mediapipe_points == MediapipePoints::ibug68;
    LandmarkFrame frame;
    frame.set.scheme = is_ibug68 ? "ibug68" : "mediapipe478";
    bool is_flat = true;
    for (std::size_t i = 0; i < count; ++i) {
        const JsonReader point = points.element(i);
        const bool is_array = point.value().is_array();
        const double x = read_coordinate(is_array ? point.element(0) : point.member("x"));
        const double y = read_coordinate(is_array ? point.element(1) : point.member("y"));
        std::optional<double> depth_px;
        if (is_array ? point.size() > 2 : point.has("z")) {
            depth_px = width * read_coordinate(is_array ? point.element(2) : point.member("z"));
            is_flat = is_flat && *depth_px == 0.0;
        }
        const std::string name = is_ibug68 ? ibug68_name_of_mediapipe_point(static_cast<int>(i)) : std::to_string(i);
        if (!name.empty()) {
            frame.set.landmarks.push_back({name, {x * width, y * height}, 1.0, depth_px});
        }
    }
    if (is_flat) { // written without depth
        for (Landmark& landmark : frame.set.landmarks) {
            landmark.depth_px.reset();
        }
    }
    return frame;
}

LandmarkFile read_mediapipe(const JsonReader& root, const LandmarkFileOptions& options)
{
    LandmarkFile file;
    file.format = LandmarkFormat::mediapipe;
    if (root.has("keypoints")) { // one face of the TensorFlow.js package, in pixels
        file.frames.push_back(read_mesh(root.member("keypoints"), MediapipeUnits::pixels, options));
        return file;
    }
    require(options.image_width > 0 && options.image_height > 0, "parse_landmarks", "options.image_width, image_height",
            "the size of the image, for normalised points",
            std::to_string(options.image_width) + " x " + std::to_string(options.image_height));
    const char* key = root.has("faceLandmarks") ? "faceLandmarks" : "face_landmarks";
    const JsonReader faces = root.value().is_array() ? root : root.member(key);
    // A bare array may hold the points of one face, or faces.
    const bool is_one_face = root.value().is_array() && faces.size() > 0 &&
                             !(faces.element(0).value().is_array() && faces.element(0).size() > 3);
    for (std::size_t i = 0; i < (is_one_face ? 1 : faces.size()); ++i) {
        file.frames.push_back(read_mesh(is_one_face ? faces : faces.element(i), MediapipeUnits::normalized, options));
        file.frames.back().face_id = static_cast<int>(i);
    }
    return file;
}

} // namespace

LandmarkFile parse_landmark_json(std::string_view text, const std::string& path, const LandmarkFileOptions& options)
{
    const Json json = parse_json(text, path);
    const JsonReader root(json, path);
    if (root.value().is_array() || root.has("faceLandmarks") || root.has("face_landmarks") || root.has("keypoints")) {
        return read_mediapipe(root, options);
    }
    if (!root.has("format") || root.member("format").text() != "lineament-landmarks") {
        throw content_error(
            path, "/format",
            "expected \"format\": \"lineament-landmarks\", or a MediaPipe result with \"faceLandmarks\" or "
            "\"keypoints\", found neither");
    }
    return read_own(root, options);
}

} // namespace detail

std::string format_landmarks(const LandmarkSet& set, int image_width, int image_height,
                             std::span<const Eigen::Matrix2d> covariances_px)
{
    require(image_width >= 1 && image_height >= 1, "format_landmarks", "image_width, image_height", "a size >= 1",
            std::to_string(image_width) + " x " + std::to_string(image_height));
    detail::Json points = detail::Json::object();
    std::set<std::string> names;
    for (const Landmark& landmark : set.landmarks) {
        require(!landmark.name.empty() && names.insert(landmark.name).second, "format_landmarks", "set.landmarks",
                "names that are not empty and not repeated", detail::in_quotes(landmark.name));
        require_finite(landmark.point_px, "format_landmarks", "point_px");
        require(landmark.confidence >= 0.0 && landmark.confidence <= 1.0, "format_landmarks", "confidence",
                "a number in 0 to 1", to_text(landmark.confidence));
        detail::Json point = {landmark.point_px.x(), landmark.point_px.y()};
        require(std::isfinite(landmark.depth_px.value_or(0.0)), "format_landmarks", "depth_px", "a finite number",
                to_text(landmark.depth_px.value_or(0.0)));
        if (landmark.confidence != 1.0 || landmark.depth_px) {
            point.push_back(landmark.confidence);
        }
        if (landmark.depth_px) {
            point.push_back(*landmark.depth_px);
        }
        points[landmark.name] = std::move(point);
    }
    detail::Json file = {{"format", "lineament-landmarks"},
                         {"version", 1},
                         {"scheme", set.scheme},
                         {"image", {{"width", image_width}, {"height", image_height}}},
                         {"points", std::move(points)}};
    if (!covariances_px.empty()) {
        require(covariances_px.size() == set.landmarks.size(), "format_landmarks", "covariances_px",
                "none, or one for each landmark", std::to_string(covariances_px.size()));
        detail::Json& covariances = file["covariances_px"] = detail::Json::object();
        for (std::size_t l = 0; l < covariances_px.size(); ++l) {
            const Eigen::Matrix2d& covariance = covariances_px[l];
            require(detail::is_positive_definite(covariance), "format_landmarks", "covariances_px",
                    "symmetric positive definite matrices", "another for " + detail::in_quotes(set.landmarks[l].name));
            covariances[set.landmarks[l].name] = {covariance(0, 0), covariance(0, 1), covariance(1, 1)};
        }
    }
    return detail::format_json(file);
}

} // namespace lineament
