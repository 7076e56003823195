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

/// And of matches the roots of their weights and the residuals times these.
inline void RealtimeFit::update_residuals()
{
    update_factors();
    const std::array<double, 8> m = image_from_model();
    const double root_scale_factor = std::sqrt(frame_.scale_factor);
    const float* p = work_.points.data() + 3 * pack_.first_match;
    const double* u = frame_.seen_u.data() + pack_.first_match;
    const double* v = frame_.seen_v.data() + pack_.first_match;
    const double* root_information = frame_.match_root_information.data();
    float* roots = work_.match_roots.data();
    float* residuals = work_.residuals.data();
    const std::size_t count = frame_.matches.size();
    for (std::size_t i = 0; i < count; ++i) {
        const double x = p[3 * i], y = p[3 * i + 1], z = p[3 * i + 2];
        const double root = root_scale_factor * root_information[i];
        roots[i] = static_cast<float>(root);
        residuals[2 * i] = static_cast<float>(root * (u[i] - (m[0] * x + m[1] * y + m[2] * z + m[3])));
        residuals[2 * i + 1] = static_cast<float>(root * (v[i] - (m[4] * x + m[5] * y + m[6] * z + m[7])));
    }
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

/// sum w (J B)^T J B of all points, in the leading columns; leaves the projected rows of the matches in work_.rows.
inline void RealtimeFit::add_normal_matrix(const AlignedBuffer<float>& grams, const PointRows& fixed_rows,
                                           int num_columns, int width, const AlignedBuffer<float>& contour_rows,
                                           AlignedBuffer<float>& gram)
{
    const bool is_identity = &grams == &pack_.identity_grams;
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
                work_.roots.push_back(static_cast<float>(std::sqrt(weight(i))));
            }
        }
        kernels_.project_rows((is_identity ? fixed_rows.identity : fixed_rows.expression).data(), width,
                              work_.present.data(), frame_.num_fixed_seen, frame_.jacobian.data(), work_.roots.data(),
                              work_.rows.data());
        kernels_.add_leading_gram(work_.rows.data(), 2 * frame_.num_fixed_seen, num_columns, width, gram.data());
    }
    const int count = static_cast<int>(frame_.matches.size());
    kernels_.project_rows(contour_rows.data(), width, frame_.match_rows.data(), count, frame_.jacobian.data(),
                          work_.match_roots.data(), work_.rows.data());
    kernels_.add_leading_gram(work_.rows.data(), 2 * count, num_columns, width, gram.data());
}

