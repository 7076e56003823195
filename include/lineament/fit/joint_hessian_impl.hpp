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
#include <iterator>
#include <limits>
#include <numeric>
#include <span>
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

/// As set_gram_by_kernels.
LINEAMENT_FIT_INLINE void JointProblem::set_arrow(const JointState& state, JointSystem& system) const
{
    const std::vector<int>& unknowns = system.unknowns;
    const auto others = std::lower_bound(unknowns.begin(), unknowns.end(), static_cast<int>(num_shape()));
    const int num_alpha = static_cast<int>(others - unknowns.begin());
    const int num_phi = others != unknowns.end() && *others < num_shared() ? 1 : 0;
    const int num_hidden = state.bias.size() > 0 ? system.num_coupling_rows : 0;
    std::vector<std::vector<int>> of_images;
    std::vector<int> counts;
    for (std::size_t f = 0; f < images.size(); ++f) {
        of_images.push_back(unknowns_of_image(f, unknowns));
        counts.push_back(static_cast<int>(of_images.back().size()) - num_alpha - num_phi);
    }
    ArrowMatrix& arrow = system.arrow;
    system.has_hessian = false;
    arrow.set_zero(counts, num_hidden, num_alpha + num_phi);
    const int alpha_column = arrow.own_width + num_hidden, phi_column = alpha_column + num_alpha;
    const int shape_width = kernels::round_up(static_cast<int>(num_shape()), kernels::width_step);
    float* shape_gram = room_for(system.shape_gram, shape_width * shape_width);
    std::fill_n(shape_gram, shape_width * shape_width, 0.0f);
    float* own = arrow.own.data();
    double phi_squares = 0;
    Eigen::VectorXf phi_with_alpha = Eigen::VectorXf::Zero(num_alpha);
    for (std::size_t f = 0; f < images.size(); ++f) {
        const std::span<const int> others_of_image =
            std::span(of_images[f]).subspan(static_cast<std::size_t>(num_alpha));
        const int num_others = static_cast<int>(others_of_image.size());
        const int alpha_begin = kernels::round_up(num_others, kernels::width_step), width = alpha_begin + shape_width;
        float* rows = set_rows(f, own_scale(f, state), others_of_image, alpha_begin, 0, width, system);
        float* gram = room_for(system.gram, alpha_begin * width);
        std::fill_n(gram, alpha_begin * width, 0.0f);
        kernels->add_leading_gram(rows, 2 * static_cast<int>(images[f].used.size()), num_others, width, gram);
        if (num_phi > 0) {
            phi_squares += gram[0];
        }
        for (int a = 0; a < num_alpha && num_phi > 0; ++a) {
            phi_with_alpha[a] += gram[alpha_begin + unknowns[static_cast<std::size_t>(a)]];
        }
        for (int i = num_phi; i < num_others; ++i, own += arrow.width()) {
            const float* from = gram + i * width;
            std::copy(from + i, from + num_others, own + i - num_phi);
            for (int a = 0; a < num_alpha; ++a) {
                own[alpha_column + a] = from[alpha_begin + unknowns[static_cast<std::size_t>(a)]];
            }
            if (num_phi > 0) {
                own[phi_column] = gram[i];
            }
            const int unknown = others_of_image[static_cast<std::size_t>(i)] - static_cast<int>(num_shared());
            const int coupled = coupling_column(own_begin(f)) + unknown, step = coupling_width();
            for (int h = 0; h < num_hidden; ++h) {
                own[arrow.own_width + h] = system.coupling_rows.data()[h * step + coupled];
            }
            if (unknown < num_expressions_) {
                own[i - num_phi] += static_cast<float>(inverse_square(options_->expression_sigma));
            }
        }

        // Of alpha alone the rows that are not those of biases, one behind the other.
        float* end = rows;
        int num_kept = 0;
        for (std::size_t row = 0; row < 2 * images[f].used.size(); ++row) {
            if (num_hidden == 0 || images[f].used[row / 2].bias_index < 0) {
                end = std::copy_n(rows + static_cast<int>(row) * width + alpha_begin, shape_width, end);
                ++num_kept;
            }
        }
        kernels->add_gram(rows, num_kept, shape_width, shape_gram);
    }
    if (num_hidden > 0) {
        add_shape_gram_of_biases(system, shape_gram);
        set_arrow_of_biases(system);
    }
    for (int j = 0; j < num_alpha; ++j) {
        const int unknown = unknowns[static_cast<std::size_t>(j)];
        float* row = arrow.shared.data() + (num_hidden + j) * arrow.shared_width + num_hidden;
        for (int i = j; i < num_alpha; ++i) {
            const int other = unknowns[static_cast<std::size_t>(i)];
            row[i] = shape_gram[unknown * shape_width + other] + static_cast<float>(prior_->entry(other, unknown));
        }
        if (num_phi > 0) {
            row[num_alpha] = phi_with_alpha[j];
        }
    }
    if (num_phi > 0) {
        arrow.shared.data()[(num_hidden + num_alpha) * (arrow.shared_width + 1)] =
            static_cast<float>(phi_squares + inverse_square(*options_->phi_sigma_per_mm));
    }
}

