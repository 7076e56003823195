// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/joint_image.hpp"
#include "lineament/kernels/scalar_kernels.hpp"

#include "lineament/fit/joint_fitter.hpp"

#include "support/planted_face.hpp"

#include <gtest/gtest.h>

namespace lineament {
namespace {

TEST(OutlineMatch, IsTheNearestPointOfTheOutlineWithItsNormal)
{
    // An upright line of five points, 10 px apart.
    Eigen::Matrix2Xd points(2, 5);
    points << 50, 50, 50, 50, 50, 0, 10, 20, 30, 40;
    detail::Polyline line;
    line.set_points(points);
    kernels::AlignedBuffer<double> u(8), v(8);
    u[0] = 57;
    v[0] = 14;
    std::vector<int> segments(1);
    line.find_nearest(kernels::scalar_kernels(), u, v, segments);
    const detail::OutlineMatch on_line = line.match(segments[0], {57, 14});
    EXPECT_FALSE(on_line.is_silhouette);
    EXPECT_EQ(on_line.position, 1);
    EXPECT_NEAR(on_line.fraction, 0.4, 1e-12);
    EXPECT_NEAR(std::abs(on_line.normal.x()), 1, 1e-12);
    EXPECT_NEAR(on_line.distance_px, 7, 1e-12);
    const auto silhouette = detail::match_silhouette(points, {57, 14}, 15, 12);
    ASSERT_TRUE(silhouette.has_value());
    EXPECT_TRUE(silhouette->is_silhouette);
    EXPECT_EQ(silhouette->position, 1);
    EXPECT_NEAR(std::abs(silhouette->normal.x()), 1, 1e-12);
    EXPECT_NEAR(silhouette->distance_px, 7, 1e-12);
    // The twins: too far along the line counts as too far; a cluster without a direction has no normal.
    EXPECT_FALSE(detail::match_silhouette(points, {50, 53}, 15, 12).has_value());
    Eigen::Matrix2Xd corners(2, 5);
    corners << 0, 5, 5, -5, -5, 0, 5, -5, 5, -5;
    const auto round = detail::match_silhouette(corners, {1, 0}, 15, 12);
    ASSERT_TRUE(round.has_value());
    EXPECT_TRUE(round->normal.isZero());
    EXPECT_NEAR(round->distance_px, 1, 1e-12);
}

/// Of frontal faces with an outline landmark moved 15 mm outwards: how many fits use it.
int num_using_it(double contour_trim)
{
    Random random(171);
    JointOptions options;
    options.contour_trim = contour_trim;
    const JointFitter fitter(test::synthetic_face(), "ibug68", options);
    int count = 0;
    for (int trial = 0; trial < 10; ++trial) {
        Camera camera = test::random_camera(random, 5);
        LandmarkSet set = test::project_landmarks(test::synthetic_face(), "ibug68", Eigen::VectorXd::Zero(0),
                                                  Eigen::VectorXd::Zero(0), camera, 0.5, random);
        Landmark& moved = set.landmarks[3];
        const Eigen::Vector2d outwards = (moved.point_px - set.landmarks[30].point_px).normalized();
        moved.point_px += 15 * camera.scale_px_per_mm * outwards;
        const FitResult fit = fitter.fit(set, camera.principal_point_px).fit;
        EXPECT_EQ(fit.status, FitStatus::success) << fit.reason;
        int num_unused = 0;
        for (const FittedLandmark& landmark : fit.landmarks) {
            num_unused += landmark.weight == 0;
        }
        EXPECT_EQ(num_unused, contour_trim > 0 ? 1 : 0); // one of sixteen
        count += fit.landmarks[3].weight > 0;
    }
    return count;
}

TEST(OutlineMatch, TheFarthestIsTrimmed)
{
    EXPECT_EQ(num_using_it(0.05), 0);
    EXPECT_EQ(num_using_it(0.0), 10);
}

} // namespace
} // namespace lineament
