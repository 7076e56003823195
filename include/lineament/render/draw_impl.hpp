// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/checks.hpp"
#include "lineament/render/draw.hpp" // IWYU pragma: keep
#include "lineament/render/font.hpp"
#include "lineament/render/inline.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace lineament {

namespace detail {

/// Calls coverage(pixel centre) for the pixels of the picture inside a box and blends the colour by it.
template <typename Coverage>
void draw_shape(ImageU8& image, const Eigen::Vector2d& low, const Eigen::Vector2d& high, const Color& color,
                Coverage&& coverage)
{
    if (!low.allFinite() || !high.allFinite()) {
        return;
    }
    const auto clipped = [](double value, int end) {
        return static_cast<int>(std::clamp(std::floor(value), 0.0, static_cast<double>(end)));
    };
    const int last_column = std::min(clipped(high.x(), image.width), image.width - 1);
    const int last_row = std::min(clipped(high.y(), image.height), image.height - 1);
    for (int row = clipped(low.y(), image.height); row <= last_row; ++row) {
        for (int column = clipped(low.x(), image.width); column <= last_column; ++column) {
            const double covered = coverage(Eigen::Vector2d(column + 0.5, row + 0.5));
            if (covered > 0) {
                blend_pixel(image, column, row, color, static_cast<float>(std::min(covered, 1.0)));
            }
        }
    }
}

/// Weights of the old pixels that make up one new pixel along one axis.
struct ResizeTap
{
    int first = 0;
    std::vector<float> weights = {};
};

inline std::vector<ResizeTap> resize_taps(int old_size, int new_size)
{
    std::vector<ResizeTap> taps(static_cast<std::size_t>(new_size));
    const double ratio = static_cast<double>(old_size) / new_size;
    for (int i = 0; i < new_size; ++i) {
        ResizeTap& tap = taps[i];
        if (new_size >= old_size) { // linear between pixel centres, the border repeated
            const double position = std::clamp((i + 0.5) * ratio - 0.5, 0.0, old_size - 1.0);
            tap.first = std::min(static_cast<int>(position), std::max(0, old_size - 2));
            const auto second = static_cast<float>(position - tap.first);
            tap.weights = old_size > 1 ? std::vector<float>{1.0f - second, second} : std::vector<float>{1.0f};
        } else { // the share of each old pixel in [i, i + 1) ratio
            const double begin = i * ratio;
            const double end = (i + 1) * ratio;
            tap.first = static_cast<int>(begin);
            const int last = std::min(old_size - 1, static_cast<int>(std::ceil(end)) - 1);
            for (int j = tap.first; j <= last; ++j) {
                const double overlap = std::min(end, j + 1.0) - std::max(begin, static_cast<double>(j));
                tap.weights.push_back(static_cast<float>(std::max(0.0, overlap) / ratio));
            }
        }
    }
    return taps;
}

} // namespace detail

LINEAMENT_RENDER_INLINE void blend_pixel(ImageU8& image, int column, int row, const Color& color, float coverage)
{
    if (!image.contains(column, row)) {
        return;
    }
    const float alpha = std::clamp(coverage, 0.0f, 1.0f) * static_cast<float>(color.alpha) / 255.0f;
    std::uint8_t* const pixel = image.pixel(column, row);
    const auto mix = [](std::uint8_t below, float above, float share) {
        return static_cast<std::uint8_t>(rounded((1.0f - share) * static_cast<float>(below) + share * above));
    };
    if (image.channels < 3) {
        const float grey =
            (static_cast<float>(color.red) + 2.0f * static_cast<float>(color.green) + static_cast<float>(color.blue)) /
            4.0f;
        pixel[0] = mix(pixel[0], grey, alpha);
        return;
    }
    float share = alpha;
    if (image.channels == 4) {
        const float below = static_cast<float>(pixel[3]) / 255.0f;
        const float together = alpha + (1.0f - alpha) * below;
        share = together > 0 ? alpha / together : 0.0f;
        pixel[3] = to_u8(together);
    }
    pixel[0] = mix(pixel[0], color.red, share);
    pixel[1] = mix(pixel[1], color.green, share);
    pixel[2] = mix(pixel[2], color.blue, share);
}