/// The rows of the biases.
LINEAMENT_FIT_INLINE void JointProblem::set_arrow_of_biases(JointSystem& system) const
{
    ArrowMatrix& arrow = system.arrow;
    for (std::size_t b = 0; b < system.rows_of_biases.size(); ++b) {
        for (int axis = 0; axis < 3 && system.rows_of_biases[b] >= 0; ++axis) {
            const int h = 3 * system.rows_of_biases[b] + axis;
            float* row = arrow.shared.data() + h * arrow.shared_width;
            for (int other = axis; other < 3; ++other) {
                row[h - axis + other] =
                    static_cast<float>(system.bias_blocks(axis, 3 * static_cast<Eigen::Index>(b) + other));
            }
            const float* coupling = system.coupling_rows.data() + h * coupling_width();
            for (int j = 0; j < arrow.num_shared; ++j) {
                row[arrow.num_hidden + j] = coupling[system.unknowns[static_cast<std::size_t>(j)]];
            }
        }
    }
}

LINEAMENT_FIT_INLINE void JointProblem::complete_hessian(JointSystem& system) const
{
    if (!is_arrow() || system.has_hessian) {
        return;
    }
    system.has_hessian = true;
    set_less_biases(system);
    const ArrowMatrix& arrow = system.arrow;
    const int num_shared = arrow.num_shared, num_hidden = arrow.num_hidden;
    const Eigen::Index size = system.hessian.rows();
    const auto add = [](const float* from, int count, double* to) {
        for (int i = 0; i < count; ++i) {
            to[i] += from[i];
        }
    };
    for (int j = 0; j < num_shared; ++j) {
        const float* row = arrow.shared.data() + (num_hidden + j) * arrow.shared_width + num_hidden;
        add(row + j, num_shared - j, system.hessian.data() + j * (size + 1));
    }
    const float* row = arrow.own.data();
    int begin = num_shared;
    for (const int count : arrow.counts) {
        for (int i = 0; i < count; ++i, row += arrow.width()) {
            add(row + i, count - i, system.hessian.data() + (begin + i) * (size + 1));
            for (int j = 0; j < num_shared; ++j) {
                system.hessian(begin + i, j) += row[arrow.own_width + num_hidden + j];
            }
        }
        begin += count;
    }
}

