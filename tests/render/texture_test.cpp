// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/render/texture.hpp"

#include "lineament/render/shading.hpp"

#include "support/matchers.hpp"
#include "test_meshes.hpp"

#include <cmath>

namespace lineament {
namespace {

using test::centered_camera;
using test::join;
using test::make_plane;
using test::make_sphere;
using test::throws;

Visibility state_of(const TextureMap& map, int column, int row)
{
    return static_cast<Visibility>(map.visibility.at(column, row));
}

/// A smooth coloured pattern.
ImageU8 make_pattern(int width, int height)
{
    ImageU8 image(width, height, 3);
    for (int row = 0; row < height; ++row) {
        for (int column = 0; column < width; ++column) {
            const double u = (column + 0.5) / width;
            const double v = (row + 0.5) / height;
            image.at(column, row, 0) = static_cast<std::uint8_t>(std::lround(128 + 90 * std::sin(20 * u)));
            image.at(column, row, 1) = static_cast<std::uint8_t>(std::lround(128 + 90 * std::cos(14 * v + 5 * u)));
            image.at(column, row, 2) = static_cast<std::uint8_t>(std::lround(255 * u));
        }
    }
    return image;
}

TEST(TextureLayout, MapsEachTexelToItsPointOnce)
{
    const Mesh plane = make_plane(40, 20, 0, 7, 5);
    const TextureLayout layout(plane, 50);
    std::vector<int> count(50 * 50);
    for (const Texel& texel : layout.texels()) {
        ++count[texel.index];
        const auto uv = [&](int i) { return plane.uv_coordinates.col(plane.uv_triangles(i, texel.triangle)); };
        const Eigen::Vector2f point =
            50 * ((1 - texel.weight_b - texel.weight_c) * uv(0) + texel.weight_b * uv(1) + texel.weight_c * uv(2));
        EXPECT_NEAR(point.x(), texel.index % 50 + 0.5, 0.01);
        EXPECT_NEAR(point.y(), texel.index / 50 + 0.5, 0.01);
    }
    EXPECT_EQ(std::count(count.begin(), count.end(), 1), 50 * 50); // uv covers the whole map
    EXPECT_NEAR(layout.texel_areas().sum(), 2500, 1e-2);
}

TEST(DrawUvLayout, DrawsTheEdgesAndNothingElse)
{
    Eigen::Matrix2Xf uv(2, 3);
    uv << 0.1f, 0.9f, 0.1f, 0.1f, 0.1f, 0.9f;
    const Eigen::Matrix3Xi triangle = Eigen::Vector3i(0, 1, 2);
    const ImageU8 picture = draw_uv_layout(uv, triangle, 100);
    const auto is_white = [&](int column, int row) { return *picture.pixel(column, row) == 255; };
    EXPECT_FALSE(is_white(50, 10) && is_white(50, 9)) << "upper side";
    EXPECT_FALSE(is_white(10, 50) && is_white(9, 50)) << "left side";
    EXPECT_FALSE(is_white(50, 50) && is_white(49, 50)) << "slope";
    EXPECT_TRUE(is_white(30, 30)) << "inside";
    EXPECT_TRUE(is_white(70, 70)) << "outside";
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)draw_uv_layout(uv.leftCols(2), triangle, 100); }, "uv_triangles"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)draw_uv_layout(uv, triangle, 0); }, "size"));
}

TEST(TextureLayout, ExcludedGroupsStayUnmapped)
{
    Mesh plane = make_plane(40, 20, 0, 2, 1);
    plane.group_names = {"skin", "mouth_interior"};
    plane.triangle_groups = Eigen::Vector4i(0, 0, 1, 1); // the right half
    EXPECT_EQ(TextureLayout(plane, 20, {"mouth_interior"}).texels().size(), 200u);
    EXPECT_EQ(TextureLayout(plane, 20, {"eyes"}).texels().size(), 400u);
    EXPECT_EQ(TextureLayout(plane, 20).texels().size(), 400u);
    const TextureMap map = extract_texture(TextureLayout(plane, 20, {"mouth_interior"}), plane.vertices,
                                           plane.triangles, centered_camera(64, 64, 1.0), ImageU8(64, 64, 3, 9));
    EXPECT_EQ(state_of(map, 15, 10), Visibility::unmapped);
    EXPECT_EQ(state_of(map, 5, 10), Visibility::visible);
}

