// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"

#include <cstdint>
#include <memory>
#include <string>

namespace lineament {

struct VideoWriterOptions
{
    double quality = 20.0; ///< Constant quality of H.264 (crf) 0 ... 51, smaller is better; 18 looks lossless.
    double expected_frame_rate = 25.0; ///< Hint for the encoder's rate control; true times are kept all the same [1/s].
    int keyframe_interval = 30;        ///< Most frames a killed process loses.
};

/// Writes pictures with their times to an MP4 file: H.264 if FFmpeg has libx264, else MPEG-4 part 2; yuv420p, BT.709.
///
/// The file is written in self-contained fragments, one for each keyframe, so that it plays up to the last whole
/// fragment even if the process is killed. Odd sizes are padded to even ones by repeating the last row or column.
class VideoWriter
{
public:
    /// @throws IoError if the file cannot be created or FFmpeg's libraries cannot be loaded; InvalidArgument if the
    /// options are out of range.
    explicit VideoWriter(const std::string& path, const VideoWriterOptions& options = {});
    /// Discards: removes the file unless `finish` was called.
    ~VideoWriter();
    VideoWriter(VideoWriter&&) noexcept;
    VideoWriter& operator=(VideoWriter&&) noexcept;

    /// Appends a picture; the first one sets the size.
    /// @param time_s  Finite, >= 0 and at least 1/60000 s after the previous one; kept to 1/60000 s.
    /// @throws InvalidArgument if the picture is not RGB of that size or the time is not later; IoError if writing
    /// fails.
    void write(const ImageU8& picture, double time_s);

    /// Completes the file. Without a picture there is nothing to complete.
    /// @throws IoError if writing fails or no picture was written.
    void finish();

    [[nodiscard]] std::int64_t num_frames() const;
    [[nodiscard]] const std::string& codec() const; ///< Name of the encoder in use.

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

} // namespace lineament
