// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/vision/video_writer.hpp"

#include "ffmpeg.hpp"
#include "lineament/core/checks.hpp"

#include <cmath>
#include <cstring>
#include <filesystem>

namespace lineament {
namespace {

constexpr int ticks_per_second = 60000; // holds 24, 25, 30, 50, 60 and 30000/1001 exactly; MPEG-4 allows 65535 at most

} // namespace

struct VideoWriter::Implementation
{
    std::string path;
    VideoWriterOptions options;
    AVFormatContext* output = nullptr;
    ffmpeg::Codec encoder;
    AVStream* stream = nullptr;
    ffmpeg::Scaler scaler;
    ffmpeg::Frame rgb;
    ffmpeg::Frame yuv;
    ffmpeg::Packet packet{ffmpeg::av_packet_alloc()};
    std::string codec_name;
    int width = 0;
    int height = 0;
    std::int64_t num_frames = 0;
    std::int64_t last_ticks = -1;
    std::int64_t last_duration = 0;
    bool finished = false;

    ~Implementation()
    {
        if (output != nullptr) {
            ffmpeg::avio_closep(&output->pb);
            ffmpeg::avformat_free_context(output);
        }
        std::error_code ignored;
        if (!finished && std::filesystem::is_regular_file(path, ignored)) {
            std::filesystem::remove(path, ignored);
        }
    }

    void check(int result, const std::string& what) const
    {
        if (result < 0) {
            throw IoError(IoErrorKind::system, path, num_frames == 0 ? "" : "frame " + std::to_string(num_frames),
                          "cannot " + what + ": " + ffmpeg::error_text(result));
        }
    }

    void open_file()
    {
        check(ffmpeg::avformat_alloc_output_context2(&output, nullptr, "mp4", nullptr), "make an MP4 file");
        check(ffmpeg::avio_open(&output->pb, ("file:" + path).c_str(), AVIO_FLAG_WRITE), "create the file");
        const AVCodec* codec = ffmpeg::avcodec_find_encoder_by_name("libx264");
        if (codec == nullptr) {
            codec = ffmpeg::avcodec_find_encoder(AV_CODEC_ID_MPEG4);
        }
        check(codec == nullptr ? AVERROR_ENCODER_NOT_FOUND : 0, "encode H.264 or MPEG-4");
        codec_name = codec->name;
        encoder.reset(ffmpeg::avcodec_alloc_context3(codec));
    }

    /// Opens the encoder for pictures of this size and writes the head of the file.
    void start(const ImageU8& picture)
    {
        width = picture.width;
        height = picture.height;
        AVCodecContext& e = *encoder;
        e.width = width + width % 2;
        e.height = height + height % 2;
        e.pix_fmt = AV_PIX_FMT_YUV420P;
        e.time_base = {1, ticks_per_second};
        e.framerate = ffmpeg::av_d2q(options.expected_frame_rate, ticks_per_second);
        e.gop_size = options.keyframe_interval;
        e.max_b_frames = 0; // frames leave in the order they come: nothing waits when the process is killed
        e.color_range = AVCOL_RANGE_MPEG;
        e.colorspace = AVCOL_SPC_BT709;
        e.color_primaries = AVCOL_PRI_BT709;
        e.color_trc = AVCOL_TRC_BT709;
        e.flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
        if (codec_name == "libx264") {
            ffmpeg::av_opt_set(e.priv_data, "preset", "veryfast", 0);
            ffmpeg::av_opt_set_double(e.priv_data, "crf", options.quality, 0);
        } else {
            e.flags |= AV_CODEC_FLAG_QSCALE;
            e.global_quality = static_cast<int>(FF_QP2LAMBDA * std::max(1.0, options.quality / 6.0));
        }
        check(ffmpeg::avcodec_open2(&e, nullptr, nullptr), "open the encoder " + codec_name);
        stream = ffmpeg::avformat_new_stream(output, nullptr);
        check(stream == nullptr ? AVERROR(ENOMEM) : 0, "add a stream");
        check(ffmpeg::avcodec_parameters_from_context(stream->codecpar, &e), "describe the stream");
        stream->time_base = e.time_base;
        stream->avg_frame_rate = e.framerate;
        AVDictionary* settings = nullptr;
        ffmpeg::av_dict_set(&settings, "movflags", "frag_keyframe+empty_moov+default_base_moof", 0);
        ffmpeg::av_dict_set_int(&settings, "video_track_timescale", ticks_per_second, 0);
        const int result = ffmpeg::avformat_write_header(output, &settings);
        ffmpeg::av_dict_free(&settings);
        check(result, "write the file's head");
        rgb = ffmpeg::make_frame(e.width, e.height, AV_PIX_FMT_RGB24);
        yuv = ffmpeg::make_frame(e.width, e.height, AV_PIX_FMT_YUV420P);
        yuv->color_range = e.color_range;
        yuv->colorspace = e.colorspace;
        scaler.reset(ffmpeg::sws_getContext(e.width, e.height, AV_PIX_FMT_RGB24, e.width, e.height, AV_PIX_FMT_YUV420P,
                                            SWS_BICUBIC | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INP, nullptr, nullptr,
                                            nullptr));
        check(scaler == nullptr ? AVERROR(ENOMEM) : 0, "convert colours");
        const int* bt709 = ffmpeg::sws_getCoefficients(SWS_CS_ITU709);
        ffmpeg::sws_setColorspaceDetails(scaler.get(), bt709, 1, bt709, 0, 0, 1 << 16, 1 << 16);
    }

