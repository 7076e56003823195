// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "face_finder.hpp"
#include "fitters.hpp"
#include "inputs.hpp"
#include "model_options.hpp"

#include "lineament/io/track_file.hpp"
#include "lineament/render/texture_fusion.hpp"
#include "lineament/report/track_report.hpp"
#include "lineament/vision/video_reader.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace lineament::cli {

struct TrackOptions
{
    ModelOptions model;
    FinderOptions finder;
    int num_identity_frames = 30;
    int texture_size = 512;
};

struct TrackSummary
{
    std::int64_t num_frames = 0;
    std::int64_t num_tracked = 0;
    double duration_s = 0.0;
    double median_rms_px = 0.0;
    double frames_per_second = 0.0; ///< Frames over the wall time of everything, reading to writing.
};

/// The names of all files that `lineament track` writes for a video.
[[nodiscard]] std::vector<std::string> track_file_names();

/// Follows one person's face through videos and writes the results.
///
/// First pass: decode, detect or follow, landmarks of every frame. Then one identity from well-spread frames (thesis
/// 5.1). Second pass: decode again, pose and expression of every frame for that identity, each from the last one's
/// where the face was seen there, overlay, texture (5.4).
class VideoTracker
{
public:
    explicit VideoTracker(const TrackOptions& options);

    /// @throws Failure(no_answer) if no frame shows a face; (bad_input) if the video broke off, or with the signal's
    ///   code after an interruption: the results, if there are any, then hold the frames up to there.
    TrackSummary track(const Job& job);

private:
    struct SeenFrame;

    [[nodiscard]] std::vector<SeenFrame> watch(const Job& job, VideoInfo& info, std::optional<std::string>& problem);
    [[nodiscard]] LandmarkSet landmarks_of(const SeenFrame& frame) const;
    [[nodiscard]] TrackFileFace fit_person(const std::vector<SeenFrame>& seen,
                                           const Eigen::Vector2d& principal_point_px);

    void write_results(const Job& job, const VideoInfo& info, const TrackFileFace& person,
                       const TextureAccumulator& texture, bool is_complete, TrackReport& report) const;

    TrackOptions options_;
    MorphableModel model_;
    Fitters fitters_;
    TextureLayout layout_;
    FaceFinder finder_;
    LandmarkSet landmarks_ = {}; ///< Of the last frame with a face: scheme and names of all frames.
};

} // namespace lineament::cli
