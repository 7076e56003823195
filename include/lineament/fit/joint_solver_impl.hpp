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

LINEAMENT_FIT_INLINE Eigen::MatrixXd block_of(const Eigen::Ref<const Eigen::MatrixXd>& matrix,
                                              const std::vector<int>& indices)
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

/// What of `solved` would leave its room joins the held; true if any does.
[[nodiscard]] inline bool hold_what_leaves(const JointSystem& system, StepRoom& room)
{
    const std::size_t num_before = room.held.size();
    for (std::size_t i = 0; i < system.unknowns.size(); ++i) {
        const int unknown = system.unknowns[i];
        const double down = system.down[unknown], up = system.up[unknown];
        const double value = room.solved[static_cast<Eigen::Index>(i)];
        if (!room.is_held[i] && !(value >= down && value <= up)) {
            room.is_held[i] = 1;
            room.held.push_back(static_cast<int>(i));
            room.bounds.push_back(value < down ? down : up);
        }
    }
    return room.held.size() > num_before;
}

/// C_KK, by the columns C of those held last; of an arrow by halves of the inverse, since these are sparse.
inline void set_block_of_held(PositiveFactor& factor, Eigen::Index num_before, StepRoom& room)
{
    if (factor.is_arrow()) {
        room.of_held = factor.inverse_block(room.held, static_cast<std::size_t>(num_before));
        return;
    }
    const Eigen::Index num_held = static_cast<Eigen::Index>(room.held.size());
    auto added = room.columns.middleCols(num_before, num_held - num_before);
    added.setZero();
    for (Eigen::Index k = num_before; k < num_held; ++k) {
        added(room.held[static_cast<std::size_t>(k)], k - num_before) = 1;
    }
    factor.solve(added);
    room.of_held.resize(num_held, num_held);
    for (Eigen::Index k = 0; k < num_held; ++k) {
        room.of_held.row(k) = room.columns.row(room.held[static_cast<std::size_t>(k)]).head(num_held);
    }
}

/// What is left once some are held; false where C_KK is not positive definite.
[[nodiscard]] inline bool solve_rest(PositiveFactor& factor, Eigen::Index num_before, StepRoom& room)
{
    set_block_of_held(factor, num_before, room);
    room.pulls.resize(room.of_held.rows());
    for (std::size_t k = 0; k < room.held.size(); ++k) {
        room.pulls[static_cast<Eigen::Index>(k)] = room.free[room.held[k]] - room.bounds[k];
    }
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> cholesky(room.of_held);
    if (cholesky.info() != Eigen::Success) {
        return false;
    }
    cholesky.solveInPlace(room.pulls);
    if (factor.is_arrow()) {
        room.solved.setZero();
        for (std::size_t k = 0; k < room.held.size(); ++k) {
            room.solved[room.held[k]] = room.pulls[static_cast<Eigen::Index>(k)];
        }
        factor.solve(room.solved);
        room.solved = room.free - room.solved;
    } else {
        room.solved = room.free;
        for (Eigen::Index k = 0; k < room.pulls.size(); ++k) {
            room.solved -= room.pulls[k] * room.columns.col(k);
        }
    }
    for (std::size_t k = 0; k < room.held.size(); ++k) {
        room.solved[room.held[k]] = room.bounds[k];
    }
    return true;
}

