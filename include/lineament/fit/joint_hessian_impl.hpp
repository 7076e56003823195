// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The matrix of a joint fit's step.
#pragma once

#include "lineament/fit/joint_problem.hpp"

#include "lineament/fit/inline.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <vector>

namespace lineament::detail {

/// How the biases are coupled with each other and with the unknowns.
LINEAMENT_FIT_INLINE void JointProblem::set_couplings(const JointState& state, JointSystem& system) const
{
    const Eigen::Index num_biases = state.bias.cols();
    if (num_biases == 0) {
        return;
    }
    system.bias_inverse.setZero(3, 3 * num_biases);
    for (Eigen::Index b = 0; b < num_biases; ++b) {
        system.bias_inverse.middleCols<3>(3 * b).diagonal() = bias_variances_mm.col(b).cwiseInverse();
    }
    std::vector<int>& rows_of_biases = system.rows_of_biases;
    rows_of_biases.assign(static_cast<std::size_t>(num_biases), -1);
    for (std::size_t f = 0; f < images.size(); ++f) {
        for (std::size_t i = 0; i < images[f].used.size(); ++i) {
            if (const int b = images[f].used[i].bias_index; b >= 0) {
                const Eigen::Matrix<double, 2, 3> by_bias =
                    own_scale(f, state) * system.terms[f].by_point(static_cast<Eigen::Index>(i));
                system.bias_inverse.middleCols<3>(3 * b).noalias() += by_bias.transpose() * by_bias;
                rows_of_biases[static_cast<std::size_t>(b)] = 0;
            }
        }
    }
    int num_rows = 0;
    for (Eigen::Index b = 0; b < num_biases; ++b) {
        const Eigen::Matrix3d block = system.bias_inverse.middleCols<3>(3 * b);
        system.bias_inverse.middleCols<3>(3 * b) = block.inverse();
        if (int& row = rows_of_biases[static_cast<std::size_t>(b)]; row >= 0) {
            row = num_rows++;
        }
    }
    if (kernels != nullptr) {
        set_coupling_rows(state, 3 * num_rows, system);
        return;
    }
    system.bias_coupling.setZero(num_unknowns(), 3 * num_biases);
    Eigen::MatrixX2d rows;
    for (std::size_t f = 0; f < images.size(); ++f) {
        for (std::size_t i = 0; i < images[f].used.size(); ++i) {
            if (const int b = images[f].used[i].bias_index; b >= 0) {
                const Eigen::Index point = static_cast<Eigen::Index>(i);
                const Eigen::Matrix<double, 2, 3> by_bias = own_scale(f, state) * system.terms[f].by_point(point);
                set_rows_of_point(f, point, system.terms[f], own_scale(f, state), rows);
                auto coupling = system.bias_coupling.middleCols<3>(3 * b);
                coupling.topRows(num_shared()).noalias() += rows.topRows(num_shared()) * by_bias;
                coupling.middleRows(own_begin(f), num_own()).noalias() += rows.bottomRows(num_own()) * by_bias;
            }
        }
    }
}

/// The same in single precision, the other way round: three rows for each bias that has points.
LINEAMENT_FIT_INLINE void JointProblem::set_coupling_rows(const JointState& state, int num_rows,
                                                          JointSystem& system) const
{
    const int width = coupling_width();
    system.num_coupling_rows = num_rows;
    float* coupling = room_for(system.coupling_rows, static_cast<Eigen::Index>(num_rows) * width);
    std::fill_n(coupling, num_rows * width, 0.0f);
    for (std::size_t f = 0; f < images.size(); ++f) {
        const PackedPoints& points = images[f].points;
        const PointTerms& terms = system.terms[f];
        const int num_points = static_cast<int>(images[f].used.size());
        const double scale = own_scale(f, state);
        double* matrices = room_for(system.factors, 9 * num_points);
        std::vector<int>& targets = system.targets;
        targets.assign(images[f].used.size(), -1);
        float* own = coupling + coupling_column(own_begin(f));
        for (int i = 0; i < num_points; ++i) {
            if (const int b = images[f].used[static_cast<std::size_t>(i)].bias_index; b >= 0) {
                const int target = system.rows_of_biases[static_cast<std::size_t>(b)];
                targets[static_cast<std::size_t>(i)] = target;
                const Eigen::Matrix<double, 2, 3> by_point = terms.by_point(i);
                Eigen::Map<Eigen::Matrix3d>(matrices + 9 * i).noalias() = scale * by_point.transpose() * by_point;
                const Eigen::Matrix<double, 3, 6> by_camera = scale * by_point.transpose() * terms.by_camera(i);
                const Eigen::Vector3d by_phi = scale * by_point.transpose() * terms.by_phi(i);
                for (int axis = 0; axis < 3; ++axis) {
                    const int row = (3 * target + axis) * width;
                    for (int c = 0; c < 6; ++c) {
                        own[row + num_expressions_ + c] += static_cast<float>(by_camera(axis, c));
                    }
                    if (has_phi()) {
                        coupling[row + num_shape()] += static_cast<float>(by_phi[axis]);
                    }
                }
            }
        }
        kernels->add_turned_points(points.identity.data(), points.identity.width(), num_points, matrices,
                                   targets.data(), coupling, width);
        Eigen::Map<Eigen::ArrayXd>(matrices, 9 * num_points) *= scale;
        kernels->add_turned_points(points.expression.data(), points.expression.width(), num_points, matrices,
                                   targets.data(), own, width);
    }
}

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
                                                 JointSystem& system, Eigen::MatrixXd& gram) const
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

