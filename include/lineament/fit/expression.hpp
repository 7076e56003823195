// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/fit/fit_result.hpp"
#include "lineament/fit/model_points.hpp"

#include <Eigen/Core>

#include <limits>
#include <string>

namespace lineament {

struct ExpressionOptions
{
    double upper_bound = std::numeric_limits<double>::infinity(); ///< Of each psi, > 0; infinite: the thesis's NNLS.
    Eigen::VectorXd prior_standard_deviations = {};               ///< k, > 0; empty: no prior.
    int max_iterations = 300;                                     ///< Linear systems, >= 1.
};

struct ExpressionResult
{
    FitStatus status = FitStatus::too_few_correspondences; ///< success, not_converged or too_few_correspondences.
    std::string reason = {};
    Eigen::VectorXd coefficients = {}; ///< k, psi >= 0.
    int num_at_upper_bound = 0;
    int iterations = 0;
};

/// Blendshape coefficients of one image under a known camera and identity, by non-negative least squares:
///
///   psi = argmin over psi >= 0  sum_i w_i |J_i D_i psi + x_i(a) - y_i|^2  (+ |psi / sigma|^2)     docs/maths.md, Eq.
///   (6)
///
/// with x_i(a) the projection of the neutral face and J_i = s R_2 (under perspective: the camera's Jacobian at
/// `linearization`). A blendshape the points cannot see at all, or cannot tell from the others, stays 0; one they
/// hardly see is noise divided by next to nothing, and needs the prior or the bound.
///
/// @param weights        N, inverse variances [1/px^2]; empty: all 1.
/// @param linearization  psi at which a perspective camera is linearised.
/// @throws InvalidArgument on sizes that disagree, non-finite input, a negative weight or bad options.
/// @par Reference  Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23.
[[nodiscard]] ExpressionResult
fit_expression(const ModelPoints& points, const Eigen::Ref<const Eigen::Matrix2Xd>& image_points, const Camera& camera,
               const Eigen::VectorXd& given_weights, const Eigen::VectorXd& shape_coefficients,
               const ExpressionOptions& options = {}, const Eigen::VectorXd& linearization = {});

} // namespace lineament

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/expression_impl.hpp"
#endif
