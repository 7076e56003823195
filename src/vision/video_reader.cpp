// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/vision/video_reader.hpp"

#include "ffmpeg.hpp"
#include "lineament/core/checks.hpp"

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <utility>

namespace lineament {
namespace {

// Self-contained video formats by FFmpeg's names; no playlists, no picture sequences, no text.
constexpr const char* allowed_formats = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,mpegvideo,flv,ogg,asf,"
                                        "gif,apng,h264,hevc,m4v,ivf,yuv4mpegpipe,nut,mxf,dv,rm,wtv";
constexpr std::int64_t max_pixels = std::int64_t(1) << 27; // of one picture

/// Where each picture axis goes, from the display matrix: shown = [a c; b d] stored, entries -1, 0 or 1.
struct Orientation
{
    int a = 1;
    int b = 0;
    int c = 0;
    int d = 1;

    [[nodiscard]] bool swaps_axes() const { return a == 0; }
    [[nodiscard]] bool is_identity() const { return a == 1 && d == 1; }
    [[nodiscard]] int clockwise_deg() const { return a == 1 ? 0 : a == -1 ? 180 : b == 1 ? 90 : 270; }
};

Orientation orientation_of(const AVStream& stream)
{
    std::size_t size = 0;
    const std::uint8_t* data = ffmpeg::av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, &size);
    if (data == nullptr || size < 9 * sizeof(std::int32_t)) {
        return {};
    }
    std::int32_t matrix[9];
    std::memcpy(matrix, data, sizeof matrix);
    const auto sign = [](std::int32_t value) { return value > 0x8000 ? 1 : value < -0x8000 ? -1 : 0; };
    const Orientation turn = {sign(matrix[0]), sign(matrix[1]), sign(matrix[3]), sign(matrix[4])};
    const bool straight = turn.a != 0 && turn.d != 0 && turn.b == 0 && turn.c == 0;
    const bool crossed = turn.a == 0 && turn.d == 0 && turn.b != 0 && turn.c != 0;
    return straight || crossed ? turn : Orientation{};
}

/// The picture as shown, from rows of RGB as stored.
ImageU8 oriented(const AVFrame& rgb, const Orientation& turn)
{
    const int width = turn.swaps_axes() ? rgb.height : rgb.width;
    const int height = turn.swaps_axes() ? rgb.width : rgb.height;
    ImageU8 picture(width, height, 3);
    for (int row = 0; row < rgb.height; ++row) {
        const std::uint8_t* source = rgb.data[0] + static_cast<std::ptrdiff_t>(row) * rgb.linesize[0];
        if (turn.is_identity()) {
            std::memcpy(picture.pixel(0, row), source, static_cast<std::size_t>(width) * 3);
            continue;
        }
        for (int column = 0; column < rgb.width; ++column, source += 3) {
            const int x = turn.a * column + turn.c * row;
            const int y = turn.b * column + turn.d * row;
            std::memcpy(
                picture.pixel(turn.a + turn.c < 0 ? x + width - 1 : x, turn.b + turn.d < 0 ? y + height - 1 : y),
                source, 3);
        }
    }
    return picture;
}

/// Coefficients of the frame's colour matrix; what is not said is BT.709 from 720 rows on and BT.601 below.
const int* colour_matrix(const AVFrame& frame)
{
    switch (frame.colorspace) {
    case AVCOL_SPC_BT709:
        return ffmpeg::sws_getCoefficients(SWS_CS_ITU709);
    case AVCOL_SPC_BT2020_NCL:
    case AVCOL_SPC_BT2020_CL:
        return ffmpeg::sws_getCoefficients(SWS_CS_BT2020);
    case AVCOL_SPC_SMPTE240M:
        return ffmpeg::sws_getCoefficients(SWS_CS_SMPTE240M);
    case AVCOL_SPC_FCC:
        return ffmpeg::sws_getCoefficients(SWS_CS_FCC);
    case AVCOL_SPC_BT470BG:
    case AVCOL_SPC_SMPTE170M:
        return ffmpeg::sws_getCoefficients(SWS_CS_ITU601);
    default:
        return ffmpeg::sws_getCoefficients(frame.height >= 720 ? SWS_CS_ITU709 : SWS_CS_ITU601);
    }
}

/// FFmpeg's old full-range formats by their new names; sets `full_range` where the format implies it.
AVPixelFormat without_range(AVPixelFormat format, bool& full_range)
{
    const auto full = [&](AVPixelFormat plain) {
        full_range = true;
        return plain;
    };
    switch (format) {
    case AV_PIX_FMT_YUVJ420P:
        return full(AV_PIX_FMT_YUV420P);
    case AV_PIX_FMT_YUVJ422P:
        return full(AV_PIX_FMT_YUV422P);
    case AV_PIX_FMT_YUVJ444P:
        return full(AV_PIX_FMT_YUV444P);
    case AV_PIX_FMT_YUVJ440P:
        return full(AV_PIX_FMT_YUV440P);
    case AV_PIX_FMT_YUVJ411P:
        return full(AV_PIX_FMT_YUV411P);
    default:
        return format;
    }
}

std::string size_text(int width, int height)
{
    return std::to_string(width) + " x " + std::to_string(height);
}

/// Whether the last top-level box of an MP4 or MOV file reaches beyond its end (ISO/IEC 14496-12, 4.2); false for
/// files of other formats.
bool ends_within_a_box(const std::string& path)
{
    std::ifstream file(path, std::ios::binary);
    const auto size = static_cast<std::uint64_t>(std::filesystem::file_size(path));
    std::uint64_t offset = 0;
    while (offset < size) {
        if (size - offset < 8) {
            return true;
        }
        unsigned char head[16] = {};
        file.seekg(static_cast<std::streamoff>(offset));
        file.read(reinterpret_cast<char*>(head), sizeof head);
        const auto big_endian = [&](int first, int count) {
            std::uint64_t value = 0;
            for (int i = first; i < first + count; ++i) {
                value = value << 8 | head[i];
            }
            return value;
        };
        if (offset == 0 && std::memcmp(head + 4, "ftyp", 4) != 0) {
            return false;
        }
        const std::uint64_t box_size = big_endian(0, 4) == 1 ? big_endian(8, 8) : big_endian(0, 4);
        if (box_size == 0) {
            return false; // reaches to the end by definition
        }
        if (box_size < 8 || box_size > size - offset) {
            return true;
        }
        file.clear();
        offset += box_size;
    }
    return false;
}

} // namespace

