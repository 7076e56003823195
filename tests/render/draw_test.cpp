// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/render/contact_sheet.hpp"
#include "lineament/render/draw.hpp"
#include "lineament/render/font.hpp"

#include "lineament/core/random.hpp"

#include "support/matchers.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <set>

namespace lineament {
namespace {

using test::throws;

constexpr Color white = {255, 255, 255};

/// Sum of the ink of white shapes on black, in pixels.
double ink(const ImageU8& image)
{
    double sum = 0.0;
    for (const std::uint8_t value : image.data) {
        sum += value / 255.0;
    }
    return sum / image.channels;
}

TEST(Draw, DiscCircleAndLineHaveTheirAnalyticArea)
{
    const double pi = std::numbers::pi;
    Random random(51);
    for (int i = 0; i < 20; ++i) {
        const Eigen::Vector2d center{50 + random.uniform(-1, 1), 50 + random.uniform(-1, 1)};
        ImageU8 disc(100, 100, 1);
        draw_disc(disc, center, 20.3, white);
        EXPECT_NEAR(ink(disc), pi * 20.3 * 20.3, 0.01 * pi * 20.3 * 20.3);
        ImageU8 circle(100, 100, 1);
        draw_circle(circle, center, 30, white, 3);
        EXPECT_NEAR(ink(circle), 2 * pi * 30 * 3, 0.02 * 2 * pi * 30 * 3);
        ImageU8 line(100, 100, 1);
        const double angle = random.uniform(0, 2 * pi);
        const Eigen::Vector2d half(30 * std::cos(angle), 30 * std::sin(angle));
        draw_line(line, center - half, center + half, white, 4);
        EXPECT_NEAR(ink(line), 60 * 4 + pi * 4, 0.03 * (60 * 4 + pi * 4));
    }
}

TEST(Draw, RectangleOutlineLiesOnItsEdges)
{
    ImageU8 image(20, 20, 1);
    draw_rectangle(image, {15.5, 12.5}, {4.5, 5.5}, white); // corners in any order
    EXPECT_EQ(image.at(4, 8), 255);
    EXPECT_EQ(image.at(15, 12), 255);
    EXPECT_EQ(image.at(9, 5), 255);
    EXPECT_EQ(image.at(9, 8), 0);
    EXPECT_EQ(image.at(3, 8), 0);
    EXPECT_NEAR(ink(image), 2 * (11 + 7), 1e-9);
}

TEST(Draw, FilledRectangleIsClipped)
{
    ImageU8 image(10, 8, 3);
    fill_rectangle(image, 7, 6, 100, 100, white);
    EXPECT_DOUBLE_EQ(ink(image), 6.0);
    fill_rectangle(image, -5, -5, 2147483647, 6, white);
    EXPECT_DOUBLE_EQ(ink(image), 16.0);
    fill_rectangle(image, 2, 2, -3, 4, white);
    EXPECT_DOUBLE_EQ(ink(image), 16.0);
}

TEST(Draw, ShapesThatAreNotFiniteOrFarAwayDrawNothing)
{
    const ImageU8 black(16, 16, 3);
    ImageU8 image = black;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const double inf = std::numeric_limits<double>::infinity();
    draw_line(image, {nan, 1}, {5, 5}, white);
    draw_line(image, {1, 1}, {inf, 5}, white);
    draw_line(image, {1, 1}, {5, 5}, white, 0);
    draw_line(image, {1, 1}, {5, 5}, white, inf);
    draw_disc(image, {8, nan}, 3, white);
    draw_disc(image, {8, 8}, -3, white);
    draw_disc(image, {1e300, -1e300}, 3, white);
    draw_circle(image, {8, 8}, nan, white);
    draw_rectangle(image, {nan, 2}, {4, 5}, white);
    draw_text(image, 1000, 1000, "far", white);
    blend_pixel(image, -1, 3, white);
    blend_pixel(image, 3, 16, white);
    EXPECT_EQ(image, black);
    ImageU8 none;
    draw_line(none, {1, 1}, {5, 5}, white);
    EXPECT_TRUE(none.empty());
}

TEST(Draw, LineAlongPixelCentersIsExact)
{
    ImageU8 image(12, 5, 1);
    draw_line(image, {2.5, 2.5}, {8.5, 2.5}, white);
    for (int column = 0; column < 12; ++column) {
        EXPECT_EQ(image.at(column, 2), column >= 2 && column <= 8 ? 255 : 0);
        EXPECT_EQ(image.at(column, 1), 0);
    }
}

TEST(BlendPixel, FollowsTheOverOperator)
{
    ImageU8 rgb(1, 1, 3, 100);
    blend_pixel(rgb, 0, 0, {200, 0, 100, 128}, 0.5f);
    EXPECT_NEAR(rgb.at(0, 0, 0), 100 + 100 * 0.251, 0.51);
    EXPECT_NEAR(rgb.at(0, 0, 1), 100 - 100 * 0.251, 0.51);
    ImageU8 rgba(1, 1, 4, 0); // nothing below: the colour itself with its own alpha
    blend_pixel(rgba, 0, 0, {10, 20, 30, 51});
    EXPECT_EQ(rgba.at(0, 0, 0), 10);
    EXPECT_EQ(rgba.at(0, 0, 2), 30);
    EXPECT_EQ(rgba.at(0, 0, 3), 51);
    blend_pixel(rgba, 0, 0, {250, 20, 30});
    EXPECT_EQ(rgba.at(0, 0, 0), 250);
    EXPECT_EQ(rgba.at(0, 0, 3), 255);
}

TEST(Font, EveryLetterDiffersAndOnlyTheSpaceIsBlank)
{
    std::set<std::string> shapes;
    for (char letter = ' '; letter <= '~'; ++letter) {
        std::string shape;
        for (int row = 0; row < glyph_height; ++row) {
            for (int column = 0; column < glyph_width; ++column) {
                shape += is_glyph_pixel(letter, column, row) ? '#' : '.';
            }
        }
        EXPECT_EQ(shape.find('#') == std::string::npos, letter == ' ') << letter;
        EXPECT_TRUE(shapes.insert(shape).second) << letter;
    }
    for (int row = 0; row < glyph_height; ++row) {
        for (int column = 0; column < glyph_width; ++column) {
            EXPECT_EQ(is_glyph_pixel('\xe4', column, row), is_glyph_pixel('?', column, row));
            EXPECT_EQ(is_glyph_pixel('\x07', column, row), is_glyph_pixel('?', column, row));
        }
    }
}

TEST(DrawText, FillsTheSizeItAnnounces)
{
    EXPECT_EQ(text_width_px("abc", 2), 34);
    EXPECT_EQ(text_width_px("a\nabcd"), 23);
    EXPECT_EQ(text_height_px("a\nabcd", 3), 60);
    EXPECT_EQ(text_width_px(""), 0);
    EXPECT_EQ(text_height_px(""), 0);
    ImageU8 image(60, 30, 1);
    draw_text(image, 4, 3, "H_\nH", white, 2);
    int last_column = 0;
    int last_row = 0;
    for (int row = 0; row < 30; ++row) {
        for (int column = 0; column < 60; ++column) {
            if (image.at(column, row) > 0) {
                last_column = std::max(last_column, column);
                last_row = std::max(last_row, row);
                EXPECT_GE(column, 4);
                EXPECT_GE(row, 3);
            }
        }
    }
    EXPECT_EQ(last_column, 4 + text_width_px("H_", 2) - 1);
    EXPECT_EQ(last_row, 29); // cut by the picture
}

TEST(Resize, SameSizeIsTheSamePicture)
{
    Random random(52);
    for (const int channels : {1, 3}) {
        ImageU8 picture(13, 9, channels);
        for (std::uint8_t& value : picture.data) {
            value = static_cast<std::uint8_t>(random.index(256));
        }
        EXPECT_EQ(resize(picture, 13, 9), picture);
    }
}

TEST(Resize, ShrinkingAveragesAreas)
{
    ImageU8 picture(4, 2, 1);
    picture.data = {0, 100, 200, 40, 20, 40, 60, 80};
    const ImageU8 half = resize(picture, 2, 1);
    EXPECT_EQ(half.at(0, 0), 40);
    EXPECT_EQ(half.at(1, 0), 95);
    ImageU8 three(3, 1, 1);
    three.data = {30, 90, 150};
    const ImageU8 two = resize(three, 2, 1); // areas 1 + 1/2 and 1/2 + 1
    EXPECT_EQ(two.at(0, 0), 50);
    EXPECT_EQ(two.at(1, 0), 130);
}

TEST(Resize, GrowingInterpolatesBetweenPixelCenters)
{
    ImageU8 picture(2, 1, 1);
    picture.data = {0, 200};
    const ImageU8 grown = resize(picture, 4, 3);
    for (int row = 0; row < 3; ++row) {
        EXPECT_EQ(grown.at(0, row), 0);
        EXPECT_EQ(grown.at(1, row), 50);
        EXPECT_EQ(grown.at(2, row), 150);
        EXPECT_EQ(grown.at(3, row), 200);
    }
    EXPECT_EQ(resize(ImageU8(1, 1, 3, 9), 5, 7), ImageU8(5, 7, 3, 9));
}

TEST(Resize, InvisibleColorsDoNotBleed)
{
    ImageU8 picture(2, 1, 4);
    picture.data = {200, 100, 50, 255, 0, 0, 0, 0};
    const ImageU8 one = resize(picture, 1, 1);
    EXPECT_EQ(one.data, (std::vector<std::uint8_t>{200, 100, 50, 128}));
}

TEST(Resize, RefusesBrokenContracts)
{
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)resize(ImageU8(2, 2, 3), -1, 2); }, "width"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)resize(ImageU8(0, 2, 3), 1, 2); }, "picture"));
    EXPECT_TRUE(resize(ImageU8(2, 2, 3), 0, 2).empty());
}

