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
    const Eigen::Index shared = num_shared();
    if (num_biases == 0) {
        return;
    }
    system.bias_blocks.setZero(3, 3 * num_biases);
    system.bias_coupling.setZero(num_unknowns(), 3 * num_biases);
    system.image_couplings.assign(images.size(), Eigen::MatrixXd::Zero(shared + num_own(), 3 * num_biases));
    Eigen::MatrixX2d rows;
    for (std::size_t f = 0; f < images.size(); ++f) {
        Eigen::MatrixXd& coupling = system.image_couplings[f];
        for (std::size_t i = 0; i < images[f].used.size(); ++i) {
            const Eigen::Index b = images[f].used[i].bias_index;
            if (b >= 0) {
                const Eigen::Index point = static_cast<Eigen::Index>(i);
                const Eigen::Matrix<double, 2, 3> by_bias = own_scale(f, state) * system.terms[f].by_point(point);
                set_rows_of_point(f, point, system.terms[f], own_scale(f, state), rows);
                coupling.middleCols<3>(3 * b).noalias() += rows * by_bias;
                system.bias_blocks.middleCols<3>(3 * b).noalias() += by_bias.transpose() * by_bias;
            }
        }
        system.bias_coupling.topRows(shared) += coupling.topRows(shared);
        system.bias_coupling.middleRows(own_begin(f), num_own()) = coupling.bottomRows(num_own());
    }
    system.bias_inverse.resize(3, 3 * num_biases);
    for (Eigen::Index b = 0; b < num_biases; ++b) {
        Eigen::Matrix3d block = system.bias_blocks.middleCols<3>(3 * b);
        block.diagonal() += bias_variances_mm.col(b).cwiseInverse();
        system.bias_inverse.middleCols<3>(3 * b) = block.inverse();
    }
}

LINEAMENT_FIT_INLINE std::vector<int> JointProblem::unknowns_of_image(std::size_t image,
                                                                      const std::vector<int>& unknowns) const
{
    std::vector<int> positions;
    const int shared = static_cast<int>(num_shared());
    const int begin = static_cast<int>(own_begin(image));
    const int end = begin + static_cast<int>(num_own());
    for (const int unknown : unknowns) {
        if (unknown < shared) {
            positions.push_back(unknown);
        } else if (unknown >= begin && unknown < end) {
            positions.push_back(shared + unknown - begin);
        }
    }
    return positions;
}

