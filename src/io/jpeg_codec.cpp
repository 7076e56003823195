// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// libjpeg reports errors by a call that must not return, so by longjmp. Every function that calls setjmp here holds
// plain data only, so that no destructor is jumped over; memory is owned by the callers.
#include "image_codecs.hpp"

#include <algorithm>
#include <csetjmp>
#include <cstdio>
#include <cstdlib>

#include <jpeglib.h>

#include <jerror.h>

namespace lineament::image_codecs {

namespace {

constexpr int max_scans = 100; // a file of a few kilobytes can otherwise ask for hours of work

struct JpegErrors : jpeg_error_mgr
{
    std::jmp_buf jump = {};
    char text[JMSG_LENGTH_MAX] = "out of memory";
    bool has_too_many_scans = false;
};

[[noreturn]] void on_error(j_common_ptr info)
{
    auto* const errors = static_cast<JpegErrors*>(info->err);
    if (!errors->has_too_many_scans) {
        errors->format_message(info, errors->text);
    }
    std::longjmp(errors->jump, 1);
}

/// libjpeg goes on after damage with invented pixels and calls that a warning; here it is an error. Oddities that leave
/// the pixels alone pass.
void on_message(j_common_ptr info, int level)
{
    if (level >= 0) {
        return;
    }
    switch (info->err->msg_code) {
    case JWRN_ADOBE_XFORM:
    case JWRN_EXTRANEOUS_DATA:
    case JWRN_JFIF_MAJOR:
        return;
    default:
        on_error(info);
    }
}

void on_progress(j_common_ptr info)
{
    if (info->is_decompressor != 0 && reinterpret_cast<j_decompress_ptr>(info)->input_scan_number > max_scans) {
        auto* const errors = static_cast<JpegErrors*>(info->err);
        errors->has_too_many_scans = true;
        on_error(info);
    }
}

void set_up(JpegErrors* errors)
{
    jpeg_std_error(errors);
    errors->error_exit = on_error;
    errors->emit_message = on_message;
}

struct JpegReader
{
    jpeg_decompress_struct info = {};
    JpegErrors errors = {};
    jpeg_progress_mgr progress = {};

    JpegReader() = default;
    ~JpegReader() { jpeg_destroy_decompress(&info); }
    JpegReader(const JpegReader&) = delete;
    JpegReader& operator=(const JpegReader&) = delete;
};

struct JpegWriter
{
    jpeg_compress_struct info = {};
    JpegErrors errors = {};
    unsigned char* output = nullptr;
    unsigned long num_bytes = 0;