struct VideoReader::Implementation
{
    std::string path;
    ffmpeg::Input input;
    ffmpeg::Codec decoder;
    AVStream* stream = nullptr;
    ffmpeg::Packet packet{ffmpeg::av_packet_alloc()};
    ffmpeg::Frame frame{ffmpeg::av_frame_alloc()};
    ffmpeg::Frame rgb; // as stored, scaled to square pixels
    ffmpeg::Scaler scaler;
    Orientation turn;
    VideoInfo info;
    std::optional<VideoFrame> first; // decoded when the file is opened

    std::int64_t num_decoded = 0;
    std::int64_t num_packets = 0;
    std::int64_t num_bad_packets = 0;
    std::int64_t num_repaired_times = 0;
    double origin_s = 0.0;
    double last_time_s = 0.0;
    int stored_width = 0; // of the first frame
    int stored_height = 0;
    bool at_end = false;
    std::string early_end;    // why reading ended before the true end
    std::string first_damage; // where the first damaged part lies

    [[noreturn]] void fail(IoErrorKind kind, const std::string& what) const { throw IoError(kind, path, "", what); }

    [[nodiscard]] std::string place() const
    {
        return "frame " + std::to_string(num_decoded) + " (" + to_text(std::round(last_time_s * 1000.0) / 1000.0) +
               " s)";
    }

