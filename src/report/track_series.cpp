// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "report/track_series.hpp"

#include "lineament/camera/angles.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lineament::html {

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

void check_rows(const TrackReport& report)
{
    const char* const function = "format_track_report";
    for (std::size_t i = 0; i < report.rows.size(); ++i) {
        const TrackRow& row = report.rows[i];
        const std::string place = "rows[" + std::to_string(i) + "]";
        require(std::isfinite(row.time_s), function, (place + ".time_s").c_str(), "a finite number",
                to_text(row.time_s));
        if (i > 0) {
            require(row.frame >= report.rows[i - 1].frame && row.time_s >= report.rows[i - 1].time_s, function,
                    place.c_str(), "frame and time not before those of the row above",
                    "frame " + std::to_string(row.frame) + " at " + to_text(row.time_s) + " s");
        }
        const Eigen::Index count = row.expression_coefficients.size();
        require(count == 0 || count == static_cast<Eigen::Index>(report.expression_names.size()), function,
                (place + ".expression_coefficients").c_str(),
                "none or " + std::to_string(report.expression_names.size()), std::to_string(count));
    }
}

void append(TrackSeries& series, double time_s, const TrackRow* row, std::size_t num_expressions)
{
    const bool has_camera = row != nullptr && row->camera.has_value();
    const HeadAngles angles =
        has_camera ? angles_from_rotation(row->camera->camera_from_model) : HeadAngles{unknown, unknown, unknown};
    series.time_s.push_back(time_s);
    series.yaw_deg.push_back(degrees(angles.yaw));
    series.pitch_deg.push_back(degrees(angles.pitch));
    series.roll_deg.push_back(degrees(angles.roll));
    series.x_mm.push_back(has_camera ? row->camera->translation_mm.x() : unknown);
    series.y_mm.push_back(has_camera ? row->camera->translation_mm.y() : unknown);
    series.scale_px_per_mm.push_back(has_camera ? row->camera->scale_px_per_mm : unknown);
    series.rms_px.push_back(row != nullptr ? row->rms_px.value_or(unknown) : unknown);
    for (std::size_t k = 0; k < num_expressions; ++k) {
        const bool has_value = row != nullptr && row->expression_coefficients.size() > 0;
        series.expressions[k].push_back(has_value ? row->expression_coefficients[static_cast<Eigen::Index>(k)]
                                                  : unknown);
    }
    series.rows.push_back(row);
    ++series.status_counts[row != nullptr && !row->status.empty() ? row->status : "not found"];
}

} // namespace

TrackSeries collect_series(const TrackReport& report, int face_id)
{
    check_rows(report);
    TrackSeries series;
    const std::size_t num_expressions = report.expression_names.size();
    series.expressions.resize(num_expressions);
    for (std::size_t begin = 0; begin < report.rows.size();) {
        const TrackRow* found = nullptr;
        std::size_t end = begin;
        for (; end < report.rows.size() && report.rows[end].frame == report.rows[begin].frame; ++end) {
            const TrackRow& row = report.rows[end];
            if (row.face == face_id || (!row.face && found == nullptr)) {
                found = &row; // a row without a face speaks for the whole frame
            }
        }
        append(series, report.rows[begin].time_s, found, num_expressions);
        begin = end;
    }
    return series;
}

Playback make_playback(const TrackReport& report, const TrackSeries& series, const FaceView& view, std::size_t stride)
{
    Playback playback;
    std::vector<std::size_t> column_of_target;
    for (const std::string& name : view.expressions.names) {
        const auto place = std::find(report.expression_names.begin(), report.expression_names.end(), name);
        column_of_target.push_back(static_cast<std::size_t>(place - report.expression_names.begin()));
    }
    for (std::size_t i = 0; i < series.time_s.size(); i += stride) {
        const TrackRow* row = series.rows[i];
        playback.times_s.push_back(static_cast<float>(series.time_s[i] - series.time_s.front()));
        playback.statuses.push_back(row != nullptr && !row->status.empty() ? row->status : "not found");
        Eigen::Matrix3d head = Eigen::Matrix3d::Zero();
        if (row != nullptr && row->camera) {
            head = frontal_rotation() * row->camera->camera_from_model;
        }
        for (const double entry : head.reshaped<Eigen::RowMajor>()) {
            playback.rotations.push_back(static_cast<float>(entry));
        }
        std::vector<float> values;
        for (const std::size_t column : column_of_target) {
            const double value = column < series.expressions.size() ? series.expressions[column][i] : 0.0;
            values.push_back(std::isfinite(value) ? static_cast<float>(value) : 0.0f);
        }
        playback.expressions.push_back(std::move(values));
    }
    return playback;
}

ImageU8 expression_heat_map(const TrackSeries& series, int max_columns)
{
    const std::size_t num_frames = series.time_s.size();
    const int columns = static_cast<int>(std::min(num_frames, static_cast<std::size_t>(max_columns)));
    ImageU8 picture(columns, static_cast<int>(series.expressions.size()), 4);
    for (int row = 0; row < picture.height; ++row) {
        const std::vector<double>& values = series.expressions[static_cast<std::size_t>(row)];
        for (int column = 0; column < columns; ++column) {
            const std::size_t begin = num_frames * static_cast<std::size_t>(column) / columns;
            const std::size_t end = num_frames * (static_cast<std::size_t>(column) + 1) / columns;
            double largest = -1.0;
            for (std::size_t i = begin; i < end; ++i) {
                largest = std::isfinite(values[i]) ? std::max(largest, std::abs(values[i])) : largest;
            }
            const bool is_gap = largest < 0;
            std::uint8_t* pixel = picture.pixel(column, row);
            pixel[0] = is_gap ? 128 : 26;
            pixel[1] = is_gap ? 128 : 122;
            pixel[2] = is_gap ? 128 : 210;
            pixel[3] = is_gap ? 60 : to_u8(static_cast<float>(largest));
        }
    }
    return picture;
}

} // namespace lineament::html