TEST(TextureLayout, RefusesBrokenContracts)
{
    const Mesh plane = make_plane(4, 4, 0);
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)TextureLayout(plane, 0); }, "size"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)TextureLayout(plane, 9000); }, "size"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)TextureLayout(Mesh{}, 8); }, "mesh.uv_triangles"));
    Mesh bad = plane;
    bad.uv_coordinates(0, 1) = NAN;
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)TextureLayout(bad, 8); }, "mesh.uv_coordinates(0, 1)"));
    bad = plane;
    bad.uv_triangles(2, 1) = 4;
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)TextureLayout(bad, 8); }, "mesh.uv_triangles(2, 1)"));
    bad = plane;
    bad.triangle_groups = Eigen::VectorXi::Zero(1);
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)TextureLayout(bad, 8, {"skin"}); }, "mesh.triangle_groups"));
}

TEST(ExtractTexture, PictureOfAFrontalPlaneComesBackUnchanged)
{
    const ImageU8 picture = make_pattern(64, 64);
    const Mesh plane = make_plane(64, 64, 0, 3, 3);
    const TextureMap map = extract_texture(TextureLayout(plane, 64), plane.vertices, plane.triangles,
                                           centered_camera(64, 64, 1.0), picture, {.outline_margin_mm = 0});
    int largest = 0;
    for (std::size_t i = 0; i < picture.data.size(); ++i) {
        largest = std::max(largest, std::abs(map.color.data[i] - picture.data[i]));
    }
    EXPECT_LE(largest, 1);
    for (const float weight : map.weight.data) {
        EXPECT_NEAR(weight, 1.0, 1e-5);
    }
}

TEST(ExtractTexture, SamplesAreRoundedNotTruncated)
{
    ImageU8 ramp(64, 64, 1);
    for (int row = 0; row < 64; ++row) {
        for (int column = 0; column < 64; ++column) {
            ramp.at(column, row) = static_cast<std::uint8_t>(column);
        }
    }
    const Mesh plane = make_plane(32, 32, 0);
    Camera camera = centered_camera(64, 64, 1.0);
    camera.translation_mm.x() = 0.75; // texel column i lies on pixel column 16.75 + i
    const TextureMap map = extract_texture(TextureLayout(plane, 32), plane.vertices, plane.triangles, camera, ramp);
    for (int column = 2; column < 30; ++column) {
        EXPECT_EQ(map.color.at(column, 16, 0), 17 + column);
    }
}

TEST(ExtractTexture, RenderedTextureComesBackWhereItIsSeen)
{
    const Mesh sphere = make_sphere(80);
    const ImageU8 texture = make_pattern(256, 256);
    for (const double phi : {0.0, 1.0 / 500}) {
        const Camera camera = centered_camera(600, 600, 3.2, {0.5, 0.2, -0.3}, phi);
        const ImageU8 picture = render_mesh(sphere, texture, camera, 600, 600);
        const TextureMap map =
            extract_texture(TextureLayout(sphere, 256), sphere.vertices, sphere.triangles, camera, picture);
        double squares = 0.0;
        int count = 0;
        for (int row = 0; row < 256; ++row) {
            for (int column = 0; column < 256; ++column) {
                if (map.weight.at(column, row) > 0.3f) {
                    for (int channel = 0; channel < 3; ++channel) {
                        const double difference = map.color.at(column, row, channel) - texture.at(column, row, channel);
                        squares += difference * difference;
                        ++count;
                    }
                }
            }
        }
        ASSERT_GT(count, 3 * 13000);
        EXPECT_GE(20 * std::log10(255 / std::sqrt(squares / count)), 40.0); // PSNR [dB]
    }
}

TEST(ExtractTexture, WeightIsTheCosineOnASlantedPlane)
{
    const Mesh plane = make_plane(40, 40, 0, 4, 4);
    const ImageU8 picture(200, 200, 3, 100);
    for (const double yaw : {0.0, 0.4, 0.9, 1.3}) {
        const TextureMap map = extract_texture(TextureLayout(plane, 16), plane.vertices, plane.triangles,
                                               centered_camera(200, 200, 4.0, {yaw, 0, 0}), picture);
        EXPECT_NEAR(map.weight.at(8, 8), std::cos(yaw), 1e-5); // 10 px per texel: density caps at 1
    }
}