    void open_file();
    void open_decoder();
    [[nodiscard]] bool decode();
    [[nodiscard]] VideoFrame convert();
    [[nodiscard]] std::optional<VideoFrame> next_frame();
    [[nodiscard]] double presentation_time();
    [[nodiscard]] std::pair<int, int> square_pixel_size() const;
    void note_damage();
    void note_early_end(int error);
};

void VideoReader::Implementation::open_file()
{
    std::error_code error;
    if (!std::filesystem::exists(path, error)) {
        fail(IoErrorKind::system, "no such file");
    }
    if (std::filesystem::is_directory(path, error)) {
        fail(IoErrorKind::system, "expected a video file, found a folder");
    }
    char start[12] = {};
    std::ifstream file(path, std::ios::binary);
    if (!file) {
        fail(IoErrorKind::system, "cannot be read");
    }
    file.read(start, sizeof start);
    if (file.gcount() == 0) {
        fail(IoErrorKind::content, "expected a video, found an empty file");
    }
    AVDictionary* settings = nullptr;
    ffmpeg::av_dict_set(&settings, "protocol_whitelist", "file", 0);
    ffmpeg::av_dict_set(&settings, "format_whitelist", allowed_formats, 0);
    AVFormatContext* opened = nullptr;
    const int result = ffmpeg::avformat_open_input(&opened, ("file:" + path).c_str(), nullptr, &settings);
    ffmpeg::av_dict_free(&settings);
    if (result < 0 && std::memcmp(start + 4, "ftyp", 4) == 0) {
        fail(IoErrorKind::content,
             "expected an MP4 or MOV video, found one without a usable index (moov): the recording "
             "or download was cut; copy the file again");
    }
    if (result < 0) {
        fail(IoErrorKind::content,
             "expected a video file, found another kind of file or a damaged one (" + ffmpeg::error_text(result) + ")");
    }
    input.reset(opened);
    input->flags |= AVFMT_FLAG_GENPTS;
    if (ffmpeg::avformat_find_stream_info(input.get(), nullptr) < 0) {
        fail(IoErrorKind::content, "no stream of the video can be understood");
    }
}

void VideoReader::Implementation::open_decoder()
{
    const AVCodec* codec = nullptr;
    const int index = ffmpeg::av_find_best_stream(input.get(), AVMEDIA_TYPE_VIDEO, -1, -1, &codec, 0);
    if (index == AVERROR_DECODER_NOT_FOUND) {
        fail(IoErrorKind::content, "the FFmpeg in use has no decoder for this video");
    }
    if (index < 0 || (input->streams[index]->disposition & AV_DISPOSITION_ATTACHED_PIC) != 0) {
        fail(IoErrorKind::content, "expected a video stream, found " + std::to_string(input->nb_streams) +
                                       " stream(s) without moving pictures (audio only?)");
    }
    for (unsigned i = 0; i < input->nb_streams; ++i) {
        input->streams[i]->discard = static_cast<int>(i) == index ? AVDISCARD_DEFAULT : AVDISCARD_ALL;
    }
    stream = input->streams[index];
    turn = orientation_of(*stream);
    decoder.reset(ffmpeg::avcodec_alloc_context3(codec));
    decoder->max_pixels = max_pixels;
    decoder->thread_count = 0;
    decoder->pkt_timebase = stream->time_base;
    if (ffmpeg::avcodec_parameters_to_context(decoder.get(), stream->codecpar) < 0 ||
        ffmpeg::avcodec_open2(decoder.get(), codec, nullptr) < 0) {
        fail(IoErrorKind::content, std::string("the ") + codec->name + " stream cannot be decoded");
    }
    const AVRational rate = stream->avg_frame_rate.num > 0 ? stream->avg_frame_rate : stream->r_frame_rate;
    info.frame_rate = rate.num > 0 && rate.den > 0 ? av_q2d(rate) : 0.0;
    info.duration_s = stream->duration > 0  ? static_cast<double>(stream->duration) * av_q2d(stream->time_base)
                      : input->duration > 0 ? static_cast<double>(input->duration) / AV_TIME_BASE
                                            : 0.0;
    info.num_frames = stream->nb_frames > 0                      ? stream->nb_frames
                      : info.duration_s * info.frame_rate < 1e15 ? std::llround(info.duration_s * info.frame_rate)
                                                                 : 0;
    info.rotation_deg = turn.clockwise_deg();
    info.codec = ffmpeg::avcodec_get_name(stream->codecpar->codec_id);
}

