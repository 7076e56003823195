// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/joint_solver.hpp"

#include "lineament/fit/inline.hpp"
#include "lineament/fit/positive_factor_impl.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace lineament::detail {

LINEAMENT_FIT_INLINE Eigen::MatrixXd block_of(const Eigen::MatrixXd& matrix, const std::vector<int>& indices)
{
    const std::size_t size = indices.size();
    Eigen::MatrixXd block(size, size);
    for (std::size_t j = 0; j < size; ++j) { // several times as fast as an indexed view
        const double* column = matrix.data() + matrix.rows() * indices[j];
        double* to = block.data() + j * size;
        for (std::size_t i = j; i < size; ++i) {
            to[i] = column[indices[i]];
        }
    }
    return block;
}

LINEAMENT_FIT_INLINE Eigen::VectorXd bounded_step(const JointSystem& system, const Eigen::VectorXd& gradient,
                                                  PositiveFactor& factor)
{
    const Eigen::VectorXd &down = system.down, &up = system.up;
    Eigen::VectorXd step = Eigen::VectorXd::Zero(gradient.size());
    const Eigen::Index size = static_cast<Eigen::Index>(system.unknowns.size());
    if (size == 0) {
        return step;
    }
    Eigen::VectorXd solved(size);
    for (Eigen::Index i = 0; i < size; ++i) { // several times as fast as an indexed view
        solved[i] = -gradient[system.unknowns[static_cast<std::size_t>(i)]];
    }
    solved = factor.solve(solved);
    bool is_inside = true;
    for (Eigen::Index i = 0; i < size; ++i) {
        const int unknown = system.unknowns[static_cast<std::size_t>(i)];
        step[unknown] = solved[i];
        is_inside = is_inside && solved[i] >= down[unknown] && solved[i] <= up[unknown];
    }
    if (is_inside) {
        return step;
    }
    const Eigen::VectorXd free = solved; // of bounds
    std::vector<bool> is_held(system.unknowns.size(), false);
    std::vector<int> held; // K, positions among the unknowns
    std::vector<double> bounds;
    while (true) {
        const std::size_t num_before = held.size();
        for (Eigen::Index i = 0; i < size; ++i) {
            const int unknown = system.unknowns[static_cast<std::size_t>(i)];
            if (!is_held[static_cast<std::size_t>(i)] && !(solved[i] >= down[unknown] && solved[i] <= up[unknown])) {
                is_held[static_cast<std::size_t>(i)] = true;
                held.push_back(static_cast<int>(i));
                bounds.push_back(solved[i] < down[unknown] ? down[unknown] : up[unknown]);
            }
        }
        if (held.size() == num_before) {
            break;
        }
        const Eigen::Map<const Eigen::VectorXd> goals(bounds.data(), static_cast<Eigen::Index>(held.size()));
        const Eigen::LLT<Eigen::MatrixXd> cholesky(factor.inverse_block(held)); // C_KK
        if (cholesky.info() != Eigen::Success) {
            solved.setConstant(std::numeric_limits<double>::quiet_NaN()); // no step; more damping makes one
            break;
        }
        Eigen::VectorXd pull = Eigen::VectorXd::Zero(size); // C_KK^-1 (x_K - bounds), 0 elsewhere
        pull(held) = Eigen::VectorXd(cholesky.solve(Eigen::VectorXd(free(held) - goals)));
        solved = free - factor.solve(pull);
        solved(held) = goals;
    }
    step(system.unknowns) = solved;
    return step;
}

LINEAMENT_FIT_INLINE Eigen::VectorXd informed_step(const JointSystem& system, const StepTaken& last,
                                                   PositiveFactor& factor)
{
    const Eigen::VectorXd change = system.gradient - last.gradient; // y
    const double curvature = last.step.dot(change);                 // s^T y
    if (curvature > 0) {
        const double along = last.step.dot(system.gradient) / curvature;
        Eigen::VectorXd step = bounded_step(system, system.gradient - along * change, factor);
        step -= (along + change.dot(step) / curvature) * last.step;
        if ((step.array() >= system.down.array() && step.array() <= system.up.array()).all()) {
            return step;
        }
    }
    return bounded_step(system, system.gradient, factor);
}

inline void set_scale_strength(JointProblem& problem, std::size_t image, double strength, JointSystem& system)
{
    double& scale_strength = problem.images[image].scale_strength;
    system.gradient[problem.camera_begin(image) + 3] += strength - scale_strength;
    scale_strength = strength;
}

/// Image by image where that takes less, unless the matrix is not positive definite to single precision.
inline void factor_system(const JointProblem& problem, JointSystem& system, double damping, PositiveFactor& factor)
{
    if (!(problem.is_arrow() && system.arrow.is_sparse() && factor.factor(system.arrow, damping))) {
        problem.complete_hessian(system);
        factor.factor(system.hessian, damping);
    }
}

