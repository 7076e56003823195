// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/fit_result.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <optional>

namespace lineament {

/// Where one eye looks, relative to the head.
struct EyeGaze
{
    /// The pupil's displacement on the fitted face from where it is when the eye looks straight ahead, along the
    /// head's x (to the subject's left) and y (up) [mm].
    Eigen::Vector2d offset_mm = Eigen::Vector2d::Zero();
    double yaw = 0.0;   ///< To the subject's left [radians].
    double pitch = 0.0; ///< Up [radians].
};

struct Gaze
{
    std::optional<EyeGaze> right = std::nullopt; ///< The subject's right eye, on the left of an unmirrored picture.
    std::optional<EyeGaze> left = std::nullopt;

    /// The mean of the eyes that have a gaze.
    [[nodiscard]] std::optional<EyeGaze> mean() const
    {
        if (!right || !left) {
            return right ? right : left;
        }
        return EyeGaze{0.5 * (right->offset_mm + left->offset_mm), 0.5 * (right->yaw + left->yaw),
                       0.5 * (right->pitch + left->pitch)};
    }
};

/// From an eye's centre of rotation to its pupil [mm]; people differ by about a tenth. The centre lies about 13.5 mm
/// behind the front of the cornea (between 14.8 mm for turns to the side and 12.2 mm for turns up and down: Fry and
/// Hill, The center of rotation of the eye, 1962, and The mechanics of elevating the eye, 1963), the pupil as it is
/// seen through the cornea about 3 mm (the schematic eye of Gullstrand and Le Grand).
inline constexpr double pupil_distance_mm = 10.5;

/// The gaze of a fit of the scheme mediapipe478, whose irises (468, 473) are seen but not fitted: an eye that turns is
/// no other face.
///
/// An eye is a ball in the head; its pupil lies at r g from the centre, |g| = 1, and at r e_z when it looks straight
/// ahead. With J the camera's Jacobian and d the iris seen minus the iris of the fitted face, both relative to the
/// middle of the two corners of the eye, g solves
///
///     J g = d / r + J e_z,    |g| = 1,    g towards the camera
///
/// (if d is longer than an eye can turn, the g next to it). Neither the angle between the line of sight and the optical
/// axis (up to 5 degrees, by Model and Eizenman on user-calibration-free gaze) nor the depth of a person's
/// eyes is known: calibrate before reading degrees as where someone looks.
///
/// @param fit  Of any scheme. Without the points of an eye, or where the head hides it (the eye's z axis is turned
///             from the camera by 70 degrees or more), the eye has no gaze.
[[nodiscard]] Gaze measure_gaze(const FitResult& fit);

namespace detail {

inline std::optional<EyeGaze> measure_eye(const FitResult& fit, const char* iris_name, const char* inner_corner,
                                          const char* outer_corner)
{
    const auto find = [&](const char* name) -> const FittedLandmark* {
        const auto found = std::find_if(fit.landmarks.begin(), fit.landmarks.end(),
                                        [&](const FittedLandmark& landmark) { return landmark.name == name; });
        return found != fit.landmarks.end() && found->point_px.allFinite() && found->fitted_px.allFinite() ? &*found
                                                                                                           : nullptr;
    };
    const FittedLandmark* iris = find(iris_name);
    const FittedLandmark* inner = find(inner_corner);
    const FittedLandmark* outer = find(outer_corner);
    const double facing = -fit.camera.camera_from_model(2, 2);
    constexpr double cos_70_degrees = 0.342;
    if (iris == nullptr || inner == nullptr || outer == nullptr || !(facing > cos_70_degrees)) {
        return std::nullopt;
    }
    const auto residual = [](const FittedLandmark& landmark) -> Eigen::Vector2d {
        return landmark.point_px - landmark.fitted_px;
    };
    const Eigen::Vector2d difference_px = residual(*iris) - 0.5 * (residual(*inner) + residual(*outer));

    const Eigen::Matrix<double, 2, 3> jacobian = fit.camera.jacobian(Eigen::Vector3d::Zero());
    const Eigen::Vector2d seen = difference_px / pupil_distance_mm + jacobian.col(2);
    const Eigen::Vector3d across = jacobian.transpose() * (jacobian * jacobian.transpose()).inverse() * seen;
    const Eigen::Vector3d to_camera = -Eigen::Vector3d(jacobian.row(0)).cross(Eigen::Vector3d(jacobian.row(1)));
    const double length = across.norm();
    const Eigen::Vector3d direction =
        length < 1.0 ? Eigen::Vector3d(across + std::sqrt(1.0 - length * length) * to_camera.normalized())
                     : Eigen::Vector3d(across / length);
    EyeGaze gaze;
    gaze.offset_mm = pupil_distance_mm * direction.head<2>();
    gaze.yaw = std::atan2(direction.x(), direction.z());
    gaze.pitch = std::asin(std::clamp(direction.y(), -1.0, 1.0));
    return gaze;
}

} // namespace detail

inline Gaze measure_gaze(const FitResult& fit)
{
    return {.right = detail::measure_eye(fit, "468", "133", "33"),
            .left = detail::measure_eye(fit, "473", "362", "263")};
}

} // namespace lineament
