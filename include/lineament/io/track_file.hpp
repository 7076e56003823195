// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"

#include <Eigen/Core>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace lineament {

/// One face in one frame of a video; what is not known is empty and gives empty cells.
struct TrackRow
{
    int frame = 0;       ///< Position in the video, from 0.
    double time_s = 0.0; ///< Time stamp of the frame [s].
    std::optional<int> face = std::nullopt;
    std::string status = {}; ///< "success", "lost", ...: every frame of the video has a row.
    std::optional<Camera> camera = std::nullopt;
    std::optional<double> rms_px = std::nullopt;
    std::optional<double> chi_square = std::nullopt;
    std::optional<double> quality = std::nullopt;    ///< [0, 1].
    std::optional<double> gaze_yaw = std::nullopt;   ///< Mean of the eyes seen, as EyeGaze [radians].
    std::optional<double> gaze_pitch = std::nullopt; ///< Likewise.
    Eigen::VectorXd expression_coefficients = {};    ///< k, or empty.
};

/// The first line of `frames.csv`: frame, time_s, face, status, yaw_deg, pitch_deg, roll_deg, x_mm, y_mm, z_mm,
/// scale_px_per_mm, rms_px, chi_square, quality, the expression names, gaze_yaw_deg and gaze_pitch_deg.
/// docs/formats.md, "frames.csv, track.json"
[[nodiscard]] std::string format_frames_header(const std::vector<std::string>& expression_names);

/// The line of one row; numbers are the shortest that read back to the same double, those not finite give empty cells.
/// @throws InvalidArgument unless there are `num_expressions` expression coefficients or none.
[[nodiscard]] std::string format_frames_row(const TrackRow& row, int num_expressions);

/// Header and rows.
[[nodiscard]] std::string format_frames_csv(const std::vector<TrackRow>& rows,
                                            const std::vector<std::string>& expression_names);

void save_frames_csv(const std::string& path, const std::vector<TrackRow>& rows,
                     const std::vector<std::string>& expression_names);

/// A text as a CSV cell: quoted as RFC 4180 asks where it holds a comma, quote or line end; a leading = + - @ tab or
/// carriage return, which a spreadsheet would take for a formula, gets an apostrophe before it.
[[nodiscard]] std::string format_csv_text(const std::string& text);

/// What was found out about one person over a whole video.
struct TrackFileFace
{
    int id = 1;
    Eigen::VectorXd shape_coefficients = {};                ///< m, dimensionless.
    Eigen::VectorXd shape_standard_deviations = {};         ///< m, posterior; empty: not known.
    std::map<std::string, int> status_counts = {};          ///< Status -> number of frames.
    std::vector<std::string> unobservable_expressions = {}; ///< Names whose value the landmarks tell in no frame.
};

/// The content of `track.json`.
struct TrackFile
{
    int width = 0;                         ///< Of the video as shown [px].
    int height = 0;                        ///< Of the video as shown [px].
    int num_frames = 0;                    ///< Frames decoded.
    double duration_s = 0.0;               ///< From the first time stamp to the last [s].
    std::optional<double> frame_rate = {}; ///< Mean frames per second, if it is known.
    bool is_complete = true;               ///< False: interrupted or broken off; later frames are not in it.
    std::string model = {};
    std::string method = {};
    std::optional<double> focal_px = std::nullopt; ///< Empty under scaled orthographic projection.
    Eigen::Vector2d principal_point_px = Eigen::Vector2d::Zero();
    std::string landmark_scheme = "ibug68";
    std::string expression_set = {};
    std::vector<std::string> expression_names = {};
    std::vector<TrackFileFace> faces = {};
};

/// The JSON text, format "lineament-track", version 1; numbers that are not finite are null.
[[nodiscard]] std::string format_track_json(const TrackFile& file);

void save_track_json(const std::string& path, const TrackFile& file);

} // namespace lineament
