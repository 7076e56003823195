// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/render/texture_fusion.hpp"

#include "lineament/core/random.hpp"

#include "support/matchers.hpp"

#include <cmath>

namespace lineament {
namespace {

using test::throws;

TextureMap random_map(Random& random, int size)
{
    TextureMap map{ImageU8(size, size, 3), ImageF(size, size, 1),
                   Image<std::uint8_t>(size, size, 1, static_cast<std::uint8_t>(Visibility::back_facing))};
    for (std::size_t i = 0; i < map.weight.data.size(); ++i) {
        if (random.uniform() < 0.7) {
            map.weight.data[i] = static_cast<float>(random.uniform(0.01, 1));
            map.visibility.data[i] = static_cast<std::uint8_t>(Visibility::visible);
        }
        for (std::size_t channel = 0; channel < 3; ++channel) {
            map.color.data[3 * i + channel] = static_cast<std::uint8_t>(random.index(256));
        }
    }
    return map;
}

TEST(TextureAccumulator, EqualsTheWeightedMeanOfAllFrames)
{
    Random random(41);
    constexpr int size = 16;
    TextureAccumulator accumulator(size, {.match_exposure = false});
    std::vector<double> weighted(3 * size * size);
    std::vector<double> weights(size * size);
    for (int frame = 0; frame < 50; ++frame) {
        const TextureMap map = random_map(random, size);
        const double frame_weight = random.uniform(0, 3);
        accumulator.add(map, frame_weight);
        for (std::size_t i = 0; i < weights.size(); ++i) {
            weights[i] += frame_weight * map.weight.data[i];
            for (std::size_t channel = 0; channel < 3; ++channel) {
                weighted[3 * i + channel] += frame_weight * map.weight.data[i] * map.color.data[3 * i + channel];
            }
        }
    }
    const TextureMap mean = accumulator.texture();
    EXPECT_EQ(accumulator.num_frames(), 50);
    for (std::size_t i = 0; i < weights.size(); ++i) {
        EXPECT_NEAR(mean.weight.data[i], weights[i], 1e-5 * weights[i]);
        for (std::size_t channel = 0; channel < 3; ++channel) {
            EXPECT_NEAR(mean.color.data[3 * i + channel], weighted[3 * i + channel] / weights[i], 0.501);
        }
    }
}

TEST(TextureAccumulator, UndoesGainAndOffsetOfAFrame)
{
    Random random(42);
    TextureMap map = random_map(random, 32);
    for (std::uint8_t& value : map.color.data) {
        value = static_cast<std::uint8_t>(80 + value / 4);
    }
    TextureMap brighter = map;
    for (std::uint8_t& value : brighter.color.data) {
        value = static_cast<std::uint8_t>(std::lround(1.25 * value + 12)); // brighter
    }
    TextureAccumulator accumulator(32);
    const ExposureMatch first = accumulator.add(map);
    EXPECT_EQ(first.num_texels, 0);
    EXPECT_EQ(first.gain, Eigen::Vector3f::Ones());
    const ExposureMatch second = accumulator.add(brighter);
    EXPECT_GT(second.num_texels, 500);
    for (int channel = 0; channel < 3; ++channel) {
        EXPECT_NEAR(second.gain[channel], 1 / 1.25, 2e-3);
        EXPECT_NEAR(second.offset[channel], -12 / 1.25, 0.4);
    }
    const TextureMap fused = accumulator.texture();
    for (std::size_t i = 0; i < map.weight.data.size(); ++i) {
        if (map.weight.data[i] > 0) {
            EXPECT_NEAR(fused.color.data[3 * i], map.color.data[3 * i], 1);
        }
    }
}

TEST(TextureAccumulator, GainIsClampedAndNotGuessedFromFewTexels)
{
    Random random(43);
    const TextureMap map = random_map(random, 32);
    TextureMap faint = map;
    for (std::uint8_t& value : faint.color.data) {
        value = static_cast<std::uint8_t>(value / 8);
    }
    TextureAccumulator clamped(32, {.max_gain = 3.0});
    clamped.add(map);
    EXPECT_FLOAT_EQ(clamped.add(faint).gain[1], 3.0f);
    TextureAccumulator cautious(32, {.min_overlap = 100000});
    cautious.add(map);
    EXPECT_EQ(cautious.add(faint).gain, Eigen::Vector3f::Ones());
    EXPECT_EQ(cautious.add(faint).offset, Eigen::Vector3f::Zero());
}

TEST(TextureAccumulator, KeepsTheBestVisibilityAndIgnoresFramesWithoutWeight)
{
    Random random(44);
    TextureMap map = random_map(random, 8);
    TextureAccumulator accumulator(8);
    EXPECT_EQ(accumulator.texture().visibility.at(0, 0), static_cast<std::uint8_t>(Visibility::unmapped));
    accumulator.add(map, 0.0);
    EXPECT_EQ(accumulator.num_frames(), 0);
    EXPECT_EQ(accumulator.texture().weight, ImageF(8, 8, 1));
    accumulator.add(map);
    EXPECT_EQ(accumulator.texture().visibility, map.visibility);
}

TEST(TextureAccumulator, RefusesBrokenContracts)
{
    Random random(45);
    TextureAccumulator accumulator(8);
    EXPECT_TRUE(throws<InvalidArgument>([&] { accumulator.add(random_map(random, 9)); }, "map.color"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { accumulator.add(random_map(random, 8), NAN); }, "frame_weight"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { accumulator.add(random_map(random, 8), -1.0); }, "frame_weight"));
    TextureMap map = random_map(random, 8);
    map.weight = ImageF(8, 7, 1);
    EXPECT_TRUE(throws<InvalidArgument>([&] { accumulator.add(map); }, "map.weight"));
    EXPECT_TRUE(throws<InvalidArgument>([] { TextureAccumulator(0); }, "size"));
    EXPECT_TRUE(throws<InvalidArgument>([] { TextureAccumulator(8, {.max_gain = 0.5}); }, "max_gain"));
    EXPECT_TRUE(throws<InvalidArgument>([] { TextureAccumulator(8, {.min_overlap = 1}); }, "min_overlap"));
}

TEST(Sharpness, IsTheVarianceOfTheLaplacian)
{
    // A chessboard of 0 and 100: the Laplacian is +-400 everywhere, in equal numbers on an even patch.
    ImageU8 picture(12, 12, 1);
    for (int row = 0; row < 12; ++row) {
        for (int column = 0; column < 12; ++column) {
            picture.at(column, row) = (row + column) % 2 == 0 ? 0 : 100;
        }
    }
    EXPECT_DOUBLE_EQ(sharpness(picture, 2, 2, 10, 10), 160000.0);
    EXPECT_DOUBLE_EQ(sharpness(picture, -50, -50, 50, 50), 160000.0); // clipped to the inner 10 x 10
    EXPECT_EQ(sharpness(picture, 20, 20, 30, 30), 0.0);
    EXPECT_EQ(sharpness(ImageU8(12, 12, 3, 9), 0, 0, 12, 12), 0.0);
    EXPECT_EQ(sharpness(ImageU8(), 0, 0, 12, 12), 0.0);
}

TEST(Sharpness, OfAMapLooksOnlyAtSeenTexels)
{
    TextureMap map{ImageU8(20, 20, 3, 80), ImageF(20, 20, 1, 1.0f), Image<std::uint8_t>(20, 20, 1)};
    map.color.at(10, 10, 1) = 200;
    EXPECT_GT(sharpness(map), 1.0);
    map.weight.at(10, 10) = 0.0f;
    EXPECT_EQ(sharpness(map), 0.0);
    EXPECT_EQ(sharpness(TextureMap{}), 0.0);
}

} // namespace
} // namespace lineament
