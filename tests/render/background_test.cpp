// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/render/background.hpp"

#include "lineament/render/shading.hpp"
#include "lineament/render/texture.hpp"

#include "support/matchers.hpp"
#include "test_meshes.hpp"

#include <array>
#include <cmath>
#include <random>

namespace lineament {
namespace {

using test::centered_camera;
using test::make_sphere;
using test::throws;

using Rgb = std::array<float, 3>;
constexpr Rgb skin = {200, 150, 125};
constexpr Rgb blue = {60, 110, 220};

/// A disc of skin, 60 mm in radius, in front of a background; the mesh is said to cover a disc of 72 mm.
class WideDisc : public ::testing::Test
{
protected:
    static constexpr int side = 100;
    static constexpr double cell_mm = 2.0;

    static double radius_mm(int column, int row)
    {
        return cell_mm * std::hypot(column + 0.5 - side / 2, row + 0.5 - side / 2);
    }

    ImageF probability(const Rgb& background, const BackgroundOptions& options = {}) const
    {
        Image<std::uint8_t> covered(side, side, 1);
        ImageF colors(side, side, 3);
        std::mt19937 generator(7);
        std::normal_distribution<float> noise(0.0F, 6.0F);
        for (int row = 0; row < side; ++row) {
            for (int column = 0; column < side; ++column) {
                const double radius = radius_mm(column, row);
                covered.at(column, row) = radius < 72 ? 1 : 0;
                for (int channel = 0; channel < 3; ++channel) {
                    const auto c = static_cast<std::size_t>(channel);
                    colors.at(column, row, channel) = (radius < 60 ? skin[c] : background[c]) + noise(generator);
                }
            }
        }
        return foreground_probability(covered, colors, in_picture, cell_mm, options);
    }

    Image<std::uint8_t> in_picture = Image<std::uint8_t>(side, side, 1, 1);
};

TEST_F(WideDisc, ShowsItsBackgroundOutsideOfTheHead)
{
    const ImageF foreground = probability(blue);
    for (int row = 0; row < side; ++row) {
        for (int column = 0; column < side; ++column) {
            const double radius = radius_mm(column, row);
            const bool is_background = foreground.at(column, row) < 0.5F;
            EXPECT_EQ(is_background, radius >= 60 && radius < 72) << column << ' ' << row;
        }
    }
}

TEST_F(WideDisc, LosesNothingBeforeABackgroundOfItsOwnColor)
{
    const ImageF foreground = probability(skin);
    int num_lost = 0;
    for (const float p : foreground.data) {
        num_lost += p < 0.5F ? 1 : 0;
    }
    EXPECT_LE(num_lost, side * side / 500); // where the noise of the two differs by chance
}

TEST_F(WideDisc, HasNothingToCompareWithAtTheEdgeOfThePicture)
{
    for (int row = 0; row < side; ++row) {
        for (int column = 0; column < side; ++column) {
            in_picture.at(column, row) = radius_mm(column, row) < 72 ? 1 : 0;
        }
    }
    const ImageF foreground = probability(blue);
    EXPECT_EQ(*std::min_element(foreground.data.begin(), foreground.data.end()), 1.0F);
}

TEST_F(WideDisc, BadOptionsAreNamed)
{
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)probability(blue, {.strip_mm = 1.0}); }, "strip_mm"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)probability(blue, {.prior_inside = -1.0}); }, "prior_inside"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)probability(blue, {.color_noise = 0.0}); }, "color_noise"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)foreground_probability({}, {}, {}, 0.0); }, "cell_mm"));
    in_picture = Image<std::uint8_t>(side, side - 1, 1, 1);
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)probability(blue); }, "in_picture.height"));
}

/// Of the texture of a sphere fitted 9 mm too large: texels with a weight, and those of them that are blue.
struct Texels
{
    int seen = 0;
    int blue = 0;
};