    /// Hands a frame (none: the end) to the encoder and writes what comes out.
    void encode(const AVFrame* frame)
    {
        check(ffmpeg::avcodec_send_frame(encoder.get(), frame), "encode");
        while (true) {
            const int result = ffmpeg::avcodec_receive_packet(encoder.get(), packet.get());
            if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) {
                return;
            }
            check(result, "encode");
            // A packet lasts until the next one; the muxer knows that of all but the last of a fragment.
            packet->duration = last_duration;
            ffmpeg::av_packet_rescale_ts(packet.get(), encoder->time_base, stream->time_base);
            packet->stream_index = stream->index;
            check(ffmpeg::av_interleaved_write_frame(output, packet.get()), "write");
            check(output->pb->error, "write");
        }
    }
};

VideoWriter::VideoWriter(const std::string& path, const VideoWriterOptions& options)
{
    const char* const function = "VideoWriter";
    require(options.quality >= 0.0 && options.quality <= 51.0, function, "quality", "a number in [0, 51]",
            to_text(options.quality));
    require(options.expected_frame_rate >= 0.01 && options.expected_frame_rate <= 1000.0, function,
            "expected_frame_rate", "a number in [0.01, 1000]", to_text(options.expected_frame_rate));
    require(options.keyframe_interval >= 1 && options.keyframe_interval <= 1000, function, "keyframe_interval",
            "a number in 1 ... 1000", std::to_string(options.keyframe_interval));
    ffmpeg::load();
    implementation_ = std::make_unique<Implementation>();
    implementation_->path = path;
    implementation_->options = options;
    implementation_->open_file();
}

VideoWriter::~VideoWriter() = default;
VideoWriter::VideoWriter(VideoWriter&&) noexcept = default;
VideoWriter& VideoWriter::operator=(VideoWriter&&) noexcept = default;

void VideoWriter::write(const ImageU8& picture, double time_s)
{
    Implementation& w = *implementation_;
    const char* const function = "VideoWriter::write";
    require(!w.finished, function, "time_s", "no picture after finish", "frame " + std::to_string(w.num_frames));
    require(picture.channels == 3 && !picture.empty(), function, "picture", "a picture of 3 channels",
            std::to_string(picture.channels));
    require(w.num_frames == 0 || (picture.width == w.width && picture.height == w.height), function, "picture",
            std::to_string(w.width) + " x " + std::to_string(w.height),
            std::to_string(picture.width) + " x " + std::to_string(picture.height));
    require(std::isfinite(time_s) && time_s >= 0.0 && time_s < 1e9, function, "time_s", "a time in [0, 1e9) s",
            to_text(time_s));
    const std::int64_t ticks = std::llround(time_s * ticks_per_second);
    require(ticks > w.last_ticks, function, "time_s",
            "later than " + to_text(static_cast<double>(w.last_ticks) / ticks_per_second), to_text(time_s));
    if (w.num_frames == 0) {
        w.start(picture);
    }
    for (int row = 0; row < w.encoder->height; ++row) {
        std::uint8_t* target = w.rgb->data[0] + static_cast<std::ptrdiff_t>(row) * w.rgb->linesize[0];
        const std::size_t size = static_cast<std::size_t>(w.width) * 3;
        std::memcpy(target, picture.pixel(0, std::min(row, w.height - 1)), size);
        if (w.encoder->width > w.width) {
            std::memcpy(target + size, target + size - 3, 3);
        }
    }
    w.check(ffmpeg::av_frame_make_writable(w.yuv.get()), "encode");
    ffmpeg::sws_scale(w.scaler.get(), w.rgb->data, w.rgb->linesize, 0, w.encoder->height, w.yuv->data, w.yuv->linesize);
    w.yuv->pts = ticks;
    w.last_duration =
        w.num_frames == 0 ? std::llround(ticks_per_second / w.options.expected_frame_rate) : ticks - w.last_ticks;
    w.last_ticks = ticks;
    w.encode(w.yuv.get());
    ++w.num_frames;
}

void VideoWriter::finish()
{
    Implementation& w = *implementation_;
    if (w.finished) {
        return;
    }
    if (w.num_frames == 0) {
        throw IoError(IoErrorKind::content, w.path, "", "no picture was written: there is no video to finish");
    }
    w.encode(nullptr);
    w.check(ffmpeg::av_write_trailer(w.output), "complete the file");
    ffmpeg::avio_flush(w.output->pb);
    w.check(w.output->pb->error, "write");
    w.check(ffmpeg::avio_closep(&w.output->pb), "close the file");
    w.finished = true;
}

std::int64_t VideoWriter::num_frames() const
{
    return implementation_->num_frames;
}

const std::string& VideoWriter::codec() const
{
    return implementation_->codec_name;
}

} // namespace lineament
