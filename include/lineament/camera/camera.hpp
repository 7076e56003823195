// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/checks.hpp"

#include <Eigen/Core>

namespace lineament {

/// diag(1, -1, -1): the `camera_from_model` of an upright frontal face, and the only flip there is.
[[nodiscard]] inline Eigen::Matrix3d frontal_rotation()
{
    return Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
}

/// Pose and camera in one: scaled orthographic projection, or perspective by one scalar phi.
///
///   x = c + s (P_x, P_y) / (1 + phi P_z),    P = R X + (tau_x, tau_y, 0)                   docs/maths.md, Eq. (3)
///
/// R is `camera_from_model` (camera space: x right, y down, z forward, mm). phi = 0 is scaled orthographic
/// projection, x = s R_2 X + t with t = c + s tau, Eq. (2). phi = 1/d > 0 is perspective with the model's origin at
/// depth d and focal length s / phi.
struct Camera
{
    Eigen::Matrix3d camera_from_model = frontal_rotation();       ///< Rotation, det +1.
    Eigen::Vector2d translation_mm = Eigen::Vector2d::Zero();     ///< tau.
    double scale_px_per_mm = 1.0;                                 ///< s, > 0.
    double phi_per_mm = 0.0;                                      ///< phi, >= 0; 0 is scaled orthographic.
    Eigen::Vector2d principal_point_px = Eigen::Vector2d::Zero(); ///< c.

    /// The model point in camera space, depth relative to the model's origin [mm].
    [[nodiscard]] Eigen::Vector3d in_camera(const Eigen::Vector3d& point_in_model) const
    {
        Eigen::Vector3d point = camera_from_model * point_in_model;
        point.head<2>() += translation_mm;
        return point;
    }

    /// The image point [px] of a model point [mm]. Under perspective the point must lie before the camera,
    /// 1 + phi P_z > 0.
    [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& point_in_model) const
    {
        const Eigen::Vector3d point = in_camera(point_in_model);
        return principal_point_px + (scale_px_per_mm / (1.0 + phi_per_mm * point.z())) * point.head<2>();
    }

    /// Image points (2 x N) [px] of model points (3 x N) [mm].
    [[nodiscard]] Eigen::Matrix2Xd project(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model) const
    {
        Eigen::Matrix2Xd image_points(2, points_in_model.cols());
        for (Eigen::Index i = 0; i < points_in_model.cols(); ++i) {
            image_points.col(i) = project(Eigen::Vector3d(points_in_model.col(i)));
        }
        return image_points;
    }

    /// d project / d point (2 x 3) [px/mm] at a model point: s R_2 under scaled orthographic projection,
    /// s / (1 + phi P_z) (R_2 - phi p r_3) with p = (P_x, P_y) / (1 + phi P_z) under perspective.
    [[nodiscard]] Eigen::Matrix<double, 2, 3> jacobian(const Eigen::Vector3d& point_in_model) const
    {
        if (phi_per_mm == 0.0) {
            return scale_px_per_mm * camera_from_model.topRows<2>();
        }
        const Eigen::Vector3d point = in_camera(point_in_model);
        const double inverse_depth = 1.0 / (1.0 + phi_per_mm * point.z());
        const Eigen::Vector2d seen = inverse_depth * point.head<2>();
        return scale_px_per_mm * inverse_depth *
               (camera_from_model.topRows<2>() - phi_per_mm * seen * camera_from_model.row(2));
    }

    /// t = c + s tau [px]: where the model's origin is seen.
    [[nodiscard]] Eigen::Vector2d image_translation_px() const
    {
        return principal_point_px + scale_px_per_mm * translation_mm;
    }
};

} // namespace lineament
