// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lineament {

/// A picture of interleaved channels: rows top to bottom, pixels left to right, channels R, G, B (, A) or grey.
///
/// Image space: origin at the outer corner of the top-left pixel, x right, y down, so the centre of pixel
/// (column, row) lies at (column + 0.5, row + 0.5). Colours are sRGB-encoded unless a name says linear.
template <typename Scalar>
struct Image
{
    int width = 0;
    int height = 0;
    int channels = 0;
    std::vector<Scalar> data = {}; ///< height * width * channels values.

    Image() = default;
    /// @throws InvalidArgument unless all sizes are >= 0.
    Image(int width_, int height_, int channels_, Scalar value = Scalar{})
        : width(width_), height(height_), channels(channels_)
    {
        require(width >= 0 && height >= 0 && channels >= 0, "Image", "size", "three numbers >= 0",
                std::to_string(width) + " x " + std::to_string(height) + " x " + std::to_string(channels));
        data.assign(static_cast<std::size_t>(width) * height * channels, value);
    }

    [[nodiscard]] bool empty() const { return data.empty(); }
    [[nodiscard]] bool contains(int column, int row) const
    {
        return column >= 0 && row >= 0 && column < width && row < height;
    }
    [[nodiscard]] Scalar* pixel(int column, int row)
    {
        return data.data() + (static_cast<std::size_t>(row) * width + column) * channels;
    }
    [[nodiscard]] const Scalar* pixel(int column, int row) const
    {
        return data.data() + (static_cast<std::size_t>(row) * width + column) * channels;
    }
    [[nodiscard]] Scalar& at(int column, int row, int channel = 0) { return pixel(column, row)[channel]; }
    [[nodiscard]] Scalar at(int column, int row, int channel = 0) const { return pixel(column, row)[channel]; }

    bool operator==(const Image&) const = default;
};

using ImageU8 = Image<std::uint8_t>; ///< 0..255, sRGB-encoded.
using ImageF = Image<float>;         ///< Colours in [0, 1]; also depth, weights.

/// Bilinear interpolation of one channel at image point (x, y) [px, pixel centres at +0.5]; outside the outermost
/// pixel centres the border value is continued. The image must not be empty and x, y finite.
template <typename Scalar>
[[nodiscard]] float sample_bilinear(const Image<Scalar>& image, float x, float y, int channel)
{
    const float u = std::clamp(x - 0.5f, 0.0f, static_cast<float>(image.width - 1));
    const float v = std::clamp(y - 0.5f, 0.0f, static_cast<float>(image.height - 1));
    const int column = static_cast<int>(u);
    const int row = static_cast<int>(v);
    const int next_column = std::min(column + 1, image.width - 1);
    const int next_row = std::min(row + 1, image.height - 1);
    const float a = u - static_cast<float>(column);
    const float b = v - static_cast<float>(row);
    const auto value = [&](int i, int j) { return static_cast<float>(image.at(i, j, channel)); };
    return (1 - b) * ((1 - a) * value(column, row) + a * value(next_column, row)) +
           b * ((1 - a) * value(column, next_row) + a * value(next_column, next_row));
}

/// Float colour in [0, 1] to 8 bits, rounded and clamped.
[[nodiscard]] inline std::uint8_t to_u8(float value)
{
    return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0f, 1.0f) * 255.0f));
}

} // namespace lineament
