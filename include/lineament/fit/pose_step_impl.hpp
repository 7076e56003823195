// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cmath>

namespace lineament::detail {

inline constexpr double nearest_depth_mm = 150.0; ///< Of the model's origin.

using PoseStep = Eigen::Matrix<double, 6, 1>; ///< Turn in camera space (3), log s, tau (2).

/// The camera after a step; phi follows the scale because the focal length is fixed.
[[nodiscard]] inline Camera apply_step(const Camera& camera, const PoseStep& step, double focal_length_px)
{
    Camera moved = camera;
    const double angle = step.head<3>().norm();
    if (angle > 0) {
        const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, step.head<3>() / angle).toRotationMatrix();
        moved.camera_from_model = Eigen::Quaterniond(turn * camera.camera_from_model).normalized().toRotationMatrix();
    }
    moved.scale_px_per_mm = camera.scale_px_per_mm * std::exp(step[3]);
    moved.translation_mm += step.tail<2>();
    moved.phi_per_mm = moved.scale_px_per_mm / focal_length_px;
    return moved;
}

/// Whether every point is well before the camera and the origin not nearer than 150 mm.
[[nodiscard]] inline bool is_in_front(const Camera& camera, const Eigen::Ref<const Eigen::Matrix3Xd>& points)
{
    const Eigen::RowVectorXd depths = camera.camera_from_model.row(2) * points;
    return camera.phi_per_mm * nearest_depth_mm <= 1.0 && 1.0 + camera.phi_per_mm * depths.minCoeff() > 0.1;
}

/// Where a point is seen, and how that changes.
struct SeenPoint
{
    Eigen::Vector2d at_px;
    Eigen::Matrix<double, 2, 3> by_point;  ///< d x / d X, as Camera::jacobian.
    Eigen::Matrix<double, 2, 6> by_camera; ///< d x / d (omega, log s, tau); the scale moves phi too: d phi / d log s =
                                           ///< phi.
    Eigen::Vector2d by_phi;                ///< d x / d phi.
};

[[nodiscard]] inline SeenPoint see_point(const Camera& camera, const Eigen::Vector3d& point)
{
    const Eigen::Vector3d rotated = camera.camera_from_model * point;
    const double inverse_depth = 1 / (1 + camera.phi_per_mm * rotated.z());
    const double scale = camera.scale_px_per_mm * inverse_depth; // d x / d P = scale (1 0 u; 0 1 v)
    const Eigen::Vector2d seen = inverse_depth * (rotated.head<2>() + camera.translation_mm);
    const double u = -camera.phi_per_mm * seen.x(), v = -camera.phi_per_mm * seen.y();
    const double x = rotated.x(), y = rotated.y(), z = rotated.z();
    const Eigen::Matrix3d& turn = camera.camera_from_model;
    SeenPoint result;
    result.at_px = camera.principal_point_px + camera.scale_px_per_mm * seen;
    result.by_point.row(0) = scale * (turn.row(0) + u * turn.row(2));
    result.by_point.row(1) = scale * (turn.row(1) + v * turn.row(2));
    result.by_camera.row(0) << scale * u * y, scale * (z - u * x), -scale * y, scale * seen.x(), scale, 0.0;
    result.by_camera.row(1) << scale * (v * y - z), -scale * v * x, scale * x, scale * seen.y(), 0.0, scale;
    result.by_phi = -scale * z * seen;
    return result;
}

} // namespace lineament::detail