TEST(ContactSheet, PutsEachPictureInItsTileUndistorted)
{
    const std::vector<Tile> tiles = {{ImageU8(40, 20, 3, 10), "one"}, {ImageU8(20, 40, 1, 20), "two"}, {{}, ""}};
    const ContactSheetOptions options{.tile_width_px = 20, .tile_height_px = 20, .gap_px = 4, .text_scale = 1};
    const ImageU8 sheet = contact_sheet(tiles, 2, options);
    EXPECT_EQ(sheet.width, 4 + 2 * 24);
    EXPECT_EQ(sheet.height, 4 + 2 * (20 + 12 + 4));
    EXPECT_EQ(sheet.at(14, 14, 0), 10); // the wide picture fills its tile's width
    EXPECT_EQ(sheet.at(4, 14, 2), 10);
    EXPECT_EQ(sheet.at(14, 6, 0), 255); // and half of its height
    EXPECT_EQ(sheet.at(38, 4, 1), 20);  // the tall one the other way
    EXPECT_EQ(sheet.at(30, 14, 0), 255);
    int num_text = 0;
    for (int row = 24; row < 36; ++row) {
        for (int column = 4; column < 24; ++column) {
            num_text += sheet.at(column, row, 0) == 40 ? 1 : 0;
        }
    }
    EXPECT_GT(num_text, 20);
}

TEST(ContactSheet, RefusesBrokenContracts)
{
    const std::vector<Tile> tiles(3);
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)contact_sheet(tiles, 0); }, "columns"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)contact_sheet(tiles, 1, {.gap_px = -1}); }, "gap_px"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)contact_sheet(tiles, 1, {.tile_width_px = 0}); }, "tile_width_px"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)contact_sheet(std::vector<Tile>(1000), 1); }, "tiles"));
    EXPECT_TRUE(contact_sheet({}, 3).empty());
}

} // namespace
} // namespace lineament
