// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/bounded_least_squares.hpp"

#include <Eigen/Core>

#include <limits>

namespace lineament {

/// Non-negative least squares in Gram form: min over x >= 0 of x^T G x / 2 - b^T x, from x = 0.
///
/// The method of Lawson and Hanson (Solving Least Squares Problems, 1974, chapter 23), which is the active set of
/// solve_bounded_least_squares without upper bounds. Finite; at most `max_iterations` systems are solved.
[[nodiscard]] inline BoundedLeastSquaresResult solve_nnls(const Eigen::Ref<const Eigen::MatrixXd>& gram,
                                                          const Eigen::Ref<const Eigen::VectorXd>& right_side,
                                                          int max_iterations)
{
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(right_side.size());
    const Eigen::VectorXd infinite =
        Eigen::VectorXd::Constant(right_side.size(), std::numeric_limits<double>::infinity());
    return solve_bounded_least_squares(gram, right_side, zero, infinite, zero, max_iterations);
}

} // namespace lineament
