// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/fit/pose_support_impl.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>

#include <optional>

namespace lineament::detail {

/// Weighted sums over pairs of a model point and where it is seen, in the image and in depth.
struct PairMoments
{
    double weight = 0.0;
    Eigen::Vector3d model = Eigen::Vector3d::Zero();
    Eigen::Vector3d seen = Eigen::Vector3d::Zero();
    Eigen::Matrix3d model_model = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d seen_model = Eigen::Matrix3d::Zero();

    void add(double pair_weight, const Eigen::Vector3d& in_model, const Eigen::Vector3d& in_view)
    {
        weight += pair_weight;
        model += pair_weight * in_model;
        seen += pair_weight * in_view;
        model_model += pair_weight * in_model * in_model.transpose();
        seen_model += pair_weight * in_view * in_model.transpose();
    }

    /// About the means, of which the sums remain.
    [[nodiscard]] PairMoments centred() const
    {
        PairMoments result = *this;
        result.model_model -= model * model.transpose() / weight;
        result.seen_model -= seen * model.transpose() / weight;
        return result;
    }
};

/// The rotation of docs/maths.md, Eq. (19); nothing for points on a line.
[[nodiscard]] inline std::optional<Eigen::Matrix3d> rotation_with_depth(const PairMoments& pairs)
{
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(pairs.centred().seen_model, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Vector3d& singular_values = svd.singularValues();
    if (!(singular_values[1] > 1e-6 * singular_values[0])) {
        return std::nullopt;
    }
    const Eigen::Matrix3d turn = svd.matrixU() * svd.matrixV().transpose();
    const Eigen::Vector3d signs(1.0, 1.0, turn.determinant() < 0 ? -1.0 : 1.0);
    return Eigen::Matrix3d(svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose());
}

/// Turns the camera, and gives it the scale and translation of Eq. (10) for that rotation; false if there is none of
/// positive scale. Depths do not matter here.
[[nodiscard]] inline bool place(const Eigen::Matrix3d& rotation, const PairMoments& pairs, Camera& camera)
{
    const PairMoments about_means = pairs.centred();
    const Eigen::Matrix<double, 2, 3> rows = rotation.topRows<2>();
    const double correlation = about_means.seen_model.topRows<2>().cwiseProduct(rows).sum();
    const double scale = correlation / (rows * about_means.model_model * rows.transpose()).trace();
    if (!(scale > 0)) {
        return false;
    }
    camera.camera_from_model = rotation;
    camera.scale_px_per_mm = scale;
    const Eigen::Vector2d translation_px = (pairs.seen.head<2>() - scale * rows * pairs.model) / pairs.weight;
    camera.translation_mm = (translation_px - camera.principal_point_px) / scale;
    return true;
}

/// The fitters' last pose: rotation of the points with depth, the rest of all points. False, and the camera as it was,
/// without four points of usable depth or if they make a face look away.
[[nodiscard]] inline bool turn_camera_by_depth(const PairMoments& all, const PairMoments& with_depth,
                                               int num_with_depth, Camera& camera)
{
    if (num_with_depth < 4) {
        return false;
    }
    const std::optional<Eigen::Matrix3d> rotation = rotation_with_depth(with_depth);
    return rotation && !looks_away(*rotation) && place(*rotation, all, camera);
}

} // namespace lineament::detail
