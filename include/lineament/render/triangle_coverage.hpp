// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace lineament {

/// A point of the image on a grid of 1/256 px, so that the sides of triangles are decided exactly, in integers.
struct GridPoint
{
    static constexpr int steps_per_px = 256;
    static constexpr double limit_px = 1 << 20; ///< Largest coordinate; beyond, 64-bit edge functions could overflow.

    std::int64_t x = 0;
    std::int64_t y = 0;

    [[nodiscard]] static bool holds(const Eigen::Vector2d& point_px)
    {
        return std::abs(point_px.x()) <= limit_px && std::abs(point_px.y()) <= limit_px;
    }
    /// The nearest grid point; the point must be one that the grid holds.
    [[nodiscard]] static GridPoint nearest(const Eigen::Vector2d& point_px)
    {
        return {std::llround(point_px.x() * steps_per_px), std::llround(point_px.y() * steps_per_px)};
    }
};

/// Twice the signed area of (a, b, c) in grid steps squared; negative for a face turned towards the camera (y down).
[[nodiscard]] inline std::int64_t signed_area2(const GridPoint& a, const GridPoint& b, const GridPoint& c)
{
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Calls visit(column, row, weight_b, weight_c) for each pixel of a width x height image whose centre the triangle
/// (a, b, c) covers, whatever its orientation. The weights are barycentric in the image plane; weight_a is the rest.
///
/// A centre on an edge belongs to the triangle for which that edge is a top or left one, so triangles that share an
/// edge cover each pixel along it exactly once. A triangle without area covers nothing.
/// @par Reference  Pineda, A Parallel Algorithm for Polygon Rasterization, SIGGRAPH 1988.
template <typename Visit>
void for_each_covered_pixel(const GridPoint& a, GridPoint b, GridPoint c, int width, int height, Visit&& visit)
{
    constexpr std::int64_t step = GridPoint::steps_per_px;
    std::int64_t area2 = signed_area2(a, b, c);
    if (area2 == 0) {
        return;
    }
    const bool is_swapped = area2 < 0;
    if (is_swapped) {
        std::swap(b, c);
        area2 = -area2;
    }

    // Columns and rows whose centres, at (index + 1/2) steps, lie within the bounding box; >> 8 rounds down.
    const auto first_index = [](std::int64_t low) { return (low + step / 2 - 1) >> 8; };
    const auto last_index = [](std::int64_t high) { return (high - step / 2) >> 8; };
    const int first_column = static_cast<int>(std::max<std::int64_t>(first_index(std::min({a.x, b.x, c.x})), 0));
    const int first_row = static_cast<int>(std::max<std::int64_t>(first_index(std::min({a.y, b.y, c.y})), 0));
    const int last_column = static_cast<int>(std::min<std::int64_t>(last_index(std::max({a.x, b.x, c.x})), width - 1));
    const int last_row = static_cast<int>(std::min<std::int64_t>(last_index(std::max({a.y, b.y, c.y})), height - 1));
    if (first_column > last_column || first_row > last_row) {
        return;
    }

    struct Edge
    {
        std::int64_t value;   // at the first pixel of the row; >= threshold: inside
        std::int64_t step_x;  // change to the next column
        std::int64_t step_y;  // change to the next row
        std::int64_t minimum; // 0 on top and left edges, else 1
    };
    const GridPoint start{first_column * step + step / 2, first_row * step + step / 2};
    const auto edge = [&](const GridPoint& from, const GridPoint& to) {
        const std::int64_t dx = to.x - from.x;
        const std::int64_t dy = to.y - from.y;
        const bool is_top_left = dy < 0 || (dy == 0 && dx > 0);
        return Edge{signed_area2(from, to, start), -dy * step, dx * step, is_top_left ? 0 : 1};
    };
    Edge opposite_a = edge(b, c);
    Edge opposite_b = edge(c, a);
    Edge opposite_c = edge(a, b);

    const double inverse_area2 = 1.0 / static_cast<double>(area2);
    for (int row = first_row; row <= last_row; ++row) {
        std::int64_t value_a = opposite_a.value;
        std::int64_t value_b = opposite_b.value;
        std::int64_t value_c = opposite_c.value;
        bool was_inside = false;
        for (int column = first_column; column <= last_column; ++column) {
            if (value_a >= opposite_a.minimum && value_b >= opposite_b.minimum && value_c >= opposite_c.minimum) {
                was_inside = true;
                const double weight_b = static_cast<double>(value_b) * inverse_area2;
                const double weight_c = static_cast<double>(value_c) * inverse_area2;
                visit(column, row, is_swapped ? weight_c : weight_b, is_swapped ? weight_b : weight_c);
            } else if (was_inside) {
                break; // a triangle is convex: the rest of the row is outside
            }
            value_a += opposite_a.step_x;
            value_b += opposite_b.step_x;
            value_c += opposite_c.step_x;
        }
        opposite_a.value += opposite_a.step_y;
        opposite_b.value += opposite_b.step_y;
        opposite_c.value += opposite_c.step_y;
    }
}

} // namespace lineament
