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

/// Bilinear interpolation at image point (x, y) [px, pixel centres at +0.5]; outside the outermost pixel centres the
/// border value is continued. The image must not be empty and x, y finite; it must outlive the sample.
template <typename Scalar>
class BilinearSample
{
public:
    BilinearSample(const Image<Scalar>& image, float x, float y)
    {
        const float u = std::clamp(x - 0.5f, 0.0f, static_cast<float>(image.width - 1));
        const float v = std::clamp(y - 0.5f, 0.0f, static_cast<float>(image.height - 1));
        const int column = static_cast<int>(u);
        const int row = static_cast<int>(v);
        const int next_column = std::min(column + 1, image.width - 1);
        const int next_row = std::min(row + 1, image.height - 1);
        top_left_ = image.pixel(column, row);
        top_right_ = image.pixel(next_column, row);
        bottom_left_ = image.pixel(column, next_row);
        bottom_right_ = image.pixel(next_column, next_row);
        a_ = u - static_cast<float>(column);
        b_ = v - static_cast<float>(row);
    }

    [[nodiscard]] float operator()(int channel) const
    {
        const auto value = [channel](const Scalar* pixel) { return static_cast<float>(pixel[channel]); };
        return (1 - b_) * ((1 - a_) * value(top_left_) + a_ * value(top_right_)) +
               b_ * ((1 - a_) * value(bottom_left_) + a_ * value(bottom_right_));
    }

private:
    const Scalar* top_left_;
    const Scalar* top_right_;
    const Scalar* bottom_left_;
    const Scalar* bottom_right_;
    float a_; ///< Share of the right pixels.
    float b_; ///< Share of the lower pixels.
};

/// One channel of a BilinearSample.
template <typename Scalar>
[[nodiscard]] float sample_bilinear(const Image<Scalar>& image, float x, float y, int channel)
{
    return BilinearSample<Scalar>(image, x, y)(channel);
}

/// std::lround of a value in [0, 2^31 - 1), without its call. The sum is exact where it decides.
[[nodiscard]] inline int rounded(float value)
{
    return static_cast<int>(static_cast<double>(value) + 0.5);
}

/// Float colour in [0, 1] to 8 bits, rounded and clamped.
[[nodiscard]] inline std::uint8_t to_u8(float value)
{
    return static_cast<std::uint8_t>(rounded(std::clamp(value, 0.0f, 1.0f) * 255.0f));
}

} // namespace lineament
