// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/core/image.hpp"

#include "lineament/core/random.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace lineament {
namespace {

TEST(Rounded, AgreesWithTheLibrarysRounding)
{
    for (int i = 0; i < 300; ++i) {
        const float half = static_cast<float>(i) + 0.5f;
        for (const float value :
             {static_cast<float>(i), half, std::nextafter(half, 0.0f), std::nextafter(half, 1e9f)}) {
            EXPECT_EQ(rounded(value), std::lround(value)) << value;
        }
    }
    for (const float value : {0.0f, std::numeric_limits<float>::denorm_min(), 1e-20f, 8388607.5f, 16777216.0f}) {
        EXPECT_EQ(rounded(value), std::lround(value)) << value;
    }
}

TEST(SampleBilinear, IsAPlaneBetweenPixelCentresAndTheBorderBeyond)
{
    ImageF image(5, 4, 2);
    for (int row = 0; row < image.height; ++row) {
        for (int column = 0; column < image.width; ++column) {
            image.at(column, row, 0) = static_cast<float>(3 * column - 2 * row);
            image.at(column, row, 1) = static_cast<float>(7 * row);
        }
    }
    Random random(3);
    for (int i = 0; i < 500; ++i) {
        const auto x = static_cast<float>(random.uniform(-2.0, 7.0));
        const auto y = static_cast<float>(random.uniform(-2.0, 6.0));
        const float u = std::min(std::max(x - 0.5f, 0.0f), 4.0f);
        const float v = std::min(std::max(y - 0.5f, 0.0f), 3.0f);
        const BilinearSample sample(image, x, y);
        EXPECT_NEAR(sample(0), 3 * u - 2 * v, 1e-5f);
        EXPECT_NEAR(sample(1), 7 * v, 1e-5f);
        EXPECT_EQ(sample_bilinear(image, x, y, 1), sample(1));
    }
}

} // namespace
} // namespace lineament