/// work_.right_side += sum w (J B)^T (y - x) of matches, with the projected rows of add_normal_matrix.
inline void RealtimeFit::add_right_side_of_matches(int width)
{
    kernels_.add_rows(work_.rows.data(), 2 * num_matches(), width, work_.residuals.data(), work_.right_side.data());
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
        update_residuals();
        add_normal_matrix(pack_.identity_grams, pack_.fixed_rows, width, width, pack_.contour_rows.identity,
                          work_.system);
        std::fill_n(work_.right_side.data(), width, 0.0f);
        kernels_.add_rows(pack_.fixed_rows.identity.data(), 3 * pack_.fixed.num_points, width, work_.factors.data(),
                          work_.right_side.data());
        add_right_side_of_matches(width);
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

/// Block principal pivoting (Portugal, Judice and Vicente 1994) on the step from the present psi, from the set that was
/// free in the solve before. False if it does not settle or the system is singular to single precision.
inline bool RealtimeFit::solve_expression()
{
    const FitOptions& options = fitter_.reference_.options();
    const int k = pack_.num_expressions;
    const int width = pack_.expression_width;
    update_residuals();
    add_normal_matrix(pack_.expression_grams, pack_.fixed_rows, k, width, pack_.contour_rows.expression, work_.gram);
    std::fill_n(work_.right_side.data(), width, 0.0f);
    // Panels are wider than the fixed points; their columns are zero there.
    kernels_.multiply_panels(pack_.fixed.expression.data(), pack_.fixed.num_panels, k, work_.factors.data(),
                             work_.right_side.data());
    add_right_side_of_matches(width);

    const double precision = 1 / (options.expression_sigma * options.expression_sigma);
    float* gram = work_.gram.data();
    for (int i = 0; i < k; ++i) {
        for (int j = 0; j < i; ++j) {
            gram[i * width + j] = gram[j * width + i];
        }
        gram[i * width + i] += static_cast<float>(precision);
        work_.right_side[i] = static_cast<float>(work_.right_side[i] - precision * frame_.psi[i]);
    }
    int fewest = k + 1;
    int patience = 3;
    for (int round = 0; round < 60; ++round) {
        // Those at a bound make their step; the rest solve for theirs.
        work_.free.clear();
        for (int j = 0; j < k; ++j) {
            work_.step[j] = 0;
            if (frame_.bound_state[j] == 0) {
                work_.free.push_back(j);
            } else {
                const double goal = frame_.bound_state[j] < 0 ? 0.0 : options.max_expression;
                work_.step[j] = static_cast<float>(goal - frame_.psi[j]);
            }
        }
        std::fill_n(work_.gradient.data(), width, 0.0f);
        if (std::any_of(work_.step.data(), work_.step.data() + k, [](float step) { return step != 0; })) {
            kernels_.add_rows(gram, k, width, work_.step.data(), work_.gradient.data());
        }
        const int num_free = static_cast<int>(work_.free.size());
        if (num_free > 0) {
            const int system_width = kernels::round_up(num_free + 1, kernels::width_step);
            float* system = work_.system.data();
            std::fill_n(system, static_cast<std::size_t>(num_free) * system_width, 0.0f);
            for (int i = 0; i < num_free; ++i) {
                const float* from = gram + work_.free[i] * width;
                for (int j = i; j < num_free; ++j) {
                    system[i * system_width + j] = from[work_.free[j]];
                }
                system[i * system_width + num_free] = work_.right_side[work_.free[i]] - work_.gradient[work_.free[i]];
            }
            float* solution = work_.free_step.data();
            if (!(kernels_.solve_positive(system, num_free, system_width, solution) > least_pivot)) {
                return false;
            }
            for (int i = 0; i < num_free; ++i) {
                work_.step[work_.free[i]] = solution[i];
            }
            if (num_free < k) { // it is that of those at a bound that is asked for
                std::fill_n(work_.gradient.data(), width, 0.0f);
                kernels_.add_rows(gram, k, width, work_.step.data(), work_.gradient.data());
            }
        }
        int num_wrong = 0;
        int last_wrong = -1;
        for (int j = 0; j < k; ++j) {
            const float gradient = work_.gradient[j] - work_.right_side[j];
            const double value = frame_.psi[j] + work_.step[j];
            const signed char state = frame_.bound_state[j];
            signed char next = state;
            if (state == 0) {
                next = value < 0 ? -1 : value > options.max_expression ? 1 : 0;
            } else if (state * gradient >
                       3e-7f * (std::abs(work_.right_side[j]) + std::abs(work_.gradient[j]) + gram[j * width + j])) {
                // more than the rounding of its terms
                next = 0;
            }
            work_.next_state[j] = next;
            if (next != state) {
                ++num_wrong;
                last_wrong = j;
            }
        }
        if (num_wrong == 0) {
            for (int j = 0; j < k; ++j) {
                const signed char state = frame_.bound_state[j];
                frame_.psi[j] = state < 0   ? 0.0
                                : state > 0 ? options.max_expression
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
    const Eigen::Index count = frame_.num_fixed_seen + static_cast<Eigen::Index>(frame_.matches.size());
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
        const RealtimeMatch& match = frame_.matches[i];
        fitter_.reference_.assign_vertex(reference.points, to, pack_.contour_vertices[match.row]);
        reference.image_points.col(to) = landmarks_.landmarks[match.landmark_index].point_px;
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