LINEAMENT_FIT_INLINE void refresh_scale_strengths(JointProblem& problem, const JointState& state, JointSystem& system,
                                                  PositiveFactor& factor)
{
    std::vector<int> linear; // positions among the unknowns
    for (int i = 0; i < static_cast<int>(system.unknowns.size()); ++i) {
        if (!problem.is_camera(system.unknowns[i])) {
            linear.push_back(i);
        }
    }
    const Eigen::Index num_linear = static_cast<Eigen::Index>(linear.size());
    PositiveFactor of_linear(problem.kernels);
    const bool is_leading = !problem.is_arrow() && (num_linear == 0 || linear.back() + 1 == num_linear);
    ArrowMatrix arrow;
    const bool is_sparse = problem.is_arrow() && system.arrow.is_sparse();
    if (is_sparse) {
        arrow = system.arrow.block(linear);
    }
    if (!is_leading && !(is_sparse && of_linear.factor(arrow, 0.0))) {
        problem.complete_hessian(system);
        of_linear.factor(block_of(system.hessian, linear));
    }
    PositiveFactor& lambda = is_leading ? factor : of_linear;
    const Eigen::Index num_biases = state.bias.cols();
    if (problem.images.size() == 1 && num_biases == 0) { // Lambda less its prior is all that the image says
        const auto begin = system.unknowns.begin();
        const std::vector<int> alpha(
            begin, std::lower_bound(begin, system.unknowns.end(), static_cast<int>(problem.num_shape())));
        const Eigen::Index count = static_cast<Eigen::Index>(alpha.size());
        const double strength =
            static_cast<double>(count) - lambda.inverse_trace(num_linear, count, problem.prior_of(alpha));
        set_scale_strength(problem, 0, strength, system);
        return;
    }
    std::vector<int> linear_unknowns;
    for (const int position : linear) {
        linear_unknowns.push_back(system.unknowns[static_cast<std::size_t>(position)]);
    }
    const auto num_alpha =
        std::lower_bound(linear_unknowns.begin(), linear_unknowns.end(), static_cast<int>(problem.num_shape())) -
        linear_unknowns.begin();
    const std::vector<double> strengths =
        problem.scale_strengths(state, linear_unknowns, lambda.inverse_columns(num_linear, num_alpha), system);
    for (std::size_t f = 0; f < strengths.size(); ++f) {
        set_scale_strength(problem, f, strengths[f], system);
    }
}

/// Below this -gradient . step, two posterior standard deviations squared, the matrix changes little with a step.
inline constexpr double short_decrease = 4.0;

LINEAMENT_FIT_INLINE void minimize(JointProblem& problem, JointState& state, const RoundLimits& limits, int round,
                                   JointScratch& scratch, JointProgress& progress)
{
    progress.has_settled = false;
    double damping = 0;
    double energy = 0;
    double last_decrease = 0;
    StepTaken last;
    auto& [system, factor, placed, next_placed, next, keeps_matrix] = scratch;
    problem.place(state, placed);
    for (int iteration = 0; iteration < limits.max_iterations && !progress.has_settled; ++iteration) {
        ++progress.iterations;
        if (!keeps_matrix || !problem.renew_gradient(state, placed, system)) {
            keeps_matrix = false;
            problem.linearize_free(state, placed, system);
            factor_system(problem, system, damping, factor);
            if (iteration == 0 && limits.sets_scale_strengths) {
                refresh_scale_strengths(problem, state, system, factor);
            }
        }
        if (iteration == 0) {
            energy = problem.energy(state, placed);
            progress.energies.push_back({round, energy});
        }
        while (true) {
            const Eigen::VectorXd step = keeps_matrix && iteration > 0 ? informed_step(system, last, factor)
                                                                       : bounded_step(system, system.gradient, factor);
            problem.move(state, system, step, damping, next);
            problem.place(next, next_placed);
            const double next_energy = problem.energy(next, next_placed);
            const double decrease = -system.gradient.dot(step);
            const double rate = last_decrease > 0 ? std::clamp(decrease / last_decrease, 0.01, 1.0) : 1.0;
            // What rounding hides in the energy is settled too.
            const double limit = std::max(limits.tolerance * limits.tolerance, 1e-14 * (1 + std::abs(energy)));
            const bool is_certain = damping <= 1;
            if (next_energy < energy) {
                progress.has_settled = is_certain && rate * std::abs(decrease) <= limit;
                std::swap(state, next);
                placed.swap(next_placed);
                energy = next_energy;
                progress.energies.push_back({round, energy});
                // A kept matrix must bring the steps down quickly.
                keeps_matrix = damping == 0 && decrease <= short_decrease &&
                               !(keeps_matrix && iteration > 0 && decrease > 0.1 * last_decrease);
                last_decrease = decrease;
                last = {step, system.gradient};
                damping = damping < 1e-4 ? 0 : 0.1 * damping;
                break;
            }
            progress.has_settled = is_certain && std::abs(decrease) <= limit;
            if (progress.has_settled || damping > 1e9) {
                return;
            }
            if (keeps_matrix) {
                keeps_matrix = false;
                problem.linearize_free(state, placed, system);
            } else {
                damping = std::max(1e-3, 10 * damping);
            }
            factor_system(problem, system, damping, factor);
        }
    }
}

} // namespace lineament::detail
