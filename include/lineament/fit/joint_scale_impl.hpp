// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The scale term of a joint fit of several images: how much of alpha each of them determines.
#pragma once

#include "lineament/fit/joint_problem.hpp"

#include "lineament/fit/inline.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace lineament::detail {

LINEAMENT_FIT_INLINE std::vector<double>
JointProblem::scale_strengths(const JointState& state, const std::vector<int>& linear, const Eigen::MatrixXd& columns,
                              const Eigen::MatrixXd& hidden, JointSystem& system) const
{
    if (columns.cols() == 0) {
        return std::vector<double>(images.size(), 0.0); // of no coefficients none is determined
    }
    const Eigen::MatrixXd spread =
        state.bias.size() > 0 ? bias_spread(linear, columns, hidden, system) : Eigen::MatrixXd();
    return kernels != nullptr ? scale_strengths_of_arrow(state, linear, columns, spread, system)
                              : scale_strengths_of_grams(state, linear, columns, spread, system);
}

/// @param spread  The covariance of alpha with the biases, or empty.
LINEAMENT_FIT_INLINE std::vector<double> JointProblem::scale_strengths_of_grams(const JointState& state,
                                                                                const std::vector<int>& linear,
                                                                                const Eigen::MatrixXd& columns,
                                                                                const Eigen::MatrixXd& spread,
                                                                                JointSystem& system) const
{
    const Eigen::Index num_alpha = columns.cols();
    Eigen::Index own_begin = num_alpha;
    RoomyMatrix<Eigen::MatrixXd> gram;
    std::vector<double> strengths;
    for (std::size_t f = 0; f < images.size(); ++f) {
        set_gram(f, own_scale(f, state), unknowns_of_image(f, linear), system, gram);
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
        for (std::size_t i = 0; spread.size() > 0 && i < images[f].used.size(); ++i) {
            if (const int b = images[f].used[i].bias_index; b >= 0) {
                const Eigen::Index point = static_cast<Eigen::Index>(i);
                const Eigen::Matrix3d covariance =
                    images[f].points.identity.of_point(point).cast<double>().transpose() * spread.middleCols<3>(3 * b);
                const Eigen::Matrix<double, 2, 3> by_point = system.terms[f].by_point(point);
                strength += own_scale(f, state) * (by_point.transpose() * by_point).cwiseProduct(covariance).sum();
            }
        }
        strengths.push_back(strength);
    }
    return strengths;
}

/// By kernels. Where alpha and a bias move a point in model space is the same in all images.
/// @param spread  The covariance of alpha with the biases, or empty.
LINEAMENT_FIT_INLINE std::vector<double> JointProblem::scale_strengths_of_arrow(const JointState& state,
                                                                                const std::vector<int>& linear,
                                                                                const Eigen::MatrixXd& columns,
                                                                                const Eigen::MatrixXd& spread,
                                                                                JointSystem& system) const
{
    using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const Eigen::Index num_alpha = columns.cols();
    const int num_rows = static_cast<int>(num_shape()), width = kernels::round_up(num_rows, kernels::width_step);
    Eigen::Map<Rows> of_alpha(room_for(system.shape_gram, num_rows * width), num_rows, width); // held ones are 0
    of_alpha.setZero();
    for (Eigen::Index j = 0; j < num_alpha; ++j) {
        for (Eigen::Index i = 0; i < num_alpha; ++i) {
            of_alpha(linear[static_cast<std::size_t>(i)], linear[static_cast<std::size_t>(j)]) =
                static_cast<float>(columns(i, j));
        }
    }
    const SpreadOfPoints of_points = spread_of_points(of_alpha.data(), spread, system);
    of_alpha.triangularView<Eigen::StrictlyUpper>() *= 2.0f; // the part below the diagonal counts too

    const ArrowMatrix& arrow = system.arrow;
    const float* own = arrow.own.data();
    auto next = linear.begin() + num_alpha;
    std::vector<double> strengths;
    for (std::size_t f = 0; f < images.size(); ++f) {
        const JointImage& image = images[f];
        const PointTerms& terms = system.terms[f];
        const double scale = own_scale(f, state);
        const auto first_free = std::find_if(image.used.begin(), image.used.end(),
                                             [](const JointPoint& point) { return point.bias_index < 0; });
        const Eigen::Index num_biased = first_free - image.used.begin();
        double strength = product_with_gram(image, terms, num_biased, of_alpha.data(), system);
        for (Eigen::Index i = 0; i < num_biased; ++i) {
            const int b = image.used[static_cast<std::size_t>(i)].bias_index;
            const Eigen::Matrix<double, 2, 3> by_point = terms.by_point(i);
            const Eigen::Matrix3d moved =
                of_points.by_alpha.middleCols<3>(3 * b) + scale * of_points.by_bias.middleCols<3>(3 * b);
            strength += (by_point * moved).cwiseProduct(by_point).sum();
        }
        const auto end = std::lower_bound(next, linear.end(), static_cast<int>(own_begin(f) + num_own()));
        const Eigen::Map<const Rows, 0, Eigen::OuterStride<>> coupling(
            own + arrow.own_width + arrow.num_hidden, end - next, num_alpha, Eigen::OuterStride<>(arrow.width()));
        strength += coupling.cast<double>().cwiseProduct(columns.middleRows(next - linear.begin(), end - next)).sum();
        next = end;
        own += arrow.counts[f] * arrow.width();
        strengths.push_back(strength);
    }
    return strengths;
}

