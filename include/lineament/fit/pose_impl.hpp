// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/pose.hpp"

#include "lineament/fit/inline.hpp"
#include "lineament/fit/pose_support_impl.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>

namespace lineament {

namespace detail {

/// The orthonormal 2 x 3 nearest to two unit rows: (N N^T)^(-1/2) N, closed form because N N^T = [1 c; c 1].
[[nodiscard]] inline Eigen::Matrix<double, 2, 3> polar_factor(const Eigen::Matrix<double, 2, 3>& unit_rows)
{
    const double cosine = unit_rows.row(0).dot(unit_rows.row(1));
    const double plus = 1 / std::sqrt(1 + cosine);
    const double minus = 1 / std::sqrt(1 - cosine);
    Eigen::Matrix2d inverse_root;
    inverse_root << plus + minus, plus - minus, plus - minus, plus + minus;
    return 0.5 * inverse_root * unit_rows;
}

LINEAMENT_FIT_INLINE PoseResult pose_of_pairs(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model,
                                              const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                              const Eigen::VectorXd& given_weights,
                                              const Eigen::Vector2d& principal_point_px)
{
    const auto weight = [&](Eigen::Index i) { return given_weights.size() > 0 ? given_weights[i] : 1.0; };
    PoseResult result;
    result.camera.principal_point_px = principal_point_px;
    Eigen::Index num_used = 0;
    double total = 0;
    // Weighted sums of offsets from the first pair that counts, so that nothing is lost where the means are taken off:
    // of points and image points, and of their products. Each by its name, for which compilers find registers.
    Eigen::Index first = 0;
    while (first + 1 < points_in_model.cols() && !(weight(first) > 0)) {
        ++first;
    }
    double x = 0, y = 0, z = 0, u = 0, v = 0;
    double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, ux = 0, uy = 0, uz = 0, vx = 0, vy = 0, vz = 0;
    for (Eigen::Index i = 0; i < points_in_model.cols(); ++i) {
        const double w = weight(i);
        const Eigen::Vector3d p = points_in_model.col(i) - points_in_model.col(first);
        const Eigen::Vector2d q = image_points.col(i) - image_points.col(first);
        const double wx = w * p.x(), wy = w * p.y(), wz = w * p.z();
        num_used += w > 0;
        total += w;
        x += wx, y += wy, z += wz;
        u += w * q.x(), v += w * q.y();
        xx += wx * p.x(), xy += wx * p.y(), xz += wx * p.z();
        yy += wy * p.y(), yz += wy * p.z(), zz += wz * p.z();
        ux += wx * q.x(), uy += wy * q.x(), uz += wz * q.x();
        vx += wx * q.y(), vy += wy * q.y(), vz += wz * q.y();
    }
    if (num_used < 4) {
        result.status = FitStatus::too_few_correspondences;
        result.reason = "a pose needs 4 points, got " + std::to_string(num_used);
        return result;
    }
    Eigen::Vector3d mean_in_model = Eigen::Vector3d(x, y, z) / total;
    Eigen::Vector2d mean_in_image = Eigen::Vector2d(u, v) / total;
    Eigen::Matrix3d moments; // about the means
    moments << xx, xy, xz, xy, yy, yz, xz, yz, zz;
    moments = Eigen::Matrix3d(moments / total - mean_in_model * mean_in_model.transpose());
    Eigen::Matrix<double, 2, 3> cross;
    cross << ux, uy, uz, vx, vy, vz;
    cross = Eigen::Matrix<double, 2, 3>(cross / total - mean_in_image * mean_in_model.transpose());
    mean_in_model += points_in_model.col(first);
    mean_in_image += image_points.col(first);

    // Variances along the principal axes: a plane within 1 % of the widest extent fixes no rotation safely. Where the
    // determinant says that all are wide, a bound of the largest does.
    const double trace = moments.trace();
    Eigen::Vector3d variances = Eigen::Vector3d::Constant(trace / 3);
    if (!(moments.determinant() > 1e-4 * trace * trace * trace)) {
        variances = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments, Eigen::EigenvaluesOnly).eigenvalues();
    }
    if (!(variances[0] > 1e-4 * variances[2])) {
        const bool is_line = !(variances[1] > 1e-4 * variances[2]);
        const bool is_point = !(variances[2] > 0);
        result.reason = is_point  ? "the model points coincide"
                        : is_line ? "the model points lie on a line"
                                  : "the model points lie in a plane";
        return result;
    }

    Eigen::Matrix<double, 2, 3> affine = cross * moments.inverse();
    const Eigen::Vector2d row_scales = affine.rowwise().norm();
    const double rounding_px = 1e-12 * (1 + image_points.cwiseAbs().maxCoeff());
    if (!(row_scales.minCoeff() * std::sqrt(variances[2]) > rounding_px) ||
        !(row_scales.minCoeff() > 1e-3 * row_scales.maxCoeff())) {
        result.reason = "the image points coincide or lie on a line";
        return result;
    }
    affine.row(0) /= row_scales[0];
    affine.row(1) /= row_scales[1];
    if (!(std::abs(affine.row(0).dot(affine.row(1))) < 1 - 1e-6)) {
        result.reason = "the image points lie on a line";
        return result;
    }

    Camera& camera = result.camera;
    const Eigen::Matrix<double, 2, 3> rotation = polar_factor(affine);
    camera.camera_from_model.topRows<2>() = rotation;
    camera.camera_from_model.row(2) = rotation.row(0).cross(rotation.row(1));
    const Eigen::Matrix2d posed = rotation * moments * rotation.transpose();
    camera.scale_px_per_mm = cross.cwiseProduct(rotation).sum() / posed.trace();
    if (!(camera.scale_px_per_mm > 0)) {
        result.camera = Camera{};
        result.camera.principal_point_px = principal_point_px;
        result.reason = "no positive scale fits the points";
        return result;
    }
    const Eigen::Vector2d translation_px = mean_in_image - camera.scale_px_per_mm * rotation * mean_in_model;
    camera.translation_mm = (translation_px - principal_point_px) / camera.scale_px_per_mm;
    judge_facing(result);
    if (result.status == FitStatus::success && is_squeezed(cross * rotation.transpose() * posed.inverse())) {
        result.status = FitStatus::implausible;
        result.reason = squeezed_reason;
    }
    return result;
}

} // namespace detail

LINEAMENT_FIT_INLINE PoseResult estimate_pose(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model,
                                              const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                              const Eigen::VectorXd& weights, const Eigen::Vector2d& principal_point_px)
{
    detail::check_pairs(points_in_model, image_points, weights, principal_point_px, "estimate_pose");
    PoseResult result = detail::pose_of_pairs(points_in_model, image_points, weights, principal_point_px);
    if (result.status == FitStatus::success || result.status == FitStatus::implausible) {
        result.rms_px = detail::weighted_rms(result.camera, points_in_model, image_points, weights);
    }
    return result;
}

} // namespace lineament
