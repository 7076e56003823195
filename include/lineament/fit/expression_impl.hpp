// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/expression.hpp"

#include "lineament/core/checks.hpp"
#include "lineament/fit/bounded_least_squares.hpp"
#include "lineament/fit/inline.hpp"
#include "lineament/fit/pose_support_impl.hpp"

#include <Eigen/LU>

#include <cmath>

namespace lineament {

LINEAMENT_FIT_INLINE ExpressionResult fit_expression(const ModelPoints& points,
                                                     const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                                     const Camera& camera, const Eigen::VectorXd& given_weights,
                                                     const Eigen::VectorXd& shape_coefficients,
                                                     const ExpressionOptions& options,
                                                     const Eigen::VectorXd& linearization)
{
    const char* const function = "fit_expression";
    const Eigen::Index count = points.num_expression_coefficients();
    detail::check_pairs(points.mean, image_points, given_weights, camera.principal_point_px, function);
    require(shape_coefficients.size() <= points.num_shape_coefficients(), function, "shape_coefficients",
            "at most " + std::to_string(points.num_shape_coefficients()), std::to_string(shape_coefficients.size()));
    require(linearization.size() <= count, function, "linearization", "at most " + std::to_string(count),
            std::to_string(linearization.size()));
    require_finite(shape_coefficients, function, "shape_coefficients");
    require_finite(linearization, function, "linearization");
    require(options.upper_bound > 0, function, "options.upper_bound", "> 0", to_text(options.upper_bound));
    require(options.max_iterations >= 1, function, "options.max_iterations", ">= 1",
            std::to_string(options.max_iterations));
    const Eigen::VectorXd& sigma = options.prior_standard_deviations;
    require(sigma.size() == 0 || (sigma.size() == count && (sigma.array() > 0).all()), function,
            "options.prior_standard_deviations", "empty, or one number > 0 for each blendshape", "another");

    ExpressionResult result;
    result.coefficients = Eigen::VectorXd::Zero(count);
    const Eigen::VectorXd weights =
        given_weights.size() > 0 ? given_weights : Eigen::VectorXd(Eigen::VectorXd::Ones(points.num_points()));
    if (!(weights.array() > 0).any()) {
        result.reason = "expressions need at least one point of positive weight";
        return result;
    }
    const Eigen::Matrix3Xd shape = points.at(shape_coefficients, linearization);
    Eigen::MatrixXd rows(count, 2 * points.num_points());
    Eigen::VectorXd residuals(2 * points.num_points());
    for (Eigen::Index i = 0; i < points.num_points(); ++i) {
        const Eigen::Vector3d point = shape.col(i);
        const double root = std::sqrt(weights[i]);
        rows.middleCols<2>(2 * i).noalias() =
            points.expression.middleCols<3>(3 * i) * (root * camera.jacobian(point)).transpose();
        residuals.segment<2>(2 * i) = root * (image_points.col(i) - camera.project(point));
    }
    residuals.noalias() += rows.topRows(linearization.size()).transpose() * linearization; // back to psi = 0
    Eigen::MatrixXd gram = rows * rows.transpose();
    if (sigma.size() > 0) {
        gram.diagonal() += sigma.array().square().inverse().matrix();
    }
    const BoundedLeastSquaresResult solved = solve_bounded_least_squares(
        gram, rows * residuals, result.coefficients, Eigen::VectorXd::Constant(count, options.upper_bound),
        result.coefficients, options.max_iterations);
    result.status = solved.status;
    result.coefficients = solved.solution;
    result.num_at_upper_bound = static_cast<int>((solved.solution.array() >= options.upper_bound).count());
    result.iterations = solved.iterations;
    if (solved.status != FitStatus::success) {
        result.reason = "the non-negative least squares did not settle in " + std::to_string(options.max_iterations) +
                        " iterations";
    }
    return result;
}

} // namespace lineament
