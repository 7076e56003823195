// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "coarse_surface.hpp"

#include "lineament/core/closest_point.hpp"

#include <Eigen/Dense>

#include <algorithm>

namespace lineament::build {

Eigen::Vector3f SurfacePoint::rounded_weights() const
{
    const Eigen::Vector3d positive = weights.cwiseMax(0.0);
    return (positive / positive.sum()).cast<float>();
}

CoarseSurface::CoarseSurface(const MorphableModel& model)
    : model_(model), level_(model.levels.front()), vertices_(model.shape.mean.data(), 3, model.num_vertices())
{}

SurfacePoint CoarseSurface::closest(const Eigen::Vector3d& point, const std::string& group) const
{
    SurfacePoint best;
    for (Eigen::Index t = 0; t < level_.triangles.cols(); ++t) {
        if (!is_of(t, group)) {
            continue;
        }
        const Eigen::Vector3i corners = level_.triangles.col(t);
        const Eigen::Vector3d a = vertex(corners[0]);
        const Eigen::Vector3d b = vertex(corners[1]);
        const Eigen::Vector3d c = vertex(corners[2]);
        const Eigen::Vector3d nearest = closest_point_on_triangle(point, a, b, c);
        if ((nearest - point).norm() < best.distance) {
            Eigen::Matrix<double, 3, 2> edges;
            edges << b - a, c - a;
            const Eigen::Vector2d bc = edges.colPivHouseholderQr().solve(nearest - a);
            best = {(nearest - point).norm(), corners, Eigen::Vector3d(1.0 - bc.sum(), bc.x(), bc.y())};
        }
    }
    return best;
}

SurfacePoint CoarseSurface::closest_in_symmetry_plane(const Eigen::Vector3d& point) const
{
    SurfacePoint best;
    const auto try_segment = [&](const Eigen::Vector3i& corners, const Eigen::Vector3d& from,
                                 const Eigen::Vector3d& to) {
        Eigen::Matrix3d points;
        points << vertex(corners[0]), vertex(corners[1]), vertex(corners[2]);
        const Eigen::Vector3d start = points * from;
        const Eigen::Vector3d along = points * to - start;
        const double s = std::clamp(along.dot(point - start) / along.squaredNorm(), 0.0, 1.0);
        const Eigen::Vector3d weights = (1.0 - s) * from + s * to;
        const double distance = (points * weights - point).norm();
        if (distance < best.distance) {
            best = {distance, corners, weights};
        }
    };
    for (Eigen::Index t = 0; t < level_.triangles.cols(); ++t) {
        if (!is_of(t, "skin")) {
            continue;
        }
        for (int i = 0; i < 3; ++i) {
            const Eigen::Vector3i corners(level_.triangles(i, t), level_.triangles((i + 1) % 3, t),
                                          level_.triangles((i + 2) % 3, t));
            const bool first_in_plane = model_.mirror[corners[0]] == corners[0];
            if (first_in_plane && model_.mirror[corners[1]] == corners[1]) {
                try_segment(corners, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY());
            } else if (first_in_plane && model_.mirror[corners[1]] == corners[2]) {
                try_segment(corners, Eigen::Vector3d(0.0, 0.5, 0.5), Eigen::Vector3d::UnitX());
            }
        }
    }
    return best;
}

SurfacePoint CoarseSurface::mirrored(const SurfacePoint& point) const
{
    SurfacePoint result = point;
    for (int& vertex : result.vertices) {
        vertex = model_.mirror[vertex];
    }
    return result;
}

bool CoarseSurface::is_of(Eigen::Index triangle, const std::string& group) const
{
    return model_.triangle_group_names[static_cast<std::size_t>(level_.triangle_groups[triangle])] == group;
}

} // namespace lineament::build