TEST(ExtractTexture, WeightIsTheCosineToTheRayOnASphere)
{
    const Mesh sphere = make_sphere(50, {0, 0, 0}, 192, 96);
    const ImageU8 picture(400, 400, 3, 100);
    for (const double phi : {0.0, 1.0 / 200}) {
        const Camera camera = centered_camera(400, 400, 2.5, {0.2, -0.3, 0.1}, phi);
        const TextureLayout layout(sphere, 64);
        const TextureMap map = extract_texture(layout, sphere.vertices, sphere.triangles, camera, picture);
        int num_seen = 0;
        for (const Texel& texel : layout.texels()) {
            const float weight = map.weight.data[texel.index];
            if (!(weight > 0) || texel.index / 64 < 12 || texel.index / 64 > 51) {
                continue; // near the poles a texel is smaller than a pixel
            }
            const double longitude = 2 * std::numbers::pi * ((texel.index % 64 + 0.5) / 64 - 0.5);
            const double latitude = std::numbers::pi * (0.5 - (texel.index / 64 + 0.5) / 64);
            const Eigen::Vector3d normal =
                camera.camera_from_model * Eigen::Vector3d(std::sin(longitude) * std::cos(latitude), std::sin(latitude),
                                                           std::cos(longitude) * std::cos(latitude));
            const Eigen::Vector3d ray =
                phi > 0 ? Eigen::Vector3d(50 * normal + Eigen::Vector3d(0, 0, 1 / phi)) : Eigen::Vector3d::UnitZ();
            EXPECT_NEAR(weight, -normal.dot(ray.normalized()), 5e-3);
            ++num_seen;
        }
        EXPECT_GT(num_seen, 500);
    }
}

TEST(ExtractTexture, WeightFallsWithThePixelsPerTexel)
{
    const Mesh plane = make_plane(40, 40, 0);
    const ImageU8 picture(100, 100, 3, 100);
    const TextureLayout layout(plane, 64);
    // 0.8 px/mm * 40 mm = 32 px for 64 texels: a quarter of a pixel per texel; under perspective also by 1/range^2.
    const TextureMap far_map =
        extract_texture(layout, plane.vertices, plane.triangles, centered_camera(100, 100, 0.8), picture);
    EXPECT_NEAR(far_map.weight.at(32, 32), 0.25, 1e-5);
    const Mesh nearer = make_plane(40, 40, 20);
    const TextureMap near_map = extract_texture(layout, nearer.vertices, nearer.triangles,
                                                centered_camera(100, 100, 0.8, {}, 1.0 / 100), picture);
    EXPECT_NEAR(near_map.weight.at(32, 32), 0.25 / 0.64, 1e-3);
}

TEST(ExtractTexture, StatesSayWhyATexelIsNotSeen)
{
    // A sphere with a plate before it, shifted so that its left part leaves the picture.
    const Mesh scene = join(make_sphere(50), make_plane(20, 20, 60));
    Camera camera = centered_camera(200, 200, 1.5);
    camera.translation_mm.x() = -50;
    const TextureLayout layout(make_sphere(50), 128);
    Mesh with_uv = scene;
    const TextureLayout scene_layout(with_uv, 128);
    const TextureMap map =
        extract_texture(scene_layout, scene.vertices, scene.triangles, camera, ImageU8(200, 200, 3, 50));
    int count[5] = {};
    for (int row = 20; row < 108; ++row) {
        for (int column = 0; column < 128; ++column) {
            const double longitude = 2 * std::numbers::pi * ((column + 0.5) / 128 - 0.5);
            const double latitude = std::numbers::pi * (0.5 - (row + 0.5) / 128);
            const double x = 50 * std::sin(longitude) * std::cos(latitude);
            const double y = 50 * std::sin(latitude);
            const double z = 50 * std::cos(longitude) * std::cos(latitude);
            const double column_px = 100 + 1.5 * (x - 50);
            const Visibility state = state_of(map, column, row);
            ++count[static_cast<int>(state)];
            const double side = std::max(std::abs(x), std::abs(y));
            if (column_px < -0.1) {
                EXPECT_EQ(state, Visibility::outside_image);
            } else if (column_px > 0.1 && z < -0.5) {
                EXPECT_EQ(state, Visibility::back_facing);
            } else if (column_px > 0.1 && z > 4 && side < 9) {
                EXPECT_EQ(state, Visibility::self_occluded);
            } else if (column_px > 0.1 && z > 4 && side > 11) {
                EXPECT_EQ(state, Visibility::visible);
            }
            EXPECT_TRUE(state == Visibility::visible || map.weight.at(column, row) == 0.0f);
        }
    }
    EXPECT_GT(count[0], 500);
    EXPECT_GT(count[1], 50);
    EXPECT_GT(count[2], 500);
    EXPECT_GT(count[3], 500);
    EXPECT_EQ(count[4], 0);
}

