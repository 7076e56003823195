// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/core/checks.hpp"
#include "lineament/fit/fit_result.hpp"

#include <Eigen/Core>
#include <Eigen/LU>

#include <cmath>
#include <string>

namespace lineament::detail {

/// Below this cosine of the viewing direction with the face's own, the face looks away by more than 100 degrees.
inline constexpr double min_facing_cosine = -0.17;

/// @throws InvalidArgument if pairs and weights are not of one size, finite and non-negative.
inline void check_pairs(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model,
                        const Eigen::Ref<const Eigen::Matrix2Xd>& image_points, const Eigen::VectorXd& weights,
                        const Eigen::Vector2d& principal_point_px, const char* function)
{
    require_size(image_points.cols(), points_in_model.cols(), function, "image_points");
    if (weights.size() > 0) {
        require_size(weights.size(), points_in_model.cols(), function, "weights");
    }
    require_finite(points_in_model, function, "points_in_model");
    require_finite(image_points, function, "image_points");
    require_finite(weights, function, "weights");
    require_finite(principal_point_px, function, "principal_point_px");
    if (weights.size() > 0 && !(weights.minCoeff() >= 0)) {
        throw InvalidArgument(function, "weights", ">= 0", to_text(weights.minCoeff()));
    }
}

/// @param weights  Or none: 1 for each pair.
[[nodiscard]] inline double weighted_rms(const Camera& camera, const Eigen::Ref<const Eigen::Matrix3Xd>& points,
                                         const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                         const Eigen::VectorXd& weights)
{
    double sum = 0, total = 0;
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
        const double weight = weights.size() > 0 ? weights[i] : 1.0;
        if (weight > 0) {
            sum += weight * (camera.project(Eigen::Vector3d(points.col(i))) - image_points.col(i)).squaredNorm();
            total += weight;
        }
    }
    return std::sqrt(sum / total);
}

/// The weights given, or 1 for each pair if there are none.
[[nodiscard]] inline Eigen::VectorXd weights_or_ones(const Eigen::VectorXd& weights, Eigen::Index num_pairs)
{
    return weights.size() > 0 ? weights : Eigen::VectorXd(Eigen::VectorXd::Ones(num_pairs));
}

inline constexpr const char* looks_away_reason =
    "the face looks away from the camera; are the landmarks mirrored or swapped?";

/// H_33 = -R_33 is the cosine between the face's forward axis and the direction to the camera.
[[nodiscard]] inline bool looks_away(const Eigen::Matrix3d& camera_from_model)
{
    return -camera_from_model(2, 2) < min_facing_cosine;
}

/// Where the points of the image are seen under a quarter as far apart in one direction as in the other, as the pose
/// would have them, that is no pose: points about a line, whatever their noise. Of 10^4 faces of 20 to 68 landmarks,
/// with up to 3 px of noise at 100 px between the outer eye corners, the least was 0.56; lines with that noise have at
/// most 0.16.
inline constexpr double min_aspect = 0.25;

inline constexpr const char* squeezed_reason =
    "the image points are squeezed together in one direction; do they lie about a line?";

/// Whether the least singular value of the map from points as posed to points as seen is below min_aspect times the
/// largest: for values p >= q of the ratio r = q / p the determinant is r / (1 + r^2) times the sum of squares.
[[nodiscard]] inline bool is_squeezed(const Eigen::Matrix2d& seen_from_posed)
{
    return !(seen_from_posed.determinant() >
             min_aspect / (1 + min_aspect * min_aspect) * seen_from_posed.squaredNorm());
}

/// Success, or implausible for a face that looks away. @tparam Result  PoseResult, which includes this file.
template <typename Result>
void judge_facing(Result& result)
{
    const bool is_away = looks_away(result.camera.camera_from_model);
    result.status = is_away ? FitStatus::implausible : FitStatus::success;
    result.reason = is_away ? looks_away_reason : "";
}

} // namespace lineament::detail
