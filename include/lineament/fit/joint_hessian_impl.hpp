// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The matrix of a joint fit's step.
#pragma once

#include "lineament/fit/joint_problem.hpp"

#include "lineament/fit/inline.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
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

/// J^T W J of some unknowns of one image, by their positions in [shared | own].
LINEAMENT_FIT_INLINE void JointProblem::set_gram(std::size_t image, double own_scale, const std::vector<int>& unknowns,
                                                 JointSystem& system, RoomyMatrix<Eigen::MatrixXd>& gram) const
{
    const PointTerms& terms = system.terms[image];
    const Eigen::Index num_points = terms.residuals.rows();
    const Eigen::Index size = static_cast<Eigen::Index>(unknowns.size());
    gram.resize(size, size);
    if (kernels != nullptr) {
        set_gram_by_kernels(image, own_scale, unknowns, system, gram);
        return;
    }
    Eigen::MatrixXd rows(size, 2 * num_points);
    Eigen::MatrixX2d of_point;
    for (Eigen::Index point = 0; point < num_points; ++point) {
        set_rows_of_point(image, point, terms, own_scale, of_point);
        rows.middleCols<2>(2 * point) = of_point(unknowns, Eigen::all);
    }
    gram.setZero();
    gram.selfadjointView<Eigen::Lower>().rankUpdate(rows);
}

/// The rows of J of an image in single precision, two a point, with all of alpha from one column on and some other
/// unknowns from another on, both filled up with zeros to where the other or the row ends, a multiple of width_step.
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
    double* jacobians = room_for(system.factors, 3 * num_rows);
    for (int k = 0; k < 6; ++k) { // faster than an assignment of transposed matrices
        const double* derivative = terms.derivatives.data() + k * num_points;
        for (int i = 0; i < num_points; ++i) {
            jacobians[6 * i + k] = derivative[i];
        }
    }
    const int alpha_end = alpha_begin < others_begin ? others_begin : width;
    const int others_end = alpha_begin < others_begin ? width : alpha_begin;
    const auto clear_before = [&](int end) { // the last columns, some of which are set below
        for (int r = 0; r < num_rows; ++r) {
            std::fill_n(rows + r * width + end - kernels::width_step, kernels::width_step, 0.0f);
        }
    };
    if (others_end > others_begin) {
        clear_before(others_end);
    }
    if (alpha_begin + shape_width < alpha_end) {
        clear_before(alpha_end);
    }
    if (shape_width > 0) {
        kernels->project_points(points.identity.data(), shape_width, num_points, jacobians, rows + alpha_begin, width);
    }
    Eigen::Map<Eigen::ArrayXd>(jacobians, 6 * num_points) *= own_scale;
    const int num_psi = static_cast<int>(camera - own),
              first_psi = others_begin + static_cast<int>(own - others.begin());
    if (num_psi == num_expressions_ && own == others.begin()) { // all at once, and zeros where the camera's will be
        kernels->project_points(points.expression.data(), expression_width, num_points, jacobians, rows + first_psi,
                                width);
    } else {
        float* by_psi = room_for(system.expression_rows, static_cast<Eigen::Index>(num_rows) * expression_width);
        kernels->project_points(points.expression.data(), expression_width, num_points, jacobians, by_psi,
                                expression_width);
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
    for (auto unknown = camera; unknown != others.end(); ++unknown) {
        const int k = *unknown - camera_begin;
        set_derivative(first_psi + static_cast<int>(unknown - own), 6 + k, 12 + k);
    }
    return rows;
}

/// In single precision. What it leaves out changes the way of a step, not where the steps end: the gradient is kept in
/// double precision.
LINEAMENT_FIT_INLINE void JointProblem::set_gram_by_kernels(std::size_t image, double own_scale,
                                                            const std::vector<int>& unknowns, JointSystem& system,
                                                            RoomyMatrix<Eigen::MatrixXd>& gram) const
{
    const int num_rows = 2 * static_cast<int>(system.terms[image].residuals.rows());
    const int shape_width = images[image].points.identity.width();
    const int size = static_cast<int>(unknowns.size()), shape_size = static_cast<int>(num_shape());
    const auto others = std::lower_bound(unknowns.begin(), unknowns.end(), shape_size);
    const int num_alpha = static_cast<int>(others - unknowns.begin());
    std::vector<int>& of_columns = system.of_columns; // from shape_width on
    std::vector<int>& columns = system.columns;       // of the unknowns other than alpha
    of_columns.assign(others, unknowns.end());
    columns.resize(of_columns.size());
    std::iota(columns.begin(), columns.end(), shape_width);
    const bool has_phi_column = !of_columns.empty() && of_columns.front() < num_shared();
    if (!has_phi_column && num_expressions_ <= kernels::double_step) { // so few are not worth choosing from
        std::transform(others, unknowns.end(), columns.begin(),
                       [&](int unknown) { return shape_width + unknown - static_cast<int>(num_shared()); });
        of_columns.resize(static_cast<std::size_t>(num_own()));
        std::iota(of_columns.begin(), of_columns.end(), static_cast<int>(num_shared()));
    }
    const int num_others = static_cast<int>(of_columns.size());
    const int width = kernels::round_up(shape_width + num_others, kernels::width_step);
    const float* rows = set_rows(image, own_scale, of_columns, 0, shape_width, width, system);
    float* sums = room_for(system.gram, static_cast<Eigen::Index>(width) * width);
    std::fill_n(sums, width * width, 0.0f);
    kernels->add_leading_gram(rows, num_rows, shape_width + num_others, width, sums);

    // The upper triangle's rows are the lower one's columns.
    for (int j = 0; j < size; ++j) {
        const int column =
            j < num_alpha ? unknowns[static_cast<std::size_t>(j)] : columns[static_cast<std::size_t>(j - num_alpha)];
        const float* row = sums + width * column;
        double* to = gram.data() + j * size;
        if (num_alpha == shape_size && j < num_alpha) {
            std::copy(row + j, row + num_alpha, to + j);
        }
        for (int i = j; i < num_alpha && num_alpha < shape_size; ++i) { // some are held
            to[i] = row[unknowns[static_cast<std::size_t>(i)]];
        }
        for (int i = std::max(j - num_alpha, 0); i < size - num_alpha; ++i) {
            to[num_alpha + i] = row[columns[static_cast<std::size_t>(i)]];
        }
    }
}