TEST(ExtractTexture, BackgroundDoesNotBleedInAtTheOutline)
{
    const Mesh sphere = make_sphere(80);
    const ImageU8 texture(8, 8, 3, 200);
    const Camera camera = centered_camera(200, 200, 1.0);
    const ImageU8 picture = render_mesh(sphere, texture, camera, 200, 200, {.background = {0, 0, 0}});
    const auto num_dark = [&](double margin) {
        const TextureMap map = extract_texture(TextureLayout(sphere, 256), sphere.vertices, sphere.triangles, camera,
                                               picture, {.outline_margin_mm = margin});
        int count = 0;
        for (std::size_t i = 0; i < map.weight.data.size(); ++i) {
            count += map.weight.data[i] > 0 && map.color.data[3 * i] < 198 ? 1 : 0;
        }
        return count;
    };
    EXPECT_GT(num_dark(0.0), 100);
    EXPECT_EQ(num_dark(1.5), 0);
}

TEST(ExtractTexture, BackgroundStaysOutOfAFitThatIsOffByThreeMillimetres)
{
    const Mesh sphere = make_sphere(80);
    const ImageU8 texture(8, 8, 3, 200);
    const Camera camera = centered_camera(400, 400, 2.0);
    const ImageU8 picture = render_mesh(sphere, texture, camera, 400, 400, {.background = {0, 0, 0}});
    Camera wrong = camera;
    wrong.translation_mm.x() += 3.0;
    const auto num_dark = [&](double margin) {
        const TextureMap map = extract_texture(TextureLayout(sphere, 256), sphere.vertices, sphere.triangles, wrong,
                                               picture, {.outline_margin_mm = margin});
        int count = 0;
        for (std::size_t i = 0; i < map.weight.data.size(); ++i) {
            count += map.weight.data[i] > 0 && map.color.data[3 * i] < 100 ? 1 : 0;
        }
        return count;
    };
    EXPECT_GT(num_dark(1.5), 100);
    EXPECT_EQ(num_dark(TextureOptions().outline_margin_mm), 0);
}

TEST(ExtractTexture, TrustOfTheVerticesMultipliesTheWeights)
{
    const Mesh plane = make_plane(20, 20, 0);
    const TextureLayout layout(plane, 32);
    const auto weights = [&](float trust) {
        TextureOptions options;
        options.vertex_trust = Eigen::VectorXf::Constant(plane.vertices.cols(), trust);
        return extract_texture(layout, plane.vertices, plane.triangles, centered_camera(100, 100, 2.0),
                               ImageU8(100, 100, 3, 50), options)
            .weight;
    };
    EXPECT_GT(weights(1.0f).at(16, 16), 0.5f);
    EXPECT_FLOAT_EQ(weights(0.25f).at(16, 16), 0.25f * weights(1.0f).at(16, 16));
    EXPECT_EQ(weights(0.0f).at(16, 16), 0.0f);
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)weights(1.5f); }, "vertex_trust"));
    TextureOptions wrong_size;
    wrong_size.vertex_trust = Eigen::VectorXf::Ones(3);
    EXPECT_TRUE(throws<InvalidArgument>(
        [&] { (void)extract_texture(layout, plane.vertices, plane.triangles, Camera{}, ImageU8(9, 9, 3), wrong_size); },
        "vertex_trust"));
}

