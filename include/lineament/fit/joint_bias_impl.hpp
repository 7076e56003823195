// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Landmark biases in the matrix of a joint fit's step.
#pragma once

#include "lineament/fit/joint_problem.hpp"

#include "lineament/fit/inline.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include <algorithm>
#include <iterator>
#include <vector>

namespace lineament::detail {

/// How the biases are coupled with each other and with the unknowns.
LINEAMENT_FIT_INLINE void JointProblem::set_couplings(const JointState& state, JointSystem& system) const
{
    const Eigen::Index num_biases = state.bias.cols();
    if (num_biases == 0) {
        return;
    }
    system.bias_blocks.setZero(3, 3 * num_biases);
    system.bias_inverse.resize(3, 3 * num_biases);
    system.bias_points.setZero(3, 3 * num_biases);
    system.bias_with_points.setZero(3, 3 * num_biases);
    for (Eigen::Index b = 0; b < num_biases; ++b) {
        system.bias_blocks.middleCols<3>(3 * b).diagonal() = bias_variances_mm.col(b).cwiseInverse();
    }
    set_rows_of_biases(num_biases, system);
    if (kernels != nullptr) {
        std::fill_n(room_for(system.coupling_rows, system.num_coupling_rows * coupling_width()),
                    system.num_coupling_rows * coupling_width(), 0.0f);
    } else {
        system.bias_coupling.setZero(num_unknowns(), 3 * num_biases);
    }
    for (std::size_t f = 0; f < images.size(); ++f) {
        const double scale = own_scale(f, state);
        const std::vector<JointPoint>& used = images[f].used;
        double* squares = room_for(system.factors, 9 * static_cast<Eigen::Index>(used.size()));
        for (std::size_t i = 0; i < used.size(); ++i, squares += 9) {
            if (const int b = used[i].bias_index; b >= 0) {
                const Eigen::Matrix<double, 2, 3> by_point = system.terms[f].by_point(static_cast<Eigen::Index>(i));
                const Eigen::Matrix3d square = by_point.transpose() * by_point;
                const Eigen::Matrix3d with_bias = scale * square, of_bias = scale * with_bias;
                system.bias_points.middleCols<3>(3 * b) += square;
                system.bias_with_points.middleCols<3>(3 * b) += with_bias;
                system.bias_blocks.middleCols<3>(3 * b) += of_bias;
                Eigen::Map<Eigen::Matrix3d>(squares, 3, 3) = of_bias;
            }
        }
        if (kernels != nullptr) {
            add_coupling_rows_of_image(f, scale, system);
        } else {
            add_coupling_of_image(f, scale, system);
        }
    }
    for (Eigen::Index b = 0; b < num_biases; ++b) {
        system.bias_inverse.middleCols<3>(3 * b) = Eigen::Matrix3d(system.bias_blocks.middleCols<3>(3 * b)).inverse();
    }
    if (kernels != nullptr) {
        const int width = coupling_width();
        add_turned_points_of_biases(
            [&](int b) { return Eigen::Matrix3d(system.bias_with_points.middleCols<3>(3 * b)); },
            system.coupling_rows.data(), width, system);
    }
}

/// Numbers the biases that have points.
LINEAMENT_FIT_INLINE void JointProblem::set_rows_of_biases(Eigen::Index num_biases, JointSystem& system) const
{
    system.rows_of_biases.assign(static_cast<std::size_t>(num_biases), -1);
    for (const JointImage& image : images) {
        for (const JointPoint& point : image.used) {
            if (point.bias_index >= 0) {
                system.rows_of_biases[static_cast<std::size_t>(point.bias_index)] = 0;
            }
        }
    }
    int num_rows = 0;
    for (int& row : system.rows_of_biases) {
        row = row == 0 ? num_rows++ : -1;
    }
    system.num_coupling_rows = 3 * num_rows;
}

LINEAMENT_FIT_INLINE void JointProblem::add_coupling_of_image(std::size_t image, double own_scale,
                                                              JointSystem& system) const
{
    Eigen::MatrixX2d rows;
    for (std::size_t i = 0; i < images[image].used.size(); ++i) {
        if (const int b = images[image].used[i].bias_index; b >= 0) {
            const Eigen::Index point = static_cast<Eigen::Index>(i);
            const Eigen::Matrix<double, 2, 3> by_bias = own_scale * system.terms[image].by_point(point);
            set_rows_of_point(image, point, system.terms[image], own_scale, rows);
            auto coupling = system.bias_coupling.middleCols<3>(3 * b);
            coupling.topRows(num_shared()).noalias() += rows.topRows(num_shared()) * by_bias;
            coupling.middleRows(own_begin(image), num_own()).noalias() += rows.bottomRows(num_own()) * by_bias;
        }
    }
}

/// The same in single precision, the other way round, three rows for each bias that has points, and but for alpha.
/// `system.factors` holds J^T W J of the image's biases, point by point.
LINEAMENT_FIT_INLINE void JointProblem::add_coupling_rows_of_image(std::size_t image, double own_scale,
                                                                   JointSystem& system) const
{
    const int width = coupling_width();
    const PackedRows& expression = images[image].points.expression;
    const PointTerms& terms = system.terms[image];
    const int num_points = static_cast<int>(images[image].used.size());
    std::vector<int>& targets = system.targets;
    targets.assign(images[image].used.size(), -1);
    float* own = system.coupling_rows.data() + coupling_column(own_begin(image));
    for (int i = 0; i < num_points; ++i) {
        if (const int b = images[image].used[static_cast<std::size_t>(i)].bias_index; b >= 0) {
            const int target = system.rows_of_biases[static_cast<std::size_t>(b)];
            targets[static_cast<std::size_t>(i)] = target;
            const Eigen::Matrix<double, 3, 2> by_bias = own_scale * terms.by_point(i).transpose();
            const Eigen::Matrix<double, 3, 6> by_camera = by_bias * terms.by_camera(i);
            const Eigen::Vector3d by_phi = by_bias * terms.by_phi(i);
            for (int axis = 0; axis < 3; ++axis) {
                const int row = (3 * target + axis) * width;
                for (int c = 0; c < 6; ++c) {
                    own[row + num_expressions_ + c] += static_cast<float>(by_camera(axis, c));
                }
                if (has_phi()) {
                    system.coupling_rows.data()[row + num_shape()] += static_cast<float>(by_phi[axis]);
                }
            }
        }
    }
    kernels->add_turned_points(expression.data(), expression.width(), num_points, system.factors.data(), targets.data(),
                               own, width);
}

/// Adds the rows of alpha of the points that have a bias, turned by a matrix each, the same in all images.
template <typename MatrixOf>
void JointProblem::add_turned_points_of_biases(MatrixOf matrix_of, float* rows, int width, JointSystem& system) const
{
    std::vector<bool> is_done(system.rows_of_biases.size(), false);
    for (const JointImage& image : images) {
        const std::size_t num_points = image.used.size();
        double* matrices = room_for(system.factors, 9 * static_cast<Eigen::Index>(num_points));
        system.targets.assign(num_points, -1);
        bool has_any = false;
        for (std::size_t i = 0; i < num_points; ++i) {
            const int b = image.used[i].bias_index;
            if (b >= 0 && !is_done[static_cast<std::size_t>(b)]) {
                is_done[static_cast<std::size_t>(b)] = has_any = true;
                system.targets[i] = system.rows_of_biases[static_cast<std::size_t>(b)];
                Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(matrices + 9 * i, 3, 3) = matrix_of(b);
            }
        }
        if (has_any) {
            kernels->add_turned_points(image.points.identity.data(), image.points.identity.width(),
                                       static_cast<int>(num_points), matrices, system.targets.data(), rows, width);
        }
    }
}

/// The matrix less C V C^T, of the coupling C and the biases' inverse blocks V = L L^T.
LINEAMENT_FIT_INLINE void JointProblem::eliminate_bias_hessian(JointSystem& system) const
{
    Eigen::MatrixXd scaled(system.hessian.rows(), system.bias_inverse.cols()); // C L
    for (Eigen::Index b = 0; b < scaled.cols(); b += 3) {
        const Eigen::Matrix3d root = Eigen::Matrix3d(system.bias_inverse.middleCols<3>(b)).llt().matrixL();
        scaled.middleCols<3>(b) = system.bias_coupling.middleCols<3>(b)(system.unknowns, Eigen::all) * root;
    }
    system.hessian.selfadjointView<Eigen::Lower>().rankUpdate(scaled, -1.0);
}

/// The covariance of alpha with the biases, -Lambda^-1 C V; held coefficients are 0.
LINEAMENT_FIT_INLINE Eigen::MatrixXd JointProblem::bias_spread(const std::vector<int>& linear,
                                                               const Eigen::MatrixXd& columns,
                                                               const Eigen::MatrixXd& hidden, JointSystem& system) const
{
    const Eigen::Index num_linear = columns.rows(), num_alpha = columns.cols();
    const Eigen::Index num_biases = static_cast<Eigen::Index>(system.rows_of_biases.size());
    Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(num_shape(), 3 * num_biases);
    if (hidden.rows() > 0) {
        for (Eigen::Index b = 0; b < num_biases; ++b) {
            const int row = system.rows_of_biases[static_cast<std::size_t>(b)];
            for (Eigen::Index j = 0; j < num_alpha && row >= 0; ++j) {
                spread.block<1, 3>(linear[static_cast<std::size_t>(j)], 3 * b) =
                    hidden.block<3, 1>(3 * row, j).transpose();
            }
        }
        return spread;
    }
    if (kernels == nullptr) {
        const std::vector<int> alpha(linear.begin(), linear.begin() + num_alpha);
        for (Eigen::Index b = 0; b < num_biases; ++b) {
            const Eigen::MatrixX3d coupling = system.bias_coupling.middleCols<3>(3 * b)(linear, Eigen::all);
            spread.middleCols<3>(3 * b)(alpha, Eigen::all) =
                -columns.transpose() * (coupling * system.bias_inverse.middleCols<3>(3 * b));
        }
        return spread;
    }
    const int width = kernels::round_up(static_cast<int>(num_alpha), kernels::width_step);
    const int from_width = coupling_width();
    using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    Eigen::Map<Rows> rows(room_for(system.rows, num_linear * width), num_linear, width);
    rows.leftCols(num_alpha) = columns.cast<float>();
    rows.rightCols(width - num_alpha).setZero();
    float* sums = room_for(system.gram, width);
    std::vector<int> from_columns;
    std::transform(linear.begin(), linear.end(), std::back_inserter(from_columns),
                   [&](int unknown) { return coupling_column(unknown); });
    std::vector<float> factors(linear.size());
    for (Eigen::Index b = 0; b < num_biases; ++b) {
        const int row = system.rows_of_biases[static_cast<std::size_t>(b)];
        for (int axis = 0; axis < 3 && row >= 0; ++axis) {
            const Eigen::Vector3f inverse = system.bias_inverse.col(3 * b + axis).cast<float>();
            const float* from = system.coupling_rows.data() + 3 * row * from_width;
            for (std::size_t i = 0; i < linear.size(); ++i) {
                const int c = from_columns[i];
                factors[i] =
                    inverse[0] * from[c] + inverse[1] * from[from_width + c] + inverse[2] * from[2 * from_width + c];
            }
            std::fill_n(sums, width, 0.0f);
            kernels->add_rows(rows.data(), static_cast<int>(num_linear), width, factors.data(), sums);
            for (Eigen::Index j = 0; j < num_alpha; ++j) {
                spread(linear[static_cast<std::size_t>(j)], 3 * b + axis) = -sums[j];
            }
        }
    }
    return spread;
}

} // namespace lineament::detail
