// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/render/color_scale.hpp"
#include "lineament/render/shading.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <limits>

namespace lineament {
namespace {

using test::throws;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(ColorScale, NumbersOutsideGetTheNearerEnd)
{
    EXPECT_EQ(scale_color(-3), scale_color(0));
    EXPECT_EQ(scale_color(1.5), scale_color(1));
    EXPECT_NE(scale_color(0), scale_color(1));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)scale_color(nan); }, "finite"));
}

TEST(ColorScale, GetsAlwaysBrighter)
{
    double before = -1;
    for (int i = 0; i <= 100; ++i) {
        const double light =
            linear_rgb(scale_color(i / 100.0)).cast<double>().dot(Eigen::Vector3d(0.2126, 0.7152, 0.0722));
        EXPECT_GT(light, before) << i;
        before = light;
    }
}

TEST(ColorScale, ColorsOfValuesAreThoseOfTheirShare)
{
    const Eigen::Matrix3Xf colors = scale_colors(Eigen::Vector3f(0, 3, 12), 6);
    for (const auto& [column, share] : {std::pair{0, 0.0}, std::pair{1, 0.5}, std::pair{2, 1.0}}) {
        const Color color = scale_color(share);
        EXPECT_EQ(to_u8(colors(0, column)), color.red);
        EXPECT_EQ(to_u8(colors(1, column)), color.green);
        EXPECT_EQ(to_u8(colors(2, column)), color.blue);
    }
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)scale_colors(Eigen::Vector2f(0, 1), 0); }, "largest"));
    EXPECT_TRUE(throws<InvalidArgument>(
        [] { (void)scale_colors(Eigen::Vector2f(0, std::numeric_limits<float>::quiet_NaN()), 1); }, "finite"));
}

TEST(ColorScale, BarRunsFromEndToEnd)
{
    const ImageU8 bar = draw_color_bar(8, "mm", 400);
    EXPECT_EQ(bar.width, 400);
    EXPECT_EQ(bar.height, 42);
    const auto color_at = [&](int column) {
        return Color{bar.at(column, 10, 0), bar.at(column, 10, 1), bar.at(column, 10, 2)};
    };
    EXPECT_EQ(color_at(100), scale_color(0));
    EXPECT_EQ(color_at(299), scale_color(1));
    EXPECT_EQ(color_at(99), (Color{255, 255, 255}));
    EXPECT_EQ(color_at(300), (Color{255, 255, 255}));
    EXPECT_EQ(color_at(200), scale_color(100.0 / 199));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)draw_color_bar(nan, "mm", 400); }, "largest"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)draw_color_bar(8, "mm", 3); }, "width"));
}

TEST(ColorBar, StandsBelowAPicture)
{
    const ImageU8 bar = draw_color_bar(8, "mm", 400);
    const ImageU8 both = add_color_bar(ImageU8(400, 30, 3, 77), 8, "mm");
    ASSERT_EQ(both.height, 30 + bar.height);
    EXPECT_EQ(both.at(399, 29, 2), 77);
    for (int row = 0; row < bar.height; ++row) {
        EXPECT_TRUE(std::equal(bar.pixel(0, row), bar.pixel(0, row) + 3 * 400, both.pixel(0, 30 + row))) << row;
    }
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)add_color_bar(ImageU8(400, 30, 1), 8, "mm"); }, "channels"));
}

TEST(ColorScale, RenderedValuesKeepTheirHueUnderTheShading)
{
    const MorphableModel model = test::make_synthetic_face();
    const Mesh mesh = model.mesh_of(model.shape.mean);
    const Camera camera = frame_camera(mesh, {}, 120, 120);
    for (const double share : {0.0, 0.4, 1.0}) {
        const Eigen::VectorXf values = Eigen::VectorXf::Constant(model.num_vertices(), static_cast<float>(5 * share));
        const ImageU8 picture = render_values(mesh, values, 5, camera, 120, 120);
        const Color color = scale_color(share);
        const std::uint8_t* const middle = picture.pixel(60, 60);
        const double light = middle[1] / static_cast<double>(color.green);
        EXPECT_GE(light, 0.44);
        EXPECT_LE(light, 1.01);
        EXPECT_NEAR(middle[0], light * color.red, 2.5);
        EXPECT_NEAR(middle[2], light * color.blue, 2.5);
        EXPECT_EQ(picture.at(1, 1, 0), 255);
    }
    EXPECT_TRUE(throws<InvalidArgument>(
        [&] { (void)render_values(mesh, Eigen::VectorXf::Zero(3), 5, camera, 120, 120); }, "values"));
}

} // namespace
} // namespace lineament
