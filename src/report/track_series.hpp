// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/report/track_report.hpp"
#include "report/viewer_data.hpp"

#include <map>
#include <string>
#include <vector>

namespace lineament::html {

/// The rows of one face as columns over all frames of the video; NaN where the face was not found.
struct TrackSeries
{
    std::vector<double> time_s = {};
    std::vector<double> yaw_deg = {}, pitch_deg = {}, roll_deg = {};
    std::vector<double> x_mm = {}, y_mm = {};
    std::vector<double> scale_px_per_mm = {};
    std::vector<double> rms_px = {};
    std::vector<std::vector<double>> expressions = {}; ///< One column an expression name of the report.
    std::vector<const TrackRow*> rows = {};            ///< The row of each frame, or nullptr.
    std::map<std::string, int> status_counts = {};
};

/// @throws InvalidArgument unless frames and times ascend and each row has all coefficients or none.
[[nodiscard]] TrackSeries collect_series(const TrackReport& report, int face_id);

/// Every `stride`-th frame for the viewer; expressions are matched to the view's morph targets by name.
[[nodiscard]] Playback make_playback(const TrackReport& report, const TrackSeries& series, const FaceView& view,
                                     std::size_t stride);

/// RGBA picture, one row an expression, at most `max_columns` columns of time: alpha is the largest value in the
/// column, grey where the face was not found throughout.
[[nodiscard]] ImageU8 expression_heat_map(const TrackSeries& series, int max_columns);

} // namespace lineament::html
