// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace lineament::detail {

/// Position of the nearest column to the point, and the distance; -1 if there is none.
[[nodiscard]] inline std::pair<int, double> nearest_column(const Eigen::Matrix2Xd& points, const Eigen::Vector2d& point)
{
    int nearest = -1;
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
        const double distance = (points.col(i) - point).squaredNorm();
        if (distance < least) {
            least = distance;
            nearest = static_cast<int>(i);
        }
    }
    return {nearest, std::sqrt(least)};
}

/// Image points (2 x N) of single vertices.
[[nodiscard]] inline Eigen::Matrix2Xd project_vertices(const Eigen::Ref<const Eigen::Matrix3Xf>& shape_vertices,
                                                       const std::vector<int>& vertices, const Camera& camera)
{
    Eigen::Matrix2Xd points(2, static_cast<Eigen::Index>(vertices.size()));
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        const Eigen::Vector3d vertex = shape_vertices.col(vertices[i]).cast<double>();
        points.col(static_cast<Eigen::Index>(i)) = camera.project(vertex);
    }
    return points;
}

inline void sort_unique(std::vector<int>& values)
{
    std::sort(values.begin(), values.end());
    values.erase(std::unique(values.begin(), values.end()), values.end());
}

} // namespace lineament::detail
