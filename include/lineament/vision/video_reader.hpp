// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

namespace lineament {

/// What a video file announces about itself; counts and durations may lie, so nothing depends on them.
struct VideoInfo
{
    int width = 0;               ///< Of the pictures `next` returns: square pixels, rotation applied [px].
    int height = 0;              ///< Likewise.
    double frame_rate = 0.0;     ///< Average [1/s]; 0 if unknown.
    double duration_s = 0.0;     ///< 0 if unknown.
    std::int64_t num_frames = 0; ///< Announced, or duration times frame rate; 0 if unknown.
    int rotation_deg = 0;        ///< Clockwise turn that was applied: 0, 90, 180 or 270.
    std::string codec = {};      ///< FFmpeg's short name: "h264", "vp9", ...
};

/// One picture of a video.
struct VideoFrame
{
    ImageU8 picture = {};   ///< RGB, sRGB-encoded as far as the video is; alpha is dropped.
    double time_s = 0.0;    ///< Presentation time since the first picture; strictly increasing.
    std::int64_t index = 0; ///< 0, 1, 2 ... in order of presentation.
    bool keyframe = false;
};

/// Reads the pictures of a video file one after the other, by FFmpeg.
///
/// Only local files in self-contained video formats are opened: no network, no playlists. Times are the true
/// presentation times, also at variable frame rate; one that is missing or not later than its predecessor is replaced
/// by one average frame interval after it and counted. A change of size within the stream is scaled to the first size;
/// if the aspect ratio changes too, reading stops with a problem. FFmpeg's log is silenced for the process. One reader
/// is used by one thread at a time. Same file, same frames.
class VideoReader
{
public:
    /// @throws IoError if the file is missing, is no video, holds no video stream or no picture that can be decoded, or
    /// if FFmpeg's libraries cannot be loaded.
    explicit VideoReader(const std::string& path);
    ~VideoReader();
    VideoReader(VideoReader&&) noexcept;
    VideoReader& operator=(VideoReader&&) noexcept;

    [[nodiscard]] const VideoInfo& info() const;

    /// The next picture; nothing at the end of what can be decoded. Then ask `problem` whether that was the true end.
    [[nodiscard]] std::optional<VideoFrame> next();

    /// What is wrong with the part read so far, in words with frame number and time; nothing if all is well. Complete
    /// once `next` has returned nothing: a cut file reads "stopped after frame n (t s) of announced m".
    [[nodiscard]] std::optional<std::string> problem() const;

    /// Frames so far whose time stamp was missing or not after the previous one.
    [[nodiscard]] std::int64_t num_repaired_times() const;

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

} // namespace lineament
