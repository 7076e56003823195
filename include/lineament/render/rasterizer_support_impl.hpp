// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/core/image.hpp"
#include "lineament/render/checks.hpp"
#include "lineament/render/rasterizer.hpp" // IWYU pragma: keep
#include "lineament/render/triangle_coverage.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <vector>

namespace lineament::detail {

/// A vertex as the rasteriser needs it.
struct ProjectedVertex
{
    GridPoint point = {};
    double depth = 0.0;         ///< P_z [mm].
    double inverse_range = 0.0; ///< 1 / (1 + phi P_z), linear in the image plane; 1 under scaled orthography.
    bool is_drawable = false;
};

inline std::vector<ProjectedVertex> project_vertices(const Eigen::Matrix3Xf& vertices, const Camera& camera)
{
    constexpr double nearest_range = 1e-3;
    std::vector<ProjectedVertex> projected(static_cast<std::size_t>(vertices.cols()));
    for (Eigen::Index v = 0; v < vertices.cols(); ++v) {
        const Eigen::Vector3d point = camera.in_camera(vertices.col(v).cast<double>());
        const double range = 1.0 + camera.phi_per_mm * point.z();
        if (!(range >= nearest_range)) {
            continue;
        }
        const Eigen::Vector2d point_px = camera.principal_point_px + (camera.scale_px_per_mm / range) * point.head<2>();
        if (GridPoint::holds(point_px)) {
            projected[v] = {GridPoint::nearest(point_px), point.z(), 1.0 / range, true};
        }
    }
    return projected;
}

/// Calls visit(triangle, pixel index, depth, weight_b, weight_c) for each fragment nearer than what `depth` holds,
/// and stores its depth there.
template <typename Visit>
void draw_triangles(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& triangles, const Camera& camera,
                    const RasterOptions& options, ImageF& depth_image, Visit&& visit)
{
    const std::vector<ProjectedVertex> projected = project_vertices(vertices, camera);
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        const ProjectedVertex& a = projected[triangles(0, t)];
        const ProjectedVertex& b = projected[triangles(1, t)];
        const ProjectedVertex& c = projected[triangles(2, t)];
        if (!a.is_drawable || !b.is_drawable || !c.is_drawable) {
            continue;
        }
        if (options.culling == Culling::back_faces && signed_area2(a.point, b.point, c.point) > 0) {
            continue;
        }
        for_each_covered_pixel(a.point, b.point, c.point, depth_image.width, depth_image.height,
                               [&](int column, int row, double weight_b, double weight_c) {
                                   // Weights on the surface: those in the image plane times the inverse ranges,
                                   // normalised.
                                   const double on_a = (1.0 - weight_b - weight_c) * a.inverse_range;
                                   const double on_b = weight_b * b.inverse_range;
                                   const double on_c = weight_c * c.inverse_range;
                                   const double normalizer = 1.0 / (on_a + on_b + on_c);
                                   const double surface_b = on_b * normalizer;
                                   const double surface_c = on_c * normalizer;
                                   const auto depth = static_cast<float>(a.depth + surface_b * (b.depth - a.depth) +
                                                                         surface_c * (c.depth - a.depth));
                                   const std::size_t pixel = static_cast<std::size_t>(row) * depth_image.width + column;
                                   if (depth < depth_image.data[pixel]) {
                                       depth_image.data[pixel] = depth;
                                       visit(static_cast<int>(t), pixel, surface_b, surface_c);
                                   }
                               });
    }
}

inline void require_scene(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& triangles, const Camera& camera,
                          int width, int height, const char* function)
{
    require_image_size(width, height, function);
    require_camera(camera, function);
    require_finite(vertices, function, "vertices");
    require_triangles(triangles, vertices.cols(), function, "triangles");
}

/// The smallest rectangle of the picture plane that holds the images of the vertices in front of the camera; low > high
/// if there are none.
struct Bounds
{
    Eigen::Vector2d low;
    Eigen::Vector2d high;
};

inline Bounds bounds_in_picture(const Eigen::Matrix3Xf& vertices, const Camera& camera)
{
    constexpr double far = 1e9;
    Bounds bounds{Eigen::Vector2d::Constant(far), Eigen::Vector2d::Constant(-far)};
    for (Eigen::Index v = 0; v < vertices.cols(); ++v) {
        const Eigen::Vector3d point = camera.in_camera(vertices.col(v).cast<double>());
        const double range = 1.0 + camera.phi_per_mm * point.z();
        if (range > 0) {
            const Eigen::Vector2d point_px =
                camera.principal_point_px + (camera.scale_px_per_mm / range) * point.head<2>();
            bounds.low = bounds.low.cwiseMin(point_px);
            bounds.high = bounds.high.cwiseMax(point_px);
        }
    }
    return bounds;
}

} // namespace lineament::detail
