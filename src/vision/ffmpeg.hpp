// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

#include <memory>
#include <string>

namespace lineament::ffmpeg {

/// Frees an FFmpeg object by its own function, which takes the address of the pointer.
template <auto free_function>
struct Free
{
    template <typename T>
    void operator()(T* object) const
    {
        free_function(&object);
    }
};

struct FreeScaler
{
    void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
};

using Frame = std::unique_ptr<AVFrame, Free<av_frame_free>>;
using Packet = std::unique_ptr<AVPacket, Free<av_packet_free>>;
using Codec = std::unique_ptr<AVCodecContext, Free<avcodec_free_context>>;
using Input = std::unique_ptr<AVFormatContext, Free<avformat_close_input>>;
using Scaler = std::unique_ptr<SwsContext, FreeScaler>;

/// Turns FFmpeg's log off, for the whole process: the library never prints.
void silence();

/// FFmpeg's words for one of its error numbers.
[[nodiscard]] std::string error_text(int error);

/// A frame with memory of its own, rows aligned for swscale. @throws std::bad_alloc
[[nodiscard]] Frame make_frame(int width, int height, AVPixelFormat format);

} // namespace lineament::ffmpeg
