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
    for (Eigen::Index b = 0; b < num_biases; ++b) {
        system.bias_blocks.middleCols<3>(3 * b).diagonal() = bias_variances_mm.col(b).cwiseInverse();
    }
    std::vector<int>& rows_of_biases = system.rows_of_biases;
    rows_of_biases.assign(static_cast<std::size_t>(num_biases), -1);
    for (std::size_t f = 0; f < images.size(); ++f) {
        for (std::size_t i = 0; i < images[f].used.size(); ++i) {
            if (const int b = images[f].used[i].bias_index; b >= 0) {
                const double scale = own_scale(f, state);
                const Eigen::Matrix<double, 2, 3> by_point = system.terms[f].by_point(static_cast<Eigen::Index>(i));
                const Eigen::Matrix3d squares = by_point.transpose() * by_point;
                system.bias_points.middleCols<3>(3 * b) += squares;
                system.bias_blocks.middleCols<3>(3 * b) += scale * scale * squares;
                rows_of_biases[static_cast<std::size_t>(b)] = 0;
            }
        }
    }
    int num_rows = 0;
    for (Eigen::Index b = 0; b < num_biases; ++b) {
        system.bias_inverse.middleCols<3>(3 * b) = Eigen::Matrix3d(system.bias_blocks.middleCols<3>(3 * b)).inverse();
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
        std::fill_n(matrices, 9 * num_points, 0.0);
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
