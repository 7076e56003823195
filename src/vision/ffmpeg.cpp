// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "ffmpeg.hpp"

#include <new>

namespace lineament::ffmpeg {

void silence()
{
    av_log_set_level(AV_LOG_QUIET);
}

std::string error_text(int error)
{
    char buffer[AV_ERROR_MAX_STRING_SIZE] = {};
    av_strerror(error, buffer, sizeof buffer);
    return buffer;
}

Frame make_frame(int width, int height, AVPixelFormat format)
{
    Frame frame(av_frame_alloc());
    if (!frame) {
        throw std::bad_alloc();
    }
    frame->width = width;
    frame->height = height;
    frame->format = format;
    if (av_frame_get_buffer(frame.get(), 0) < 0) {
        throw std::bad_alloc();
    }
    return frame;
}

} // namespace lineament::ffmpeg
