// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/affine_camera.hpp"
#include "lineament/fit/bounded_least_squares.hpp"
#include "lineament/fit/model_points.hpp"
#include "lineament/fit/pose.hpp"

#include <Eigen/Cholesky>

// The thesis's sequence pose -> expression -> iterations x (pose -> identity -> expression) put together from parts,
// with parts that FaceFitter does not have: an affine camera, and expressions that may be negative.
namespace lineament::bench {

enum class CameraKind
{
    scaled_orthographic,
    affine,
};

struct PartsOptions
{
    CameraKind camera = CameraKind::scaled_orthographic;
    double min_expression = 0.0;
    double max_expression = 3.0;
    int iterations = 5;
    double prior_px = 90.0; ///< Weight of |a|^2 [px^2]: 30 times a noise variance of 3 px^2, the published setting.
};

struct PartsResult
{
    FitStatus status = FitStatus::degenerate; ///< Of the pose.
    Eigen::VectorXd alpha = {};
    Eigen::VectorXd psi = {};
    Eigen::Matrix<double, 2, 4> image_from_model = {};
};

[[nodiscard]] inline Eigen::Matrix<double, 2, 4> affine_of(const Camera& camera)
{
    Eigen::Matrix<double, 2, 4> matrix;
    matrix.leftCols<3>() = camera.scale_px_per_mm * camera.camera_from_model.topRows<2>();
    matrix.col(3) = camera.image_translation_px();
    return matrix;
}

/// Fits landmark i to column i of the points.
[[nodiscard]] inline PartsResult fit_by_parts(const ModelPoints& points, const Eigen::Matrix2Xd& seen,
                                              const PartsOptions& options)
{
    PartsResult result;
    result.alpha = Eigen::VectorXd::Zero(points.num_shape_coefficients());
    result.psi = Eigen::VectorXd::Zero(points.num_expression_coefficients());

    const auto estimate_camera = [&] {
        const Eigen::Matrix3Xd shape = points.at(result.alpha, result.psi);
        if (options.camera == CameraKind::affine) {
            const AffineCameraResult affine = estimate_affine_camera(shape, seen);
            result.status = affine.status;
            result.image_from_model = affine.image_from_model;
        } else {
            const PoseResult pose = estimate_pose(shape, seen);
            result.status = pose.status;
            result.image_from_model = affine_of(pose.camera);
        }
    };
    // One row for each coefficient: what it moves in the image; and what is left to explain, point by point.
    const auto rows_of = [&](const Eigen::MatrixXd& model_rows) {
        Eigen::MatrixXd rows(model_rows.rows(), 2 * points.num_points());
        for (Eigen::Index i = 0; i < points.num_points(); ++i) {
            rows.middleCols<2>(2 * i) =
                model_rows.middleCols<3>(3 * i) * result.image_from_model.leftCols<3>().transpose();
        }
        return rows;
    };
    const auto unexplained = [&](const Eigen::VectorXd& alpha, const Eigen::VectorXd& psi) {
        const Eigen::Matrix2Xd linear = result.image_from_model.leftCols<3>() * points.at(alpha, psi);
        const Eigen::Matrix2Xd difference = (seen - linear).colwise() - result.image_from_model.col(3);
        return Eigen::VectorXd(difference.reshaped());
    };
    const auto fit_identity = [&] {
        const Eigen::MatrixXd rows = rows_of(points.identity);
        Eigen::MatrixXd gram = rows * rows.transpose();
        gram.diagonal().array() += options.prior_px;
        result.alpha = gram.llt().solve(rows * unexplained({}, result.psi));
    };
    const auto fit_expression = [&] {
        const Eigen::MatrixXd rows = rows_of(points.expression);
        const Eigen::Index count = rows.rows();
        result.psi = solve_bounded_least_squares(rows * rows.transpose(), rows * unexplained(result.alpha, {}),
                                                 Eigen::VectorXd::Constant(count, options.min_expression),
                                                 Eigen::VectorXd::Constant(count, options.max_expression),
                                                 Eigen::VectorXd::Zero(count), 300)
                         .solution;
    };
    estimate_camera();
    fit_expression();
    for (int iteration = 0; iteration < options.iterations; ++iteration) {
        estimate_camera();
        fit_identity();
        fit_expression();
    }
    return result;
}

/// Image points of a landmark set whose names are in the map's order (2 x L).
[[nodiscard]] inline Eigen::Matrix2Xd points_of(const LandmarkSet& landmarks)
{
    Eigen::Matrix2Xd points(2, static_cast<Eigen::Index>(landmarks.landmarks.size()));
    for (Eigen::Index l = 0; l < points.cols(); ++l) {
        points.col(l) = landmarks.landmarks[static_cast<std::size_t>(l)].point_px;
    }
    return points;
}

} // namespace lineament::bench
