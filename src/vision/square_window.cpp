// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "square_window.hpp"

#include <algorithm>
#include <cmath>

namespace lineament {
namespace {

/// Mixes the four pixels around (x, y), given in units where pixel centres are whole numbers; any of them may be
/// outside.
void sample_at_border(const ImageU8& picture, double x, double y, Border border, float* sum)
{
    // A window may reach far out: beyond one pixel outside nothing changes any more.
    x = std::clamp(x, -2.0, picture.width + 1.0);
    y = std::clamp(y, -2.0, picture.height + 1.0);
    const int left = static_cast<int>(std::floor(x));
    const int top = static_cast<int>(std::floor(y));
    sum[0] = sum[1] = sum[2] = 0.0f;
    for (int k = 0; k < 4; ++k) {
        int column = left + k % 2;
        int row = top + k / 2;
        const double weight = (1.0 - std::abs(x - column)) * (1.0 - std::abs(y - row));
        if (!picture.contains(column, row)) {
            if (border == Border::black) {
                continue;
            }
            column = std::clamp(column, 0, picture.width - 1);
            row = std::clamp(row, 0, picture.height - 1);
        }
        const std::uint8_t* pixel = picture.pixel(column, row);
        for (int channel = 0; channel < 3; ++channel) {
            sum[channel] += static_cast<float>(weight) * static_cast<float>(pixel[channel]);
        }
    }
}

} // namespace

SquareWindow::Affine SquareWindow::picture_from_window(double size) const
{
    const double scale = side / size;
    const double c = scale * std::cos(angle);
    const double s = scale * std::sin(angle);
    Affine affine;
    affine.linear << c, -s, s, c;
    affine.offset = center - affine.linear * Eigen::Vector2d::Constant(0.5 * size);
    return affine;
}

SquareWindow window_around(const ImageU8& picture)
{
    return {.center = {0.5 * picture.width, 0.5 * picture.height},
            .side = static_cast<double>(std::max(picture.width, picture.height))};
}

void sample_window(const ImageU8& picture, const SquareWindow& window, int size, Border border, float low, float high,
                   std::span<float> values)
{
    const SquareWindow::Affine picture_from_window = window.picture_from_window(size);
    const float gain = (high - low) / 255.0f;
    const std::ptrdiff_t row_stride = static_cast<std::ptrdiff_t>(picture.width) * 3;
    float* to = values.data();
    for (int i = 0; i < size; ++i) {
        for (int j = 0; j < size; ++j, to += 3) {
            const Eigen::Vector2d point = picture_from_window({j + 0.5, i + 0.5});
            const double x = point.x() - 0.5;
            const double y = point.y() - 0.5;
            if (x >= 0.0 && y >= 0.0 && x < picture.width - 1 && y < picture.height - 1) {
                const int column = static_cast<int>(x);
                const int row = static_cast<int>(y);
                const float a = static_cast<float>(x - column);
                const float b = static_cast<float>(y - row);
                const std::uint8_t* upper = picture.pixel(column, row);
                const std::uint8_t* lower = upper + row_stride;
                for (int channel = 0; channel < 3; ++channel) {
                    const auto value = [channel](const std::uint8_t* p) { return static_cast<float>(p[channel]); };
                    to[channel] = (1 - b) * ((1 - a) * value(upper) + a * value(upper + 3)) +
                                  b * ((1 - a) * value(lower) + a * value(lower + 3));
                }
            } else {
                sample_at_border(picture, x, y, border, to);
            }
            for (int channel = 0; channel < 3; ++channel) {
                to[channel] = low + gain * to[channel];
            }
        }
    }
}

} // namespace lineament
