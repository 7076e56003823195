// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/core/random.hpp"
#include "lineament/render/rasterizer.hpp"
#include "lineament/render/triangle_coverage.hpp"

#include "support/matchers.hpp"
#include "test_meshes.hpp"

#include <algorithm>
#include <cmath>

namespace lineament {
namespace {

using test::cast_ray;
using test::centered_camera;
using test::join;
using test::make_plane;
using test::make_sphere;
using test::throws;

int count_covered(const Raster& raster)
{
    return static_cast<int>(
        std::count_if(raster.triangle.data.begin(), raster.triangle.data.end(), [](int t) { return t >= 0; }));
}

GridPoint random_point(Random& random, double size)
{
    return GridPoint::nearest({random.uniform(-0.2 * size, 1.2 * size), random.uniform(-0.2 * size, 1.2 * size)});
}

TEST(TriangleCoverage, CoveredAreaEqualsAnalyticArea)
{
    Random random(11);
    for (int i = 0; i < 200; ++i) {
        const auto point = [&] { return GridPoint::nearest({random.uniform(5, 395), random.uniform(5, 395)}); };
        const GridPoint a = point();
        const GridPoint b = point();
        const GridPoint c = point();
        const double area_px = std::abs(static_cast<double>(signed_area2(a, b, c))) / (2.0 * 256 * 256);
        int count = 0;
        for_each_covered_pixel(a, b, c, 400, 400, [&](int, int, double, double) { ++count; });
        const auto length = [](const GridPoint& p, const GridPoint& q) {
            return std::hypot(static_cast<double>(p.x - q.x), static_cast<double>(p.y - q.y)) / 256;
        };
        // The count differs from the area by less than the perimeter (a lattice-point bound).
        EXPECT_LE(std::abs(count - area_px), 0.5 * (length(a, b) + length(b, c) + length(c, a)) + 2) << i;
    }
}

TEST(TriangleCoverage, CoversAPixelIfAndOnlyIfItsCenterIsInside)
{
    Random random(12);
    for (int i = 0; i < 300; ++i) {
        const GridPoint p[3] = {random_point(random, 40), random_point(random, 40), random_point(random, 40)};
        Image<int> count(40, 40, 1);
        for_each_covered_pixel(p[0], p[1], p[2], 40, 40,
                               [&](int column, int row, double, double) { ++count.at(column, row); });
        for (int row = 0; row < 40; ++row) {
            for (int column = 0; column < 40; ++column) {
                const GridPoint center{column * 256 + 128, row * 256 + 128};
                const std::int64_t s0 = signed_area2(p[0], p[1], center);
                const std::int64_t s1 = signed_area2(p[1], p[2], center);
                const std::int64_t s2 = signed_area2(p[2], p[0], center);
                const bool is_inside = (s0 > 0 && s1 > 0 && s2 > 0) || (s0 < 0 && s1 < 0 && s2 < 0);
                const bool is_outside = std::min({s0, s1, s2}) < 0 && std::max({s0, s1, s2}) > 0;
                if (is_inside) {
                    ASSERT_EQ(count.at(column, row), 1) << i;
                } else if (is_outside) {
                    ASSERT_EQ(count.at(column, row), 0) << i;
                }
            }
        }
    }
}

TEST(TriangleCoverage, SharedEdgesAreDrawnExactlyOnce)
{
    // A fan about one point whose rim encloses the image: every pixel must be covered once, in whatever orientation,
    // also where edges pass exactly through pixel centres (coordinates on the half-pixel grid).
    Random random(13);
    for (int i = 0; i < 300; ++i) {
        const bool is_on_centers = i % 2 == 0;
        const auto snapped = [&](double x, double y) {
            return is_on_centers ? GridPoint::nearest({std::floor(x) + 0.5, std::floor(y) + 0.5})
                                 : GridPoint::nearest({x, y});
        };
        const double x = random.uniform(2, 30);
        const GridPoint middle = snapped(x, random.uniform(2, 30));
        const int num_rim = 3 + random.index(12);
        std::vector<GridPoint> rim;
        for (int k = 0; k < num_rim; ++k) {
            const double angle = 2 * std::numbers::pi * (k + random.uniform(-0.2, 0.2)) / num_rim;
            rim.push_back(snapped(16 + 120 * std::cos(angle), 16 + 120 * std::sin(angle)));
        }
        Image<int> count(32, 32, 1);
        for (int k = 0; k < num_rim; ++k) {
            GridPoint corners[3] = {middle, rim[k], rim[(k + 1) % num_rim]};
            if (random.uniform() < 0.5) {
                std::swap(corners[1], corners[2]);
            }
            for_each_covered_pixel(corners[0], corners[1], corners[2], 32, 32,
                                   [&](int column, int row, double, double) { ++count.at(column, row); });
        }
        EXPECT_EQ(std::count(count.data.begin(), count.data.end(), 1), 32 * 32) << i;
    }
}

TEST(TriangleCoverage, WeightsReproduceThePixelCenter)
{
    Random random(14);
    for (int i = 0; i < 100; ++i) {
        const GridPoint a = random_point(random, 64);
        const GridPoint b = random_point(random, 64);
        const GridPoint c = random_point(random, 64);
        for_each_covered_pixel(a, b, c, 64, 64, [&](int column, int row, double weight_b, double weight_c) {
            const double weight_a = 1 - weight_b - weight_c;
            const auto mix = [&](auto axis) {
                return (weight_a * static_cast<double>(a.*axis) + weight_b * static_cast<double>(b.*axis) +
                        weight_c * static_cast<double>(c.*axis)) /
                       256;
            };
            EXPECT_NEAR(mix(&GridPoint::x), column + 0.5, 1e-9);
            EXPECT_NEAR(mix(&GridPoint::y), row + 0.5, 1e-9);
        });
    }
}

TEST(TriangleCoverage, TriangleWithoutAreaCoversNothing)
{
    int count = 0;
    const GridPoint a{128, 128};
    const GridPoint b{2000, 2000};
    for_each_covered_pixel(a, a, b, 64, 64, [&](int, int, double, double) { ++count; });
    for_each_covered_pixel(a, b, GridPoint{1000, 1000}, 64, 64, [&](int, int, double, double) { ++count; });
    EXPECT_EQ(count, 0);
}

TEST(Rasterize, PlaneCoversItsAnalyticArea)
{
    const Raster raster = rasterize(make_plane(40, 20, 5).vertices, make_plane(40, 20, 5).triangles,
                                    centered_camera(100, 100, 2.0), 100, 100);
    EXPECT_EQ(count_covered(raster), 80 * 40);
    EXPECT_EQ(raster.triangle.at(9, 50), -1);
    EXPECT_GE(raster.triangle.at(10, 50), 0);
    EXPECT_FLOAT_EQ(raster.depth.at(50, 50), -5.0f); // 5 mm towards the camera
}

TEST(Rasterize, PerspectivePlaneIsLargerByItsRange)
{
    // 50 mm before the origin, camera 250 mm from the origin: 1 / (1 - 50/250) = 1.25 times as large
    const Mesh plane = make_plane(40, 20, 50);
    const Raster raster =
        rasterize(plane.vertices, plane.triangles, centered_camera(200, 100, 2.0, {}, 1.0 / 250), 200, 100);
    EXPECT_EQ(count_covered(raster), 100 * 50);
}

TEST(Rasterize, AgreesWithRayCasting)
{
    Mesh scene = join(make_sphere(30, {0, 0, 0}, 24, 12), make_sphere(12, {10, 5, 40}, 16, 8));
    for (const double phi : {0.0, 1.0 / 200}) {
        const Camera camera = centered_camera(64, 64, 0.9, {0.4, -0.2, 0.3}, phi);
        const Raster raster = rasterize(scene.vertices, scene.triangles, camera, 64, 64);
        int num_different = 0;
        int num_covered = 0;
        for (int row = 0; row < 64; ++row) {
            for (int column = 0; column < 64; ++column) {
                const auto hit = cast_ray(scene, camera, {column + 0.5, row + 0.5});
                const int triangle = raster.triangle.at(column, row);
                num_covered += triangle >= 0 ? 1 : 0;
                if ((hit ? hit->first : -1) != triangle) {
                    ++num_different; // only where an edge passes within the 1/256 px of rounding
                } else if (hit) {
                    EXPECT_NEAR(raster.depth.at(column, row), hit->second, 0.05);
                }
            }
        }
        EXPECT_GT(num_covered, 1500);
        EXPECT_LE(num_different, 16);
    }
}

TEST(Rasterize, WeightsSumToOneAndAreCorrectUnderPerspective)
{
    Mesh plane = make_plane(80, 80, 0);
    const Camera camera = centered_camera(100, 100, 1.0, {0.9, 0.2, 0.0}, 1.0 / 160);
    const Raster raster = rasterize(plane.vertices, plane.triangles, camera, 100, 100);
    int num_covered = 0;
    for (int row = 0; row < 100; ++row) {
        for (int column = 0; column < 100; ++column) {
            const int t = raster.triangle.at(column, row);
            const float* const weights = raster.barycentric.pixel(column, row);
            if (t < 0) {
                EXPECT_EQ(weights[0] + weights[1] + weights[2], 0.0f);
                continue;
            }
            ++num_covered;
            EXPECT_NEAR(weights[0] + weights[1] + weights[2], 1.0, 1e-6);
            Eigen::Vector3d point = Eigen::Vector3d::Zero();
            for (int i = 0; i < 3; ++i) {
                point += weights[i] * plane.vertices.col(plane.triangles(i, t)).cast<double>();
            }
            EXPECT_LE((camera.project(point) - Eigen::Vector2d(column + 0.5, row + 0.5)).norm(), 0.01);
        }
    }
    EXPECT_GT(num_covered, 1000);
}

TEST(Rasterize, BackFacesAreLeftOutOnlyOnDemand)
{
    Mesh plane = make_plane(40, 20, 5);
    plane.triangles.row(1).swap(plane.triangles.row(2)); // now facing away
    const Camera camera = centered_camera(100, 100, 2.0);
    EXPECT_EQ(count_covered(rasterize(plane.vertices, plane.triangles, camera, 100, 100)), 3200);
    EXPECT_EQ(count_covered(rasterize(plane.vertices, plane.triangles, camera, 100, 100, {Culling::back_faces})), 0);
    plane.triangles.row(1).swap(plane.triangles.row(2));
    EXPECT_EQ(count_covered(rasterize(plane.vertices, plane.triangles, camera, 100, 100, {Culling::back_faces})), 3200);
}

TEST(Rasterize, NearerSurfaceWinsInAnyOrder)
{
    const Mesh near_first = join(make_plane(20, 20, 9), make_plane(40, 40, 1));
    const Mesh far_first = join(make_plane(40, 40, 1), make_plane(20, 20, 9));
    const Camera camera = centered_camera(50, 50, 1.0);
    const Raster a = rasterize(near_first.vertices, near_first.triangles, camera, 50, 50);
    const Raster b = rasterize(far_first.vertices, far_first.triangles, camera, 50, 50);
    EXPECT_EQ(a.depth, b.depth);
    EXPECT_FLOAT_EQ(a.depth.at(25, 25), -9.0f);
}

TEST(Rasterize, DepthAloneIsTheSame)
{
    const Mesh sphere = make_sphere(40);
    const Camera camera = centered_camera(90, 70, 0.8, {0.3, 0.1, 0.2}, 1.0 / 300);
    EXPECT_EQ(render_depth(sphere.vertices, sphere.triangles, camera, 90, 70),
              rasterize(sphere.vertices, sphere.triangles, camera, 90, 70).depth);
}

TEST(Rasterize, TrianglesBehindTheCameraAreLeftOut)
{
    const Mesh plane = make_plane(40, 20, 150); // 50 mm behind a camera 100 mm from the origin
    const Camera camera = centered_camera(100, 100, 2.0, {}, 1.0 / 100);
    EXPECT_EQ(count_covered(rasterize(plane.vertices, plane.triangles, camera, 100, 100)), 0);
}

TEST(Rasterize, ClipsToTheImage)
{
    const Mesh plane = make_plane(4000, 4000, 0);
    EXPECT_EQ(count_covered(rasterize(plane.vertices, plane.triangles, centered_camera(33, 17, 100.0), 33, 17)),
              33 * 17);
    Camera aside = centered_camera(33, 17, 1.0);
    aside.translation_mm.x() = 1e5;
    EXPECT_EQ(count_covered(rasterize(plane.vertices, plane.triangles, aside, 33, 17)), 0);
    aside.translation_mm.x() = 1e30; // beyond what the grid of corners holds
    EXPECT_EQ(count_covered(rasterize(plane.vertices, plane.triangles, aside, 33, 17)), 0);
}

TEST(Rasterize, ImageWithoutPixelsIsEmpty)
{
    const Mesh plane = make_plane(4, 4, 0);
    const Raster raster = rasterize(plane.vertices, plane.triangles, Camera{}, 0, 10);
    EXPECT_TRUE(raster.depth.empty());
    EXPECT_TRUE(raster.triangle.empty());
    EXPECT_TRUE(raster.barycentric.empty());
}

TEST(Rasterize, MeshWithoutTrianglesSeesNothing)
{
    EXPECT_EQ(count_covered(rasterize({}, {}, Camera{}, 4, 4)), 0);
}

TEST(Rasterize, RefusesBrokenContracts)
{
    const Mesh plane = make_plane(4, 4, 0);
    const auto run = [&](auto&& change) {
        Mesh mesh = plane;
        Camera camera;
        int width = 8;
        change(mesh, camera, width);
        return rasterize(mesh.vertices, mesh.triangles, camera, width, 8);
    };
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)run([](Mesh& m, Camera&, int&) { m.triangles(1, 0) = 4; }); },
                                        "triangles(1, 0)", "got 4"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)run([](Mesh& m, Camera&, int&) { m.triangles(0, 1) = -1; }); },
                                        "triangles(0, 1)", "got -1"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)run([](Mesh& m, Camera&, int&) { m.vertices(2, 3) = NAN; }); },
                                        "vertices(2, 3)", "nan"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)run([](Mesh&, Camera& c, int&) { c.scale_px_per_mm = 0; }); },
                                        "scale_px_per_mm"));
    EXPECT_TRUE(
        throws<InvalidArgument>([&] { (void)run([](Mesh&, Camera& c, int&) { c.phi_per_mm = -1; }); }, "phi_per_mm"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)run([](Mesh&, Camera&, int& width) { width = -1; }); }, "width"));
    EXPECT_TRUE(
        throws<InvalidArgument>([&] { (void)run([](Mesh&, Camera&, int& width) { width = 40000; }); }, "width"));
}

} // namespace
} // namespace lineament