/// J^T W J of some unknowns of one image, by their positions in [shared | own].
LINEAMENT_FIT_INLINE void JointProblem::set_gram(std::size_t image, double own_scale, const std::vector<int>& unknowns,
                                                 JointSystem& system, Eigen::Ref<Eigen::MatrixXd> gram) const
{
    const PointTerms& terms = system.terms[image];
    const Eigen::Index num_points = terms.residuals.rows();
    const Eigen::Index size = static_cast<Eigen::Index>(unknowns.size());
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
                                                            Eigen::Ref<Eigen::MatrixXd> gram) const
{
    const PointTerms& terms = system.terms[image];
    const PackedPoints& points = images[image].points;
    const int num_points = static_cast<int>(terms.residuals.rows()), num_rows = 2 * num_points;
    const int shape_width = points.identity.width(), expression_width = points.expression.width();
    const int size = static_cast<int>(unknowns.size()), shape_size = static_cast<int>(num_shape());

    // Columns are [all of alpha, filled up | the other unknowns, filled up]. Few expressions are not worth choosing
    // from.
    const auto others = std::lower_bound(unknowns.begin(), unknowns.end(), shape_size);
    const auto own = std::lower_bound(others, unknowns.end(), static_cast<int>(num_shared()));
    const int camera_begin = static_cast<int>(num_shared() + num_expressions_);
    const auto camera = std::lower_bound(own, unknowns.end(), camera_begin);
    const int num_alpha = static_cast<int>(others - unknowns.begin());
    const bool has_all_psi = others == own && expression_width <= kernels::double_step;
    const int num_others = has_all_psi ? static_cast<int>(num_own()) : size - num_alpha;
    const int width = kernels::round_up(shape_width + num_others, kernels::width_step);
    float* rows = room_for(system.rows, static_cast<Eigen::Index>(num_rows) * width);
    double* jacobians = room_for(system.factors, 3 * num_rows);
    Eigen::Map<Eigen::MatrixXd> by_point(jacobians, 6, num_points);
    by_point = terms.derivatives.leftCols<6>().transpose();
    for (int r = 1; r <= num_rows; ++r) { // what fills them up
        std::fill_n(rows + r * width - kernels::width_step, kernels::width_step, 0.0f);
    }
    if (shape_width > 0) {
        kernels->project_points(points.identity.data(), shape_width, num_points, jacobians, rows, width);
    }
    by_point *= own_scale;
    const int first_psi = shape_width + static_cast<int>(own - others);
    if (has_all_psi) {
        kernels->project_points(points.expression.data(), expression_width, num_points, jacobians, rows + first_psi,
                                width);
    } else {
        float* by_psi = room_for(system.expression_rows, static_cast<Eigen::Index>(num_rows) * expression_width);
        kernels->project_points(points.expression.data(), expression_width, num_points, jacobians, by_psi,
                                expression_width);
        for (int r = 0; r < num_rows; ++r) {
            float* to = rows + r * width + first_psi;
            const float* from = by_psi + r * expression_width - num_shared();
            for (auto unknown = own; unknown != camera; ++unknown) {
                *to++ = from[*unknown];
            }
        }
    }
    std::vector<int>& columns = system.columns; // of the unknowns other than alpha
    columns.clear();
    for (auto other = others; other != unknowns.end(); ++other) {
        columns.push_back(shape_width + static_cast<int>(has_all_psi ? *other - num_shared() : other - others));
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
    if (others != own) { // phi
        set_derivative(shape_width, 18, 19);
    }
    for (auto unknown = camera; unknown != unknowns.end(); ++unknown) {
        const int k = *unknown - camera_begin;
        set_derivative(columns[static_cast<std::size_t>(unknown - others)], 6 + k, 12 + k);
    }
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
    const Eigen::Index size = static_cast<Eigen::Index>(system.unknowns.size());
    const auto is_before = [&](Eigen::Index end) {
        return std::lower_bound(system.unknowns.begin(), system.unknowns.end(), static_cast<int>(end)) -
               system.unknowns.begin();
    };
    const Eigen::Index shared = is_before(num_shared());
    if (images.size() == 1 && state.bias.size() == 0) {
        system.hessian.resize(size, size);
        set_gram(0, own_scale(0, state), system.unknowns, system, system.hessian);
    } else {
        system.hessian.setZero(size, size);
        system.image_grams.resize(images.size());
        for (std::size_t f = 0; f < images.size(); ++f) {
            Eigen::MatrixXd& gram = system.image_grams[f];
            const std::vector<int> positions = unknowns_of_image(f, system.unknowns);
            gram.resize(static_cast<Eigen::Index>(positions.size()), static_cast<Eigen::Index>(positions.size()));
            set_gram(f, own_scale(f, state), positions, system, gram);
            const Eigen::Index begin = is_before(own_begin(f)), own = gram.rows() - shared;
            system.hessian.topLeftCorner(shared, shared) += gram.topLeftCorner(shared, shared);
            system.hessian.block(begin, 0, own, shared) = gram.bottomLeftCorner(own, shared);
            system.hessian.block(begin, begin, own, own) = gram.bottomRightCorner(own, own);
        }
    }
    const Eigen::Index num_alpha = is_before(num_shape());
    if (prior_->matrix.size() == 0) {
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

/// The matrix less C V C^T, of the coupling C and the biases' inverse blocks V = L L^T; in single precision, as
/// J^T W J, where there are kernels.
LINEAMENT_FIT_INLINE void JointProblem::eliminate_bias_hessian(JointSystem& system) const
{
    const Eigen::Index size = system.hessian.rows(), num_columns = system.bias_coupling.cols();
    Eigen::MatrixXd scaled(size, num_columns); // C L
    for (Eigen::Index begin = 0; begin < num_columns; begin += 3) {
        const Eigen::Matrix3d inverse = system.bias_inverse.middleCols<3>(begin);
        const Eigen::Matrix3d root = inverse.llt().matrixL();
        const double* coupling = system.bias_coupling.data() + begin * system.bias_coupling.rows();
        for (Eigen::Index i = 0; i < size; ++i) { // several times as fast as an indexed view
            const int unknown = system.unknowns[i];
            const Eigen::RowVector3d row(coupling[unknown], coupling[system.bias_coupling.rows() + unknown],
                                         coupling[2 * system.bias_coupling.rows() + unknown]);
            scaled.block<1, 3>(i, begin).noalias() = row * root;
        }
    }
    if (kernels == nullptr) {
        system.hessian.selfadjointView<Eigen::Lower>().rankUpdate(scaled, -1.0);
        return;
    }
    const int width = kernels::round_up(static_cast<int>(size), kernels::width_step);
    float* rows = room_for(system.rows, num_columns * width);
    float* gram = room_for(system.gram, static_cast<Eigen::Index>(width) * width);
    for (Eigen::Index r = 0; r < num_columns; ++r) {
        for (Eigen::Index i = 0; i < size; ++i) {
            rows[r * width + i] = static_cast<float>(scaled(i, r));
        }
        std::fill(rows + r * width + size, rows + (r + 1) * width, 0.0f);
    }
    std::fill_n(gram, width * width, 0.0f);
    kernels->add_gram(rows, static_cast<int>(num_columns), width, gram);
    for (Eigen::Index j = 0; j < size; ++j) {
        for (Eigen::Index i = j; i < size; ++i) {
            system.hessian(i, j) -= gram[j * width + i];
        }
    }
}

} // namespace lineament::detail