/// In single precision. What it leaves out changes the way of a step, not where the steps end: the gradient is kept in
/// double precision.
LINEAMENT_FIT_INLINE void JointProblem::set_gram_by_kernels(std::size_t image, double own_scale,
                                                            const std::vector<int>& unknowns, JointSystem& system,
                                                            Eigen::MatrixXd& gram) const
{
    const PointTerms& terms = system.terms[image];
    const PackedPoints& points = images[image].points;
    const int num_points = static_cast<int>(terms.residuals.rows()), num_rows = 2 * num_points;
    const int shape_width = points.identity.width(), expression_width = points.expression.width();
    const int size = static_cast<int>(unknowns.size()), shape_size = static_cast<int>(num_shape());

    // Columns are [all of alpha, filled up | the other unknowns, filled up].
    const auto others = std::lower_bound(unknowns.begin(), unknowns.end(), shape_size);
    const auto own = std::lower_bound(others, unknowns.end(), static_cast<int>(num_shared()));
    const int camera_begin = static_cast<int>(num_shared() + num_expressions_);
    const auto camera = std::lower_bound(own, unknowns.end(), camera_begin);
    const int num_alpha = static_cast<int>(others - unknowns.begin());
    const int width = kernels::round_up(shape_width + size - num_alpha, kernels::width_step);
    float* rows = room_for(system.rows, static_cast<Eigen::Index>(num_rows) * width);
    float* by_psi = room_for(system.expression_rows, static_cast<Eigen::Index>(num_rows) * expression_width);
    double* jacobians = room_for(system.factors, 3 * num_rows);
    Eigen::Map<Eigen::MatrixXd> by_point(jacobians, 6, num_points);
    by_point = terms.derivatives.leftCols<6>().transpose();
    kernels->project_points(points.identity.data(), shape_width, num_points, jacobians, rows, width);
    by_point *= own_scale;
    kernels->project_points(points.expression.data(), expression_width, num_points, jacobians, by_psi,
                            expression_width);
    const int end = width - shape_width;
    for (int i = 0; i < num_points; ++i) {
        float* first = rows + 2 * i * width + shape_width;
        float* second = first + width;
        const int of_point = 2 * i * expression_width - static_cast<int>(num_shared());
        const auto derivative = [&](int column) { return static_cast<float>(terms.derivatives(i, column)); };
        int c = 0;
        if (others != own) { // phi
            first[c] = derivative(18);
            second[c++] = derivative(19);
        }
        for (auto unknown = own; unknown != camera; ++unknown, ++c) {
            first[c] = by_psi[of_point + *unknown];
            second[c] = by_psi[of_point + expression_width + *unknown];
        }
        for (auto unknown = camera; unknown != unknowns.end(); ++unknown, ++c) {
            first[c] = derivative(6 + *unknown - camera_begin);
            second[c] = derivative(12 + *unknown - camera_begin);
        }
        for (; c < end; ++c) {
            first[c] = second[c] = 0;
        }
    }
    float* sums = room_for(system.gram, static_cast<Eigen::Index>(width) * width);
    std::fill_n(sums, width * width, 0.0f);
    kernels->add_gram(rows, num_rows, width, sums);

    // The upper triangle's rows are the lower one's columns.
    for (int j = 0; j < size; ++j) {
        const float* row =
            sums + width * (j < num_alpha ? unknowns[static_cast<std::size_t>(j)] : shape_width + j - num_alpha);
        double* to = gram.data() + j * size;
        if (num_alpha == shape_size && j < num_alpha) {
            std::copy(row + j, row + num_alpha, to + j);
        }
        for (int i = j; i < num_alpha && num_alpha < shape_size; ++i) { // some are held
            to[i] = row[unknowns[static_cast<std::size_t>(i)]];
        }
        const int begin = std::max(j, num_alpha);
        std::copy(row + shape_width + begin - num_alpha, row + shape_width + size - num_alpha, to + begin);
    }
}

