// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "square_window.hpp"

#include "support/matchers.hpp"

#include <cmath>

namespace lineament {
namespace {

/// Red: the column, green: the row, blue: 200 less the column.
ImageU8 gradient(int width, int height)
{
    ImageU8 picture(width, height, 3);
    for (int row = 0; row < height; ++row) {
        for (int column = 0; column < width; ++column) {
            picture.at(column, row, 0) = static_cast<std::uint8_t>(column);
            picture.at(column, row, 1) = static_cast<std::uint8_t>(row);
            picture.at(column, row, 2) = static_cast<std::uint8_t>(200 - column);
        }
    }
    return picture;
}

TEST(SampleWindow, OfATurnedWindowGivesTheGradientsValuesAtItsPoints)
{
    const ImageU8 picture = gradient(200, 160);
    constexpr int size = 16;
    constexpr double degree = 0.017453292519943295;
    for (const double angle : {0.0, 30 * degree, -77 * degree, 180 * degree}) {
        std::vector<float> values(3 * size * size);
        sample_window(picture, {.center = {90, 80}, .side = 64, .angle = angle}, size, Border::black, 0.0f, 255.0f,
                      values);
        for (int i = 0; i < size; ++i) {
            for (int j = 0; j < size; ++j) {
                // 4 px of the picture for each of the window, from its middle; pixel centres are at +0.5.
                const double u = 4.0 * (j + 0.5 - 8.0);
                const double v = 4.0 * (i + 0.5 - 8.0);
                const double x = 90.0 + u * std::cos(angle) - v * std::sin(angle) - 0.5;
                const double y = 80.0 + u * std::sin(angle) + v * std::cos(angle) - 0.5;
                const float* const value = &values[static_cast<std::size_t>(3 * (i * size + j))];
                EXPECT_NEAR(static_cast<double>(value[0]), x, 1e-3) << i << ", " << j << " angle " << angle;
                EXPECT_NEAR(static_cast<double>(value[1]), y, 1e-3) << i << ", " << j << " angle " << angle;
                EXPECT_NEAR(static_cast<double>(value[2]), 200.0 - x, 1e-3) << i << ", " << j << " angle " << angle;
            }
        }
    }
}

TEST(SampleWindow, AroundAWidePictureIsTheWholePictureBetweenBlackBars)
{
    const ImageU8 picture(90, 30, 3, 255);
    constexpr int size = 9;
    std::vector<float> values(3 * size * size);
    sample_window(picture, window_around(picture), size, Border::black, -1.0f, 1.0f, values);
    for (int i = 0; i < size; ++i) {
        for (int j = 0; j < size; ++j) {
            const float expected = i >= 3 && i < 6 ? 1.0f : -1.0f;
            EXPECT_NEAR(values[static_cast<std::size_t>(3 * (i * size + j))], expected, 1e-6f) << i << ", " << j;
        }
    }
}

TEST(SampleWindow, BeyondTheBorderIsBlackOrTheOutermostPixel)
{
    const ImageU8 picture = gradient(40, 20);
    // One value in the middle of each window: left of the picture, on its outer edge, below its right corner.
    const auto value = [&](double x, double y, Border border, std::size_t channel) {
        std::vector<float> values(3);
        sample_window(picture, {.center = {x, y}, .side = 1}, 1, border, 0.0f, 255.0f, values);
        return static_cast<double>(values[channel]);
    };
    EXPECT_EQ(value(-30, 10.5, Border::black, 2), 0.0);
    EXPECT_EQ(value(-30, 10.5, Border::repeated, 2), 200.0);
    EXPECT_EQ(value(-30, 10.5, Border::repeated, 1), 10.0);
    EXPECT_EQ(value(0.0, 10.5, Border::black, 2), 100.0); // half a pixel of 200, half of nothing
    EXPECT_EQ(value(0.0, 10.5, Border::repeated, 2), 200.0);
    EXPECT_EQ(value(1000, 1000, Border::repeated, 0), 39.0);
    EXPECT_EQ(value(1000, 1000, Border::repeated, 1), 19.0);
    EXPECT_EQ(value(1000, 1000, Border::black, 0), 0.0);
}

} // namespace
} // namespace lineament
