// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/rasterizer.hpp"

#include "lineament/core/mesh.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace lineament {

/// How a point of a surface is seen. The first of these that holds, in the order outside_image, back_facing,
/// self_occluded, visible.
enum class Visibility : std::uint8_t
{
    visible = 0,
    self_occluded = 1, ///< Another part of the surface lies in front of it.
    back_facing = 2,   ///< Its outward normal points away from the camera, or is zero.
    outside_image = 3, ///< It projects outside the picture, or lies behind the camera.
    unmapped = 4,      ///< Of texels only: no point of the surface is mapped there.
};

struct VisibilityOptions
{
    double depth_tolerance_mm = 1.0; ///< How far a point may lie behind the depth image and still count as seen, >= 0.
};

/// Depth image of a mesh, made once, and the question whether a point of its surface is seen.
class DepthTest
{
public:
    /// @throws InvalidArgument as `rasterize`, or on a negative tolerance.
    DepthTest(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& triangles, const Camera& camera, int width,
              int height, const VisibilityOptions& options = {});

    /// How a point of the surface is seen, given in camera space (Camera::in_camera) with its outward unit normal,
    /// also in camera space. Its depth is compared at the nearest pixel centre, where the tangent plane is met by the
    /// pixel's ray, so that slanted surfaces do not hide themselves.
    [[nodiscard]] Visibility operator()(const Eigen::Vector3d& point_in_camera,
                                        const Eigen::Vector3d& normal_in_camera) const;

    [[nodiscard]] const ImageF& depth() const { return depth_; }

private:
    Camera camera_;
    double tolerance_mm_;
    ImageF depth_;
};

/// How each vertex is seen (V values); normals are `compute_vertex_normals`.
/// @throws InvalidArgument as `rasterize`, or on a negative tolerance.
[[nodiscard]] std::vector<Visibility> compute_visibility(const Eigen::Matrix3Xf& vertices,
                                                         const Eigen::Matrix3Xi& triangles, const Camera& camera,
                                                         int width, int height, const VisibilityOptions& options = {});

/// The ray from the camera to a point in camera space, times 1 + phi P_z; (0, 0, 1) under scaled orthography.
[[nodiscard]] inline Eigen::Vector3d view_ray(const Camera& camera, const Eigen::Vector3d& point_in_camera)
{
    return camera.phi_per_mm * point_in_camera + Eigen::Vector3d::UnitZ();
}

inline Visibility DepthTest::operator()(const Eigen::Vector3d& point_in_camera,
                                        const Eigen::Vector3d& normal_in_camera) const
{
    const double range = 1.0 + camera_.phi_per_mm * point_in_camera.z();
    if (!(range > 0)) {
        return Visibility::outside_image;
    }
    const Eigen::Vector2d point_px =
        camera_.principal_point_px + (camera_.scale_px_per_mm / range) * point_in_camera.head<2>();
    if (!(point_px.x() >= 0 && point_px.y() >= 0 && point_px.x() < depth_.width && point_px.y() < depth_.height)) {
        return Visibility::outside_image;
    }
    if (!(normal_in_camera.dot(view_ray(camera_, point_in_camera)) < 0)) {
        return Visibility::back_facing;
    }
    const int column = static_cast<int>(point_px.x());
    const int row = static_cast<int>(point_px.y());

    // The ray of the pixel's centre is (e (1 + phi z), z); it meets the tangent plane n . (P - point) = 0 at:
    const Eigen::Vector2d e =
        (Eigen::Vector2d(column + 0.5, row + 0.5) - camera_.principal_point_px) / camera_.scale_px_per_mm;
    const double across = normal_in_camera.head<2>().dot(e);
    const double slope = normal_in_camera.z() + camera_.phi_per_mm * across;
    double expected_depth = point_in_camera.z();
    constexpr double grazing = -0.05; // nearer to the silhouette the tangent plane says nothing
    if (slope < grazing) {
        expected_depth = (normal_in_camera.dot(point_in_camera) - across) / slope;
    }
    return expected_depth > static_cast<double>(depth_.at(column, row)) + tolerance_mm_ ? Visibility::self_occluded
                                                                                        : Visibility::visible;
}

} // namespace lineament

#ifndef LINEAMENT_COMPILED_RENDER
#include "lineament/render/visibility_impl.hpp"
#endif