LINEAMENT_RENDER_INLINE void draw_line(ImageU8& image, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                                       const Color& color, double width_px)
{
    if (!(width_px > 0) || !std::isfinite(width_px)) {
        return;
    }
    const double reach = 0.5 * width_px + 0.5;
    const Eigen::Vector2d along = to - from;
    const double length2 = along.squaredNorm();
    const double far2 =
        reach * reach * length2 * 1.000001; // beyond it the distance from the line is the reach at least
    const Eigen::Vector2d low = from.cwiseMin(to).array() - reach;
    const Eigen::Vector2d high = from.cwiseMax(to).array() + reach;
    detail::draw_shape(image, low, high, color, [&](const Eigen::Vector2d& center) {
        const double across = (center.x() - from.x()) * along.y() - (center.y() - from.y()) * along.x();
        if (across * across > far2) {
            return 0.0;
        }
        const double position = length2 > 0 ? std::clamp((center - from).dot(along) / length2, 0.0, 1.0) : 0.0;
        const double coverage = reach - (center - from - position * along).norm();
        return std::min(coverage, width_px); // a line thinner than a pixel is fainter
    });
}

LINEAMENT_RENDER_INLINE void draw_disc(ImageU8& image, const Eigen::Vector2d& center, double radius_px,
                                       const Color& color)
{
    if (!(radius_px > 0)) {
        return;
    }
    const Eigen::Vector2d low = center.array() - (radius_px + 0.5);
    const Eigen::Vector2d high = center.array() + (radius_px + 0.5);
    detail::draw_shape(image, low, high, color,
                       [&](const Eigen::Vector2d& point) { return radius_px + 0.5 - (point - center).norm(); });
}

LINEAMENT_RENDER_INLINE void draw_circle(ImageU8& image, const Eigen::Vector2d& center, double radius_px,
                                         const Color& color, double width_px)
{
    if (!(radius_px > 0) || !(width_px > 0)) {
        return;
    }
    const double reach = 0.5 * width_px + 0.5;
    const Eigen::Vector2d low = center.array() - (radius_px + reach);
    const Eigen::Vector2d high = center.array() + (radius_px + reach);
    detail::draw_shape(image, low, high, color, [&](const Eigen::Vector2d& point) {
        return std::min(reach - std::abs((point - center).norm() - radius_px), width_px);
    });
}

LINEAMENT_RENDER_INLINE void draw_rectangle(ImageU8& image, const Eigen::Vector2d& corner,
                                            const Eigen::Vector2d& opposite_corner, const Color& color, double width_px)
{
    if (!(width_px > 0)) {
        return;
    }
    const double reach = 0.5 * width_px + 0.5;
    const Eigen::Vector2d low = corner.cwiseMin(opposite_corner);
    const Eigen::Vector2d high = corner.cwiseMax(opposite_corner);
    const Eigen::Vector2d middle = 0.5 * (low + high);
    const Eigen::Vector2d half = 0.5 * (high - low);
    detail::draw_shape(image, low.array() - reach, high.array() + reach, color, [&](const Eigen::Vector2d& point) {
        const Eigen::Vector2d beyond = (point - middle).cwiseAbs() - half; // > 0 outside
        return std::min(reach - std::abs(beyond.maxCoeff()), width_px);
    });
}

LINEAMENT_RENDER_INLINE void fill_rectangle(ImageU8& image, int left, int top, int width, int height,
                                            const Color& color)
{
    const auto clipped = [](std::int64_t value, int end) {
        return static_cast<int>(std::clamp<std::int64_t>(value, 0, end));
    };
    const int right = clipped(static_cast<std::int64_t>(left) + width, image.width);
    const int bottom = clipped(static_cast<std::int64_t>(top) + height, image.height);
    for (int row = std::max(0, top); row < bottom; ++row) {
        for (int column = std::max(0, left); column < right; ++column) {
            blend_pixel(image, column, row, color);
        }
    }
}

