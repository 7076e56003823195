// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/checks.hpp"
#include "lineament/fit/fit_result.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <vector>

namespace lineament {

struct BoundedLeastSquaresResult
{
    FitStatus status = FitStatus::not_converged; ///< success or not_converged.
    Eigen::VectorXd solution = {};               ///< n, within the bounds whatever the status.
    Eigen::VectorXd gradient = {};               ///< n, G x - b at the solution.
    int num_at_bound = 0;
    int iterations = 0; ///< Linear systems solved.
};

/// Least squares with bounds, in Gram form:
///
///   min over x   x^T G x / 2 - b^T x    subject to  lower <= x <= upper                    docs/maths.md, Eq. (11)
///
/// by an active set: at the solution the gradient is 0 where x is free, >= 0 at a lower and <= 0 at an upper bound.
/// A variable that the Gram matrix cannot tell from those already free stays at its bound.
///
/// @param gram            n x n, symmetric, positive semidefinite (G = A^T W A, plus priors).
/// @param right_side      n, b.
/// @param lower, upper    n each, lower < upper, may be infinite.
/// @param start           n, within the bounds; a variable strictly between its bounds starts free.
/// @param max_iterations  Linear systems to solve at most; the status says if that was not enough.
/// @throws InvalidArgument on sizes that disagree, non-finite gram or right_side, or a start outside the bounds.
/// @par Cost       One n^3 / 3 factorisation per change of the free set.
/// @par Reference  Stark and Parker, Bounded-Variable Least-Squares, Computational Statistics 1995.
[[nodiscard]] BoundedLeastSquaresResult solve_bounded_least_squares(const Eigen::Ref<const Eigen::MatrixXd>& gram,
                                                                    const Eigen::Ref<const Eigen::VectorXd>& right_side,
                                                                    const Eigen::VectorXd& lower,
                                                                    const Eigen::VectorXd& upper,
                                                                    const Eigen::VectorXd& start, int max_iterations);

} // namespace lineament

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/bounded_least_squares_impl.hpp"
#endif
