// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// PNG files by libdeflate, which packs a picture two to three times as fast as zlib, and smaller.
//
// Based on: Portable Network Graphics (PNG) Specification, third edition, W3C, 2025.
#include "image_codecs.hpp"

#include <libdeflate.h>

#include <algorithm>
#include <memory>
#include <new>
#include <string_view>
#include <vector>

namespace lineament {

namespace {

using Bytes = std::vector<std::byte>;

void append(Bytes& bytes, std::span<const std::byte> more)
{
    bytes.insert(bytes.end(), more.begin(), more.end());
}

void append(Bytes& bytes, std::string_view text)
{
    append(bytes, std::as_bytes(std::span(text)));
}

void append_big_endian(Bytes& bytes, std::uint32_t number)
{
    for (int shift = 24; shift >= 0; shift -= 8) {
        bytes.push_back(static_cast<std::byte>(number >> shift));
    }
}

/// Length, type and content, and the checksum of the latter two.
void append_chunk(Bytes& bytes, std::string_view type, std::span<const std::byte> content)
{
    append_big_endian(bytes, static_cast<std::uint32_t>(content.size()));
    const std::size_t start = bytes.size();
    append(bytes, type);
    append(bytes, content);
    append_big_endian(bytes, libdeflate_crc32(0, bytes.data() + start, bytes.size() - start));
}

Bytes header_of(const ImageU8& image)
{
    constexpr std::byte bit_depth{8};
    constexpr std::byte grey{0};
    constexpr std::byte rgb{2};
    constexpr std::byte rgb_alpha{6};
    Bytes header;
    append_big_endian(header, static_cast<std::uint32_t>(image.width));
    append_big_endian(header, static_cast<std::uint32_t>(image.height));
    header.push_back(bit_depth);
    header.push_back(image.channels == 1 ? grey : image.channels == 3 ? rgb : rgb_alpha);
    header.resize(header.size() + 3); // compression, filtering and interlacing: all of kind 0
    return header;
}

/// The rows, each behind the number of its filter: 1 (Sub), by which a byte gives way to its difference from the pixel
/// to the left. Nearly as small as the best filter of each row.
std::vector<std::uint8_t> filtered_rows(const ImageU8& image)
{
    const std::size_t row_bytes = static_cast<std::size_t>(image.width) * image.channels;
    const auto pixel_bytes = static_cast<std::size_t>(image.channels);
    std::vector<std::uint8_t> rows(image.height * (row_bytes + 1));
    std::uint8_t* target = rows.data();
    for (int row = 0; row < image.height; ++row) {
        const std::uint8_t* const source = image.pixel(0, row);
        *target++ = 1;
        std::copy_n(source, pixel_bytes, target);
        for (std::size_t i = pixel_bytes; i < row_bytes; ++i) {
            target[i] = static_cast<std::uint8_t>(source[i] - source[i - pixel_bytes]);
        }
        target += row_bytes;
    }
    return rows;
}

/// As a zlib stream.
Bytes compressed(std::span<const std::uint8_t> content)
{
    constexpr int fastest_level = 1;
    const std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)> compressor(
        libdeflate_alloc_compressor(fastest_level), &libdeflate_free_compressor);
    if (!compressor) {
        throw std::bad_alloc();
    }
    Bytes bytes(libdeflate_zlib_compress_bound(compressor.get(), content.size()));
    bytes.resize(
        libdeflate_zlib_compress(compressor.get(), content.data(), content.size(), bytes.data(), bytes.size()));
    return bytes;
}

} // namespace

std::vector<std::byte> format_png(const ImageU8& image)
{
    image_codecs::check_image(image, "format_png");
    require(image.channels == 1 || image.channels == 3 || image.channels == 4, "format_png", "channels", "1, 3 or 4",
            std::to_string(image.channels));
    const Bytes pixels = compressed(filtered_rows(image));
    Bytes bytes;
    bytes.reserve(pixels.size() + 128);
    append(bytes, "\x89PNG\r\n\x1a\n");
    append_chunk(bytes, "IHDR", header_of(image));
    constexpr std::size_t longest_chunk = 1u << 30; // the format allows 2^31 - 1 bytes
    for (std::size_t start = 0; start < pixels.size(); start += longest_chunk) {
        append_chunk(bytes, "IDAT", std::span(pixels).subspan(start, std::min(longest_chunk, pixels.size() - start)));
    }
    append_chunk(bytes, "IEND", {});
    return bytes;
}

} // namespace lineament