LINEAMENT_FIT_INLINE void bounded_step(const JointSystem& system, const Eigen::VectorXd& gradient,
                                       PositiveFactor& factor, StepRoom& room, Eigen::VectorXd& step)
{
    const Eigen::Index size = static_cast<Eigen::Index>(system.unknowns.size());
    step.setZero(gradient.size());
    if (size == 0) {
        return;
    }
    room.solved.resize(size);
    for (Eigen::Index i = 0; i < size; ++i) { // several times as fast as an indexed view
        room.solved[i] = -gradient[system.unknowns[static_cast<std::size_t>(i)]];
    }
    factor.solve(room.solved);
    room.held.clear();
    room.bounds.clear();
    room.is_held.assign(system.unknowns.size(), 0);
    for (Eigen::Index num_before = 0; hold_what_leaves(system, room);) {
        if (num_before == 0) {
            room.free = room.solved;
            room.columns.resize(size, factor.is_arrow() ? 0 : size);
        }
        if (!solve_rest(factor, num_before, room)) {
            room.solved.setConstant(std::numeric_limits<double>::quiet_NaN()); // no step; more damping makes one
            break;
        }
        num_before = static_cast<Eigen::Index>(room.held.size());
    }
    for (Eigen::Index i = 0; i < size; ++i) {
        step[system.unknowns[static_cast<std::size_t>(i)]] = room.solved[i];
    }
}

LINEAMENT_FIT_INLINE void informed_step(const JointSystem& system, const StepTaken& last, PositiveFactor& factor,
                                        StepRoom& room, Eigen::VectorXd& step)
{
    room.change = system.gradient - last.gradient;       // y
    const double curvature = last.step.dot(room.change); // s^T y
    if (curvature > 0) {
        const double along = last.step.dot(system.gradient) / curvature;
        room.gradient = system.gradient - along * room.change;
        bounded_step(system, room.gradient, factor, room, step);
        step -= (along + room.change.dot(step) / curvature) * last.step;
        if ((step.array() >= system.down.array() && step.array() <= system.up.array()).all()) {
            return;
        }
    }
    bounded_step(system, system.gradient, factor, room, step);
}

inline void set_scale_strength(JointProblem& problem, std::size_t image, double strength, JointSystem& system)
{
    double& scale_strength = problem.images[image].scale_strength;
    system.gradient[problem.camera_begin(image) + 3] += strength - scale_strength;
    scale_strength = strength;
}

/// In single precision where there are kernels, image by image where that takes less, unless the matrix is not positive
/// definite to that.
/// @param num_inverted  As for PositiveFactor.
inline void factor_system(const JointProblem& problem, const JointState& state, JointSystem& system, double damping,
                          PositiveFactor& factor, Eigen::Index num_inverted = 0)
{
    const bool is_factored = problem.is_arrow()
                                 ? system.arrow.is_sparse() && factor.factor(system.arrow, damping)
                                 : !system.has_hessian && factor.factor(system.upper, damping, num_inverted);
    if (!is_factored) {
        problem.complete_hessian(state, system);
        factor.factor(system.hessian, damping);
    }
}

/// Of one image without biases: Lambda less its prior is all that the image says.
/// @param lambda  The factor of alpha and expressions, or of more behind them.
[[nodiscard]] inline double only_scale_strength(const JointProblem& problem, const JointSystem& system,
                                                Eigen::Index num_linear, PositiveFactor& lambda)
{
    const auto alpha_end =
        std::lower_bound(system.unknowns.begin(), system.unknowns.end(), static_cast<int>(problem.num_shape()));
    const Eigen::Index num_alpha = alpha_end - system.unknowns.begin();
    if (num_alpha == 0) {
        return 0.0;
    }
    const Eigen::MatrixXd prior = problem.has_standard_prior()
                                      ? Eigen::MatrixXd()
                                      : problem.prior_of(std::vector<int>(system.unknowns.begin(), alpha_end));
    return static_cast<double>(num_alpha) - lambda.inverse_trace(num_linear, num_alpha, prior);
}

[[nodiscard]] inline bool is_alone_without_biases(const JointProblem& problem, const JointState& state)
{
    return problem.images.size() == 1 && state.bias.size() == 0;
}

/// How many of the unknowns that the scale strength of a single image without biases is of come before all others, if
/// they do.
[[nodiscard]] inline Eigen::Index num_leading_linear(const JointProblem& problem, const JointState& state,
                                                     const JointSystem& system)
{
    const auto camera =
        std::lower_bound(system.unknowns.begin(), system.unknowns.end(), static_cast<int>(problem.camera_begin(0)));
    return is_alone_without_biases(problem, state) &&
                   std::none_of(system.unknowns.begin(), camera, [&](int i) { return problem.is_camera(i); })
               ? camera - system.unknowns.begin()
               : 0;
}

