// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/pose.hpp"

#include "lineament/fit/inline.hpp"
#include "lineament/fit/pair_moments_impl.hpp"
#include "lineament/fit/pose_support_impl.hpp"

#include <optional>

namespace lineament {

LINEAMENT_FIT_INLINE PoseResult estimate_pose_with_depth(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model,
                                                         const Eigen::Ref<const Eigen::Matrix3Xd>& seen_points,
                                                         const Eigen::VectorXd& given_weights,
                                                         const Eigen::Vector2d& principal_point_px)
{
    detail::check_pairs(points_in_model, seen_points.topRows<2>(), given_weights, principal_point_px,
                        "estimate_pose_with_depth");
    require_finite(seen_points, "estimate_pose_with_depth", "seen_points");
    const Eigen::VectorXd weights = detail::weights_or_ones(given_weights, points_in_model.cols());
    PoseResult result;
    result.camera.principal_point_px = principal_point_px;
    const Eigen::Index num_used = (weights.array() > 0).count();
    if (num_used < 3) {
        result.status = FitStatus::too_few_correspondences;
        result.reason = "a pose with depth needs 3 points, got " + std::to_string(num_used);
        return result;
    }
    detail::PairMoments pairs;
    for (Eigen::Index i = 0; i < points_in_model.cols(); ++i) {
        pairs.add(weights[i], points_in_model.col(i), seen_points.col(i));
    }
    const std::optional<Eigen::Matrix3d> rotation = detail::rotation_with_depth(pairs);
    if (!rotation || !detail::place(*rotation, pairs, result.camera)) {
        result.reason = "the points coincide or lie on a line";
        return result;
    }
    result.rms_px = detail::weighted_rms(result.camera, points_in_model, seen_points.topRows<2>(), weights);
    detail::judge_facing(result);
    return result;
}

} // namespace lineament
