// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/joint_problem.hpp"

#include "lineament/fit/inline.hpp"
#include "lineament/fit/joint_arrow_impl.hpp"
#include "lineament/fit/joint_bias_impl.hpp"
#include "lineament/fit/joint_hessian_impl.hpp"
#include "lineament/fit/joint_scale_impl.hpp"
#include "lineament/fit/pose_step_impl.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

namespace lineament::detail {

LINEAMENT_FIT_INLINE double JointProblem::prior_squares(const Eigen::VectorXd& alpha) const
{
    if (has_standard_prior()) {
        return (alpha - prior_->mean).squaredNorm();
    }
    const Eigen::VectorXd offset = alpha - prior_->mean;
    return offset.dot(prior_->matrix * offset);
}

LINEAMENT_FIT_INLINE Eigen::MatrixXd JointProblem::prior_of(const std::vector<int>& coefficients) const
{
    return has_standard_prior() ? Eigen::MatrixXd() : Eigen::MatrixXd(prior_->matrix(coefficients, coefficients));
}

/// Expression and bias count at the scale s_0: how large they are in the image must not tell how large the image of the
/// head is.
LINEAMENT_FIT_INLINE void JointProblem::place_image(std::size_t image, const JointState& state,
                                                    const PlacedPoints& first, PlacedPoints& placed) const
{
    const JointImage& seen = images[image];
    const PackedPoints& points = seen.points;
    Eigen::Index num_shaped = std::exchange(placed.num_shaped, 0);
    if (const Eigen::Index count = num_as_first(image); kernels != nullptr && count > num_shaped) {
        placed.shape.resize(3, points.mean.cols());
        placed.shape.leftCols(count) = first.shape.leftCols(count);
        num_shaped = count;
    }
    points.expression.multiply(kernels, points.num_points, state.psi[image], placed.padded, placed.offsets);
    if (state.bias.size() > 0) {
        for (std::size_t i = 0; i < seen.used.size(); ++i) {
            if (seen.used[i].bias_index >= 0) {
                placed.offsets.col(static_cast<Eigen::Index>(i)) += state.bias.col(seen.used[i].bias_index);
            }
        }
    }
    placed.offsets *= own_scale(image, state);
    points.evaluate_shape(kernels, state.alpha, num_shaped, placed.padded, placed.shape);
    placed.points = placed.shape.leftCols(points.num_points) + placed.offsets;
    set_residuals(kernels, state.cameras[image], placed.points, seen.image_points, seen.roots, placed.residuals);
}

[[nodiscard]] inline kernels::PerspectiveCamera for_kernels(const Camera& camera)
{
    kernels::PerspectiveCamera same;
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(same.turn) = camera.camera_from_model;
    Eigen::Map<Eigen::Vector2d>(same.translation) = camera.translation_mm;
    same.scale = camera.scale_px_per_mm;
    same.phi = camera.phi_per_mm;
    Eigen::Map<Eigen::Vector2d>(same.centre) = camera.principal_point_px;
    return same;
}

LINEAMENT_FIT_INLINE void set_residuals(const kernels::Kernels* kernels, const Camera& camera,
                                        const RoomyMatrix<Eigen::Matrix3Xd>& points,
                                        const Eigen::Matrix2Xd& image_points,
                                        const RoomyMatrix<Eigen::MatrixX3d>& roots,
                                        RoomyMatrix<Eigen::MatrixX2d>& residuals)
{
    const Eigen::Index count = points.cols();
    residuals.resize(count, 2);
    if (kernels != nullptr) {
        kernels->camera_residuals(for_kernels(camera), points.data(), image_points.data(), roots.data(),
                                  static_cast<int>(count), residuals.data());
        return;
    }
    for (Eigen::Index i = 0; i < count; ++i) {
        const Eigen::Vector2d distance = camera.project(Eigen::Vector3d(points.col(i))) - image_points.col(i);
        residuals(i, 0) = roots(i, 0) * distance.x() + roots(i, 1) * distance.y();
        residuals(i, 1) = roots(i, 2) * distance.y();
    }
}

LINEAMENT_FIT_INLINE void JointProblem::place(const JointState& state, std::vector<PlacedPoints>& placed) const
{
    placed.resize(images.size());
    for (std::size_t f = 0; f < images.size(); ++f) {
        place_image(f, state, placed.front(), placed[f]);
    }
}

LINEAMENT_FIT_INLINE double JointProblem::prior_energy(const JointState& state) const
{
    double energy = prior_squares(state.alpha);
    for (const Eigen::VectorXd& psi : state.psi) {
        energy += (psi / options_->expression_sigma).squaredNorm();
    }
    if (has_phi()) {
        energy += state.phi_per_mm * state.phi_per_mm * inverse_square(*options_->phi_sigma_per_mm);
    }
    if (state.bias.size() > 0) {
        energy += state.bias.cwiseAbs2().cwiseQuotient(bias_variances_mm).sum();
    }
    return energy;
}

LINEAMENT_FIT_INLINE double JointProblem::energy(const JointState& state, const std::vector<PlacedPoints>& placed) const
{
    double energy = prior_energy(state);
    for (std::size_t f = 0; f < images.size(); ++f) {
        const Camera& camera = state.cameras[f];
        if (camera.phi_per_mm > 0 && !is_in_front(camera, placed[f].points)) {
            return std::numeric_limits<double>::infinity();
        }
        RobustSum losses(options_->loss);
        for (std::size_t i = 0; i < images[f].used.size(); ++i) {
            losses.add(placed[f].squared_residual(static_cast<Eigen::Index>(i)), images[f].used[i].num_dimensions);
        }
        energy += losses.sum() + 2 * images[f].scale_strength * std::log(camera.scale_px_per_mm);
    }
    return energy;
}

LINEAMENT_FIT_INLINE double JointProblem::chi_square(const JointState& state,
                                                     const std::vector<PlacedPoints>& placed) const
{
    double sum = prior_energy(state);
    for (const PlacedPoints& of_image : placed) {
        sum += of_image.residuals.squaredNorm();
    }
    return sum;
}

LINEAMENT_FIT_INLINE void JointProblem::set_terms(std::size_t image, const JointState& state,
                                                  const PlacedPoints& placed, PointTerms& terms) const
{
    const JointImage& seen = images[image];
    const Camera& camera = state.cameras[image];
    const Eigen::Index count = placed.points.cols();
    RoomyMatrix<Eigen::VectorXd>& root_curvatures = terms.root_curvatures;
    root_curvatures.resize(count);
    terms.residuals.resize(count, 2);
    const double least = reweighs ? 1.0 : least_curvature;
    const bool is_by_kernel = kernels != nullptr && options_->loss == RobustLoss::student_t;
    if (is_by_kernel) {
        kernels->weigh_by_student_t(placed.residuals.data(), seen.dimensions.data(), student_t_degrees, least,
                                    static_cast<int>(count), root_curvatures.data(), terms.residuals.data());
    }
    for (Eigen::Index i = 0; i < count && !is_by_kernel; ++i) {
        const double squared = placed.squared_residual(i);
        const int num_dimensions = seen.used[static_cast<std::size_t>(i)].num_dimensions;
        const RobustDerivatives at = robust_derivatives(options_->loss, squared, num_dimensions, least);
        const double root = std::sqrt(at.curvature);
        root_curvatures[i] = root;
        terms.residuals.row(i) = at.weight / root * placed.residuals.row(i);
    }
    terms.derivatives.resize(count, 20);
    if (kernels != nullptr) {
        kernels->camera_derivatives(for_kernels(camera), placed.points.data(), placed.offsets.data(), seen.roots.data(),
                                    root_curvatures.data(), static_cast<int>(count), terms.derivatives.data());
    } else {
        for (Eigen::Index i = 0; i < count; ++i) {
            const SeenPoint at = see_point(camera, placed.points.col(i));
            Eigen::Matrix2d root;
            root << seen.roots(i, 0), seen.roots(i, 1), 0.0, seen.roots(i, 2);
            root *= root_curvatures[i];
            const Eigen::Matrix<double, 2, 3> by_point = root * at.by_point;
            Eigen::Matrix<double, 2, 6> by_camera = root * at.by_camera;
            by_camera.col(3) -= by_point * placed.offsets.col(i);
            const Eigen::Vector2d by_phi = root * at.by_phi;
            terms.derivatives.row(i) << by_point.row(0), by_point.row(1), by_camera.row(0), by_camera.row(1),
                by_phi.transpose();
        }
    }
    terms.derivatives.rightCols<2>() *= camera.scale_px_per_mm / reference_scale; // by the shared phi
}

/// J^T W r of one image. By kernels that of alpha, of points that the first image has too, is left to that one, which
/// therefore comes last.
LINEAMENT_FIT_INLINE void JointProblem::add_gradient(std::size_t image, const JointState& state,
                                                     JointSystem& system) const
{
    const JointImage& seen = images[image];
    const Eigen::Index num_points = seen.points.num_points;
    const PointTerms& terms = system.terms[image];
    const auto first = terms.residuals.col(0), second = terms.residuals.col(1);
    const auto derivative = [&](int column) { return terms.derivatives.col(column); };
    Eigen::Map<Eigen::Matrix3Xd> factors(room_for(system.factors, 3 * num_points), 3, num_points);
    if (kernels != nullptr) {
        kernels->pull_points(terms.residuals.data(), terms.derivatives.data(), static_cast<int>(num_points),
                             factors.data());
    } else {
        for (int axis = 0; axis < 3; ++axis) {
            factors.row(axis) = first.cwiseProduct(derivative(axis)) + second.cwiseProduct(derivative(3 + axis));
        }
    }
    for (int c = 0; c < 6; ++c) {
        system.gradient[camera_begin(image) + c] = first.dot(derivative(6 + c)) + second.dot(derivative(12 + c));
    }
    if (has_phi()) {
        system.gradient[num_shape()] += first.dot(derivative(18)) + second.dot(derivative(19));
    }
    for (Eigen::Index i = 0; i < num_points && state.bias.size() > 0; ++i) {
        if (const int b = seen.used[static_cast<std::size_t>(i)].bias_index; b >= 0) {
            system.bias_gradient.col(b) += own_scale(image, state) * factors.col(i);
        }
    }
    const auto add_scaled_rows = [&](const PackedRows& packed, Eigen::Index begin, double scale, auto gradient) {
        double* sums = room_for(system.sums, packed.width());
        std::fill_n(sums, packed.width(), 0.0);
        kernels->add_wide(packed.data() + 3 * begin * packed.width(), static_cast<int>(3 * (num_points - begin)),
                          packed.width(), factors.data() + 3 * begin, sums);
        gradient += scale * Eigen::Map<const Eigen::VectorXd>(sums, gradient.size());
    };
    auto by_alpha = system.gradient.head(num_shape());
    auto by_psi = system.gradient.segment(own_begin(image), num_expressions_);
    if (kernels != nullptr) {
        add_scaled_rows(seen.points.expression, 0, own_scale(image, state), by_psi);
        const Eigen::Index num_same = num_as_first(image);
        system.pulls_as_first.leftCols(num_same) += factors.leftCols(num_same);
        if (image == 0 && images.size() > 1) {
            factors.leftCols(system.pulls_as_first.cols()) += system.pulls_as_first;
        }
        add_scaled_rows(seen.points.identity, num_same, 1.0, by_alpha);
    } else {
        const Eigen::Map<const Eigen::VectorXd> stacked(factors.data(), factors.size());
        by_alpha.noalias() += seen.points.identity.leading(num_points).cast<double>() * stacked;
        by_psi.noalias() +=
            own_scale(image, state) * (seen.points.expression.leading(num_points).cast<double>() * stacked);
    }
}

/// The gradient with respect to unknowns and biases, these not eliminated.
LINEAMENT_FIT_INLINE void JointProblem::set_gradient(const JointState& state, const std::vector<PlacedPoints>& placed,
                                                     JointSystem& system) const
{
    system.gradient.setZero(num_unknowns());
    system.bias_gradient.setZero(3, state.bias.cols());
    system.terms.resize(images.size());
    if (images.size() > 1) {
        system.pulls_as_first.setZero(3, static_cast<Eigen::Index>(images.front().map_indices.size()));
    }
    for (std::size_t f = images.size(); f-- > 0;) { // the first one last
        set_terms(f, state, placed[f], system.terms[f]);
        add_gradient(f, state, system);
        system.gradient[camera_begin(f) + 3] += images[f].scale_strength;
        system.gradient.segment(own_begin(f), num_expressions_) +=
            inverse_square(options_->expression_sigma) * state.psi[f];
    }
    if (has_standard_prior()) {
        system.gradient.head(num_shape()) += state.alpha - prior_->vector;
    } else {
        system.gradient.head(num_shape()) += prior_->matrix * state.alpha - prior_->vector;
    }
    if (has_phi()) {
        system.gradient[num_shape()] += inverse_square(*options_->phi_sigma_per_mm) * state.phi_per_mm;
    }
    if (state.bias.cols() > 0) {
        system.bias_gradient += state.bias.cwiseQuotient(bias_variances_mm);
    }
}

/// The rows of J^T that a point adds, in the order [shared | own] (x 2).
LINEAMENT_FIT_INLINE void JointProblem::set_rows_of_point(std::size_t image, Eigen::Index point,
                                                          const PointTerms& terms, double own_scale,
                                                          Eigen::MatrixX2d& rows) const
{
    const PackedPoints& points = images[image].points;
    const Eigen::Matrix<double, 2, 3> by_point = terms.by_point(point);
    rows.resize(num_shared() + num_own(), 2);
    rows.topRows(num_shape()).noalias() = points.identity.of_point(point).cast<double>() * by_point.transpose();
    if (has_phi()) {
        rows.row(num_shape()) = terms.by_phi(point).transpose();
    }
    rows.bottomRows<6>() = terms.by_camera(point).transpose();
    rows.middleRows(num_shared(), num_expressions_).noalias() =
        points.expression.of_point(point).cast<double>() * (own_scale * by_point.transpose());
}

LINEAMENT_FIT_INLINE void JointProblem::eliminate_bias_gradient(JointSystem& system) const
{
    if (system.bias_gradient.size() == 0) {
        return;
    }
    if (kernels != nullptr) {
        double* factors = room_for(system.factors, system.num_coupling_rows);
        for (Eigen::Index b = 0; b < system.bias_gradient.cols(); ++b) {
            if (const int row = system.rows_of_biases[static_cast<std::size_t>(b)]; row >= 0) {
                Eigen::Map<Eigen::Vector3d>(factors + 3 * row).noalias() =
                    -system.bias_inverse.middleCols<3>(3 * b) * system.bias_gradient.col(b);
            }
        }
        double* sums = room_for(system.sums, coupling_width());
        std::fill_n(sums, coupling_width(), 0.0);
        kernels->add_wide(system.coupling_rows.data(), system.num_coupling_rows, coupling_width(), factors, sums);
        const Eigen::Map<const Eigen::VectorXd> in_columns(sums, coupling_width());
        system.gradient.head(num_shared()) += in_columns.head(num_shared());
        for (std::size_t f = 0; f < images.size(); ++f) {
            system.gradient.segment(own_begin(f), num_own()) +=
                in_columns.segment(coupling_column(own_begin(f)), num_own());
        }
        return;
    }
    for (Eigen::Index b = 0; b < system.bias_gradient.cols(); ++b) {
        system.gradient.noalias() -= system.bias_coupling.middleCols<3>(3 * b) *
                                     (system.bias_inverse.middleCols<3>(3 * b) * system.bias_gradient.col(b));
    }
}

/// What a step adds to the gradient with respect to the biases.
LINEAMENT_FIT_INLINE Eigen::Matrix3Xd JointProblem::bias_pulls(const JointSystem& system,
                                                               const Eigen::VectorXd& step) const
{
    Eigen::Matrix3Xd pulls = Eigen::Matrix3Xd::Zero(3, system.bias_gradient.cols());
    if (kernels == nullptr) {
        Eigen::Map<Eigen::VectorXd>(pulls.data(), pulls.size()).noalias() = system.bias_coupling.transpose() * step;
        return pulls;
    }
    AlignedBuffer<double> in_columns(static_cast<std::size_t>(coupling_width()));
    std::copy_n(step.data(), num_shared(), in_columns.data());
    for (std::size_t f = 0; f < images.size(); ++f) {
        std::copy_n(step.data() + own_begin(f), num_own(), in_columns.data() + coupling_column(own_begin(f)));
    }
    Eigen::Matrix3Xd products(3, system.num_coupling_rows / 3);
    kernels->multiply_wide(system.coupling_rows.data(), system.num_coupling_rows, coupling_width(), in_columns.data(),
                           products.data());
    for (Eigen::Index b = 0; b < pulls.cols(); ++b) {
        if (const int row = system.rows_of_biases[static_cast<std::size_t>(b)]; row >= 0) {
            pulls.col(b) = products.col(row);
        }
    }
    return pulls;
}

LINEAMENT_FIT_INLINE void JointProblem::find_free_unknowns(const JointState& state, JointSystem& system,
                                                           std::vector<int>& free) const
{
    room(state, system.down, system.up);
    const Eigen::VectorXd& gradient = system.gradient;
    free.clear();
    for (Eigen::Index i = 0; i < gradient.size(); ++i) {
        const bool is_low = system.down[i] >= 0;
        const bool is_high = system.up[i] <= 0;
        if (!(is_low && (is_high || gradient[i] > 0)) && !(is_high && gradient[i] < 0)) {
            free.push_back(static_cast<int>(i));
        }
    }
}

LINEAMENT_FIT_INLINE void JointProblem::linearize(const JointState& state, const std::vector<PlacedPoints>& placed,
                                                  JointSystem& system) const
{
    set_gradient(state, placed, system);
    set_couplings(state, system);
    eliminate_bias_gradient(system);
    system.unknowns.resize(static_cast<std::size_t>(num_unknowns()));
    std::iota(system.unknowns.begin(), system.unknowns.end(), 0);
    if (is_arrow()) {
        set_arrow(state, system);
    } else {
        set_hessian(state, system, kernels != nullptr);
    }
}

LINEAMENT_FIT_INLINE void JointProblem::linearize_free(const JointState& state, const std::vector<PlacedPoints>& placed,
                                                       JointSystem& system) const
{
    set_gradient(state, placed, system);
    set_couplings(state, system);
    eliminate_bias_gradient(system);
    find_free_unknowns(state, system, system.unknowns);
    if (is_arrow()) {
        set_arrow(state, system);
    } else if (kernels != nullptr) {
        set_upper(state, system);
    } else {
        set_hessian(state, system, false);
    }
}

LINEAMENT_FIT_INLINE bool JointProblem::renew_gradient(const JointState& state, const std::vector<PlacedPoints>& placed,
                                                       JointSystem& system) const
{
    set_gradient(state, placed, system);
    eliminate_bias_gradient(system);
    find_free_unknowns(state, system, system.free);
    return std::includes(system.unknowns.begin(), system.unknowns.end(), system.free.begin(), system.free.end());
}

LINEAMENT_FIT_INLINE void JointProblem::room(const JointState& state, Eigen::VectorXd& down, Eigen::VectorXd& up) const
{
    const double infinity = std::numeric_limits<double>::infinity();
    down = Eigen::VectorXd::Constant(num_unknowns(), -infinity);
    up = Eigen::VectorXd::Constant(num_unknowns(), infinity);
    down.head(num_shape()).array() = -options_->max_coefficient - state.alpha.array();
    up.head(num_shape()).array() = options_->max_coefficient - state.alpha.array();
    if (has_phi()) {
        down[num_shape()] = -state.phi_per_mm;
    }
    for (std::size_t f = 0; f < images.size(); ++f) {
        down.segment(own_begin(f), num_expressions_) = -state.psi[f];
        up.segment(own_begin(f), num_expressions_).array() = options_->max_expression - state.psi[f].array();
        const double log_scale = std::log(state.cameras[f].scale_px_per_mm / images[f].matched_scale);
        down[camera_begin(f) + 3] = -std::log(max_scale_change) - log_scale;
        up[camera_begin(f) + 3] = std::log(max_scale_change) - log_scale;
        if (holds_cameras) {
            down.segment<6>(camera_begin(f)).setZero();
            up.segment<6>(camera_begin(f)).setZero();
        }
    }
}

LINEAMENT_FIT_INLINE void JointProblem::move(const JointState& state, const JointSystem& system,
                                             const Eigen::VectorXd& step, double damping, JointState& next) const
{
    next = state;
    const double bound = options_->max_coefficient;
    next.alpha = (state.alpha + step.head(num_shape())).cwiseMax(-bound).cwiseMin(bound);
    if (has_phi()) {
        next.phi_per_mm = std::max(0.0, state.phi_per_mm + step[num_shape()]);
    }
    for (std::size_t f = 0; f < images.size(); ++f) {
        const Camera& camera = state.cameras[f];
        const double focal_length_px = options_->focal_length_px.value_or(1.0);
        next.cameras[f] = apply_step(camera, step.segment<6>(camera_begin(f)), focal_length_px);
        if (!options_->focal_length_px) {
            next.cameras[f].phi_per_mm =
                has_phi() ? next.phi_per_mm * next.cameras[f].scale_px_per_mm / reference_scale : 0.0;
        }
        next.psi[f] = (state.psi[f] + step.segment(own_begin(f), num_expressions_))
                          .cwiseMax(0.0)
                          .cwiseMin(options_->max_expression);
    }
    if (state.bias.size() > 0) {
        const Eigen::Matrix3Xd pulls = system.bias_gradient + bias_pulls(system, step);
        for (Eigen::Index b = 0; b < state.bias.cols(); ++b) {
            next.bias.col(b) -= system.bias_inverse.middleCols<3>(3 * b) * pulls.col(b) / (1 + damping);
        }
    }
}

} // namespace lineament::detail