/// Fills `frame` with the next decoded picture; false at the end.
bool VideoReader::Implementation::decode()
{
    while (true) {
        const int received = ffmpeg::avcodec_receive_frame(decoder.get(), frame.get());
        if (received >= 0) {
            return true;
        }
        if (received == AVERROR_EOF) {
            return false;
        }
        if (received != AVERROR(EAGAIN)) {
            note_damage();
            if (at_end) {
                return false;
            }
        }
        const int read = ffmpeg::av_read_frame(input.get(), packet.get());
        if (read < 0) {
            note_early_end(read);
            at_end = true;
            ffmpeg::avcodec_send_packet(decoder.get(), nullptr); // from here on the decoder hands out what it holds
            continue;
        }
        if (packet->stream_index == stream->index) {
            ++num_packets;
            if ((packet->flags & AV_PKT_FLAG_CORRUPT) != 0) {
                note_damage(); // the file ends within the packet
            }
            if (ffmpeg::avcodec_send_packet(decoder.get(), packet.get()) < 0) {
                note_damage();
            }
        }
        ffmpeg::av_packet_unref(packet.get());
    }
}

void VideoReader::Implementation::note_damage()
{
    if (num_bad_packets++ == 0) {
        first_damage = place();
    }
}

/// Distinguishes the true end of the stream from a cut file.
void VideoReader::Implementation::note_early_end(int error)
{
    if (error != AVERROR_EOF) {
        early_end = "reading failed (" + ffmpeg::error_text(error) + ")";
    } else if (input->pb != nullptr && input->pb->error < 0) {
        early_end = "reading failed (" + ffmpeg::error_text(input->pb->error) + ")";
    } else if (num_packets < stream->nb_frames || ends_within_a_box(path)) {
        early_end = "the file is cut";
    }
}

/// Seconds since the first picture; repaired so that time always advances.
double VideoReader::Implementation::presentation_time()
{
    const double interval_s = info.frame_rate > 0.0 ? 1.0 / info.frame_rate : 0.04;
    const bool known = frame->best_effort_timestamp != AV_NOPTS_VALUE;
    const double stamp_s = known ? static_cast<double>(frame->best_effort_timestamp) * av_q2d(stream->time_base) : 0.0;
    if (num_decoded == 0) {
        origin_s = stamp_s;
        num_repaired_times += known ? 0 : 1;
        return 0.0;
    }
    const double time_s = stamp_s - origin_s;
    if (known && time_s > last_time_s) {
        return time_s;
    }
    ++num_repaired_times;
    return last_time_s + interval_s;
}

/// Size of the picture with square pixels, before rotation.
std::pair<int, int> VideoReader::Implementation::square_pixel_size() const
{
    const AVRational ratio = ffmpeg::av_guess_sample_aspect_ratio(input.get(), stream, frame.get());
    const double aspect = ratio.num > 0 && ratio.den > 0 ? av_q2d(ratio) : 1.0;
    if (aspect < 0.125 || aspect > 8.0) {
        return {frame->width, frame->height}; // nonsense
    }
    return {aspect > 1.0 ? static_cast<int>(std::lround(frame->width * aspect)) : frame->width,
            aspect < 1.0 ? static_cast<int>(std::lround(frame->height / aspect)) : frame->height};
}

