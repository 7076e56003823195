// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/core/closest_point.hpp"

#include "lineament/core/random.hpp"
#include "support/matchers.hpp"

namespace lineament {
namespace {

/// Nearest point by sampling the triangle densely.
double sampled_distance(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                        const Eigen::Vector3d& c)
{
    double nearest = std::numeric_limits<double>::infinity();
    constexpr int steps = 200;
    for (int i = 0; i <= steps; ++i) {
        for (int j = 0; i + j <= steps; ++j) {
            const Eigen::Vector3d point = a + (b - a) * i / steps + (c - a) * j / steps;
            nearest = std::min(nearest, (point - p).norm());
        }
    }
    return nearest;
}

Eigen::Vector3d random_point(Random& random)
{
    return {random.normal(), random.normal(), random.normal()};
}

TEST(ClosestPoint, OfATriangleIsNoFartherThanAnySampledPoint)
{
    Random random(3);
    for (int i = 0; i < 100; ++i) {
        const Eigen::Vector3d a = random_point(random), b = random_point(random), c = random_point(random);
        const Eigen::Vector3d p = 2.0 * random_point(random);
        const double distance = (closest_point_on_triangle(p, a, b, c) - p).norm();
        const double sampled = sampled_distance(p, a, b, c);
        EXPECT_LE(distance, sampled + 1e-12);
        EXPECT_GE(distance, sampled - 0.05); // and it lies on the triangle: the sampling is that dense
    }
}

TEST(ClosestPoint, TheTreeFindsWhatAllTrianglesFind)
{
    Random random(4);
    Eigen::Matrix3Xd vertices(3, 300);
    for (Eigen::Index i = 0; i < vertices.cols(); ++i) {
        vertices.col(i) = random_point(random);
    }
    Eigen::Matrix3Xi triangles(3, 500);
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        triangles.col(t) << random.index(300), random.index(300), random.index(300);
    }
    const ClosestPointTree tree(vertices, triangles);
    for (int i = 0; i < 200; ++i) {
        const Eigen::Vector3d p = 2.0 * random_point(random);
        double nearest = std::numeric_limits<double>::infinity();
        for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
            const Eigen::Vector3d point = closest_point_on_triangle(
                p, vertices.col(triangles(0, t)), vertices.col(triangles(1, t)), vertices.col(triangles(2, t)));
            nearest = std::min(nearest, (point - p).norm());
        }
        const SurfacePoint found = tree.closest(p);
        EXPECT_NEAR(found.distance, nearest, 1e-12);
        EXPECT_NEAR((found.point - p).norm(), nearest, 1e-12);
    }
}

TEST(ClosestPoint, RefusesAnIndexOutsideTheVertices)
{
    const Eigen::Matrix3Xd vertices = Eigen::Matrix3d::Identity();
    Eigen::Matrix3Xi triangles(3, 1);
    triangles << 0, 1, 3;
    EXPECT_TRUE(
        test::throws<InvalidArgument>([&] { ClosestPointTree tree(vertices, triangles); }, "triangles", "0 to 2"));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { ClosestPointTree tree(vertices, Eigen::Matrix3Xi(3, 0)); }));
}

} // namespace
} // namespace lineament
