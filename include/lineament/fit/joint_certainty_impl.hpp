// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The posterior covariance of a joint fit.
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_CERTAINTY_IMPL_HPP
#define LINEAMENT_FIT_JOINT_CERTAINTY_IMPL_HPP

#include "lineament/fit/arrow_inverse_impl.hpp"
#include "lineament/fit/joint_problem.hpp"
#include "lineament/fit/positive_factor_impl.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <new>
#include <vector>

namespace lineament::detail {

/// How sure the unknowns are.
class JointCertainty
{
public:
    /// With H = U^T U that of the free unknowns F, C = H^-1, and 1 / (H_kk - |U^-T H_Fk|^2) is the variance of an
    /// unknown k that is held. Of an arrow alone, where that takes less, image by image.
    /// @param system  With the matrix of all unknowns.
    /// @param factor  Its memory may hold the answer.
    void find(const JointProblem& problem, const JointState& state, JointSystem& system, PositiveFactor& factor)
    {
        problem.find_free_unknowns(state, system, free_);
        is_arrow_ = problem.is_arrow() && !system.has_hessian && system.arrow.is_sparse();
        if (is_arrow_) {
            arrow_.find(*problem.kernels, system.arrow, free_, deviations_);
            return;
        }
        problem.complete_hessian(state, system);
        held_.clear();
        std::set_difference(system.unknowns.begin(), system.unknowns.end(), free_.begin(), free_.end(),
                            std::back_inserter(held_));
        const Eigen::Index num_free = static_cast<Eigen::Index>(free_.size());
        factor.factor_block(system.hessian, free_, held_, explained_);
        const PositiveFactor::Square inverse = factor.inverse(num_free);
        new (&inverse_) PositiveFactor::Square(inverse);
        deviations_.resize(system.hessian.rows());
        for (Eigen::Index i = 0; i < num_free; ++i) {
            deviations_[free_[static_cast<std::size_t>(i)]] = std::sqrt(inverse_(i, i));
        }
        for (std::size_t k = 0; k < held_.size(); ++k) {
            const int unknown = held_[k];
            deviations_[unknown] =
                1 / std::sqrt(system.hessian(unknown, unknown) - explained_[static_cast<Eigen::Index>(k)]);
        }
    }

    [[nodiscard]] bool is_finite() const { return deviations_.allFinite(); }

    /// K, standard deviations, each as if it were free.
    [[nodiscard]] const Eigen::VectorXd& deviations() const { return deviations_; }

    /// Sets the block of some unknowns, shared or of one image's own, ascending; rows of those held are 0.
    template <typename Block>
    void set_covariance(std::size_t image, const std::vector<int>& unknowns, Block covariance)
    {
        if (is_arrow_) {
            arrow_.set_block_of_image(image, of_image_, block_);
            set_covariance(of_image_, block_, unknowns, covariance);
        } else {
            set_covariance(free_, inverse_, unknowns, covariance);
        }
    }

private:
    template <typename Inverse, typename Block>
    void set_covariance(const std::vector<int>& free, const Inverse& inverse, const std::vector<int>& unknowns,
                        Block covariance)
    {
        const Eigen::Index size = static_cast<Eigen::Index>(unknowns.size());
        positions_.clear();
        auto next = free.begin();
        for (const int unknown : unknowns) {
            next = std::lower_bound(next, free.end(), unknown);
            positions_.push_back(next != free.end() && *next == unknown ? next - free.begin() : -1);
        }
        Eigen::Index num_same = 0; // the first, which are the first of the free
        while (num_same < size && positions_[static_cast<std::size_t>(num_same)] == num_same) {
            ++num_same;
        }
        for (Eigen::Index j = 0; j < size; ++j) { // several times as fast as an indexed view
            const Eigen::Index from = positions_[static_cast<std::size_t>(j)];
            if (from < 0) {
                covariance.col(j).setZero();
                continue;
            }
            covariance.col(j).head(num_same) = inverse.col(from).head(num_same);
            for (Eigen::Index i = num_same; i < size; ++i) {
                const Eigen::Index at = positions_[static_cast<std::size_t>(i)];
                covariance(i, j) = at >= 0 ? inverse(at, from) : 0.0;
            }
        }
    }

    std::vector<int> free_ = {}; ///< Ascending; the others are held at a bound.
    std::vector<int> held_ = {};
    PositiveFactor::Square inverse_ = {nullptr, 0, 0, Eigen::OuterStride<>(0)}; ///< The covariance of the free.
    Eigen::VectorXd deviations_ = {};
    RoomyMatrix<Eigen::VectorXd> explained_ = {};
    std::vector<Eigen::Index> positions_ = {}; ///< Among the free, or -1.
    bool is_arrow_ = false;                    ///< The covariance is in `arrow_`.
    ArrowInverse arrow_ = {};
    std::vector<int> of_image_ = {}; ///< Kept for their room.
    Eigen::MatrixXd block_ = {};
};

} // namespace lineament::detail

#endif
