// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/joint_solver.hpp"

#include "lineament/fit/inline.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace lineament::detail {

LINEAMENT_FIT_INLINE std::vector<int> free_unknowns(const JointSystem& system, const Eigen::VectorXd& down,
                                                    const Eigen::VectorXd& up)
{
    std::vector<int> free;
    for (Eigen::Index i = 0; i < system.gradient.size(); ++i) {
        const bool is_low = down[i] >= 0;
        const bool is_high = up[i] <= 0;
        const double gradient = system.gradient[i];
        if (!(is_low && (is_high || gradient > 0)) && !(is_high && gradient < 0)) {
            free.push_back(static_cast<int>(i));
        }
    }
    return free;
}

LINEAMENT_FIT_INLINE Eigen::MatrixXd block_of(const Eigen::MatrixXd& matrix, const std::vector<int>& indices)
{
    const std::size_t size = indices.size();
    Eigen::MatrixXd block(size, size);
    double* to = block.data();
    for (std::size_t j = 0; j < size; ++j) { // several times as fast as an indexed view
        const double* column = matrix.data() + matrix.rows() * indices[j];
        for (std::size_t i = 0; i < size; ++i) {
            *to++ = column[indices[i]];
        }
    }
    return block;
}

LINEAMENT_FIT_INLINE Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& matrix)
{
    const Eigen::Index size = matrix.rows();
    const Eigen::LLT<Eigen::MatrixXd> cholesky(matrix);
    Eigen::MatrixXd root = Eigen::MatrixXd::Identity(size, size);
    cholesky.matrixL().solveInPlace(root); // L^-1
    Eigen::MatrixXd inverse = Eigen::MatrixXd::Zero(size, size);
    inverse.selfadjointView<Eigen::Lower>().rankUpdate(root.transpose());
    inverse.triangularView<Eigen::StrictlyUpper>() = inverse.transpose();
    return inverse;
}

/// The damped Gauss-Newton step within the bounds: what would leave them is held at its bound and the rest solved
/// again.
[[nodiscard]] inline Eigen::VectorXd bounded_step(const JointSystem& system, double damping,
                                                  const Eigen::VectorXd& down, const Eigen::VectorXd& up)
{
    Eigen::VectorXd step = Eigen::VectorXd::Zero(system.gradient.size());
    std::vector<int> free = free_unknowns(system, down, up);
    while (!free.empty()) {
        const Eigen::VectorXd right_side = -system.gradient - system.hessian * step;
        Eigen::MatrixXd block = block_of(system.hessian, free);
        block.diagonal() *= 1 + damping;
        const Eigen::VectorXd solved = block.llt().solve(Eigen::VectorXd(right_side(free)));
        std::vector<int> inside;
        for (std::size_t i = 0; i < free.size(); ++i) {
            const double goal = solved[static_cast<Eigen::Index>(i)];
            if (goal >= down[free[i]] && goal <= up[free[i]]) {
                inside.push_back(free[i]);
            } else {
                step[free[i]] = goal < down[free[i]] ? down[free[i]] : up[free[i]];
            }
        }
        if (inside.size() == free.size()) {
            step(free) = solved;
            break;
        }
        free = std::move(inside);
    }
    return step;
}

LINEAMENT_FIT_INLINE void refresh_scale_strengths(JointProblem& problem, const JointState& state, JointSystem& system)
{
    Eigen::VectorXd down, up;
    problem.room(state, down, up);
    std::vector<int> linear = free_unknowns(system, down, up);
    std::erase_if(linear, [&](int i) { return problem.is_camera(i); });
    const Eigen::Index size = system.gradient.size();
    Eigen::MatrixXd inverse = Eigen::MatrixXd::Zero(size, size);
    inverse(linear, linear) = inverse_of(block_of(system.hessian, linear));
    const Eigen::Index num_biases = state.bias.cols();
    Eigen::MatrixXd spread(num_biases > 0 ? size : 0, 3 * num_biases); // - covariance of the unknowns with the biases
    for (Eigen::Index b = 0; b < num_biases; ++b) {
        const Eigen::Matrix3d bias_inverse = system.bias_inverse.middleCols<3>(3 * b);
        spread.middleCols<3>(3 * b).noalias() = inverse * (system.bias_coupling.middleCols<3>(3 * b) * bias_inverse);
    }
    const Eigen::Index shared = problem.num_shared();
    const Eigen::Index own = problem.num_own();
    for (std::size_t f = 0; f < problem.images.size(); ++f) {
        const Eigen::Index begin = problem.own_begin(f);
        const Eigen::MatrixXd& gram = system.image_grams[f];
        double strength = gram.topLeftCorner(shared, shared).cwiseProduct(inverse.topLeftCorner(shared, shared)).sum();
        strength += gram.bottomLeftCorner(own, shared).cwiseProduct(inverse.block(begin, 0, own, shared)).sum();
        if (num_biases > 0) {
            strength -= system.image_couplings[f].topRows(shared).cwiseProduct(spread.topRows(shared)).sum();
        }
        double& scale_strength = problem.images[f].scale_strength;
        system.gradient[begin + 3] += strength - scale_strength;
        scale_strength = strength;
    }
}

LINEAMENT_FIT_INLINE void minimize(JointProblem& problem, JointState& state, int max_iterations, double tolerance,
                                   int round, JointProgress& progress)
{
    progress.has_settled = false;
    double damping = 0;
    double energy = 0;
    Eigen::VectorXd down, up;
    for (int iteration = 0; iteration < max_iterations && !progress.has_settled; ++iteration) {
        ++progress.iterations;
        JointSystem system = problem.linearize(state);
        if (iteration == 0) {
            refresh_scale_strengths(problem, state, system);
            energy = problem.energy(state);
            progress.energies.push_back({round, energy});
        }
        problem.room(state, down, up);
        while (true) {
            const Eigen::VectorXd step = bounded_step(system, damping, down, up);
            JointState next = problem.moved(state, system, step, damping);
            const double next_energy = problem.energy(next);
            const double decrease = -system.gradient.dot(step);
            // What rounding hides in the energy is settled too.
            progress.has_settled =
                damping <= 1 && decrease <= std::max(tolerance * tolerance, 1e-14 * (1 + std::abs(energy)));
            if (next_energy < energy) {
                state = std::move(next);
                energy = next_energy;
                progress.energies.push_back({round, energy});
                damping = damping < 1e-4 ? 0 : 0.1 * damping;
                break;
            }
            if (progress.has_settled || damping > 1e9) {
                return;
            }
            damping = std::max(1e-3, 10 * damping);
        }
    }
}

} // namespace lineament::detail
