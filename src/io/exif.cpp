// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Based on: Exchangeable image file format for digital still cameras: Exif Version 2.32, CIPA DC-008, 2019; and the
// eXIf chunk of the PNG Specification (Third Edition), W3C.
#include "image_codecs.hpp"

#include <cstring>
#include <optional>
#include <string_view>

namespace lineament::image_codecs {

namespace {

using Bytes = std::span<const std::byte>;

enum class ByteOrder
{
    little,
    big,
};

/// The number of `count` bytes at the offset, if it lies inside.
std::optional<std::uint32_t> number_at(Bytes bytes, std::size_t offset, std::size_t count, ByteOrder order)
{
    if (offset > bytes.size() || count > bytes.size() - offset) {
        return std::nullopt;
    }
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < count; ++i) {
        value = value << 8 | static_cast<std::uint32_t>(bytes[offset + (order == ByteOrder::big ? i : count - 1 - i)]);
    }
    return value;
}

bool has_text(Bytes bytes, std::size_t offset, std::string_view text)
{
    return offset <= bytes.size() && text.size() <= bytes.size() - offset &&
           std::memcmp(bytes.data() + offset, text.data(), text.size()) == 0;
}

/// Orientation in the first directory of a TIFF block; no other directory is followed, so there are no loops.
int orientation_of_tiff(Bytes tiff)
{
    constexpr std::uint32_t orientation_tag = 0x0112;
    constexpr std::uint32_t short_type = 3;
    const ByteOrder order = has_text(tiff, 0, "II") ? ByteOrder::little : ByteOrder::big;
    if (order == ByteOrder::big && !has_text(tiff, 0, "MM")) {
        return 1;
    }
    const std::optional<std::uint32_t> directory = number_at(tiff, 4, 4, order);
    if (number_at(tiff, 2, 2, order) != 42u || !directory) {
        return 1;
    }
    const std::uint32_t count = number_at(tiff, *directory, 2, order).value_or(0);
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::size_t entry = std::size_t{*directory} + 2 + 12 * std::size_t{i};
        const std::optional<std::uint32_t> tag = number_at(tiff, entry, 2, order);
        if (!tag) {
            return 1;
        }
        if (*tag == orientation_tag && number_at(tiff, entry + 2, 2, order) == short_type) {
            const std::uint32_t value = number_at(tiff, entry + 8, 2, order).value_or(1);
            return value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
        }
    }
    return 1;
}

int orientation_of_png(Bytes file)
{
    std::size_t offset = 8;
    while (const std::optional<std::uint32_t> length = number_at(file, offset, 4, ByteOrder::big)) {
        const std::size_t left = file.size() - offset;
        if (left < 12 || *length > left - 12) {
            break;
        }
        if (has_text(file, offset + 4, "eXIf")) {
            return orientation_of_tiff(file.subspan(offset + 8, *length));
        }
        offset += 12 + std::size_t{*length};
    }
    return 1;
}

int orientation_of_jpeg(Bytes file)
{
    constexpr std::string_view exif("Exif\0\0", 6);
    std::size_t offset = 2;
    while (const std::optional<std::uint32_t> marker = number_at(file, offset, 2, ByteOrder::big)) {
        if (*marker == 0xffff) { // fill byte
            ++offset;
            continue;
        }
        const std::uint32_t length = number_at(file, offset + 2, 2, ByteOrder::big).value_or(0);
        if (*marker < 0xff02 || *marker == 0xffda || length < 2 || length > file.size() - offset - 2) {
            break;
        }
        if (*marker == 0xffe1 && length >= 8 && has_text(file, offset + 4, exif)) {
            return orientation_of_tiff(file.subspan(offset + 10, length - 8));
        }
        offset += 2 + std::size_t{length};
    }
    return 1;
}

} // namespace

int find_orientation(Bytes file)
{
    return has_text(file, 0, "\xff\xd8") ? orientation_of_jpeg(file) : orientation_of_png(file);
}

ImageU8 apply_orientation(ImageU8 image, int orientation)
{
    if (orientation == 1) {
        return image;
    }
    const bool is_transposed = orientation >= 5;
    const bool mirrors_columns = orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
    const bool mirrors_rows = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
    ImageU8 result(is_transposed ? image.height : image.width, is_transposed ? image.width : image.height,
                   image.channels);
    for (int row = 0; row < result.height; ++row) {
        for (int column = 0; column < result.width; ++column) {
            int from_column = is_transposed ? row : column;
            int from_row = is_transposed ? column : row;
            from_column = mirrors_columns ? image.width - 1 - from_column : from_column;
            from_row = mirrors_rows ? image.height - 1 - from_row : from_row;
            std::memcpy(result.pixel(column, row), image.pixel(from_column, from_row),
                        static_cast<std::size_t>(image.channels));
        }
    }
    return result;
}

} // namespace lineament::image_codecs