VideoFrame VideoReader::Implementation::convert()
{
    if (rgb == nullptr) {
        const auto [width, height] = square_pixel_size();
        rgb = ffmpeg::make_frame(width, height, AV_PIX_FMT_RGB24);
        stored_width = frame->width;
        stored_height = frame->height;
        info.width = turn.swaps_axes() ? height : width;
        info.height = turn.swaps_axes() ? width : height;
    }
    bool full_range = frame->color_range == AVCOL_RANGE_JPEG;
    const AVPixelFormat format = without_range(static_cast<AVPixelFormat>(frame->format), full_range);
    const bool resized = frame->width != rgb->width || frame->height != rgb->height;
    scaler.reset(ffmpeg::sws_getCachedContext(
        scaler.release(), frame->width, frame->height, format, rgb->width, rgb->height, AV_PIX_FMT_RGB24,
        (resized ? SWS_BICUBIC : SWS_BILINEAR) | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT, nullptr, nullptr, nullptr));
    if (scaler == nullptr) {
        fail(IoErrorKind::content, "the pixel format of " + place() + " cannot be converted to RGB");
    }
    ffmpeg::sws_setColorspaceDetails(scaler.get(), colour_matrix(*frame), full_range ? 1 : 0,
                                     ffmpeg::sws_getCoefficients(SWS_CS_DEFAULT), 1, 0, 1 << 16, 1 << 16);
    ffmpeg::sws_scale(scaler.get(), frame->data, frame->linesize, 0, frame->height, rgb->data, rgb->linesize);
    VideoFrame result = {.picture = oriented(*rgb, turn),
                         .time_s = presentation_time(),
                         .index = num_decoded,
                         .keyframe = frame->key_frame != 0};
    last_time_s = result.time_s;
    ++num_decoded;
    return result;
}

/// The next picture, unless the stream ends or turns into something else.
std::optional<VideoFrame> VideoReader::Implementation::next_frame()
{
    if (!early_end.empty() && !at_end) {
        return std::nullopt; // stopped by a change of aspect ratio
    }
    if (!decode()) {
        return std::nullopt;
    }
    if (rgb != nullptr) {
        const double change =
            static_cast<double>(frame->width) * stored_height / (double(frame->height) * stored_width);
        if (std::abs(change - 1.0) > 0.02) {
            early_end = "the picture size changes from " + size_text(stored_width, stored_height) + " to " +
                        size_text(frame->width, frame->height) + ", another aspect ratio: split the video there";
            return std::nullopt;
        }
    }
    if ((frame->flags & AV_FRAME_FLAG_CORRUPT) != 0 || frame->decode_error_flags != 0) {
        note_damage();
    }
    return convert();
}

VideoReader::VideoReader(const std::string& path)
{
    ffmpeg::load();
    implementation_ = std::make_unique<Implementation>();
    implementation_->path = path;
    implementation_->open_file();
    implementation_->open_decoder();
    implementation_->first = implementation_->next_frame();
    if (!implementation_->first) {
        implementation_->fail(IoErrorKind::content, "expected pictures, but none of the announced " +
                                                        std::to_string(implementation_->info.num_frames) +
                                                        " can be decoded");
    }
}

VideoReader::~VideoReader() = default;
VideoReader::VideoReader(VideoReader&&) noexcept = default;
VideoReader& VideoReader::operator=(VideoReader&&) noexcept = default;

const VideoInfo& VideoReader::info() const
{
    return implementation_->info;
}

std::optional<VideoFrame> VideoReader::next()
{
    if (implementation_->first) {
        return std::exchange(implementation_->first, std::nullopt);
    }
    return implementation_->next_frame();
}

std::optional<std::string> VideoReader::problem() const
{
    const Implementation& r = *implementation_;
    std::string text;
    if (!r.early_end.empty()) {
        text = "stopped after " + r.place() + " of announced " + std::to_string(r.info.num_frames) + ": " + r.early_end;
    }
    if (r.num_bad_packets > 0) {
        text += (text.empty() ? "" : "; ") + std::to_string(r.num_bad_packets) + " damaged part(s), the first after " +
                r.first_damage;
    }
    return text.empty() ? std::nullopt : std::optional<std::string>(text);
}

std::int64_t VideoReader::num_repaired_times() const
{
    return implementation_->num_repaired_times;
}

} // namespace lineament
