// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/core/random.hpp"
#include "lineament/render/shading.hpp"

#include "support/matchers.hpp"
#include "test_meshes.hpp"

#include <algorithm>
#include <cmath>

namespace lineament {
namespace {

using test::centered_camera;
using test::make_plane;
using test::make_sphere;
using test::throws;

Color pixel_of(const ImageU8& image, int column, int row)
{
    const std::uint8_t* const p = image.pixel(column, row);
    return {p[0], p[1], p[2], image.channels == 4 ? p[3] : std::uint8_t{255}};
}

TEST(Color, EveryEightBitValueSurvivesLinearLight)
{
    for (int value = 0; value < 256; ++value) {
        EXPECT_EQ(srgb_u8_from_linear(linear_from_srgb_u8(static_cast<std::uint8_t>(value))), value);
    }
    EXPECT_NEAR(linear_from_srgb(0.5f), 0.2140411, 1e-6); // IEC 61966-2-1
    EXPECT_EQ(srgb_u8_from_linear(-3.0f), 0);
    EXPECT_EQ(srgb_u8_from_linear(3.0f), 255);
}

TEST(RenderMesh, EmptySurroundingsShowTheBackground)
{
    const ShadingOptions options{.background = {10, 20, 30}};
    const ImageU8 image = render_mesh(make_sphere(10), centered_camera(64, 48, 1.0), 64, 48, options);
    ASSERT_EQ(image.width, 64);
    ASSERT_EQ(image.height, 48);
    ASSERT_EQ(image.channels, 3);
    EXPECT_EQ(pixel_of(image, 2, 2), (Color{10, 20, 30}));
    EXPECT_NE(pixel_of(image, 32, 24), (Color{10, 20, 30}));
}

TEST(RenderMesh, UnlitClayHasItsOwnColor)
{
    const ShadingOptions options{.lighting = Lighting::unlit, .clay = {200, 100, 50}};
    const ImageU8 image = render_mesh(make_sphere(20), centered_camera(64, 64, 1.0), 64, 64, options);
    EXPECT_EQ(pixel_of(image, 32, 32), (Color{200, 100, 50}));
}

TEST(RenderMesh, EdgePixelMixesInLinearLight)
{
    // The plane's left edge lies in the middle of column 10: half of its samples are covered.
    const ShadingOptions options{.lighting = Lighting::unlit, .clay = {255, 255, 255}, .background = {0, 0, 0}};
    const ImageU8 image = render_mesh(make_plane(43, 43, 0), centered_camera(64, 64, 1.0), 64, 64, options);
    EXPECT_EQ(image.at(10, 32, 0), srgb_u8_from_linear(0.5f));
    EXPECT_EQ(image.at(9, 32, 0), 0);
    EXPECT_EQ(image.at(11, 32, 0), 255);
}

TEST(RenderMesh, KeyLightComesFromTheUpperLeft)
{
    const ImageU8 image = render_mesh(make_sphere(28), centered_camera(64, 64, 1.0), 64, 64);
    EXPECT_GT(image.at(22, 20, 0), image.at(42, 44, 0));
    EXPECT_GT(image.at(32, 14, 0), image.at(32, 50, 0));
}

TEST(RenderMesh, VertexColorsAreUsedUnlessClayIsAskedFor)
{
    Mesh plane = make_plane(40, 40, 0);
    plane.colors = Eigen::Matrix3Xf::Zero(3, 4);
    plane.colors.row(1).setOnes();
    const Camera camera = centered_camera(32, 32, 1.0);
    EXPECT_EQ(pixel_of(render_mesh(plane, camera, 32, 32, {.lighting = Lighting::unlit}), 16, 16), (Color{0, 255, 0}));
    const ShadingOptions clay{.lighting = Lighting::unlit, .surface = SurfaceColor::clay, .clay = {9, 8, 7}};
    EXPECT_EQ(pixel_of(render_mesh(plane, camera, 32, 32, clay), 16, 16), (Color{9, 8, 7}));
}

TEST(RenderMesh, TextureAppearsUnchangedTexelByTexel)
{
    ImageU8 texture(32, 32, 3);
    Random random(21);
    for (std::uint8_t& value : texture.data) {
        value = static_cast<std::uint8_t>(random.index(256));
    }
    // One texel a pixel, one sample a pixel, at its centre.
    const ImageU8 image =
        render_mesh(make_plane(32, 32, 0), texture, centered_camera(32, 32, 1.0), 32, 32, {.supersampling = 1});
    int largest = 0;
    for (std::size_t i = 0; i < image.data.size(); ++i) {
        largest = std::max(largest, std::abs(image.data[i] - texture.data[i]));
    }
    EXPECT_LE(largest, 1); // rounding of uv in single precision
}

TEST(RenderMesh, PictureMovesWithTheMeshWhereverItsBandsEnd)
{
    Random random(32);
    ImageU8 texture(64, 64, 3);
    for (std::uint8_t& value : texture.data) {
        value = static_cast<std::uint8_t>(random.uniform() * 255);
    }
    const Mesh mesh = make_sphere(90);
    for (const DrawMode mode : {DrawMode::surface, DrawMode::surface_and_wireframe}) {
        ShadingOptions options{.mode = mode, .lighting = Lighting::unlit};
        options.supersampling = 2;
        Camera camera = centered_camera(200, 300, 1.0);
        const ImageU8 picture = render_mesh(mesh, texture, camera, 200, 300, options);
        camera.principal_point_px.y() += 17.0; // what ended a band now lies within one
        const ImageU8 moved = render_mesh(mesh, texture, camera, 200, 300, options);
        const std::size_t row = 3 * 200;
        EXPECT_TRUE(std::equal(picture.data.begin(), picture.data.end() - 17 * row, moved.data.begin() + 17 * row));
        EXPECT_FALSE(std::equal(picture.data.begin(), picture.data.end() - 18 * row, moved.data.begin() + 18 * row));
    }
}

TEST(RenderMesh, TransparentTexelsShowClay)
{
    const ImageU8 texture(4, 4, 4, 0);
    const ShadingOptions options{.clay = {90, 80, 70}};
    const ImageU8 image = render_mesh(make_plane(32, 32, 0), texture, centered_camera(32, 32, 1.0), 32, 32, options);
    EXPECT_EQ(pixel_of(image, 16, 16), (Color{90, 80, 70}));
}

TEST(RenderMesh, TransparentBackgroundGivesStraightAlpha)
{
    const ShadingOptions options{
        .lighting = Lighting::unlit, .background_mode = BackgroundMode::transparent, .clay = {200, 100, 50}};
    const ImageU8 image = render_mesh(make_plane(43, 43, 0), centered_camera(64, 64, 1.0), 64, 64, options);
    ASSERT_EQ(image.channels, 4);
    EXPECT_EQ(pixel_of(image, 0, 0), (Color{0, 0, 0, 0}));
    EXPECT_EQ(pixel_of(image, 32, 32), (Color{200, 100, 50, 255}));
    EXPECT_EQ(pixel_of(image, 10, 32), (Color{200, 100, 50, 128}));
}

TEST(RenderMesh, WireframeShowsEdgesAndLetsTheRestThrough)
{
    const ShadingOptions options{
        .mode = DrawMode::wireframe, .background = {255, 255, 255}, .wire = {0, 0, 0}, .wire_width_px = 2.0};
    const ImageU8 image = render_mesh(make_plane(40, 40, 0), centered_camera(64, 64, 1.0), 64, 64, options);
    EXPECT_LE(image.at(12, 40, 0), 10);  // on the left edge
    EXPECT_EQ(image.at(20, 24, 0), 255); // inside the upper left triangle
    EXPECT_LE(image.at(32, 31, 0), 10);  // on the diagonal
    EXPECT_EQ(image.at(2, 2, 0), 255);
}

TEST(RenderMesh, OpennessDarkensACrease)
{
    // Two planes meet in a valley; with occlusion its bottom is darker, the picture elsewhere the same.
    Mesh valley = make_plane(60, 60, 0, 2, 1);
    valley.vertices(2, 1) = -30;
    valley.vertices(2, 4) = -30;
    const Camera camera = centered_camera(64, 64, 1.0);
    const ImageU8 open = render_mesh(valley, camera, 64, 64, {.ambient_occlusion = 0.0});
    const ImageU8 occluded = render_mesh(valley, camera, 64, 64, {.ambient_occlusion = 1.0});
    EXPECT_LT(occluded.at(30, 32, 0) + 8, open.at(30, 32, 0));
    const Mesh plane = make_plane(60, 60, 0);
    EXPECT_EQ(render_mesh(plane, camera, 64, 64, {.ambient_occlusion = 0.0}),
              render_mesh(plane, camera, 64, 64, {.ambient_occlusion = 1.0}));
}

TEST(RenderMeshOver, PictureStaysWhereTheMeshIsNot)
{
    ImageU8 picture(64, 64, 3);
    for (std::size_t i = 0; i < picture.data.size(); ++i) {
        picture.data[i] = static_cast<std::uint8_t>(i * 7);
    }
    const Mesh plane = make_plane(20, 20, 0);
    const Camera camera = centered_camera(64, 64, 1.0);
    const ImageU8 image = render_mesh_over(picture, plane, camera, {.lighting = Lighting::unlit, .clay = {1, 2, 3}});
    EXPECT_EQ(pixel_of(image, 32, 32), (Color{1, 2, 3}));
    EXPECT_EQ(pixel_of(image, 5, 40), pixel_of(picture, 5, 40));
    EXPECT_EQ(render_mesh_over(picture, plane, camera, {.opacity = 0.0}), picture);
    const ImageU8 grey(64, 64, 1, 77);
    EXPECT_EQ(pixel_of(render_mesh_over(grey, plane, camera), 1, 1), (Color{77, 77, 77}));
}

TEST(FrameCamera, FitsTheMeshIntoThePicture)
{
    const Mesh sphere = make_sphere(37, {100, -50, 20});
    for (const double yaw : {0.0, 1.0, -2.0}) {
        const Camera camera = frame_camera(sphere, {yaw, 0.3, -0.2}, 300, 200, 0.1);
        Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9);
        Eigen::Vector2d high = -low;
        for (Eigen::Index v = 0; v < sphere.vertices.cols(); ++v) {
            const Eigen::Vector2d point = camera.project(Eigen::Vector3d(sphere.vertices.col(v).cast<double>()));
            low = low.cwiseMin(point);
            high = high.cwiseMax(point);
        }
        EXPECT_NEAR(low.y(), 20, 1e-6);
        EXPECT_NEAR(high.y(), 180, 1e-6);
        EXPECT_NEAR(0.5 * (low.x() + high.x()), 150, 1e-6);
    }
}

TEST(RenderMesh, RefusesBrokenContracts)
{
    const Mesh plane = make_plane(4, 4, 0);
    const auto run = [](const Mesh& mesh, const ShadingOptions& options) {
        (void)render_mesh(mesh, Camera{}, 8, 8, options);
    };
    EXPECT_TRUE(throws<InvalidArgument>([&] { run(plane, {.supersampling = 0}); }, "supersampling"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { run(plane, {.opacity = NAN}); }, "opacity"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { run(plane, {.ambient_occlusion = 1.5}); }, "ambient_occlusion"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { run(plane, {.occlusion_radius_mm = 0}); }, "occlusion_radius_mm"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { run(plane, {.wire_width_px = -1}); }, "wire_width_px"));
    Mesh colored = plane;
    colored.colors = Eigen::Matrix3Xf::Zero(3, 3);
    EXPECT_TRUE(throws<InvalidArgument>([&] { run(colored, {}); }, "mesh.colors"));
    Mesh bad_uv = plane;
    bad_uv.uv_triangles(0, 0) = 4;
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)render_mesh(bad_uv, ImageU8(4, 4, 3), Camera{}, 8, 8); },
                                        "mesh.uv_triangles(0, 0)"));
    EXPECT_TRUE(
        throws<InvalidArgument>([&] { (void)render_mesh(plane, ImageU8(4, 4, 1), Camera{}, 8, 8); }, "texture"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)render_mesh(plane, ImageU8(), Camera{}, 8, 8); }, "texture"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)frame_camera(Mesh{}, {}, 8, 8); }, "mesh"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)frame_camera(plane, {NAN, 0, 0}, 8, 8); }, "angles"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)frame_camera(plane, {}, 8, 8, 0.5); }, "margin"));
    EXPECT_TRUE(render_mesh(plane, Camera{}, 0, 8).empty());
}

} // namespace
} // namespace lineament
