// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The matrix of a joint fit's step.
#pragma once

#include "lineament/fit/joint_problem.hpp"

#include "lineament/fit/inline.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

namespace lineament::detail {

LINEAMENT_FIT_INLINE std::vector<int> JointProblem::unknowns_of_image(std::size_t image,
                                                                      const std::vector<int>& unknowns) const
{
    const auto position_of = [&](Eigen::Index unknown) {
        return std::lower_bound(unknowns.begin(), unknowns.end(), static_cast<int>(unknown));
    };
    std::vector<int> positions(unknowns.begin(), position_of(num_shared()));
    const Eigen::Index begin = own_begin(image);
    for (auto unknown = position_of(begin); unknown != position_of(begin + num_own()); ++unknown) {
        positions.push_back(static_cast<int>(*unknown + num_shared() - begin));
    }
    return positions;
}

/// The upper triangle's rows are the lower one's columns.
inline void set_lower(const UpperTriangle& upper, RoomyMatrix<Eigen::MatrixXd>& lower)
{
    lower.resize(upper.size, upper.size);
    for (Eigen::Index j = 0; j < upper.size; ++j) {
        std::copy_n(upper.row_from_diagonal(j), upper.size - j, lower.data() + j * (upper.size + 1));
    }
}

/// J^T W J of some unknowns of one image, by their positions in [shared | own].
LINEAMENT_FIT_INLINE void JointProblem::set_gram(std::size_t image, double own_scale, const std::vector<int>& unknowns,
                                                 const JointSystem& system, RoomyMatrix<Eigen::MatrixXd>& gram) const
{
    const PointTerms& terms = system.terms[image];
    const Eigen::Index num_points = terms.residuals.rows();
    const Eigen::Index size = static_cast<Eigen::Index>(unknowns.size());
    gram.resize(size, size);
    Eigen::MatrixXd rows(size, 2 * num_points);
    Eigen::MatrixX2d of_point;
    for (Eigen::Index point = 0; point < num_points; ++point) {
        set_rows_of_point(image, point, terms, own_scale, of_point);
        rows.middleCols<2>(2 * point) = of_point(unknowns, Eigen::all);
    }
    gram.setZero();
    gram.selfadjointView<Eigen::Lower>().rankUpdate(rows);
}

/// The rows of J of an image in single precision, two a point, with all of alpha from one column on, a multiple of
/// double_step, and some other unknowns from another on. Behind alpha and behind the others there are zeros up to where
/// the other begins, just behind or at a multiple of width_step, or where the row ends; before them the columns are not
/// set.
/// @param others  As positions in [shared | own].
LINEAMENT_FIT_INLINE float* JointProblem::set_rows(std::size_t image, double own_scale, std::span<const int> others,
                                                   int alpha_begin, int others_begin, int width,
                                                   JointSystem& system) const
{
    const PointTerms& terms = system.terms[image];
    const PackedPoints& points = images[image].points;
    const int num_points = static_cast<int>(terms.residuals.rows()), num_rows = 2 * num_points;
    const int shape_width = points.identity.width(), expression_width = points.expression.width();
    const int shared = static_cast<int>(num_shared()), camera_begin = shared + static_cast<int>(num_expressions_);
    const auto own = std::lower_bound(others.begin(), others.end(), shared);
    const auto camera = std::lower_bound(own, others.end(), camera_begin);
    float* rows = room_for(system.rows, static_cast<Eigen::Index>(num_rows) * width);
    const int alpha_end = alpha_begin <= others_begin ? others_begin : width;
    const int others_end = alpha_begin <= others_begin ? width : alpha_begin;
    const auto clear_before = [&](int end) { // the last columns, some of which are set below
        for (int r = 0; r < num_rows; ++r) {
            std::fill_n(rows + r * width + end - kernels::width_step, kernels::width_step, 0.0f);
        }
    };
    const auto project = [&](const PackedRows& packed, double scale, float* to, int to_width) {
        kernels->project_points(packed.data(), packed.width(), num_points, terms.derivatives.data(), scale, to,
                                to_width);
    };
    if (others_end > others_begin + static_cast<int>(others.size())) {
        clear_before(others_end);
    }
    if (alpha_begin + shape_width < alpha_end) {
        clear_before(alpha_end);
    }
    if (shape_width > 0) {
        project(points.identity, 1.0, rows + alpha_begin, width);
    }
    const int num_psi = static_cast<int>(camera - own),
              first_psi = others_begin + static_cast<int>(own - others.begin());
    if (num_psi == num_expressions_ && own == others.begin() && first_psi + expression_width <= others_end) {
        // All at once, and zeros where the camera's will be.
        project(points.expression, own_scale, rows + first_psi, width);
    } else {
        float* by_psi = room_for(system.expression_rows, static_cast<Eigen::Index>(num_rows) * expression_width);
        project(points.expression, own_scale, by_psi, expression_width);
        for (int r = 0; r < num_rows; ++r) {
            float* to = rows + r * width + first_psi;
            const float* from = by_psi + r * expression_width;
            for (int k = 0; k < num_psi; ++k) {
                to[k] = from[own[k] - shared];
            }
        }
    }
    const auto set_derivative = [&](int column, int of_first, int of_second) {
        const double* first = terms.derivatives.data() + of_first * num_points;
        const double* second = terms.derivatives.data() + of_second * num_points;
        float* to = rows + column;
        for (int i = 0; i < num_points; ++i, to += 2 * width) {
            to[0] = static_cast<float>(first[i]);
            to[width] = static_cast<float>(second[i]);
        }
    };
    if (others.begin() != own) { // phi
        set_derivative(others_begin, 18, 19);
    }
    const int first_camera = first_psi + num_psi;
    if (others.end() - camera == 6) {
        for (int axis = 0; axis < 2; ++axis) {
            kernels->turn_columns(terms.derivatives.data() + 6 * (axis + 1) * num_points, num_points, 6,
                                  rows + axis * width + first_camera, 2 * width);
        }
        return rows;
    }
    for (auto unknown = camera; unknown != others.end(); ++unknown) {
        const int k = *unknown - camera_begin;
        set_derivative(first_camera + static_cast<int>(unknown - camera), 6 + k, 12 + k);
    }
    return rows;
}

/// In single precision. What it leaves out changes the way of a step, not where the steps end: the gradient is kept in
/// double precision.
LINEAMENT_FIT_INLINE void JointProblem::set_upper_gram(std::size_t image, double own_scale,
                                                       std::span<const int> unknowns, JointSystem& system,
                                                       UpperTriangle& gram) const
{
    const int num_rows = 2 * static_cast<int>(system.terms[image].residuals.rows());
    const int num_alpha = static_cast<int>(num_shape());
    const auto others = std::lower_bound(unknowns.begin(), unknowns.end(), num_alpha);
    const std::size_t num_free_alpha = static_cast<std::size_t>(others - unknowns.begin());
    gram.resize(num_alpha + (unknowns.end() - others));
    const int width = gram.width(), begin = gram.begin(), end = begin + static_cast<int>(gram.size);
    const float* rows =
        set_rows(image, own_scale, unknowns.subspan(num_free_alpha), begin, begin + num_alpha, width, system);
    kernels->set_gram(rows, num_rows, begin, end, width, gram.rows.data());
    if (num_free_alpha == static_cast<std::size_t>(num_alpha)) {
        return;
    }
    UpperTriangle& with_held = system.with_held;
    std::swap(gram, with_held);
    gram.resize(static_cast<Eigen::Index>(unknowns.size()));
    std::fill_n(gram.rows.data(), gram.width() * gram.width(), 0.0f);
    const auto position_of = [&](std::size_t i) {
        return i < num_free_alpha ? unknowns[i] : num_alpha + static_cast<int>(i - num_free_alpha);
    };
    for (std::size_t j = 0; j < unknowns.size(); ++j) {
        const int row = position_of(j);
        for (std::size_t i = j; i < unknowns.size(); ++i) {
            gram.row_from_diagonal(static_cast<Eigen::Index>(j))[i - j] =
                with_held.row_from_diagonal(row)[position_of(i) - row];
        }
    }
}

LINEAMENT_FIT_INLINE void JointProblem::set_upper(const JointState& state, JointSystem& system) const
{
    const std::vector<int>& unknowns = system.unknowns;
    set_upper_gram(0, own_scale(0, state), unknowns, system, system.upper);
    system.has_hessian = false;
    const auto others = std::lower_bound(unknowns.begin(), unknowns.end(), static_cast<int>(num_shape()));
    for (auto i = unknowns.begin(); i != unknowns.end(); ++i) {
        float* from_diagonal = system.upper.row_from_diagonal(i - unknowns.begin());
        if (i >= others) {
            *from_diagonal += static_cast<float>(prior_of_other(*i));
        } else if (has_standard_prior()) {
            *from_diagonal += 1;
        } else {
            std::transform(i, others, from_diagonal, from_diagonal,
                           [&](int other, float sum) { return sum + static_cast<float>(prior_->matrix(other, *i)); });
        }
    }
}

LINEAMENT_FIT_INLINE void JointProblem::complete_hessian(const JointState& state, JointSystem& system) const
{
    if (system.has_hessian) {
        return;
    }
    if (is_arrow()) {
        system.has_hessian = true;
        complete_hessian_of_arrow(system);
    } else {
        set_hessian(state, system, false); // to kernels it is not positive definite
    }
}

/// The matrix of system.unknowns, biases eliminated.
LINEAMENT_FIT_INLINE void JointProblem::set_hessian(const JointState& state, JointSystem& system,
                                                    bool is_by_kernels) const
{
    system.has_hessian = true;
    const Eigen::Index size = static_cast<Eigen::Index>(system.unknowns.size());
    const auto is_before = [&](Eigen::Index end) {
        return std::lower_bound(system.unknowns.begin(), system.unknowns.end(), static_cast<int>(end)) -
               system.unknowns.begin();
    };
    const Eigen::Index shared = is_before(num_shared());
    if (is_by_kernels) { // of a single image without biases
        set_upper_gram(0, own_scale(0, state), system.unknowns, system, system.upper);
        set_lower(system.upper, system.hessian);
    } else {
        system.hessian.setZero(size, size);
        RoomyMatrix<Eigen::MatrixXd> gram;
        for (std::size_t f = 0; f < images.size(); ++f) {
            set_gram(f, own_scale(f, state), unknowns_of_image(f, system.unknowns), system, gram);
            const Eigen::Index begin = is_before(own_begin(f)), own = gram.rows() - shared;
            system.hessian.topLeftCorner(shared, shared) += gram.topLeftCorner(shared, shared);
            system.hessian.block(begin, 0, own, shared) = gram.bottomLeftCorner(own, shared);
            system.hessian.block(begin, begin, own, own) = gram.bottomRightCorner(own, own);
        }
    }
    const Eigen::Index num_alpha = is_before(num_shape());
    if (has_standard_prior()) {
        system.hessian.diagonal().head(num_alpha).array() += 1;
    } else if (num_alpha == num_shape()) {
        system.hessian.topLeftCorner(num_alpha, num_alpha) += prior_->matrix;
    } else {
        const std::vector<int> alpha(system.unknowns.begin(), system.unknowns.begin() + num_alpha);
        system.hessian.topLeftCorner(num_alpha, num_alpha) += prior_->matrix(alpha, alpha);
    }
    for (Eigen::Index i = num_alpha; i < size; ++i) {
        system.hessian(i, i) += prior_of_other(system.unknowns[static_cast<std::size_t>(i)]);
    }
    if (state.bias.size() > 0) {
        eliminate_bias_hessian(system);
    }
}

} // namespace lineament::detail
