// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Identity and expressions of RealtimeFit, and what of them is left to double precision.
#include "lineament/fit/realtime_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_REALTIME_SOLVE_IMPL_HPP
#define LINEAMENT_FIT_REALTIME_SOLVE_IMPL_HPP

#include <algorithm>
#include <cmath>

namespace lineament::detail {

/// For the present shape: factors of the rows of points, w J^T (y - x).
inline void RealtimeFit::update_factors()
{
    const std::array<double, 8> m = image_from_model();
    kernels_.residual_factors(work_.points.data(), frame_.seen_u.data(), frame_.seen_v.data(),
                              frame_.information.data(), frame_.scale_factor, num_points(), m.data(),
                              work_.factors.data());
}

/// How often each of the six Gram matrices counts: w J^T J of a point of information 1, in their order.
inline std::array<double, 6> RealtimeFit::gram_factors() const
{
    const double s = frame_.camera.scale_px_per_mm;
    const double f = frame_.scale_factor * s * s;
    const double x = frame_.camera.camera_from_model(2, 0), y = frame_.camera.camera_from_model(2, 1);
    const double z = frame_.camera.camera_from_model(2, 2);
    return {f * (1 - x * x), f * (1 - y * y), f * (1 - z * z), -f * x * y, -f * x * z, -f * y * z};
}

/// sum w (J B)^T J B of all points, in the leading columns.
inline void RealtimeFit::add_normal_matrix(const AlignedBuffer<float>& grams, const PointRows& fixed_rows,
                                           int num_columns, int width, const AlignedBuffer<float>& contour_rows,
                                           AlignedBuffer<float>& gram)
{
    const bool is_identity = &grams == &pack_.identity_grams;
    std::array<float, 6> jacobian = frame_.jacobian; // times the root of what weights have in common
    for (float& entry : jacobian) {
        entry *= static_cast<float>(std::sqrt(frame_.scale_factor));
    }
    if (frame_.is_nominal) {
        const std::array<double, 6> factors = gram_factors();
        float scales[6];
        std::copy(factors.begin(), factors.end(), scales);
        kernels_.combine_grams(grams.data(), num_columns, width, scales, gram.data());
    } else {
        std::fill_n(gram.data(), static_cast<std::size_t>(width) * width, 0.0f);
        work_.present.clear();
        work_.roots.clear();
        for (int i = 0; i < pack_.fixed.num_points; ++i) {
            if (frame_.landmark_of_fixed[i] >= 0) {
                work_.present.push_back(i);
                work_.roots.push_back(static_cast<float>(std::sqrt(frame_.information[i])));
            }
        }
        kernels_.project_rows((is_identity ? fixed_rows.identity : fixed_rows.expression).data(), width,
                              work_.present.data(), frame_.num_fixed_seen, jacobian.data(), work_.roots.data(),
                              work_.rows.data());
        kernels_.add_gram(work_.rows.data(), 2 * frame_.num_fixed_seen, 0, num_columns, width, gram.data());
    }
    kernels_.project_rows(contour_rows.data(), width, frame_.match_rows.data(), num_matches(), jacobian.data(),
                          frame_.match_roots.data(), work_.rows.data());
    kernels_.add_gram(work_.rows.data(), 2 * num_matches(), 0, num_columns, width, gram.data());
}

/// Adds the prior to the normal equations in work.system and work.right_side and takes their step from work.alpha.
/// False, with nothing changed of alpha, if that would pass a bound or the system is singular to single precision.
[[nodiscard]] inline bool step_identity(const kernels::Kernels& kernels, const RealtimePack& pack,
                                        double regularization, RealtimeBuffers& work)
{
    const int width = pack.shape_width;
    const int m = pack.num_shape;
    for (int j = 0; j < m; ++j) {
        const std::size_t row = static_cast<std::size_t>(j) * width;
        work.system[row + j] += static_cast<float>(regularization);
        work.system[row + m] = static_cast<float>(work.right_side[j] - regularization * work.alpha[j]);
    }
    if (!(kernels.solve_positive(work.system.data(), m, width, work.step.data()) > least_pivot)) {
        return false;
    }
    const double bound = IdentityOptions().max_coefficient;
    double* alpha = work.alpha.data();
    const float* step = work.step.data();
    bool is_inside = true;
    for (int j = 0; j < m; ++j) {
        is_inside &= std::abs(alpha[j] + step[j]) < bound;
    }
    for (int j = 0; j < m && is_inside; ++j) {
        alpha[j] += step[j];
    }
    return is_inside;
}

inline void RealtimeFit::fit_identity()
{
    identity_status_ = FitStatus::success;
    if (pack_.num_shape > 0) {
        const int width = pack_.shape_width;
        update_factors();
        add_normal_matrix(pack_.identity_grams, pack_.fixed_rows, width, width, pack_.contour_rows.identity,
                          work_.system);
        std::fill_n(work_.right_side.data(), width, 0.0f);
        kernels_.add_rows(pack_.fixed_rows.identity.data(), 3 * pack_.fixed.num_points, width, work_.factors.data(),
                          work_.right_side.data());
        kernels_.add_point_rows(pack_.contour_rows.identity.data(), width, frame_.match_rows.data(), num_matches(),
                                work_.factors.data() + 3 * pack_.first_match, work_.right_side.data());
        if (!step_identity(kernels_, pack_, fitter_.reference_.options().regularization, work_)) {
            fit_identity_in_double();
        }
    }
    take_identity();
    update_fixed_positions();
    update_match_positions();
}

/// Leaves the positions of matches to the next step, which may match anew.
inline void RealtimeFit::fit_expression()
{
    if (pack_.num_expressions == 0) {
        return;
    }
    if (!solve_expression()) {
        fit_expression_in_double();
    }
    const double upper = fitter_.reference_.options().max_expression;
    frame_.num_held = 0;
    for (int j = 0; j < pack_.num_expressions; ++j) {
        frame_.num_held += frame_.psi[j] >= upper;
    }
    update_expression_row();
    update_fixed_positions();
}

/// Normal equations of the step from the present psi: work_.gram in full, work_.right_side.
inline void RealtimeFit::assemble_expressions()
{
    const int k = pack_.num_expressions;
    const int width = pack_.expression_width;
    update_factors();
    add_normal_matrix(pack_.expression_grams, pack_.fixed_rows, k, width, pack_.contour_rows.expression, work_.gram);
    float* gram = work_.gram.data();
    const double sigma = fitter_.reference_.options().expression_sigma;
    const double precision = 1 / (sigma * sigma);
    for (int i = 0; i < k; ++i) {
        for (int j = 0; j < i; ++j) {
            gram[i * width + j] = gram[j * width + i];
        }
        gram[i * width + i] += static_cast<float>(precision);
    }
    float* right_side = work_.right_side.data();
    std::fill_n(right_side, width, 0.0f);
    kernels_.add_point_rows(pack_.contour_rows.expression.data(), width, frame_.match_rows.data(), num_matches(),
                            work_.factors.data() + 3 * pack_.first_match, right_side);
    // Panels are wider than the fixed points; their columns are zero there.
    float* of_fixed = work_.free_step.data();
    kernels_.multiply_panels(pack_.fixed.expression.data(), pack_.fixed.num_panels, k, work_.factors.data(), of_fixed);
    for (int i = 0; i < k; ++i) {
        right_side[i] = static_cast<float>(right_side[i] + of_fixed[i] - precision * frame_.psi[i]);
    }
}

/// The step of free expressions in work_.step, where those at a bound make theirs, and what is left of the right side
/// then, minus the gradient, in work_.gradient. False where the system is singular to single precision.
inline bool RealtimeFit::step_free_expressions()
{
    const int k = pack_.num_expressions;
    const int width = pack_.expression_width;
    const float* gram = work_.gram.data();
    const float* right_side = work_.right_side.data();
    float* step = work_.step.data();
    float* gradient = work_.gradient.data();
    if (k <= kernels::max_few) {
        return kernels_.solve_few(gram, k, width, right_side, work_.is_free.data(), step, gradient) > least_pivot;
    }
    work_.free.clear();
    for (int j = 0; j < k; ++j) {
        if (work_.is_free[j] != 0) {
            work_.free.push_back(j);
            step[j] = 0;
        }
    }
    const auto update_gradient = [&] {
        std::copy_n(right_side, width, gradient);
        if (std::any_of(step, step + k, [](float value) { return value != 0; })) {
            std::transform(step, step + k, work_.free_step.data(), [](float value) { return -value; });
            kernels_.add_rows(gram, k, width, work_.free_step.data(), gradient);
        }
    };
    update_gradient();
    const int num_free = static_cast<int>(work_.free.size());
    if (num_free == 0) {
        return true;
    }
    const int system_width = kernels::round_up(num_free + 1, kernels::width_step);
    float* system = work_.system.data();
    std::fill_n(system, static_cast<std::size_t>(num_free) * system_width, 0.0f);
    for (int i = 0; i < num_free; ++i) {
        const float* from = gram + work_.free[i] * width;
        for (int j = i; j < num_free; ++j) {
            system[i * system_width + j] = from[work_.free[j]];
        }
        system[i * system_width + num_free] = gradient[work_.free[i]];
    }
    float* solution = work_.free_step.data();
    if (!(kernels_.solve_positive(system, num_free, system_width, solution) > least_pivot)) {
        return false;
    }
    for (int i = 0; i < num_free; ++i) {
        step[work_.free[i]] = solution[i];
    }
    if (num_free < k) { // it is that of those at a bound that is asked for
        update_gradient();
    }
    return true;
}

/// Block principal pivoting (Portugal, Judice and Vicente 1994) on the step from the present psi, from the set that was
/// free in the solve before. False if it does not settle or the system is singular to single precision.
inline bool RealtimeFit::solve_expression()
{
    const double upper = fitter_.reference_.options().max_expression;
    const int k = pack_.num_expressions;
    assemble_expressions();
    const float* gram = work_.gram.data();
    const int width = pack_.expression_width;
    int fewest = k + 1;
    int patience = 3;
    for (int round = 0; round < 60; ++round) {
        for (int j = 0; j < k; ++j) {
            const signed char state = frame_.bound_state[j];
            work_.is_free[j] = state == 0 ? 1.0f : 0.0f;
            work_.step[j] = static_cast<float>((state < 0 ? 0.0 : upper) - frame_.psi[j]);
        }
        if (!step_free_expressions()) {
            return false;
        }
        int num_wrong = 0;
        int last_wrong = -1;
        for (int j = 0; j < k; ++j) {
            const double value = frame_.psi[j] + work_.step[j];
            const signed char state = frame_.bound_state[j];
            // More than the rounding of the gradient's terms.
            const float rounding = 3e-7f * (2 * std::abs(work_.right_side[j]) + gram[j * width + j]);
            const signed char next_of_free = value < 0 ? -1 : value > upper ? 1 : 0;
            const signed char next_of_held = -state * work_.gradient[j] > rounding ? 0 : state;
            work_.next_state[j] = state == 0 ? next_of_free : next_of_held;
            if (work_.next_state[j] != state) {
                ++num_wrong;
                last_wrong = j;
            }
        }
        if (num_wrong == 0) {
            for (int j = 0; j < k; ++j) {
                const signed char state = frame_.bound_state[j];
                frame_.psi[j] = state < 0   ? 0.0
                                : state > 0 ? upper
                                            : frame_.psi[j] + static_cast<double>(work_.step[j]);
            }
            return true;
        }
        if (num_wrong < fewest) {
            fewest = num_wrong;
            patience = 3;
        } else {
            --patience;
        }
        if (patience >= 0) {
            frame_.bound_state.swap(work_.next_state);
        } else { // one at a time, so that it ends
            frame_.bound_state[last_wrong] = work_.next_state[last_wrong];
        }
    }
    return false;
}

inline RealtimeFit::Reference RealtimeFit::reference_points() const
{
    const Eigen::Index count = frame_.num_fixed_seen + num_matches();
    Reference reference;
    reference.points = ModelPoints::sized(count, pack_.num_shape, pack_.num_expressions);
    reference.image_points.resize(2, count);
    reference.weights.resize(count);
    Eigen::Index to = 0;
    for (int i = 0; i < pack_.fixed.num_points; ++i) {
        const int landmark = frame_.landmark_of_fixed[i];
        if (landmark >= 0) {
            reference.points.assign(to, fitter_.reference_.landmark_points(), frame_.map_indices[landmark]);
            reference.image_points.col(to) = landmarks_.landmarks[landmark].point_px;
            reference.weights[to] = weight(i);
            ++to;
        }
    }
    for (int i = 0; i < num_matches(); ++i, ++to) {
        fitter_.reference_.assign_vertex(reference.points, to, pack_.contour_vertices[frame_.match_rows[i]]);
        reference.image_points.col(to) = landmarks_.landmarks[frame_.match_landmarks[i]].point_px;
        reference.weights[to] = weight(pack_.first_match + i);
    }
    return reference;
}

inline void RealtimeFit::fit_identity_in_double()
{
    ++workspace_.num_reference_solves_;
    const Reference reference = reference_points();
    IdentityOptions options;
    options.regularization = fitter_.reference_.options().regularization;
    const IdentityResult solved =
        lineament::fit_identity(reference.points, reference.image_points, frame_.camera, reference.weights,
                                Eigen::Map<const Eigen::VectorXd>(frame_.psi.data(), pack_.num_expressions), options);
    identity_status_ = solved.status;
    identity_reason_ = solved.reason;
    std::copy_n(solved.coefficients.data(), pack_.num_shape, work_.alpha.begin());
}

inline void RealtimeFit::fit_expression_in_double()
{
    ++workspace_.num_reference_solves_;
    const Reference reference = reference_points();
    ExpressionOptions options;
    options.upper_bound = fitter_.reference_.options().max_expression;
    options.prior_standard_deviations =
        Eigen::VectorXd::Constant(pack_.num_expressions, fitter_.reference_.options().expression_sigma);
    const ExpressionResult solved =
        lineament::fit_expression(reference.points, reference.image_points, frame_.camera, reference.weights,
                                  Eigen::Map<const Eigen::VectorXd>(work_.alpha.data(), pack_.num_shape), options);
    std::copy_n(solved.coefficients.data(), pack_.num_expressions, frame_.psi.begin());
    if (solved.status != FitStatus::success) {
        frame_.status = solved.status;
        frame_.reason = solved.reason;
    }
    for (int j = 0; j < pack_.num_expressions; ++j) {
        frame_.bound_state[j] = frame_.psi[j] <= 0 ? -1 : frame_.psi[j] >= options.upper_bound ? 1 : 0;
    }
}

} // namespace lineament::detail

#endif
