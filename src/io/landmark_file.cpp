// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/landmark_file.hpp"

#include "landmark_formats.hpp"
#include "text.hpp"

#include "lineament/core/checks.hpp"
#include "lineament/io/file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace lineament {

namespace detail {

Eigen::Vector2d to_image_space(double x, double y, double shift, const LandmarkFileOptions& options)
{
    if (options.units == LandmarkUnits::normalized) {
        return {x * options.image_width, y * options.image_height};
    }
    return {x + shift, y + shift};
}

bool is_coordinate(double value)
{
    return std::abs(value) <= max_coordinate_px;
}

namespace {

LandmarkFormat guess_format(std::string_view text)
{
    const std::size_t first = std::min(text.find_first_not_of(" \t\r\n"), text.size());
    const std::string_view start = text.substr(first);
    if (start.starts_with("[")) {
        return LandmarkFormat::json;
    }
    if (start.starts_with("{")) {
        const std::size_t second = start.find_first_not_of(" \t\r\n", 1);
        const bool is_json = second == std::string_view::npos || start[second] == '"' || start[second] == '}';
        return is_json ? LandmarkFormat::json : LandmarkFormat::pts;
    }
    const std::string_view line = start.substr(0, start.find_first_of("\r\n"));
    return line.starts_with("\"") || line.find_first_of(",;") != std::string_view::npos ||
                   line.find("x_") != std::string_view::npos
               ? LandmarkFormat::csv
               : LandmarkFormat::pts;
}

// All points of a face within 0..1 are almost surely parts of the image size.
void check_units(const LandmarkFile& file, const std::string& path)
{
    for (const LandmarkFrame& frame : file.frames) {
        const auto& landmarks = frame.set.landmarks;
        // The file's own numbers are at most half a pixel from image space.
        const bool all_tiny = std::all_of(landmarks.begin(), landmarks.end(), [](const Landmark& landmark) {
            return landmark.point_px.minCoeff() >= -0.5 && landmark.point_px.maxCoeff() <= 1.5;
        });
        if (landmarks.size() >= 4 && all_tiny) {
            throw content_error(path, "",
                                "expected pixels, found all " + std::to_string(landmarks.size()) +
                                    " points of a face within 0...1: normalised? Then say so "
                                    "(--landmark-units normalized)");
        }
    }
}

} // namespace

} // namespace detail

LandmarkFile parse_landmarks(std::string_view bytes, const std::string& path, const LandmarkFileOptions& options)
{
    require(options.units == LandmarkUnits::pixels || (options.image_width > 0 && options.image_height > 0),
            "parse_landmarks", "options.image_width, image_height", "the size of the image, for normalised points",
            std::to_string(options.image_width) + " x " + std::to_string(options.image_height));
    const std::string_view text = detail::checked_text(bytes, path, "landmarks (.pts, CSV or JSON)");
    LandmarkFile file;
    switch (detail::guess_format(text)) {
    case LandmarkFormat::pts:
        file = detail::parse_pts(text, path, options);
        break;
    case LandmarkFormat::csv:
        file = detail::parse_landmark_csv(text, path, options);
        break;
    case LandmarkFormat::json:
    case LandmarkFormat::mediapipe:
        file = detail::parse_landmark_json(text, path, options);
        break;
    }
    if (options.units == LandmarkUnits::pixels && file.format != LandmarkFormat::mediapipe) {
        detail::check_units(file, path);
    }
    return file;
}

LandmarkFile load_landmarks(const std::string& path, const LandmarkFileOptions& options)
{
    return parse_landmarks(read_text_file(path), path, options);
}

void save_landmarks(const std::string& path, const LandmarkSet& set, int image_width, int image_height,
                    std::span<const Eigen::Matrix2d> covariances_px)
{
    write_file(path, format_landmarks(set, image_width, image_height, covariances_px));
}

std::string ibug68_name_of_mediapipe_point(int index)
{
    // {point of the face mesh, point of ibug68}; the first is the chin, then right and left eyebrow, nose, right and
    // left eye, outer and inner lips, each in the order of ibug68.
    static constexpr std::array<std::pair<int, int>, 52> table = {{
        {152, 9},  {70, 18},  {63, 19},  {105, 20}, {66, 21},  {107, 22}, {336, 23}, {296, 24}, {334, 25},
        {293, 26}, {300, 27}, {168, 28}, {197, 29}, {5, 30},   {4, 31},   {75, 32},  {97, 33},  {2, 34},
        {326, 35}, {305, 36}, {33, 37},  {160, 38}, {158, 39}, {133, 40}, {153, 41}, {144, 42}, {362, 43},
        {385, 44}, {387, 45}, {263, 46}, {373, 47}, {380, 48}, {61, 49},  {39, 50},  {37, 51},  {0, 52},
        {267, 53}, {269, 54}, {291, 55}, {405, 56}, {314, 57}, {17, 58},  {84, 59},  {181, 60}, {78, 61},
        {82, 62},  {13, 63},  {312, 64}, {308, 65}, {317, 66}, {14, 67},  {87, 68},
    }};
    for (const auto& [mesh_point, ibug_point] : table) {
        if (mesh_point == index) {
            return std::to_string(ibug_point);
        }
    }
    return {};
}

} // namespace lineament
