// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// FFmpeg is loaded when the first video is opened: its libraries pull in more than a hundred others, which would cost
// every program that links Lineament some 40 ms at its start. The functions used are the pointers declared here under
// the names of FFmpeg's headers; to call one of FFmpeg's own by mistake does not link.
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

#define LINEAMENT_FFMPEG_FUNCTIONS(use)                                                                                \
    use(av_d2q);                                                                                                       \
    use(av_dict_free);                                                                                                 \
    use(av_dict_set);                                                                                                  \
    use(av_dict_set_int);                                                                                              \
    use(av_find_best_stream);                                                                                          \
    use(av_frame_alloc);                                                                                               \
    use(av_frame_free);                                                                                                \
    use(av_frame_get_buffer);                                                                                          \
    use(av_frame_make_writable);                                                                                       \
    use(av_guess_sample_aspect_ratio);                                                                                 \
    use(av_interleaved_write_frame);                                                                                   \
    use(av_log_set_level);                                                                                             \
    use(av_opt_set);                                                                                                   \
    use(av_opt_set_double);                                                                                            \
    use(av_packet_alloc);                                                                                              \
    use(av_packet_free);                                                                                               \
    use(av_packet_rescale_ts);                                                                                         \
    use(av_packet_unref);                                                                                              \
    use(av_read_frame);                                                                                                \
    use(av_stream_get_side_data);                                                                                      \
    use(av_strerror);                                                                                                  \
    use(av_write_trailer);                                                                                             \
    use(avcodec_alloc_context3);                                                                                       \
    use(avcodec_find_encoder);                                                                                         \
    use(avcodec_find_encoder_by_name);                                                                                 \
    use(avcodec_free_context);                                                                                         \
    use(avcodec_get_name);                                                                                             \
    use(avcodec_open2);                                                                                                \
    use(avcodec_parameters_from_context);                                                                              \
    use(avcodec_parameters_to_context);                                                                                \
    use(avcodec_receive_frame);                                                                                        \
    use(avcodec_receive_packet);                                                                                       \
    use(avcodec_send_frame);                                                                                           \
    use(avcodec_send_packet);                                                                                          \
    use(avformat_alloc_output_context2);                                                                               \
    use(avformat_close_input);                                                                                         \
    use(avformat_find_stream_info);                                                                                    \
    use(avformat_free_context);                                                                                        \
    use(avformat_new_stream);                                                                                          \
    use(avformat_open_input);                                                                                          \
    use(avformat_write_header);                                                                                        \
    use(avio_closep);                                                                                                  \
    use(avio_flush);                                                                                                   \
    use(avio_open);                                                                                                    \
    use(sws_freeContext);                                                                                              \
    use(sws_getCachedContext);                                                                                         \
    use(sws_getCoefficients);                                                                                          \
    use(sws_getContext);                                                                                               \
    use(sws_scale);                                                                                                    \
    use(sws_setColorspaceDetails);

namespace lineament::ffmpeg {

#define LINEAMENT_DECLARE(function) extern decltype(&::function) function
LINEAMENT_FFMPEG_FUNCTIONS(LINEAMENT_DECLARE)
#undef LINEAMENT_DECLARE

/// Loads FFmpeg unless it is there; to be called before any of the functions above. Its log is turned off, for the
/// whole process: the library never prints. Any thread may call it.
/// @throws IoError(system) if a library is missing; the major version must be that of the headers.
void load();

/// Frees an FFmpeg object by its own function, which takes the address of the pointer.
template <auto& free_function>
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

/// FFmpeg's words for one of its error numbers.
[[nodiscard]] std::string error_text(int error);

/// A frame with memory of its own, rows aligned for swscale. @throws std::bad_alloc
[[nodiscard]] Frame make_frame(int width, int height, AVPixelFormat format);

} // namespace lineament::ffmpeg