TEST(ExtractTexture, FinePictureIsAveragedNotAliased)
{
    // One-pixel stripes, 16 px per texel and axis: every texel must be grey.
    ImageU8 picture(512, 512, 3);
    for (int row = 0; row < 512; ++row) {
        for (int column = 0; column < 512; ++column) {
            for (int channel = 0; channel < 3; ++channel) {
                picture.at(column, row, channel) = column % 2 == 0 ? 0 : 255;
            }
        }
    }
    const Mesh plane = make_plane(512, 512, 0);
    const TextureMap map = extract_texture(TextureLayout(plane, 32), plane.vertices, plane.triangles,
                                           centered_camera(512, 512, 1.0), picture);
    for (std::size_t i = 0; i < map.color.data.size(); ++i) {
        EXPECT_NEAR(map.color.data[i], 128, 1);
    }
}

TEST(ExtractTexture, GreyAndRgbaPicturesWork)
{
    const Mesh plane = make_plane(20, 20, 0);
    const TextureLayout layout(plane, 8);
    const Camera camera = centered_camera(64, 64, 1.0);
    const ImageU8 grey(64, 64, 1, 77);
    const ImageU8 rgba(64, 64, 4, 78);
    EXPECT_EQ(extract_texture(layout, plane.vertices, plane.triangles, camera, grey).color.at(4, 4, 2), 77);
    EXPECT_EQ(extract_texture(layout, plane.vertices, plane.triangles, camera, rgba).color.at(4, 4, 2), 78);
}

TEST(ExtractTexture, WithoutPictureEveryTexelIsOutside)
{
    const Mesh plane = make_plane(20, 20, 0);
    const TextureMap map =
        extract_texture(TextureLayout(plane, 8), plane.vertices, plane.triangles, Camera{}, ImageU8());
    EXPECT_EQ(state_of(map, 4, 4), Visibility::outside_image);
    EXPECT_EQ(map.weight.at(4, 4), 0.0f);
    Camera aside;
    aside.translation_mm.x() = 1e6;
    const TextureMap none =
        extract_texture(TextureLayout(plane, 8), plane.vertices, plane.triangles, aside, ImageU8(9, 9, 3));
    EXPECT_EQ(state_of(none, 4, 4), Visibility::outside_image);
}

TEST(ExtractTexture, RefusesBrokenContracts)
{
    const Mesh plane = make_plane(20, 20, 0);
    const TextureLayout layout(plane, 8);
    const ImageU8 picture(8, 8, 3);
    const auto run = [&](const Mesh& mesh, const ImageU8& image, const TextureOptions& options) {
        (void)extract_texture(layout, mesh.vertices, mesh.triangles, Camera{}, image, options);
    };
    EXPECT_TRUE(throws<InvalidArgument>([&] { run(make_plane(1, 1, 0, 2, 2), picture, {}); }, "triangles"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { run(plane, ImageU8(8, 8, 2), {}); }, "picture"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { run(plane, picture, {.depth_tolerance_mm = NAN}); }, "depth_tolerance"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { run(plane, picture, {.outline_margin_mm = -1}); }, "outline_margin_mm"));
    Mesh bad = plane;
    bad.vertices(0, 0) = INFINITY;
    EXPECT_TRUE(throws<InvalidArgument>([&] { run(bad, picture, {}); }, "vertices(0, 0)"));
    bad = plane;
    bad.triangles(0, 0) = 4;
    EXPECT_TRUE(throws<InvalidArgument>([&] { run(bad, picture, {}); }, "triangles(0, 0)"));
}

TEST(MarkHoles, HolesAreCheckeredOrTransparentAndTheRestUnchanged)
{
    TextureMap map{ImageU8(16, 16, 3, 50), ImageF(16, 16, 1, 0.5f), Image<std::uint8_t>(16, 16, 1)};
    map.weight.at(3, 4) = 0.0f;
    const ImageU8 checkered = mark_holes(map);
    EXPECT_GE(checkered.at(3, 4, 0), 184);
    EXPECT_EQ(checkered.at(4, 4, 0), 50);
    const ImageU8 transparent = mark_holes(map, HoleMark::transparent);
    EXPECT_EQ(transparent.at(3, 4, 3), 0);
    EXPECT_EQ(transparent.at(4, 4, 3), 255);
    EXPECT_EQ(transparent.at(4, 4, 1), 50);
}

} // namespace
} // namespace lineament
