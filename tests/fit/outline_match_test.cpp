// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/joint_image.hpp"

#include <gtest/gtest.h>

namespace lineament {
namespace {

TEST(OutlineMatch, IsTheNearestPointOfTheOutlineWithItsNormal)
{
    // An upright line of five vertices, 10 px apart.
    const std::vector<int> vertices{3, 5, 7, 9, 11};
    Eigen::Matrix2Xd line(2, 5);
    line << 50, 50, 50, 50, 50, 0, 10, 20, 30, 40;
    const detail::OutlineMatch on_line = detail::match_polyline(vertices, line, {57, 14});
    EXPECT_EQ(on_line.vertex, 5);
    EXPECT_EQ(on_line.next_vertex, 7);
    EXPECT_NEAR(on_line.fraction, 0.4, 1e-12);
    EXPECT_NEAR(std::abs(on_line.normal.x()), 1, 1e-12);
    EXPECT_NEAR(on_line.distance_px, 7, 1e-12);
    const auto silhouette = detail::match_silhouette(vertices, line, {57, 14}, 15, 12);
    ASSERT_TRUE(silhouette.has_value());
    EXPECT_EQ(silhouette->vertex, 5);
    EXPECT_NEAR(std::abs(silhouette->normal.x()), 1, 1e-12);
    EXPECT_NEAR(silhouette->distance_px, 7, 1e-12);
    // The twins: too far along the line counts as too far; a cluster without a direction has no normal.
    EXPECT_FALSE(detail::match_silhouette(vertices, line, {50, 53}, 15, 12).has_value());
    Eigen::Matrix2Xd corners(2, 5);
    corners << 0, 5, 5, -5, -5, 0, 5, -5, 5, -5;
    const auto round = detail::match_silhouette(vertices, corners, {1, 0}, 15, 12);
    ASSERT_TRUE(round.has_value());
    EXPECT_TRUE(round->normal.isZero());
    EXPECT_NEAR(round->distance_px, 1, 1e-12);
}

} // namespace
} // namespace lineament