/// The matrix of system.unknowns, biases eliminated.
LINEAMENT_FIT_INLINE void JointProblem::set_hessian(const JointState& state, JointSystem& system) const
{
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
        system.image_grams.resize(images.size());
        for (std::size_t f = 0; f < images.size(); ++f) {
            Eigen::MatrixXd& gram = system.image_grams[f];
            set_gram(f, own_scale(f, state), unknowns_of_image(f, system.unknowns), system, gram);
            const Eigen::Index begin = is_before(own_begin(f)), own = gram.rows() - shared;
            system.hessian.topLeftCorner(shared, shared) += gram.topLeftCorner(shared, shared);
            system.hessian.block(begin, 0, own, shared) = gram.bottomLeftCorner(own, shared);
            system.hessian.block(begin, begin, own, own) = gram.bottomRightCorner(own, own);
        }
    }
    const Eigen::Index num_alpha = is_before(num_shape());
    if (is_prior_standard_) {
        system.hessian.diagonal().head(num_alpha).array() += 1;
    } else if (num_alpha == num_shape()) {
        system.hessian.topLeftCorner(num_alpha, num_alpha) += prior_.matrix;
    } else {
        const std::vector<int> alpha(system.unknowns.begin(), system.unknowns.begin() + num_alpha);
        system.hessian.topLeftCorner(num_alpha, num_alpha) += prior_.matrix(alpha, alpha);
    }
    for (Eigen::Index i = num_alpha; i < size; ++i) {
        if (system.unknowns[i] < num_shared()) {
            system.hessian(i, i) += std::pow(*options_.phi_sigma_per_mm, -2);
        } else if (!is_camera(system.unknowns[i])) {
            system.hessian(i, i) += std::pow(options_.expression_sigma, -2);
        }
    }
    if (state.bias.size() > 0) {
        eliminate_bias_hessian(system);
    }
}

/// The matrix less C V C^T, of the coupling C and the biases' inverse blocks V = L L^T; in single precision, as
/// J^T W J, where there are kernels.
LINEAMENT_FIT_INLINE void JointProblem::eliminate_bias_hessian(JointSystem& system) const
{
    const Eigen::Index size = system.hessian.rows(), num_biases = system.bias_inverse.cols() / 3;
    if (kernels == nullptr) {
        Eigen::MatrixXd scaled(size, 3 * num_biases); // C L
        for (Eigen::Index b = 0; b < num_biases; ++b) {
            const Eigen::Matrix3d root = Eigen::Matrix3d(system.bias_inverse.middleCols<3>(3 * b)).llt().matrixL();
            scaled.middleCols<3>(3 * b) = system.bias_coupling.middleCols<3>(3 * b)(system.unknowns, Eigen::all) * root;
        }
        system.hessian.selfadjointView<Eigen::Lower>().rankUpdate(scaled, -1.0);
        return;
    }
    std::vector<int> columns;
    columns.reserve(system.unknowns.size());
    for (const int unknown : system.unknowns) {
        columns.push_back(coupling_column(unknown));
    }
    const int width = kernels::round_up(static_cast<int>(size), kernels::width_step);
    const int num_rows = system.num_coupling_rows, from_width = coupling_width();
    float* rows = room_for(system.rows, static_cast<Eigen::Index>(num_rows) * width); // L^T C^T
    float* gram = room_for(system.gram, static_cast<Eigen::Index>(width) * width);
    for (Eigen::Index b = 0; b < num_biases; ++b) {
        const int row = 3 * system.rows_of_biases[static_cast<std::size_t>(b)];
        if (row < 0) {
            continue;
        }
        const Eigen::Matrix3d inverse = system.bias_inverse.middleCols<3>(3 * b);
        const Eigen::Matrix3f root = Eigen::Matrix3d(inverse.llt().matrixL()).cast<float>();
        const float* from = system.coupling_rows.data() + row * from_width;
        float* to = rows + row * width;
        for (Eigen::Index i = 0; i < size; ++i) {
            const int c = columns[static_cast<std::size_t>(i)];
            const float x = from[c], y = from[from_width + c], z = from[2 * from_width + c];
            to[i] = root(0, 0) * x + root(1, 0) * y + root(2, 0) * z;
            to[width + i] = root(1, 1) * y + root(2, 1) * z;
            to[2 * width + i] = root(2, 2) * z;
        }
        for (int axis = 0; axis < 3; ++axis) {
            std::fill(to + axis * width + size, to + (axis + 1) * width, 0.0f);
        }
    }
    std::fill_n(gram, width * width, 0.0f);
    kernels->add_gram(rows, num_rows, width, gram);
    for (Eigen::Index j = 0; j < size; ++j) {
        for (Eigen::Index i = j; i < size; ++i) {
            system.hessian(i, j) -= gram[j * width + i];
        }
    }
}