LINEAMENT_RENDER_INLINE void draw_text(ImageU8& image, int left, int top, std::string_view text, const Color& color,
                                       int scale)
{
    int x = left;
    int y = top;
    for (const char letter : text) {
        if (letter == '\n') {
            x = left;
            y += (glyph_height + 2) * scale;
            continue;
        }
        for (int row = 0; row < glyph_height; ++row) {
            for (int column = 0; column < glyph_width; ++column) {
                if (is_glyph_pixel(letter, column, row)) {
                    fill_rectangle(image, x + column * scale, y + row * scale, scale, scale, color);
                }
            }
        }
        x += (glyph_width + 1) * scale;
    }
}

LINEAMENT_RENDER_INLINE int text_width_px(std::string_view text, int scale)
{
    int longest = 0;
    int length = 0;
    for (const char letter : text) {
        length = letter == '\n' ? 0 : length + 1;
        longest = std::max(longest, length);
    }
    return longest > 0 ? (longest * (glyph_width + 1) - 1) * scale : 0;
}

LINEAMENT_RENDER_INLINE int text_height_px(std::string_view text, int scale)
{
    const auto num_lines = static_cast<int>(1 + std::count(text.begin(), text.end(), '\n'));
    return text.empty() ? 0 : num_lines * (glyph_height + 2) * scale;
}

LINEAMENT_RENDER_INLINE void paste(ImageU8& image, const ImageU8& picture, int left, int top)
{
    for (int row = std::max(0, -top); row < picture.height && row + top < image.height; ++row) {
        for (int column = std::max(0, -left); column < picture.width && column + left < image.width; ++column) {
            const std::uint8_t* const pixel = picture.pixel(column, row);
            const bool is_grey = picture.channels < 3;
            const Color color{pixel[0], pixel[is_grey ? 0 : 1], pixel[is_grey ? 0 : 2],
                              picture.channels == 4 ? pixel[3] : std::uint8_t{255}};
            blend_pixel(image, column + left, row + top, color);
        }
    }
}

LINEAMENT_RENDER_INLINE ImageU8 resize(const ImageU8& picture, int width, int height)
{
    require_image_size(width, height, "resize");
    ImageU8 resized(width, height, picture.channels);
    if (resized.empty()) {
        return resized;
    }
    require(!picture.empty(), "resize", "picture", "a picture with pixels", "an empty one");
    const std::vector<detail::ResizeTap> taps_x = detail::resize_taps(picture.width, width);
    const std::vector<detail::ResizeTap> taps_y = detail::resize_taps(picture.height, height);
    const int channels = picture.channels;
    const bool has_alpha = channels == 4;

    ImageF narrowed(width, picture.height, channels);
    for (int row = 0; row < picture.height; ++row) {
        for (int column = 0; column < width; ++column) {
            const detail::ResizeTap& tap = taps_x[column];
            float* const sum = narrowed.pixel(column, row);
            for (std::size_t i = 0; i < tap.weights.size(); ++i) {
                const std::uint8_t* const pixel = picture.pixel(tap.first + static_cast<int>(i), row);
                const float weight = tap.weights[i] * (has_alpha ? static_cast<float>(pixel[3]) / 255.0f : 1.0f);
                for (int channel = 0; channel < channels; ++channel) {
                    const bool is_alpha = has_alpha && channel == 3;
                    sum[channel] += is_alpha ? tap.weights[i] * static_cast<float>(pixel[3])
                                             : weight * static_cast<float>(pixel[channel]);
                }
            }
        }
    }
    std::vector<float> sum(static_cast<std::size_t>(channels));
    for (int row = 0; row < height; ++row) {
        const detail::ResizeTap& tap = taps_y[row];
        for (int column = 0; column < width; ++column) {
            std::fill(sum.begin(), sum.end(), 0.0f);
            for (std::size_t i = 0; i < tap.weights.size(); ++i) {
                const float* const pixel = narrowed.pixel(column, tap.first + static_cast<int>(i));
                for (int channel = 0; channel < channels; ++channel) {
                    sum[channel] += tap.weights[i] * pixel[channel];
                }
            }
            for (int channel = 0; channel < channels; ++channel) {
                const bool is_color_of_alpha = has_alpha && channel < 3;
                const float value =
                    is_color_of_alpha ? (sum[3] > 0 ? sum[channel] * 255.0f / sum[3] : 0.0f) : sum[channel];
                resized.at(column, row, channel) = to_u8(value / 255.0f);
            }
        }
    }
    return resized;
}

} // namespace lineament
