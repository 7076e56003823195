// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/checks.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace lineament {

/// y = scale * rotation * x + translation.
struct Similarity
{
    double scale = 1.0;
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity(); ///< det +1.
    Eigen::Vector3d translation = Eigen::Vector3d::Zero();

    /// Maps points (3 x N).
    [[nodiscard]] Eigen::Matrix3Xd operator*(const Eigen::Matrix3Xd& points) const
    {
        return ((scale * rotation) * points).colwise() + translation;
    }
};

enum class AlignmentScale
{
    free,  ///< Similarity: the scale is estimated.
    fixed, ///< Rigid motion: scale 1.
};

/// The similarity (or rigid motion) that minimises sum_i |target_i - (s R source_i + t)|^2.
///
/// Neutral (scale 1, identity rotation) where the sources coincide.
/// @param source, target  3 x N, N >= 1.
/// @throws InvalidArgument on sizes that disagree or non-finite input.
/// @par Reference  Umeyama, Least-Squares Estimation of Transformation Parameters Between Two Point Patterns, PAMI
/// 1991.
[[nodiscard]] inline Similarity align_points(const Eigen::Matrix3Xd& source, const Eigen::Matrix3Xd& target,
                                             AlignmentScale alignment_scale = AlignmentScale::free)
{
    require(source.cols() >= 1, "align_points", "source", "at least one point", "none");
    require_size(target.cols(), source.cols(), "align_points", "target");
    require_finite(source, "align_points", "source");
    require_finite(target, "align_points", "target");
    const Eigen::Vector3d source_mean = source.rowwise().mean();
    const Eigen::Vector3d target_mean = target.rowwise().mean();
    const Eigen::Matrix3Xd x = source.colwise() - source_mean;
    const Eigen::Matrix3Xd y = target.colwise() - target_mean;
    const double variance = x.squaredNorm();
    Similarity result;
    if (variance > 0.0) {
        const Eigen::JacobiSVD<Eigen::Matrix3d> svd(y * x.transpose(), Eigen::ComputeFullU | Eigen::ComputeFullV);
        Eigen::Vector3d signs(1.0, 1.0, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0);
        result.rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
        if (alignment_scale == AlignmentScale::free) {
            result.scale = svd.singularValues().dot(signs) / variance;
        }
    }
    result.translation = target_mean - result.scale * result.rotation * source_mean;
    return result;
}

} // namespace lineament
