// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace lineament {

/// The largest picture a reader decodes; checked against the file's header before memory is taken.
struct ImageLimits
{
    double max_megapixels = 64.0; ///< Width times height / 10^6, > 0.
};

/// The picture in a PNG or JPEG file as 8-bit RGB, upright: the EXIF orientation is applied. The content decides which
/// format it is, not the name.
///
/// PNG: every colour type, depth and interlacing; 16 bits are rounded to 8; transparent parts are laid over white.
/// JPEG: grey, YCbCr, RGB, CMYK and YCCK (without colour profile), sequential and progressive up to 100 scans. Colour
/// profiles and gamma chunks are ignored: values are taken as sRGB.
///
/// @throws IoError (content) if the file is another format (named, with what to do), cut or damaged: half a picture is
///         never returned; (limit) if it is larger than the limits; (system) if it cannot be read.
[[nodiscard]] ImageU8 load_image(const std::filesystem::path& path, const ImageLimits& limits = {});

/// The picture in a file's bytes; `name` stands for the path in messages.
[[nodiscard]] ImageU8 parse_image(std::span<const std::byte> bytes, const std::string& name,
                                  const ImageLimits& limits = {});

/// Writes a PNG file of a grey (1 channel), RGB (3) or RGBA (4) picture: pixels only, no metadata.
/// @throws InvalidArgument on another number of channels or an empty picture. @throws IoError if writing fails.
void save_png(const std::filesystem::path& path, const ImageU8& image);

/// The bytes save_png writes.
[[nodiscard]] std::vector<std::byte> format_png(const ImageU8& image);

/// The bytes of a JPEG file of a grey (1 channel) or RGB (3) picture, without metadata.
/// @param quality  1 to 100.
/// @throws InvalidArgument on another number of channels, an empty picture, sides above 65,500 px or a bad quality.
[[nodiscard]] std::vector<std::byte> format_jpeg(const ImageU8& image, int quality = 90);

} // namespace lineament