/// @param of_alpha  The covariance of alpha, rows filled up.
/// @param spread    Its covariance with the biases, or empty.
LINEAMENT_FIT_INLINE JointProblem::SpreadOfPoints
JointProblem::spread_of_points(const float* of_alpha, const Eigen::MatrixXd& spread, JointSystem& system) const
{
    const int num_rows = static_cast<int>(num_shape()), width = kernels::round_up(num_rows, kernels::width_step);
    SpreadOfPoints of_points;
    of_points.by_alpha.setConstant(3, spread.cols(), std::numeric_limits<double>::quiet_NaN());
    of_points.by_bias = of_points.by_alpha;
    float* sums = room_for(system.gram, width);
    for (const JointImage& image : images) {
        for (std::size_t i = 0; i < image.used.size(); ++i) {
            const int b = image.used[i].bias_index;
            if (b < 0 || !std::isnan(of_points.by_alpha(0, 3 * b))) {
                continue;
            }
            const auto rows = image.points.identity.of_point(static_cast<Eigen::Index>(i)); // B^T
            for (int axis = 0; axis < 3; ++axis) {
                std::fill_n(sums, width, 0.0f);
                kernels->add_rows(of_alpha, num_rows, width, rows.col(axis).data(), sums);
                of_points.by_alpha.col(3 * b + axis) =
                    (rows.transpose() * Eigen::Map<const Eigen::VectorXf>(sums, num_rows)).cast<double>();
            }
            of_points.by_bias.middleCols<3>(3 * b) =
                rows.cast<double>().transpose().lazyProduct(spread.middleCols<3>(3 * b));
        }
    }
    return of_points;
}

/// The sum over the entries of J^T W J of alpha, of the points of an image from `begin` on, times others.
/// @param factors  Upper triangle, rows filled up.
LINEAMENT_FIT_INLINE double JointProblem::product_with_gram(const JointImage& image, const PointTerms& terms,
                                                            Eigen::Index begin, const float* factors,
                                                            JointSystem& system) const
{
    const Eigen::Index num_points = image.points.num_points - begin;
    if (num_points == 0) {
        return 0.0;
    }
    const int num_alpha = static_cast<int>(num_shape()), width = kernels::round_up(num_alpha, kernels::width_step);
    const int from_width = image.points.identity.width();
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 6>> by_point(room_for(system.factors, 6 * num_points), num_points,
                                                                  6);
    by_point = terms.derivatives.block(begin, 0, num_points, 6);
    float* rows = room_for(system.rows, 2 * num_points * width);
    std::fill_n(rows, 2 * num_points * width, 0.0f);
    kernels->project_points(image.points.identity.data() + 3 * begin * from_width, from_width,
                            static_cast<int>(num_points), by_point.data(), 1.0, rows, width);
    float* gram = room_for(system.gram, width * width);
    kernels->set_gram(rows, static_cast<int>(2 * num_points), 0, num_alpha, width, gram);
    double sum = 0;
    for (int j = 0; j < num_alpha; ++j) {
        const Eigen::Index at = j * (width + 1), count = num_alpha - j;
        sum += Eigen::Map<const Eigen::VectorXf>(gram + at, count)
                   .cast<double>()
                   .dot(Eigen::Map<const Eigen::VectorXf>(factors + at, count).cast<double>());
    }
    return sum;
}

} // namespace lineament::detail
