// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/pose.hpp"

#include "lineament/fit/inline.hpp"
#include "lineament/fit/pose_step_impl.hpp"
#include "lineament/fit/pose_support_impl.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>

namespace lineament {

namespace detail {

/// From the closed form to the least reprojection error with phi = s / f; scaled orthographic with f infinite.
[[nodiscard]] LINEAMENT_FIT_INLINE PoseResult minimize_reprojection(
    const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model, const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
    double focal_length_px, const Eigen::VectorXd& given_weights, const Eigen::Vector2d& principal_point_px)
{
    PoseResult result = estimate_pose(points_in_model, image_points, given_weights, principal_point_px);
    if (result.status != FitStatus::success) {
        return result;
    }
    const Eigen::Index num_points = points_in_model.cols();
    const Eigen::VectorXd weights = weights_or_ones(given_weights, points_in_model.cols());

    // tau of the start is seen at the origin's depth, which holds under perspective too.
    Camera camera = apply_step(result.camera, PoseStep::Zero(), focal_length_px);
    if (!is_in_front(camera, points_in_model)) {
        result.status = FitStatus::implausible;
        result.reason = "with this focal length the face would be nearer than 150 mm";
        return result;
    }
    double rms = weighted_rms(camera, points_in_model, image_points, weights);
    double damping = 1e-6;
    result.status = FitStatus::not_converged;
    result.reason = "the pose did not settle in 50 steps";
    for (int iteration = 1; iteration <= 50; ++iteration) {
        result.iterations = iteration;
        Eigen::Matrix<double, 6, 6> hessian = Eigen::Matrix<double, 6, 6>::Zero();
        PoseStep gradient = PoseStep::Zero();
        for (Eigen::Index i = 0; i < num_points; ++i) {
            if (weights[i] > 0) {
                const SeenPoint seen = see_point(camera, points_in_model.col(i));
                hessian += weights[i] * seen.by_camera.transpose() * seen.by_camera;
                gradient += weights[i] * seen.by_camera.transpose() * (seen.at_px - image_points.col(i));
            }
        }
        hessian.diagonal() *= 1 + damping;
        const PoseStep step = -hessian.ldlt().solve(gradient);
        const Camera moved = apply_step(camera, step, focal_length_px);
        const double moved_rms = is_in_front(moved, points_in_model)
                                     ? weighted_rms(moved, points_in_model, image_points, weights)
                                     : std::numeric_limits<double>::infinity();
        // Motion of the points in the metric of the face: 100 mm across, so radians and log s count 100-fold.
        const double motion_mm = std::max(100 * step.head<4>().cwiseAbs().maxCoeff(), step.tail<2>().norm());
        const bool has_settled = motion_mm < 1e-9;
        if (moved_rms <= rms) {
            camera = moved;
            rms = moved_rms;
            damping = std::max(damping * 0.1, 1e-12);
        } else {
            damping *= 10;
        }
        if (has_settled || damping > 1e6) { // no representable step lowers the error any more
            result.status = FitStatus::success;
            result.reason.clear();
            break;
        }
    }
    result.camera = camera;
    result.rms_px = rms;
    if (looks_away(camera.camera_from_model)) {
        result.status = FitStatus::implausible;
        result.reason = looks_away_reason;
    }
    return result;
}

} // namespace detail

LINEAMENT_FIT_INLINE PoseResult estimate_pose_exactly(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model,
                                                      const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                                      const Eigen::VectorXd& weights,
                                                      const Eigen::Vector2d& principal_point_px)
{
    return detail::minimize_reprojection(points_in_model, image_points, std::numeric_limits<double>::infinity(),
                                         weights, principal_point_px);
}

LINEAMENT_FIT_INLINE PoseResult estimate_pose_perspective(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model,
                                                          const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                                          double focal_length_px, const Eigen::VectorXd& weights,
                                                          const Eigen::Vector2d& principal_point_px)
{
    require(std::isfinite(focal_length_px) && focal_length_px > 0, "estimate_pose_perspective", "focal_length_px",
            "a finite number > 0", to_text(focal_length_px));
    return detail::minimize_reprojection(points_in_model, image_points, focal_length_px, weights, principal_point_px);
}

} // namespace lineament