    JpegWriter() = default;
    ~JpegWriter()
    {
        jpeg_destroy_compress(&info);
        std::free(output); // NOLINT: jpeg_mem_dest allocates with malloc
    }
    JpegWriter(const JpegWriter&) = delete;
    JpegWriter& operator=(const JpegWriter&) = delete;
};

bool read_header(JpegReader* reader, const unsigned char* bytes, std::size_t count)
{
    set_up(&reader->errors);
    reader->info.err = &reader->errors;
    if (setjmp(reader->errors.jump) != 0) {
        return false;
    }
    jpeg_create_decompress(&reader->info);
    reader->progress.progress_monitor = on_progress;
    reader->info.progress = &reader->progress;
    jpeg_mem_src(&reader->info, bytes, count);
    jpeg_read_header(&reader->info, TRUE);
    const bool has_black = reader->info.jpeg_color_space == JCS_CMYK || reader->info.jpeg_color_space == JCS_YCCK;
    reader->info.out_color_space = has_black ? JCS_CMYK : JCS_RGB;
    reader->info.dct_method = JDCT_ISLOW; // the exact one: the same pixels on every machine
    return true;
}

/// All rows, 3 or 4 channels, into `pixels` (width * height * num_channels).
bool read_rows(JpegReader* reader, std::uint8_t* pixels, std::size_t num_channels)
{
    if (setjmp(reader->errors.jump) != 0) {
        return false;
    }
    jpeg_start_decompress(&reader->info);
    if (static_cast<std::size_t>(reader->info.output_components) != num_channels) {
        ERREXIT(&reader->info, JERR_CONVERSION_NOTIMPL);
    }
    const std::size_t row_bytes = reader->info.output_width * num_channels;
    while (reader->info.output_scanline < reader->info.output_height) {
        JSAMPROW row = pixels + reader->info.output_scanline * row_bytes;
        jpeg_read_scanlines(&reader->info, &row, 1);
    }
    jpeg_finish_decompress(&reader->info);
    return true;
}

bool write_rows(JpegWriter* writer, const ImageU8* image, int quality)
{
    set_up(&writer->errors);
    writer->info.err = &writer->errors;
    if (setjmp(writer->errors.jump) != 0) {
        return false;
    }
    jpeg_create_compress(&writer->info);
    jpeg_mem_dest(&writer->info, &writer->output, &writer->num_bytes);
    writer->info.image_width = static_cast<JDIMENSION>(image->width);
    writer->info.image_height = static_cast<JDIMENSION>(image->height);
    writer->info.input_components = image->channels;
    writer->info.in_color_space = image->channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(&writer->info);
    jpeg_set_quality(&writer->info, quality, TRUE);
    writer->info.dct_method = JDCT_ISLOW;
    jpeg_start_compress(&writer->info, TRUE);
    while (writer->info.next_scanline < writer->info.image_height) {
        // libjpeg does not write to the rows it is given.
        JSAMPROW row = const_cast<JSAMPROW>(image->pixel(0, static_cast<int>(writer->info.next_scanline)));
        jpeg_write_scanlines(&writer->info, &row, 1);
    }
    jpeg_finish_compress(&writer->info);
    return true;
}

/// RGB of printing colours without a profile: each light is what its ink and black let pass.
ImageU8 rgb_from_cmyk(const ImageU8& image, bool is_inverted)
{
    ImageU8 result(image.width, image.height, 3);
    const std::uint8_t* source = image.data.data();
    for (std::size_t i = 0; i < result.data.size(); i += 3, source += 4) {
        for (std::size_t k = 0; k < 3; ++k) {
            const int passes = is_inverted ? source[k] : 255 - source[k];
            const int white = is_inverted ? source[3] : 255 - source[3];
            result.data[i + k] = static_cast<std::uint8_t>((passes * white + 127) / 255);
        }
    }
    return result;
}

} // namespace

ImageU8 decode_jpeg(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits)
{
    JpegReader reader;
    const auto fail = [&] {
        if (reader.errors.has_too_many_scans) {
            throw IoError(IoErrorKind::limit, name, "",
                          "progressive JPEG image with more than " + std::to_string(max_scans) + " scans");
        }
        throw IoError(IoErrorKind::content, name, "", std::string("damaged JPEG image: ") + reader.errors.text);
    };
    if (!read_header(&reader, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size())) {
        fail();
    }
    check_size(reader.info.image_width, reader.info.image_height, name, limits);
    ImageU8 image(static_cast<int>(reader.info.image_width), static_cast<int>(reader.info.image_height),
                  reader.info.out_color_space == JCS_CMYK ? 4 : 3);
    if (!read_rows(&reader, image.data.data(), static_cast<std::size_t>(image.channels))) {
        fail();
    }
    return image.channels == 4 ? rgb_from_cmyk(image, reader.info.saw_Adobe_marker != 0) : image;
}

} // namespace lineament::image_codecs

namespace lineament {

std::vector<std::byte> format_jpeg(const ImageU8& image, int quality)
{
    image_codecs::check_image(image, "format_jpeg");
    require(image.channels == 1 || image.channels == 3, "format_jpeg", "channels", "1 or 3",
            std::to_string(image.channels));
    require(std::max(image.width, image.height) <= JPEG_MAX_DIMENSION, "format_jpeg", "image",
            "sides of at most " + std::to_string(JPEG_MAX_DIMENSION) + " px",
            std::to_string(image.width) + " x " + std::to_string(image.height));
    require(quality >= 1 && quality <= 100, "format_jpeg", "quality", "1 to 100", std::to_string(quality));
    image_codecs::JpegWriter writer;
    if (!image_codecs::write_rows(&writer, &image, quality)) {
        throw Error(std::string("format_jpeg: ") + writer.errors.text);
    }
    const auto* const bytes = reinterpret_cast<const std::byte*>(writer.output);
    return {bytes, bytes + writer.num_bytes};
}

} // namespace lineament
