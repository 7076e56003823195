// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/render/visibility.hpp"

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

TEST(ComputeVisibility, SphereShowsItsNearHalfAndBlockerHidesItsShadow)
{
    // A plane of 20 x 20 mm stands 60 mm before a sphere of 50 mm: analytic sets under scaled orthography.
    const Mesh sphere = make_sphere(50);
    const Mesh scene = join(sphere, make_plane(20, 20, 60));
    const auto visibility =
        compute_visibility(scene.vertices, scene.triangles, centered_camera(240, 240, 2.0), 240, 240);
    int count[5] = {};
    for (Eigen::Index v = 0; v < sphere.vertices.cols(); ++v) {
        const Eigen::Vector3f point = sphere.vertices.col(v);
        const float side = std::max(std::abs(point.x()), std::abs(point.y()));
        ++count[static_cast<int>(visibility[v])];
        if (point.z() < -1e-3f) {
            EXPECT_EQ(visibility[v], Visibility::back_facing);
        } else if (point.z() > 3.0f && side < 9.5f) {
            EXPECT_EQ(visibility[v], Visibility::self_occluded);
        } else if (point.z() > 3.0f && side > 10.5f) {
            EXPECT_EQ(visibility[v], Visibility::visible) << point.transpose();
        }
    }
    EXPECT_GT(count[0], 1000);
    EXPECT_GT(count[1], 50);
    EXPECT_GT(count[2], 1000);
    EXPECT_EQ(count[3] + count[4], 0);
}

TEST(ComputeVisibility, AgreesWithRayCasting)
{
    const Mesh scene = join(make_sphere(30, {0, 0, 0}, 32, 16), make_sphere(12, {10, 5, 40}, 20, 10));
    for (const double phi : {0.0, 1.0 / 250}) {
        const Camera camera = centered_camera(256, 256, 3.0, {0.4, -0.2, 0.3}, phi);
        const auto visibility = compute_visibility(scene.vertices, scene.triangles, camera, 256, 256);
        const Eigen::Matrix3Xf normals = compute_vertex_normals(scene.vertices, scene.triangles);
        int num_compared = 0;
        int num_occluded = 0;
        int num_different = 0;
        for (Eigen::Index v = 0; v < scene.vertices.cols(); ++v) {
            const Eigen::Vector3d point = camera.in_camera(scene.vertices.col(v).cast<double>());
            const Eigen::Vector3d normal = camera.camera_from_model * normals.col(v).cast<double>();
            if (normal.dot(view_ray(camera, point).normalized()) > -0.2) {
                continue; // at the silhouette both answers are a matter of rounding
            }
            const auto hit =
                cast_ray(scene, camera, camera.project(Eigen::Vector3d(scene.vertices.col(v).cast<double>())));
            const bool is_hidden = hit && hit->second < point.z() - 1.0;
            num_occluded += is_hidden ? 1 : 0;
            num_different += is_hidden != (visibility[v] == Visibility::self_occluded) ? 1 : 0;
            ++num_compared;
        }
        EXPECT_GT(num_compared, 200);
        EXPECT_GT(num_occluded, 10);
        EXPECT_LE(num_different, 2); // vertices within a pixel of an occluder's outline
    }
}

TEST(ComputeVisibility, SlantedPlaneDoesNotHideItself)
{
    const Mesh plane = make_plane(60, 60, 0, 20, 20);
    for (const double yaw : {30.0, 60.0, 80.0, 85.0}) {
        for (const double phi : {0.0, 1.0 / 400}) {
            const Camera camera = centered_camera(128, 128, 1.0, {radians(yaw), 0.1, 0.2}, phi);
            const auto visibility = compute_visibility(plane.vertices, plane.triangles, camera, 128, 128);
            for (const Visibility state : visibility) {
                EXPECT_NE(state, Visibility::self_occluded) << yaw;
            }
        }
    }
}

TEST(ComputeVisibility, PointsOutsideTheImageOrBehindTheCameraAreOutside)
{
    const Mesh plane = make_plane(60, 60, 0);
    const auto aside = compute_visibility(plane.vertices, plane.triangles, centered_camera(40, 40, 1.0), 40, 40);
    EXPECT_EQ(std::count(aside.begin(), aside.end(), Visibility::outside_image), 4);
    const Mesh behind = make_plane(1, 1, 200);
    const auto states =
        compute_visibility(behind.vertices, behind.triangles, centered_camera(40, 40, 1.0, {}, 1.0 / 100), 40, 40);
    EXPECT_EQ(std::count(states.begin(), states.end(), Visibility::outside_image), 4);
    const auto none = compute_visibility(plane.vertices, plane.triangles, Camera{}, 0, 0);
    EXPECT_EQ(std::count(none.begin(), none.end(), Visibility::outside_image), 4);
}

TEST(ComputeVisibility, VertexWithoutTriangleFacesNowhere)
{
    Mesh plane = make_plane(20, 20, 0);
    plane.vertices.conservativeResize(3, 5);
    plane.vertices.col(4).setZero();
    const auto visibility = compute_visibility(plane.vertices, plane.triangles, centered_camera(64, 64, 1.0), 64, 64);
    EXPECT_EQ(visibility[0], Visibility::visible);
    EXPECT_EQ(visibility[4], Visibility::back_facing);
}

TEST(ComputeVisibility, ToleranceDecidesHowFarBehindStillCounts)
{
    const Mesh scene = join(make_plane(20, 20, 0), make_plane(40, 40, 5)); // 5 mm behind the second
    const Camera camera = centered_camera(64, 64, 1.0);
    EXPECT_EQ(compute_visibility(scene.vertices, scene.triangles, camera, 64, 64, {4.9})[0], Visibility::self_occluded);
    EXPECT_EQ(compute_visibility(scene.vertices, scene.triangles, camera, 64, 64, {5.1})[0], Visibility::visible);
}

TEST(ComputeVisibility, RefusesBrokenContracts)
{
    Mesh plane = make_plane(20, 20, 0);
    EXPECT_TRUE(throws<InvalidArgument>(
        [&] { (void)compute_visibility(plane.vertices, plane.triangles, Camera{}, 8, 8, {-1.0}); },
        "depth_tolerance_mm"));
    EXPECT_TRUE(throws<InvalidArgument>(
        [&] { (void)compute_visibility(plane.vertices, plane.triangles, Camera{}, 8, 8, {NAN}); },
        "depth_tolerance_mm"));
    plane.triangles(0, 0) = 99;
    EXPECT_TRUE(throws<InvalidArgument>(
        [&] { (void)compute_visibility(plane.vertices, plane.triangles, Camera{}, 8, 8); }, "triangles(0, 0)"));
}

} // namespace
} // namespace lineament
