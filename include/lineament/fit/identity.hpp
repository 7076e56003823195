// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/fit/bounded_least_squares.hpp"
#include "lineament/fit/fit_result.hpp"
#include "lineament/fit/model_points.hpp"

#include <Eigen/Core>

#include <string>

namespace lineament {

struct IdentityOptions
{
    double regularization = 1.0;    ///< Weight of |a|^2, >= 0; 1: maximum a posteriori, 0: least squares.
    double landmark_sigma_px = 3.0; ///< Standard deviation of every point where no weights are given, > 0.
    double max_coefficient = 5.0;   ///< |a_j| is held at this many standard deviations, > 0.

    void check() const; ///< @throws InvalidArgument naming the member and the value.
};

struct IdentityResult
{
    FitStatus status = FitStatus::degenerate;
    std::string reason = {};
    Eigen::VectorXd coefficients = {}; ///< m; zeros if too_few_correspondences or degenerate.
    int num_at_bound = 0;              ///< Coefficients held at the bound; > 0 makes the status implausible.
};

/// The normal equations of Eq. (4), summed point by point: for one image or stacked over many.
class IdentitySystem
{
public:
    explicit IdentitySystem(Eigen::Index num_coefficients);

    /// Adds every point of one image.
    /// @param points                   N points.
    /// @param image_points             2 x N, px.
    /// @param weights                  N, inverse variances [1/px^2], >= 0.
    /// @param expression_coefficients  psi; missing trailing ones are 0.
    /// @param linearization            a at which a perspective camera is linearised; scaled orthographic cameras are
    ///                                 linear and do not need it.
    void add(const ModelPoints& points, const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
             const Eigen::VectorXd& weights, const Camera& camera, const Eigen::VectorXd& expression_coefficients,
             const Eigen::VectorXd& linearization);

    /// (sum A^T W A + regularization I) a = -sum A^T W b, |a_j| <= max_coefficient.
    [[nodiscard]] IdentityResult solve(const IdentityOptions& options) const;

    [[nodiscard]] const Eigen::MatrixXd& gram() const { return gram_; }             ///< m x m, lower triangle.
    [[nodiscard]] const Eigen::VectorXd& right_side() const { return right_side_; } ///< m.

private:
    Eigen::MatrixXd gram_;
    Eigen::VectorXd right_side_;
    Eigen::Index num_points_ = 0;
};

/// Shape coefficients of one image under a known camera and expression:
///
///   a = argmin sum_i w_i |A_i a + b_i|^2 + regularization |a|^2                              docs/maths.md, Eq. (4)
///
/// with A_i = J_i B_i, b_i the residual at a = 0 and J_i = s R_2 (under perspective: the camera's Jacobian at
/// `linearization`; repeat to convergence).
///
/// @return too_few_correspondences without a point of positive weight; degenerate if the system is singular (possible
///         only with regularization 0); implausible if a coefficient was held at the bound.
/// @throws InvalidArgument on sizes that disagree, non-finite input, a negative weight or bad options.
/// @par Cost       N m^2 + m^3 / 3 multiplications; allocates. Thread-safe. Same input, same bits.
/// @par Reference  Aldrian and Smith, Inverse Rendering of Faces with a 3D Morphable Model, PAMI 2013.
[[nodiscard]] IdentityResult
fit_identity(const ModelPoints& points, const Eigen::Ref<const Eigen::Matrix2Xd>& image_points, const Camera& camera,
             const Eigen::VectorXd& weights = {}, const Eigen::VectorXd& expression_coefficients = {},
             const IdentityOptions& options = {}, const Eigen::VectorXd& linearization = {});

} // namespace lineament

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/identity_impl.hpp"
#endif
