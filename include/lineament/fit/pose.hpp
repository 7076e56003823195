// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/fit/fit_result.hpp"

#include <Eigen/Core>

#include <string>

namespace lineament {

/// The camera of one view, and what is known of it.
struct PoseResult
{
    FitStatus status = FitStatus::degenerate;
    std::string reason = {}; ///< Of a status other than success, in words.
    Camera camera = {};      ///< Neutral if too_few_correspondences or degenerate; the best found otherwise.
    double rms_px = 0.0;     ///< Weighted root mean square reprojection distance.
    int iterations = 0;      ///< 0 for the closed form.
};

/// The scaled orthographic camera of point pairs, in closed form:
///
///   A = argmin sum_i w_i |A X_i + t - y_i|^2,  R_2 = polar factor of A's rows made unit,        docs/maths.md, Eq. (9)
///   (s, t) = argmin sum_i w_i |s R_2 X_i + t - y_i|^2                                          docs/maths.md, Eq. (10)
///
/// The second line, usually left out, makes scale and translation the best ones for the rotation returned. Exact for
/// pairs without noise; with noise it is near, but not at, the least reprojection error.
///
/// @param points_in_model     3 x N, mm, N >= 4, not in one plane.
/// @param image_points        2 x N, px.
/// @param weights             N, >= 0; empty: all 1. A pair of weight 0 is absent.
/// @param principal_point_px  Only splits the image translation t = c + s tau.
/// @return too_few_correspondences below four pairs of positive weight; degenerate for coincident, collinear or planar
///         model points or image points on a line; implausible for a face that looks away by more than 100 degrees, or
///         image points seen less than a quarter as far apart in one direction as in the other, by what the pose says.
/// @throws InvalidArgument on sizes that disagree, non-finite input or a negative weight.
/// @par Reference  Bas, Smith, Bolkart and Wuhrer, Fitting a 3D Morphable Model to Edges, ACCV workshops 2016.
[[nodiscard]] PoseResult estimate_pose(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model,
                                       const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                       const Eigen::VectorXd& weights = {},
                                       const Eigen::Vector2d& principal_point_px = Eigen::Vector2d::Zero());

namespace detail {

/// The same of pairs that are known to be usable, without rms_px.
[[nodiscard]] PoseResult pose_of_pairs(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model,
                                       const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                       const Eigen::VectorXd& weights, const Eigen::Vector2d& principal_point_px);

} // namespace detail

/// The scaled orthographic camera of points that are seen with their depth, in closed form: with y_i = (u, v, depth),
///
///   (s, R, t) = argmin sum_i w_i |s R X_i + t - y_i|^2                                         docs/maths.md, Eq. (19)
///
/// keeps R; scale and translation are then those of Eq. (10), which leave depth out. A network that draws depth after
/// how the head is turned knows more of the turn than where its points lie in the picture tells.
///
/// @param points_in_model     3 x N, mm, N >= 3, not on one line.
/// @param seen_points         3 x N, px: image point and depth, growing away from the camera, from any origin.
/// @param weights             N, >= 0; empty: all 1. A pair of weight 0 is absent.
/// @param principal_point_px  Only splits the image translation.
/// @return too_few_correspondences below three pairs of positive weight; degenerate for points on a line; implausible
///         as estimate_pose.
/// @throws InvalidArgument as estimate_pose.
/// @par Reference  Umeyama, Least-Squares Estimation of Transformation Parameters Between Two Point Patterns, PAMI
/// 1991.
[[nodiscard]] PoseResult estimate_pose_with_depth(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model,
                                                  const Eigen::Ref<const Eigen::Matrix3Xd>& seen_points,
                                                  const Eigen::VectorXd& weights = {},
                                                  const Eigen::Vector2d& principal_point_px = Eigen::Vector2d::Zero());

/// The scaled orthographic camera of least reprojection error, sum_i w_i |x_i - y_i|^2: the steps of
/// estimate_pose_perspective with phi = 0. From the closed form one or two steps are usually enough.
///
/// Arguments, return value and errors as estimate_pose; not_converged after 50 steps, with the best camera found.
[[nodiscard]] PoseResult estimate_pose_exactly(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model,
                                               const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                               const Eigen::VectorXd& weights = {},
                                               const Eigen::Vector2d& principal_point_px = Eigen::Vector2d::Zero());

/// The perspective camera of known focal length that minimises sum_i w_i |x_i - y_i|^2 with x of Eq. (3) and
/// phi = s / f: damped Gauss-Newton steps on rotation, log s and tau from the start of estimate_pose.
///
/// @param focal_length_px  f > 0, in the same pixels as the image points.
/// @return As estimate_pose; implausible also if the face would be nearer than 150 mm, then with the best camera found.
/// @throws InvalidArgument as estimate_pose, and unless the focal length is positive and finite.
[[nodiscard]] PoseResult estimate_pose_perspective(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model,
                                                   const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                                   double focal_length_px, const Eigen::VectorXd& weights = {},
                                                   const Eigen::Vector2d& principal_point_px = Eigen::Vector2d::Zero());

} // namespace lineament

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/depth_pose_impl.hpp"
#include "lineament/fit/perspective_pose_impl.hpp"
#include "lineament/fit/pose_impl.hpp"
#endif