/// The matrix of system.unknowns, biases eliminated.
LINEAMENT_FIT_INLINE void JointProblem::set_hessian(const JointState& state, JointSystem& system) const
{
    if (is_arrow()) {
        set_arrow(state, system);
        complete_hessian(system);
        return;
    }
    const Eigen::Index size = static_cast<Eigen::Index>(system.unknowns.size());
    const auto is_before = [&](Eigen::Index end) {
        return std::lower_bound(system.unknowns.begin(), system.unknowns.end(), static_cast<int>(end)) -
               system.unknowns.begin();
    };
    const Eigen::Index shared = is_before(num_shared());
    if (images.size() == 1 && state.bias.size() == 0) {
        set_gram(0, own_scale(0, state), system.unknowns, system, system.hessian);
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
        if (system.unknowns[i] < num_shared()) {
            system.hessian(i, i) += inverse_square(*options_->phi_sigma_per_mm);
        } else if (!is_camera(system.unknowns[i])) {
            system.hessian(i, i) += inverse_square(options_->expression_sigma);
        }
    }
    if (state.bias.size() > 0) {
        eliminate_bias_hessian(system);
    }
}

LINEAMENT_FIT_INLINE std::vector<double> JointProblem::scale_strengths(const JointState& state,
                                                                       const std::vector<int>& linear,
                                                                       const Eigen::MatrixXd& columns,
                                                                       JointSystem& system) const
{
    const bool has_biases = state.bias.size() > 0;
    const Eigen::Index num_alpha = columns.cols();
    if (num_alpha == 0) {
        return std::vector<double>(images.size(), 0.0); // of no coefficients none is determined
    }
    const Eigen::MatrixXd spread = has_biases ? bias_spread(linear, columns, system) : Eigen::MatrixXd();
    Eigen::Matrix3Xd covariances = // of where alpha and a bias move its point, where they are known
        Eigen::Matrix3Xd::Constant(3, spread.cols(), std::numeric_limits<double>::quiet_NaN());
    Eigen::Index own_begin = num_alpha;
    RoomyMatrix<Eigen::MatrixXd> gram;
    std::vector<double> strengths;
    for (std::size_t f = 0; f < images.size(); ++f) {
        const std::vector<int> of_image = unknowns_of_image(f, linear);
        set_gram(f, own_scale(f, state), of_image, system, gram);
        double strength = 0;
        for (Eigen::Index j = 0; j < num_alpha; ++j) { // of symmetric matrices: below the diagonal all counts twice
            const Eigen::Index below = num_alpha - 1 - j;
            strength += gram(j, j) * columns(j, j) +
                        2 * gram.col(j).segment(j + 1, below).dot(columns.col(j).segment(j + 1, below));
        }
        const Eigen::Index num_own = gram.rows() - num_alpha;
        strength +=
            gram.bottomLeftCorner(num_own, num_alpha).cwiseProduct(columns.middleRows(own_begin, num_own)).sum();
        own_begin += num_own;
        for (std::size_t i = 0; has_biases && i < images[f].used.size(); ++i) {
            if (const int b = images[f].used[i].bias_index; b >= 0) {
                const Eigen::Index point = static_cast<Eigen::Index>(i);
                auto covariance = covariances.middleCols<3>(3 * b);
                if (std::isnan(covariance(0, 0))) { // the same in all images
                    covariance = images[f].points.identity.of_point(point).cast<double>().transpose().lazyProduct(
                        spread.middleCols<3>(3 * b));
                }
                const Eigen::Matrix<double, 2, 3> by_point = system.terms[f].by_point(point);
                strength += own_scale(f, state) * (by_point.transpose() * by_point).cwiseProduct(covariance).sum();
            }
        }
        strengths.push_back(strength);
    }
    return strengths;
}

} // namespace lineament::detail