Texels count_texels(double size_of_fit, float vertex_skin, double resolution)
{
    const Mesh sphere = make_sphere(80);
    const ImageU8 texture(8, 8, 3, 200);
    const int side_px = static_cast<int>(200 * resolution);
    const Camera camera = centered_camera(side_px, side_px, resolution);
    const ImageU8 picture = render_mesh(sphere, texture, camera, side_px, side_px, {.background = {0, 0, 250}});
    Mesh fit = sphere;
    fit.vertices *= static_cast<float>(size_of_fit);
    TextureOptions options;
    options.vertex_skin = Eigen::VectorXf::Constant(fit.vertices.cols(), vertex_skin);
    const TextureMap map =
        extract_texture(TextureLayout(fit, 256), fit.vertices, fit.triangles, camera, picture, options);
    Texels texels;
    for (std::size_t i = 0; i < map.weight.data.size(); ++i) {
        const bool is_seen = map.weight.data[i] > 0;
        texels.seen += is_seen ? 1 : 0;
        texels.blue += is_seen && map.color.data[3 * i + 2] > map.color.data[3 * i] + 20 ? 1 : 0;
    }
    return texels;
}

TEST(ExtractTexture, BackgroundStaysOutOfAFitThatIsTooWide)
{
    for (const double resolution : {0.5, 1.0, 4.0}) {
        const Texels questioned = count_texels(1.12, 1.0F, resolution);
        const Texels unquestioned = count_texels(1.12, 0.0F, resolution);
        EXPECT_GT(unquestioned.blue, 1000) << resolution;
        EXPECT_LE(questioned.blue, unquestioned.blue / 50) << resolution;
        EXPECT_GE(questioned.seen, 0.9 * (unquestioned.seen - unquestioned.blue)) << resolution;
    }
}

TEST(ExtractTexture, AGoodFitLosesNothingToTheBackground)
{
    EXPECT_GE(count_texels(1.0, 1.0F, 2.0).seen, 0.995 * count_texels(1.0, 0.0F, 2.0).seen);
}

TEST(ForegroundTest, TakesGreyAndTransparentPictures)
{
    const Mesh sphere = make_sphere(90); // in the picture it is one of 80
    const Camera camera = centered_camera(200, 200, 1.0);
    ImageU8 grey(200, 200, 1);
    ImageU8 rgba(200, 200, 4, 255);
    for (int row = 0; row < 200; ++row) {
        for (int column = 0; column < 200; ++column) {
            const std::uint8_t value = std::hypot(column - 99.5, row - 99.5) < 80 ? 190 : 30;
            grey.at(column, row) = value;
            std::fill_n(rgba.pixel(column, row), 3, value);
        }
    }
    for (const ImageU8& picture : {grey, rgba}) {
        const ForegroundTest test(sphere.vertices, sphere.triangles, camera, picture);
        EXPECT_LT(test({100.0 + 85.0, 100.0}), 0.01F) << picture.channels;
        EXPECT_GT(test({100.0 + 75.0, 100.0}), 0.99F) << picture.channels;
    }
}

TEST(ForegroundTest, BadSkinIsNamed)
{
    const Mesh sphere = make_sphere(80);
    const auto extract = [&](const Eigen::VectorXf& skin) {
        TextureOptions options;
        options.vertex_skin = skin;
        (void)extract_texture(TextureLayout(sphere, 16), sphere.vertices, sphere.triangles,
                              centered_camera(50, 50, 0.2), ImageU8(50, 50, 3), options);
    };
    EXPECT_TRUE(throws<InvalidArgument>([&] { extract(Eigen::VectorXf::Zero(3)); }, "vertex_skin"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { extract(Eigen::VectorXf::Constant(sphere.vertices.cols(), 2.0F)); },
                                        "vertex_skin"));
}

TEST(ForegroundTest, OfAMeshBesideThePictureIsOneEverywhere)
{
    const Mesh sphere = make_sphere(80);
    Camera camera = centered_camera(50, 50, 1.0);
    camera.principal_point_px.x() = 5000;
    const ForegroundTest test(sphere.vertices, sphere.triangles, camera, ImageU8(50, 50, 3));
    EXPECT_EQ(test({25.0, 25.0}), 1.0F);
    EXPECT_EQ(ForegroundTest(sphere.vertices, sphere.triangles, Camera(), ImageU8())({0.0, 0.0}), 1.0F);
}

} // namespace
} // namespace lineament
