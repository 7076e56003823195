// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/render/texture_completion.hpp"

#include "lineament/core/random.hpp"

#include "support/matchers.hpp"

#include <cmath>

namespace lineament {
namespace {

using test::throws;

TextureMap make_map(int size)
{
    return {ImageU8(size, size, 3), ImageF(size, size, 1), Image<std::uint8_t>(size, size, 1)};
}

TexelOrigin origin_of(const CompletedTexture& texture, int column, int row)
{
    return static_cast<TexelOrigin>(texture.origin.at(column, row));
}

TEST(Diffuse, KeepsWhatIsKnownAndStaysWithinItsRange)
{
    Random random(31);
    ImageF values(37, 23, 2);
    ImageF weights(37, 23, 1);
    for (int row = 0; row < 23; ++row) {
        for (int column = 0; column < 37; ++column) {
            weights.at(column, row) = random.uniform() < 0.1 ? 1.0f : 0.0f;
            values.at(column, row, 0) = static_cast<float>(random.uniform(3, 5));
            values.at(column, row, 1) = NAN; // not looked at where unknown
            if (weights.at(column, row) > 0) {
                values.at(column, row, 1) = 7.0f;
            }
        }
    }
    const ImageF filled = diffuse(values, weights);
    for (int row = 0; row < 23; ++row) {
        for (int column = 0; column < 37; ++column) {
            if (weights.at(column, row) > 0) {
                EXPECT_EQ(filled.at(column, row, 0), values.at(column, row, 0));
            }
            EXPECT_TRUE(filled.at(column, row, 0) >= 3.0f && filled.at(column, row, 0) <= 5.0f);
            EXPECT_NEAR(filled.at(column, row, 1), 7.0f, 1e-5); // a constant spreads as itself
        }
    }
}

TEST(Diffuse, WithoutAnyWeightIsZero)
{
    const ImageF filled = diffuse(ImageF(5, 3, 1, 4.0f), ImageF(5, 3, 1, 0.0f));
    EXPECT_EQ(filled, ImageF(5, 3, 1, 0.0f));
    EXPECT_TRUE(diffuse(ImageF(), ImageF(0, 0, 1)).empty());
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)diffuse(ImageF(5, 3, 1), ImageF(4, 3, 1)); }, "weights"));
}

TEST(CompleteTexture, SeenTexelsStayAndHolesTakeTheMirroredSide)
{
    // A symmetric pattern of which the right half, except a strip, is hidden.
    TextureMap map = make_map(64);
    for (int row = 0; row < 64; ++row) {
        for (int column = 0; column < 64; ++column) {
            const int from_middle = std::min(column, 63 - column);
            map.weight.at(column, row) = column < 40 ? 1.0f : 0.0f;
            for (int channel = 0; channel < 3; ++channel) {
                map.color.at(column, row, channel) =
                    column < 40 ? static_cast<std::uint8_t>(100 + 3 * from_middle + row % 7) : std::uint8_t{0};
            }
        }
    }
    const CompletedTexture completed = complete_texture(map);
    for (int row = 0; row < 64; ++row) {
        for (int column = 0; column < 64; ++column) {
            EXPECT_EQ(origin_of(completed, column, row), column < 40 ? TexelOrigin::seen : TexelOrigin::mirrored);
            EXPECT_EQ(completed.color.at(column, row, 1), 100 + 3 * std::min(column, 63 - column) + row % 7);
        }
    }
}

TEST(CompleteTexture, MirroredSideIsShiftedToTheLightOfItsOwnSide)
{
    // The right side is 30 levels brighter; what is copied there must become so too.
    TextureMap map = make_map(32);
    for (int row = 0; row < 32; ++row) {
        for (int column = 0; column < 32; ++column) {
            map.weight.at(column, row) = column < 24 ? 1.0f : 0.0f;
            for (int channel = 0; channel < 3; ++channel) {
                map.color.at(column, row, channel) = column < 16 ? 100 : 130;
            }
        }
    }
    const CompletedTexture completed = complete_texture(map);
    EXPECT_EQ(origin_of(completed, 28, 16), TexelOrigin::mirrored);
    EXPECT_NEAR(completed.color.at(25, 16, 0), 130, 8);
}

TEST(CompleteTexture, WithoutMirroringHolesAreDiffused)
{
    TextureMap map = make_map(16);
    map.weight.at(2, 2) = 1.0f;
    map.color.at(2, 2, 0) = 90;
    const CompletedTexture completed = complete_texture(map, {.mirroring = Mirroring::none});
    EXPECT_EQ(origin_of(completed, 13, 2), TexelOrigin::diffused);
    EXPECT_EQ(origin_of(completed, 2, 2), TexelOrigin::seen);
    EXPECT_EQ(completed.color.at(13, 2, 0), 90);
    EXPECT_EQ(origin_of(complete_texture(map), 13, 2), TexelOrigin::mirrored);
}

TEST(CompleteTexture, BadlySeenTexelsAreReplaced)
{
    TextureMap map = make_map(16);
    std::fill(map.weight.data.begin(), map.weight.data.end(), 1.0f);
    std::fill(map.color.data.begin(), map.color.data.end(), std::uint8_t{60});
    map.weight.at(5, 5) = 0.05f;
    map.color.at(5, 5, 0) = 255;
    EXPECT_EQ(complete_texture(map).color.at(5, 5, 0), 60);
    EXPECT_EQ(origin_of(complete_texture(map), 5, 5), TexelOrigin::mirrored);
    EXPECT_EQ(complete_texture(map, {.min_relative_weight = 0}).color.at(5, 5, 0), 255);
}

TEST(CompleteTexture, OnlyTheRatioOfWeightsCounts)
{
    // A small face seen by few pixels, and many frames fused: the same texture, whatever the weights add up to.
    Random random(32);
    TextureMap map = make_map(32);
    for (std::size_t i = 0; i < map.weight.data.size(); ++i) {
        map.weight.data[i] = static_cast<float>(std::max(0.0, random.uniform(-0.3, 1)));
        map.color.data[3 * i] = static_cast<std::uint8_t>(random.index(256));
    }
    const CompletedTexture completed = complete_texture(map);
    EXPECT_GT(std::count(completed.origin.data.begin(), completed.origin.data.end(), 0), 500);
    for (const float factor : {1.0f / 1024, 256.0f}) {
        TextureMap scaled = map;
        for (float& weight : scaled.weight.data) {
            weight *= factor;
        }
        EXPECT_EQ(complete_texture(scaled).color, completed.color);
        EXPECT_EQ(complete_texture(scaled).origin, completed.origin);
    }
}

TEST(CompleteTexture, NothingSeenBecomesMidGrey)
{
    const CompletedTexture completed = complete_texture(make_map(8));
    EXPECT_EQ(completed.color, ImageU8(8, 8, 3, 128));
    EXPECT_EQ(origin_of(completed, 1, 1), TexelOrigin::diffused);
    EXPECT_TRUE(complete_texture(TextureMap{}).color.empty());
}

TEST(CompleteTexture, RefusesBrokenContracts)
{
    TextureMap map = make_map(8);
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)complete_texture(map, {.min_relative_weight = NAN}); },
                                        "min_relative_weight"));
    map.weight = ImageF(7, 8, 1);
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)complete_texture(map); }, "map.weight"));
    map = make_map(8);
    map.color = ImageU8(8, 8, 4);
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)complete_texture(map); }, "map.color"));
}

} // namespace
} // namespace lineament
