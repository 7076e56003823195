// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/io/image_file.hpp"

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

// What image_file.cpp, png_reader.cpp, png_writer.cpp, jpeg_codec.cpp and exif.cpp share.
namespace lineament::image_codecs {

/// The pixels as stored (orientation not applied), RGB.
[[nodiscard]] ImageU8 decode_png(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits);
[[nodiscard]] ImageU8 decode_jpeg(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits);

/// @throws IoError (limit) if there are too many pixels.
void check_size(std::uint64_t width, std::uint64_t height, const std::string& name, const ImageLimits& limits);

/// @throws InvalidArgument naming `function` if the picture is empty or its sizes disagree with its data.
void check_image(const ImageU8& image, const char* function);

/// EXIF orientation, 1 to 8, of a PNG or JPEG file; 1 if there is none or it is damaged.
[[nodiscard]] int find_orientation(std::span<const std::byte> file);

/// The picture turned and mirrored upright from an EXIF orientation 1 to 8.
[[nodiscard]] ImageU8 apply_orientation(ImageU8 image, int orientation);

} // namespace lineament::image_codecs