LINEAMENT_FIT_INLINE void refresh_scale_strengths(JointProblem& problem, const JointState& state, JointSystem& system,
                                                  PositiveFactor& factor)
{
    const bool is_alone = is_alone_without_biases(problem, state);
    if (const Eigen::Index num_leading = num_leading_linear(problem, state, system); num_leading > 0) {
        set_scale_strength(problem, 0, only_scale_strength(problem, system, num_leading, factor), system);
        return;
    }
    std::vector<int> linear, linear_unknowns; // the former positions among the unknowns
    for (std::size_t i = 0; i < system.unknowns.size(); ++i) {
        if (!problem.is_camera(system.unknowns[i])) {
            linear.push_back(static_cast<int>(i));
            linear_unknowns.push_back(system.unknowns[i]);
        }
    }
    const Eigen::Index num_linear = static_cast<Eigen::Index>(linear.size());
    PositiveFactor lambda(problem.kernels);
    ArrowMatrix arrow;
    const bool is_sparse = problem.is_arrow() && system.arrow.is_sparse();
    if (is_sparse) {
        arrow = system.arrow.block(linear);
    }
    if (!(is_sparse && lambda.factor(arrow, 0.0))) {
        problem.complete_hessian(state, system);
        lambda.factor(block_of(system.hessian, linear));
    }
    if (is_alone) {
        set_scale_strength(problem, 0, only_scale_strength(problem, system, num_linear, lambda), system);
        return;
    }
    const auto num_alpha =
        std::lower_bound(linear_unknowns.begin(), linear_unknowns.end(), static_cast<int>(problem.num_shape())) -
        linear_unknowns.begin();
    Eigen::MatrixXd hidden;
    const Eigen::MatrixXd columns = lambda.inverse_columns(num_linear, num_alpha, hidden);
    const std::vector<double> strengths = problem.scale_strengths(state, linear_unknowns, columns, hidden, system);
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
    auto& [system, factor, placed, next_placed, next, step_room, step, last, keeps_matrix] = scratch;
    problem.place(state, placed);
    for (int iteration = 0; iteration < limits.max_iterations && !progress.has_settled; ++iteration) {
        ++progress.iterations;
        problem.reweighs = limits.reweighs;
        if (!keeps_matrix || !problem.renew_gradient(state, placed, system)) {
            keeps_matrix = false;
            problem.linearize_free(state, placed, system);
            const bool sets_scale_strengths = iteration == 0 && limits.sets_scale_strengths;
            factor_system(problem, state, system, damping, factor,
                          sets_scale_strengths && problem.num_shape() > 0 ? num_leading_linear(problem, state, system)
                                                                          : 0);
            if (sets_scale_strengths) {
                refresh_scale_strengths(problem, state, system, factor);
            }
        }
        if (iteration == 0) {
            energy = problem.energy(state, placed);
            progress.energies.push_back({round, energy});
        }
        while (true) {
            if (keeps_matrix && iteration > 0) {
                informed_step(system, last, factor, step_room, step);
            } else {
                bounded_step(system, system.gradient, factor, step_room, step);
            }
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
                last.step = step;
                last.gradient = system.gradient;
                damping = damping < 1e-4 ? 0 : 0.1 * damping;
                break;
            }
            progress.has_settled = is_certain && std::abs(decrease) <= limit;
            if (progress.has_settled || damping > 1e9) {
                return;
            }
            const bool may_reweigh = !problem.reweighs;
            if (keeps_matrix || may_reweigh) {
                problem.reweighs = !keeps_matrix || problem.reweighs;
                keeps_matrix = false;
                problem.linearize_free(state, placed, system);
            } else {
                damping = std::max(1e-3, 10 * damping);
            }
            factor_system(problem, state, system, damping, factor);
        }
    }
}

} // namespace lineament::detail
