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

/// d x / d (omega, log s, tau) of one point (2 x 6); the scale moves phi too: d phi / d log s = phi.
[[nodiscard]] inline Eigen::Matrix<double, 2, 6> pose_jacobian(const Camera& camera, const Eigen::Vector3d& point)
{
    const Eigen::Vector3d rotated = camera.camera_from_model * point;
    const Eigen::Vector3d in_camera = camera.in_camera(point);
    const double inverse_depth = 1 / (1 + camera.phi_per_mm * in_camera.z());
    const Eigen::Vector2d seen = inverse_depth * in_camera.head<2>();
    Eigen::Matrix<double, 2, 3> by_point; // d x / d P
    by_point.leftCols<2>() = camera.scale_px_per_mm * inverse_depth * Eigen::Matrix2d::Identity();
    by_point.col(2) = -camera.scale_px_per_mm * inverse_depth * camera.phi_per_mm * seen;
    Eigen::Matrix<double, 2, 6> jacobian;
    for (int axis = 0; axis < 3; ++axis) {
        jacobian.col(axis) = by_point * Eigen::Vector3d::Unit(axis).cross(rotated);
    }
    jacobian.col(3) = camera.scale_px_per_mm * inverse_depth * seen; // s p (1 - phi P_z / (1 + phi P_z))
    jacobian.rightCols<2>() = by_point.leftCols<2>();
    return jacobian;
}

} // namespace lineament::detail
