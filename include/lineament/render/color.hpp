// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lineament {

/// An sRGB-encoded colour, not premultiplied.
struct Color
{
    std::uint8_t red = 0;
    std::uint8_t green = 0;
    std::uint8_t blue = 0;
    std::uint8_t alpha = 255; ///< 0: invisible, 255: opaque.

    bool operator==(const Color&) const = default;
};

/// Linear light in [0, 1] of an sRGB-encoded value in [0, 1] (IEC 61966-2-1).
[[nodiscard]] inline float linear_from_srgb(float encoded)
{
    return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

/// sRGB-encoded value in [0, 1] of linear light in [0, 1].
[[nodiscard]] inline float srgb_from_linear(float linear)
{
    return linear <= 0.0031308f ? linear * 12.92f : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

/// Linear light of each 8-bit sRGB value.
[[nodiscard]] inline const std::array<float, 256>& linear_from_srgb_table()
{
    static const std::array<float, 256> table = [] {
        std::array<float, 256> values{};
        for (std::size_t i = 0; i < values.size(); ++i) {
            values[i] = linear_from_srgb(static_cast<float>(i) / 255.0f);
        }
        return values;
    }();
    return table;
}

/// Linear light of an 8-bit sRGB value, from a table.
[[nodiscard]] inline float linear_from_srgb_u8(std::uint8_t encoded)
{
    return linear_from_srgb_table()[encoded];
}

/// 8-bit sRGB value of linear light, clamped to [0, 1]; the inverse of `linear_from_srgb_u8`.
[[nodiscard]] inline std::uint8_t srgb_u8_from_linear(float linear)
{
    constexpr int last = 16383; // fine enough that every 8-bit value comes back
    static const std::vector<std::uint8_t> table = [] {
        std::vector<std::uint8_t> values(last + 1);
        for (int i = 0; i <= last; ++i) {
            const float encoded = srgb_from_linear(static_cast<float>(i) / static_cast<float>(last));
            values[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(std::lround(encoded * 255.0f));
        }
        return values;
    }();
    return table[static_cast<std::size_t>(std::clamp(linear, 0.0f, 1.0f) * static_cast<float>(last) + 0.5f)];
}

/// Linear light of the colour, without its alpha.
[[nodiscard]] inline Eigen::Vector3f linear_rgb(const Color& color)
{
    return {linear_from_srgb_u8(color.red), linear_from_srgb_u8(color.green), linear_from_srgb_u8(color.blue)};
}

} // namespace lineament
