// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/identity.hpp"

#include "lineament/fit/inline.hpp"
#include "lineament/fit/pose_support_impl.hpp"

#include <cmath>

namespace lineament {

LINEAMENT_FIT_INLINE void IdentityOptions::check() const
{
    require(std::isfinite(regularization) && regularization >= 0, "IdentityOptions", "regularization",
            "a finite number >= 0", to_text(regularization));
    require(std::isfinite(landmark_sigma_px) && landmark_sigma_px > 0, "IdentityOptions", "landmark_sigma_px",
            "a finite number > 0", to_text(landmark_sigma_px));
    require(max_coefficient > 0, "IdentityOptions", "max_coefficient", "> 0", to_text(max_coefficient));
}

LINEAMENT_FIT_INLINE IdentitySystem::IdentitySystem(Eigen::Index num_coefficients)
    : gram_(Eigen::MatrixXd::Zero(num_coefficients, num_coefficients)),
      right_side_(Eigen::VectorXd::Zero(num_coefficients))
{}

LINEAMENT_FIT_INLINE void IdentitySystem::add(const ModelPoints& points,
                                              const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                              const Eigen::VectorXd& weights, const Camera& camera,
                                              const Eigen::VectorXd& expression_coefficients,
                                              const Eigen::VectorXd& linearization)
{
    const Eigen::Index num_points = points.num_points();
    const Eigen::Matrix3Xd shape = points.at(linearization, expression_coefficients);
    Eigen::MatrixXd rows(gram_.rows(), 2 * num_points); // A^T, times the square roots of the weights
    Eigen::VectorXd residuals(2 * num_points);          // -b, likewise
    for (Eigen::Index i = 0; i < num_points; ++i) {
        const Eigen::Vector3d point = shape.col(i);
        const double root = std::sqrt(weights[i]);
        const Eigen::Matrix<double, 2, 3> jacobian = root * camera.jacobian(point);
        rows.middleCols<2>(2 * i).noalias() = points.identity.middleCols<3>(3 * i) * jacobian.transpose();
        residuals.segment<2>(2 * i) = root * (image_points.col(i) - camera.project(point));
        num_points_ += weights[i] > 0;
    }
    if (gram_.rows() == 0) {
        return; // no identity to fit
    }
    residuals.noalias() += rows.topRows(linearization.size()).transpose() * linearization; // back to a = 0
    gram_.selfadjointView<Eigen::Lower>().rankUpdate(rows);
    right_side_.noalias() += rows * residuals;
}

LINEAMENT_FIT_INLINE IdentityResult IdentitySystem::solve(const IdentityOptions& options) const
{
    options.check();
    IdentityResult result;
    result.coefficients = Eigen::VectorXd::Zero(right_side_.size());
    if (num_points_ == 0) {
        result.status = FitStatus::too_few_correspondences;
        result.reason = "identity needs at least one point of positive weight";
        return result;
    }
    Eigen::MatrixXd system = gram_.selfadjointView<Eigen::Lower>();
    system.diagonal().array() += options.regularization;
    const Eigen::VectorXd bound = Eigen::VectorXd::Constant(right_side_.size(), options.max_coefficient);
    const BoundedLeastSquaresResult solved = solve_bounded_least_squares(
        system, right_side_, -bound, bound, result.coefficients, static_cast<int>(10 * right_side_.size()) + 10);
    if (solved.status != FitStatus::success) {
        result.status = FitStatus::degenerate;
        result.reason = "the points do not determine the shape coefficients; use regularization > 0";
        return result;
    }
    result.coefficients = solved.solution;
    result.num_at_bound = solved.num_at_bound;
    result.status = FitStatus::success;
    if (solved.num_at_bound > 0) {
        result.status = FitStatus::implausible;
        result.reason = std::to_string(solved.num_at_bound) + " shape coefficients were held at " +
                        to_text(options.max_coefficient) + " standard deviations";
    }
    return result;
}

LINEAMENT_FIT_INLINE IdentityResult fit_identity(const ModelPoints& points,
                                                 const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                                 const Camera& camera, const Eigen::VectorXd& weights,
                                                 const Eigen::VectorXd& expression_coefficients,
                                                 const IdentityOptions& options, const Eigen::VectorXd& linearization)
{
    options.check();
    detail::check_pairs(points.mean, image_points, weights, camera.principal_point_px, "fit_identity");
    const Eigen::Index num_expressions = points.num_expression_coefficients();
    require(expression_coefficients.size() <= num_expressions, "fit_identity", "expression_coefficients",
            "at most " + std::to_string(num_expressions), std::to_string(expression_coefficients.size()));
    require(linearization.size() <= points.num_shape_coefficients(), "fit_identity", "linearization",
            "at most " + std::to_string(points.num_shape_coefficients()), std::to_string(linearization.size()));
    require_finite(expression_coefficients, "fit_identity", "expression_coefficients");
    require_finite(linearization, "fit_identity", "linearization");
    const double default_weight = 1 / (options.landmark_sigma_px * options.landmark_sigma_px);
    IdentitySystem system(points.num_shape_coefficients());
    system.add(points, image_points,
               weights.size() > 0 ? weights
                                  : Eigen::VectorXd(Eigen::VectorXd::Constant(points.num_points(), default_weight)),
               camera, expression_coefficients, linearization);
    return system.solve(options);
}

} // namespace lineament
