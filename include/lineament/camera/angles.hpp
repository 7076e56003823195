// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lineament {

/// Head angles in radians: H = F R = R_y(yaw) R_x(pitch) R_z(roll) with F = diag(1, -1, -1), right-handed turns in
/// x right, y up, z towards the camera.                                                   docs/maths.md, section 2
///
/// Frontal is (0, 0, 0). yaw > 0: the subject turns to its own left; pitch > 0: nose down; roll > 0: the head tilts
/// towards the subject's right shoulder. The only gimbal lock is at pitch = +-90 degrees.
struct HeadAngles
{
    double yaw = 0.0;
    double pitch = 0.0;
    double roll = 0.0;
};

[[nodiscard]] inline double degrees(double radians)
{
    return radians * (180.0 / std::numbers::pi);
}
[[nodiscard]] inline double radians(double degrees)
{
    return degrees * (std::numbers::pi / 180.0);
}

/// Angles of a rotation `camera_from_model`.
[[nodiscard]] inline HeadAngles angles_from_rotation(const Eigen::Matrix3d& camera_from_model)
{
    const Eigen::Matrix3d head = frontal_rotation() * camera_from_model;
    return {std::atan2(head(0, 2), head(2, 2)), -std::asin(std::clamp(head(1, 2), -1.0, 1.0)),
            std::atan2(head(1, 0), head(1, 1))};
}

/// angles_from_rotation(camera_from_model).yaw alone.
[[nodiscard]] inline double yaw_from_rotation(const Eigen::Matrix3d& camera_from_model)
{
    return std::atan2(camera_from_model(0, 2), -camera_from_model(2, 2));
}

/// The rotation `camera_from_model` with these angles.
[[nodiscard]] inline Eigen::Matrix3d rotation_from_angles(const HeadAngles& angles)
{
    const Eigen::Matrix3d head = (Eigen::AngleAxisd(angles.yaw, Eigen::Vector3d::UnitY()) *
                                  Eigen::AngleAxisd(angles.pitch, Eigen::Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(angles.roll, Eigen::Vector3d::UnitZ()))
                                     .toRotationMatrix();
    return frontal_rotation() * head;
}

} // namespace lineament