/// The part of the matrix that eliminating the biases takes off, -C V C^T, of the coupling C and the biases' inverse
/// blocks V = L L^T.
LINEAMENT_FIT_INLINE void JointProblem::set_less_biases(JointSystem& system) const
{
    const ArrowMatrix& arrow = system.arrow;
    const int num_shared = arrow.num_shared, num_hidden = arrow.num_hidden;
    const int size = static_cast<int>(system.unknowns.size()), width = kernels::round_up(size, kernels::width_step);
    system.hessian.resize(size, size);
    if (num_hidden == 0) {
        system.hessian.setZero();
        return;
    }
    float* rows = room_for(system.rows, num_hidden * width); // L^T C^T
    for (std::size_t b = 0; b < system.rows_of_biases.size(); ++b) {
        const int h = 3 * system.rows_of_biases[b];
        if (h < 0) {
            continue;
        }
        const Eigen::Matrix3d inverse = system.bias_inverse.middleCols<3>(3 * static_cast<Eigen::Index>(b));
        const Eigen::Matrix3f root = Eigen::Matrix3d(inverse.llt().matrixL()).cast<float>();
        float* to = rows + h * width;
        const auto set = [&](int c, const float* coupling, int step) {
            const float x = coupling[0], y = coupling[step], z = coupling[2 * step];
            to[c] = root(0, 0) * x + root(1, 0) * y + root(2, 0) * z;
            to[width + c] = root(1, 1) * y + root(2, 1) * z;
            to[2 * width + c] = root(2, 2) * z;
        };
        for (int j = 0; j < num_shared; ++j) {
            set(j, arrow.shared.data() + h * arrow.shared_width + num_hidden + j, arrow.shared_width);
        }
        for (int i = num_shared; i < size; ++i) {
            set(i, arrow.own.data() + (i - num_shared) * arrow.width() + arrow.own_width + h, 1);
        }
        for (int axis = 0; axis < 3; ++axis) {
            std::fill(to + axis * width + size, to + (axis + 1) * width, 0.0f);
        }
    }
    float* gram = room_for(system.gram, width * width);
    std::fill_n(gram, width * width, 0.0f);
    kernels->add_gram(rows, num_hidden, width, gram);
    for (int j = 0; j < size; ++j) {
        std::transform(gram + j * width + j, gram + j * width + size, system.hessian.data() + j * (size + 1),
                       [](float taken) { return -static_cast<double>(taken); });
    }
}

/// R with R^T R = A, positive semi-definite.
[[nodiscard]] inline Eigen::Matrix3d root_of(Eigen::Matrix3d a)
{
    Eigen::Matrix3d root = Eigen::Matrix3d::Zero();
    const double least = 1e-12 * a.trace(); // below is rounding
    for (int k = 0; k < 3; ++k) {
        if (a(k, k) > least) {
            root.row(k) = a.row(k) / std::sqrt(a(k, k));
            a.noalias() -= root.row(k).transpose() * root.row(k);
        }
    }
    return root;
}

/// Points with a bias are the same in all images, so that what images say of a point is summed first.
LINEAMENT_FIT_INLINE void JointProblem::add_shape_gram_of_biases(JointSystem& system, float* gram) const
{
    const int width = kernels::round_up(static_cast<int>(num_shape()), kernels::width_step);
    float* rows = room_for(system.rows, system.num_coupling_rows * width);
    std::fill_n(rows, system.num_coupling_rows * width, 0.0f);
    std::vector<bool> is_done(system.rows_of_biases.size(), false);
    for (const JointImage& image : images) {
        const std::size_t num_points = image.used.size();
        double* roots = room_for(system.factors, 9 * static_cast<Eigen::Index>(num_points));
        system.targets.assign(num_points, -1);
        for (std::size_t i = 0; i < num_points; ++i) {
            const int b = image.used[i].bias_index;
            if (b >= 0 && !is_done[static_cast<std::size_t>(b)]) {
                is_done[static_cast<std::size_t>(b)] = true;
                system.targets[i] = system.rows_of_biases[static_cast<std::size_t>(b)];
                Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(roots + 9 * i) =
                    root_of(system.bias_points.middleCols<3>(3 * b));
            }
        }
        kernels->add_turned_points(image.points.identity.data(), image.points.identity.width(),
                                   static_cast<int>(num_points), roots, system.targets.data(), rows, width);
    }
    kernels->add_gram(rows, system.num_coupling_rows, width, gram);
}

/// The covariance of alpha with the biases, -Lambda^-1 C V; held coefficients are 0.
LINEAMENT_FIT_INLINE Eigen::MatrixXd
JointProblem::bias_spread(const std::vector<int>& linear, const Eigen::MatrixXd& columns, JointSystem& system) const
{
    const Eigen::Index num_linear = columns.rows(), num_alpha = columns.cols();
    const Eigen::Index num_biases = static_cast<Eigen::Index>(system.rows_of_biases.size());
    Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(num_shape(), 3 * num_biases);
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

LINEAMENT_FIT_INLINE std::vector<double> JointProblem::scale_strengths(const JointState& state,
                                                                       const std::vector<int>& linear,
                                                                       const Eigen::MatrixXd& columns,
                                                                       JointSystem& system) const
{
    const bool has_biases = state.bias.size() > 0;
    const Eigen::Index num_alpha = columns.cols();
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