/// The covariance of alpha with the biases, -Lambda^-1 C V; held coefficients are 0.
LINEAMENT_FIT_INLINE Eigen::MatrixXd
JointProblem::bias_spread(const std::vector<int>& linear, const Eigen::MatrixXd& columns, JointSystem& system) const
{
    const Eigen::Index num_linear = columns.rows(), num_alpha = columns.cols();
    const Eigen::Index num_biases = static_cast<Eigen::Index>(system.rows_of_biases.size());
    Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(num_shape(), 3 * num_biases);
    std::vector<int> unknowns;
    for (const int position : linear) {
        unknowns.push_back(system.unknowns[static_cast<std::size_t>(position)]);
    }
    const std::vector<int> alpha(unknowns.begin(), unknowns.begin() + num_alpha);
    if (kernels == nullptr) {
        for (Eigen::Index b = 0; b < num_biases; ++b) {
            const Eigen::MatrixX3d coupling = system.bias_coupling.middleCols<3>(3 * b)(unknowns, Eigen::all);
            spread.middleCols<3>(3 * b)(alpha, Eigen::all) =
                -columns.transpose() * (coupling * system.bias_inverse.middleCols<3>(3 * b));
        }
        return spread;
    }
    const int width = kernels::round_up(static_cast<int>(num_alpha), kernels::width_step);
    using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    Eigen::Map<Rows> rows(room_for(system.rows, num_linear * width), num_linear, width);
    rows.leftCols(num_alpha) = columns.cast<float>();
    rows.rightCols(width - num_alpha).setZero();
    float* sums = room_for(system.gram, width);
    Eigen::VectorXf factors(num_linear);
    for (Eigen::Index b = 0; b < num_biases; ++b) {
        const int row = system.rows_of_biases[static_cast<std::size_t>(b)];
        for (int axis = 0; axis < 3 && row >= 0; ++axis) {
            const Eigen::Vector3f inverse = system.bias_inverse.col(3 * b + axis).cast<float>();
            const float* from = system.coupling_rows.data() + 3 * row * coupling_width();
            for (Eigen::Index i = 0; i < num_linear; ++i) {
                const int c = coupling_column(unknowns[static_cast<std::size_t>(i)]);
                factors[i] = inverse[0] * from[c] + inverse[1] * from[coupling_width() + c] +
                             inverse[2] * from[2 * coupling_width() + c];
            }
            std::fill_n(sums, width, 0.0f);
            kernels->add_rows(rows.data(), static_cast<int>(num_linear), width, factors.data(), sums);
            for (std::size_t j = 0; j < alpha.size(); ++j) {
                spread(alpha[j], 3 * b + axis) = -sums[j];
            }
        }
    }
    return spread;
}

LINEAMENT_FIT_INLINE std::vector<double> JointProblem::scale_strengths(const JointState& state,
                                                                       const std::vector<int>& linear,
                                                                       const Eigen::MatrixXd& columns,
                                                                       JointSystem& system) const
{
    const Eigen::Index num_alpha = columns.cols();
    const Eigen::MatrixXd spread = bias_spread(linear, columns, system);
    std::vector<double> strengths;
    auto own = linear.begin() + num_alpha; // of the image
    for (std::size_t f = 0; f < images.size(); ++f) {
        const Eigen::MatrixXd& gram = system.image_grams[f];
        double strength = 0;
        for (Eigen::Index j = 0; j < num_alpha; ++j) { // of symmetric matrices: below the diagonal all counts twice
            const Eigen::Index below = num_alpha - 1 - j;
            strength += gram(j, j) * columns(j, j) +
                        2 * gram.col(j).segment(j + 1, below).dot(columns.col(j).segment(j + 1, below));
        }
        const auto end = std::find_if(
            own, linear.end(), [&](int i) { return system.unknowns[static_cast<std::size_t>(i)] >= camera_begin(f); });
        const Eigen::Index num_psi = end - own;
        const Eigen::Index shared =
            std::lower_bound(system.unknowns.begin(), system.unknowns.end(), static_cast<int>(num_shared())) -
            system.unknowns.begin();
        strength += gram.block(shared, 0, num_psi, num_alpha)
                        .cwiseProduct(columns.middleRows(own - linear.begin(), num_psi))
                        .sum();
        own = end;
        for (std::size_t i = 0; i < images[f].used.size(); ++i) {
            if (const int b = images[f].used[i].bias_index; b >= 0) {
                const Eigen::Index point = static_cast<Eigen::Index>(i);
                const Eigen::Matrix<double, 2, 3> by_point = system.terms[f].by_point(point);
                const Eigen::Matrix3d of_point =
                    images[f].points.identity.of_point(point).cast<double>().transpose() * spread.middleCols<3>(3 * b);
                strength += own_scale(f, state) * (by_point.transpose() * by_point).cwiseProduct(of_point).sum();
            }
        }
        strengths.push_back(strength);
    }
    return strengths;
}

} // namespace lineament::detail
