// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/bounded_least_squares.hpp"

#include "lineament/fit/inline.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace lineament {

namespace detail {

/// The minimiser over the free variables, the others held; nothing if their Gram matrix is singular to rounding.
[[nodiscard]] inline std::optional<Eigen::VectorXd> solve_free(const Eigen::Ref<const Eigen::MatrixXd>& gram,
                                                               const Eigen::Ref<const Eigen::VectorXd>& right_side,
                                                               const Eigen::VectorXd& x, const std::vector<int>& free)
{
    Eigen::VectorXd held = x;
    held(free).setZero();
    const Eigen::VectorXd reduced = right_side - gram * held;
    const Eigen::MatrixXd block = gram(free, free);
    const Eigen::LLT<Eigen::MatrixXd> cholesky(block);
    if (cholesky.info() != Eigen::Success) {
        return std::nullopt;
    }
    for (Eigen::Index i = 0; i < block.rows(); ++i) { // a pivot lost to cancellation: column i depends on the others
        const double pivot = cholesky.matrixLLT()(i, i);
        if (!(pivot * pivot > 1e-12 * block(i, i))) {
            return std::nullopt;
        }
    }
    return cholesky.solve(Eigen::VectorXd(reduced(free)));
}

} // namespace detail

LINEAMENT_FIT_INLINE BoundedLeastSquaresResult solve_bounded_least_squares(
    const Eigen::Ref<const Eigen::MatrixXd>& gram, const Eigen::Ref<const Eigen::VectorXd>& right_side,
    const Eigen::VectorXd& lower, const Eigen::VectorXd& upper, const Eigen::VectorXd& start, int max_iterations)
{
    const char* const function = "solve_bounded_least_squares";
    const Eigen::Index size = right_side.size();
    require(gram.rows() == size && gram.cols() == size, function, "gram",
            std::to_string(size) + " x " + std::to_string(size),
            std::to_string(gram.rows()) + " x " + std::to_string(gram.cols()));
    require_size(lower.size(), size, function, "lower");
    require_size(upper.size(), size, function, "upper");
    require_size(start.size(), size, function, "start");
    require_finite(gram, function, "gram");
    require_finite(right_side, function, "right_side");
    require_finite(start, function, "start");
    require((lower.array() < upper.array()).all(), function, "lower", "less than upper", "an empty interval");
    require((lower.array() <= start.array()).all() && (start.array() <= upper.array()).all(), function, "start",
            "within the bounds", "a value outside");

    BoundedLeastSquaresResult result;
    result.solution = start;
    Eigen::VectorXd& x = result.solution;
    std::vector<char> is_free(size), is_blocked(size, 0);
    bool is_stale = false; // the free variables are not yet at their minimum
    for (Eigen::Index i = 0; i < size; ++i) {
        is_free[i] = lower[i] < x[i] && x[i] < upper[i];
        is_stale = is_stale || is_free[i];
    }
    const double rounding = 100 * std::numeric_limits<double>::epsilon();
    int entered = -1;

    while (true) {
        if (!is_stale) { // the variable at a bound that wants to leave it most
            result.gradient = gram * x - right_side;
            const Eigen::VectorXd terms = right_side.cwiseAbs() + gram.cwiseAbs() * x.cwiseAbs();
            double largest = rounding * terms.lpNorm<Eigen::Infinity>();
            entered = -1;
            for (Eigen::Index i = 0; i < size; ++i) {
                const double pull = x[i] <= lower[i] ? -result.gradient[i] : result.gradient[i];
                if (!is_free[i] && !is_blocked[i] && pull > largest) {
                    largest = pull;
                    entered = static_cast<int>(i);
                }
            }
            if (entered < 0) {
                result.status = FitStatus::success;
                break;
            }
            is_free[entered] = 1;
        }
        if (result.iterations == max_iterations) {
            break;
        }
        ++result.iterations;

        std::vector<int> free;
        for (Eigen::Index i = 0; i < size; ++i) {
            if (is_free[i]) {
                free.push_back(static_cast<int>(i));
            }
        }
        const std::optional<Eigen::VectorXd> target = detail::solve_free(gram, right_side, x, free);
        if (!target) {
            if (entered < 0) {
                break; // the start itself is singular
            }
            is_free[entered] = 0;
            is_blocked[entered] = 1;
            is_stale = false;
            continue;
        }
        double step = 1; // towards the target, as far as the bounds allow
        for (std::size_t f = 0; f < free.size(); ++f) {
            const int i = free[f];
            const double goal = (*target)[static_cast<Eigen::Index>(f)];
            if (goal < lower[i] || goal > upper[i]) {
                const double bound = goal < lower[i] ? lower[i] : upper[i];
                step = std::min(step, (bound - x[i]) / (goal - x[i]));
            }
        }
        is_stale = false;
        for (std::size_t f = 0; f < free.size(); ++f) {
            const int i = free[f];
            const double goal = (*target)[static_cast<Eigen::Index>(f)];
            const bool is_beyond = goal < lower[i] || goal > upper[i];
            const double bound = goal < lower[i] ? lower[i] : upper[i];
            if (is_beyond && !((bound - x[i]) / (goal - x[i]) > step)) {
                x[i] = bound;
                is_free[i] = 0;
                is_stale = true;
            } else {
                x[i] = step == 1 ? goal : std::clamp(x[i] + step * (goal - x[i]), lower[i], upper[i]);
            }
        }
        if (step > 0) {
            is_blocked.assign(size, 0);
        } else if (entered >= 0 && !is_free[entered]) {
            is_blocked[entered] = 1; // its gradient was rounding
        }
    }
    result.gradient = gram * x - right_side;
    for (Eigen::Index i = 0; i < size; ++i) {
        result.num_at_bound += x[i] <= lower[i] || x[i] >= upper[i];
    }
    return result;
}

} // namespace lineament
