// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The posterior covariance of a joint fit.
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_CERTAINTY_IMPL_HPP
#define LINEAMENT_FIT_JOINT_CERTAINTY_IMPL_HPP

#include "lineament/fit/joint_problem.hpp"
#include "lineament/fit/positive_factor_impl.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

namespace lineament::detail {

/// How sure the unknowns are.
struct JointCertainty
{
    std::vector<int> free = {};      ///< Ascending; the others are held at a bound.
    PositiveFactor::Square inverse;  ///< The covariance of those, in memory of the factor.
    Eigen::VectorXd deviations = {}; ///< K, standard deviations, each as if it were free.

    [[nodiscard]] bool is_finite() const { return deviations.allFinite(); }

    /// Of some unknowns, ascending; rows of those held are 0.
    [[nodiscard]] Eigen::MatrixXd covariance_of(const std::vector<int>& unknowns) const
    {
        const Eigen::Index size = static_cast<Eigen::Index>(unknowns.size());
        std::vector<Eigen::Index> positions; // among the free, or -1
        auto next = free.begin();
        for (const int unknown : unknowns) {
            next = std::lower_bound(next, free.end(), unknown);
            positions.push_back(next != free.end() && *next == unknown ? next - free.begin() : -1);
        }
        Eigen::Index num_same = 0; // the first, which are the first of the free
        while (num_same < size && positions[static_cast<std::size_t>(num_same)] == num_same) {
            ++num_same;
        }
        Eigen::MatrixXd covariance(size, size);
        for (Eigen::Index j = 0; j < size; ++j) { // several times as fast as an indexed view
            const Eigen::Index from = positions[static_cast<std::size_t>(j)];
            if (from < 0) {
                covariance.col(j).setZero();
                continue;
            }
            covariance.col(j).head(num_same) = inverse.col(from).head(num_same);
            for (Eigen::Index i = num_same; i < size; ++i) {
                const Eigen::Index at = positions[static_cast<std::size_t>(i)];
                covariance(i, j) = at >= 0 ? inverse(at, from) : 0.0;
            }
        }
        return covariance;
    }
};

/// With H = U^T U that of the free unknowns F, C = H^-1, and 1 / (H_kk - |U^-T H_Fk|^2) is the variance of an
/// unknown k that is held.
/// @param system  With the matrix of all unknowns.
/// @param factor  Its memory holds the answer.
[[nodiscard]] inline JointCertainty certainty_of(const JointProblem& problem, const JointState& state,
                                                 JointSystem& system, PositiveFactor& factor)
{
    std::vector<int> free;
    problem.find_free_unknowns(state, system, free);
    std::vector<int> held;
    std::set_difference(system.unknowns.begin(), system.unknowns.end(), free.begin(), free.end(),
                        std::back_inserter(held));
    const Eigen::Index num_free = static_cast<Eigen::Index>(free.size());
    const Eigen::VectorXd explained = factor.factor_block(system.hessian, free, held);
    JointCertainty certainty{free, factor.inverse(num_free), Eigen::VectorXd(system.hessian.rows())};
    for (Eigen::Index i = 0; i < num_free; ++i) {
        certainty.deviations[free[i]] = std::sqrt(certainty.inverse(i, i));
    }
    for (std::size_t k = 0; k < held.size(); ++k) {
        certainty.deviations[held[k]] =
            1 / std::sqrt(system.hessian(held[k], held[k]) - explained[static_cast<Eigen::Index>(k)]);
    }
    return certainty;
}

} // namespace lineament::detail

#endif
