// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/io/track_file.hpp"
#include "lineament/report/face_view.hpp"

#include <optional>
#include <string>
#include <vector>

namespace lineament {

/// One person of a track report.
struct TrackReportFace
{
    int id = 1;                                             ///< As in TrackRow::face.
    FaceView view = {};                                     ///< Neutral face, morph targets, fused texture.
    ImageU8 texture_confidence = {};                        ///< In uv space, 0..255; may be empty.
    std::vector<std::string> unobservable_expressions = {}; ///< Names whose value the landmarks cannot tell.
};

/// A small picture out of the video.
struct TrackReportThumbnail
{
    double time_s = 0.0;
    ImageU8 picture = {}; ///< A frame with its overlay.
};

/// What a track report is made of.
struct TrackReport
{
    std::string title = {}; ///< Name of the video.
    int width = 0;          ///< Of the video as shown [px].
    int height = 0;
    std::optional<double> frame_rate = std::nullopt; ///< Mean frames per second.
    bool is_complete = true;                         ///< As TrackFile::is_complete; if not, the report says so first.
    std::string model_name = {};
    std::string program = {};                       ///< "lineament 0.1.0".
    std::vector<std::string> expression_names = {}; ///< Of the rows' coefficients.
    std::vector<TrackRow> rows = {};                ///< By ascending frame and time; every frame has at least one.
    std::vector<TrackReportFace> faces = {};
    std::vector<TrackReportThumbnail> thumbnails = {};
};

/// One HTML file that needs nothing else: facts, a strip of pictures, and for each person a 3D view that plays the
/// recorded head pose and expressions, plots over time with gaps where the face was not found, statuses, and texture.
/// It makes no request and every text from outside is escaped, as in format_fit_report. Where a video has more than
/// 3000 frames, the 3D view plays every second, third, ... one and says so.
/// @throws InvalidArgument unless frames and times ascend, or if a row's coefficients or a face's mesh disagree in
/// size.
[[nodiscard]] std::string format_track_report(const TrackReport& report);

} // namespace lineament
