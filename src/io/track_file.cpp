// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/track_file.hpp"

#include "json.hpp"
#include "text.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/core/checks.hpp"
#include "lineament/io/file.hpp"

#include <cmath>

namespace lineament {

namespace {

using detail::Json;

void append_cell(std::string& line, const std::optional<double>& value)
{
    line += ',';
    if (value && std::isfinite(*value)) {
        detail::append_number(line, *value + 0.0); // no negative zero
    }
}

Json json_numbers(const Eigen::VectorXd& values)
{
    Json numbers = Json::array();
    for (const double value : values) {
        numbers.push_back(value); // not finite: written as null
    }
    return numbers;
}

Json json_optional(const std::optional<double>& value)
{
    return value ? Json(*value) : Json();
}

} // namespace

std::string format_csv_text(const std::string& text)
{
    const std::string safe =
        !text.empty() && std::string_view("=+-@\t\r").find(text[0]) != std::string_view::npos ? "'" + text : text;
    if (safe.find_first_of(",\"\r\n") == std::string::npos) {
        return safe;
    }
    std::string quoted = "\"";
    for (const char c : safe) {
        quoted += c;
        if (c == '"') {
            quoted += c;
        }
    }
    quoted += '"';
    return quoted;
}

std::string format_frames_header(const std::vector<std::string>& expression_names)
{
    std::string line = "frame,time_s,face,status,yaw_deg,pitch_deg,roll_deg,x_mm,y_mm,z_mm,scale_px_per_mm,rms_px,"
                       "chi_square,quality";
    for (const std::string& name : expression_names) {
        line += ',';
        line += format_csv_text(name);
    }
    line += ",gaze_yaw_deg,gaze_pitch_deg\n";
    return line;
}

std::string format_frames_row(const TrackRow& row, int num_expressions)
{
    if (row.expression_coefficients.size() > 0) {
        require_size(row.expression_coefficients.size(), num_expressions, "format_frames_row",
                     "row.expression_coefficients");
    }
    std::string line = std::to_string(row.frame);
    append_cell(line, row.time_s);
    line += ',';
    line += row.face ? std::to_string(*row.face) : "";
    line += ',';
    line += format_csv_text(row.status);
    if (row.camera) {
        const Camera& camera = *row.camera;
        const HeadAngles angles = angles_from_rotation(camera.camera_from_model);
        for (const double value : {degrees(angles.yaw), degrees(angles.pitch), degrees(angles.roll),
                                   camera.translation_mm.x(), camera.translation_mm.y()}) {
            append_cell(line, value);
        }
        append_cell(line, camera.phi_per_mm > 0.0 ? std::optional<double>(1.0 / camera.phi_per_mm) : std::nullopt);
        append_cell(line, camera.scale_px_per_mm);
    } else {
        line += ",,,,,,,";
    }
    append_cell(line, row.rms_px);
    append_cell(line, row.chi_square);
    append_cell(line, row.quality);
    for (int i = 0; i < num_expressions; ++i) {
        append_cell(line, row.expression_coefficients.size() > 0 ? std::optional<double>(row.expression_coefficients[i])
                                                                 : std::nullopt);
    }
    append_cell(line, row.gaze_yaw ? std::optional(degrees(*row.gaze_yaw)) : std::nullopt);
    append_cell(line, row.gaze_pitch ? std::optional(degrees(*row.gaze_pitch)) : std::nullopt);
    line += '\n';
    return line;
}

std::string format_frames_csv(const std::vector<TrackRow>& rows, const std::vector<std::string>& expression_names)
{
    std::string text = format_frames_header(expression_names);
    for (const TrackRow& row : rows) {
        text += format_frames_row(row, static_cast<int>(expression_names.size()));
    }
    return text;
}

void save_frames_csv(const std::string& path, const std::vector<TrackRow>& rows,
                     const std::vector<std::string>& expression_names)
{
    write_file(path, format_frames_csv(rows, expression_names));
}

std::string format_track_json(const TrackFile& file)
{
    Json faces = Json::array();
    for (const TrackFileFace& face : file.faces) {
        faces.push_back({{"id", face.id},
                         {"shape_coefficients", json_numbers(face.shape_coefficients)},
                         {"shape_standard_deviations", json_numbers(face.shape_standard_deviations)},
                         {"unobservable_expressions", Json(face.unobservable_expressions)},
                         {"status_counts", Json(face.status_counts)}});
    }
    return detail::format_json(
        {{"format", "lineament-track"},
         {"version", 1},
         {"video",
          {{"width", file.width},
           {"height", file.height},
           {"frames", file.num_frames},
           {"duration_s", file.duration_s},
           {"frame_rate", json_optional(file.frame_rate)},
           {"complete", file.is_complete}}},
         {"model", file.model},
         {"method", file.method},
         {"camera",
          {{"focal_px", json_optional(file.focal_px)}, {"principal_point_px", json_numbers(file.principal_point_px)}}},
         {"landmark_scheme", file.landmark_scheme},
         {"expression", {{"set", file.expression_set}, {"names", Json(file.expression_names)}}},
         {"faces", std::move(faces)}});
}

void save_track_json(const std::string& path, const TrackFile& file)
{
    write_file(path, format_track_json(file));
}

} // namespace lineament
