// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// libpng reports errors by longjmp. Every function that calls setjmp here holds plain data only, so that no destructor
// is jumped over; memory is owned by the callers.
#include "image_codecs.hpp"

#include <algorithm>
#include <csetjmp>
#include <cstdio>
#include <cstring>

#include <png.h>

namespace lineament::image_codecs {

namespace {

struct PngState
{
    png_structp png = nullptr;
    png_infop info = nullptr;
    const std::byte* next = nullptr; ///< The bytes not read yet.
    std::size_t num_left = 0;
    char error[128] = "out of memory";
    png_uint_32 width = 0;
    png_uint_32 height = 0;
    int bit_depth = 0;
    int color_type = 0;
    int has_alpha = 0;
};

void on_error(png_structp png, png_const_charp message)
{
    auto* const state = static_cast<PngState*>(png_get_error_ptr(png));
    std::snprintf(state->error, sizeof state->error, "%s", message);
    std::longjmp(png_jmpbuf(png), 1);
}

void on_warning(png_structp, png_const_charp) {} // damaged side information; the pixels are not touched by it

void read_bytes(png_structp png, png_bytep target, std::size_t count)
{
    auto* const state = static_cast<PngState*>(png_get_io_ptr(png));
    if (count > state->num_left) {
        png_error(png, "the file ends too early; download again?");
    }
    std::memcpy(target, state->next, count);
    state->next += count;
    state->num_left -= count;
}

bool read_header(PngState* state)
{
    state->png = png_create_read_struct(PNG_LIBPNG_VER_STRING, state, on_error, on_warning);
    if (state->png == nullptr || (state->info = png_create_info_struct(state->png)) == nullptr) {
        return false;
    }
    if (setjmp(png_jmpbuf(state->png)) != 0) {
        return false;
    }
    png_set_read_fn(state->png, state, read_bytes);
    png_set_user_limits(state->png, PNG_UINT_31_MAX, PNG_UINT_31_MAX); // our own limit is on the product
    // Compressed side information is not unpacked at all.
    static const png_byte skipped[] = "iCCP\0zTXt\0iTXt\0tEXt\0sPLT\0eXIf";
    png_set_keep_unknown_chunks(state->png, PNG_HANDLE_CHUNK_NEVER, skipped, 6);
    png_read_info(state->png, state->info);
    png_get_IHDR(state->png, state->info, &state->width, &state->height, &state->bit_depth, &state->color_type, nullptr,
                 nullptr, nullptr);
    state->has_alpha =
        (state->color_type & PNG_COLOR_MASK_ALPHA) != 0 || png_get_valid(state->png, state->info, PNG_INFO_tRNS) != 0;
    return true;
}

/// All rows as RGB or RGBA, 8 bits, into `pixels` (width * height * num_channels).
bool read_rows(PngState* state, std::uint8_t* pixels, std::size_t num_channels)
{
    if (setjmp(png_jmpbuf(state->png)) != 0) {
        return false;
    }
    png_set_expand(state->png);
    png_set_scale_16(state->png);
    png_set_gray_to_rgb(state->png);
    const int num_passes = png_set_interlace_handling(state->png);
    png_read_update_info(state->png, state->info);
    const std::size_t row_bytes = state->width * num_channels;
    if (png_get_rowbytes(state->png, state->info) != row_bytes) {
        png_error(state->png, "unexpected row size");
    }
    for (int pass = 0; pass < num_passes; ++pass) {
        for (png_uint_32 row = 0; row < state->height; ++row) {
            png_read_row(state->png, pixels + row * row_bytes, nullptr);
        }
    }
    png_read_end(state->png, nullptr);
    return true;
}

/// Ends libpng's structures at the end of the scope.
struct PngReader : PngState
{
    PngReader() = default;
    ~PngReader() { png_destroy_read_struct(&png, &info, nullptr); }
    PngReader(const PngReader&) = delete;
    PngReader& operator=(const PngReader&) = delete;
};

/// RGBA over white, as RGB.
ImageU8 flatten(const ImageU8& image)
{
    ImageU8 result(image.width, image.height, 3);
    const std::uint8_t* source = image.data.data();
    for (std::size_t i = 0; i < result.data.size(); i += 3, source += 4) {
        const int alpha = source[3];
        for (std::size_t k = 0; k < 3; ++k) {
            result.data[i + k] = static_cast<std::uint8_t>((source[k] * alpha + 255 * (255 - alpha) + 127) / 255);
        }
    }
    return result;
}

} // namespace

ImageU8 decode_png(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits)
{
    PngReader reader;
    reader.next = bytes.data();
    reader.num_left = bytes.size();
    const auto fail = [&] {
        throw IoError(IoErrorKind::content, name, "", std::string("damaged PNG image: ") + reader.error);
    };
    if (!read_header(&reader)) {
        fail();
    }
    check_size(reader.width, reader.height, name, limits);
    ImageU8 image(static_cast<int>(reader.width), static_cast<int>(reader.height), reader.has_alpha != 0 ? 4 : 3);
    if (!read_rows(&reader, image.data.data(), static_cast<std::size_t>(image.channels))) {
        fail();
    }
    return image.channels == 4 ? flatten(image) : image;
}

} // namespace lineament::image_codecs
