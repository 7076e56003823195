// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/joint_problem.hpp"

#include "lineament/fit/inline.hpp"
#include "lineament/fit/pose_step_impl.hpp"
#include "lineament/kernels/aligned_buffer.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <limits>
#include <vector>

namespace lineament::detail {

LINEAMENT_FIT_INLINE double prior_squares(const IdentityInformation& prior, const Eigen::VectorXd& alpha)
{
    const Eigen::VectorXd offset = alpha - prior.matrix.ldlt().solve(prior.vector);
    return offset.dot(prior.matrix * offset);
}

LINEAMENT_FIT_INLINE Eigen::Matrix3Xd JointProblem::shape_of_points(std::size_t image, const JointState& state) const
{
    const JointImage& seen = images[image];
    // Expressions and biases count at the scale s_0: how large they are in the image must not tell how large the image
    // of the head is.
    const double own_scale = seen.matched_scale / state.cameras[image].scale_px_per_mm;
    Eigen::Matrix3Xd shape = seen.points.at(state.alpha, own_scale * state.psi[image]);
    for (std::size_t i = 0; i < seen.used.size(); ++i) {
        if (seen.used[i].bias_index >= 0) {
            shape.col(static_cast<Eigen::Index>(i)) += own_scale * state.bias.col(seen.used[i].bias_index);
        }
    }
    return shape;
}

LINEAMENT_FIT_INLINE double JointProblem::squared_residual(std::size_t image, Eigen::Index point,
                                                           const JointState& state, const Eigen::Matrix3Xd& shape) const
{
    const JointImage& seen = images[image];
    const Eigen::Vector2d fitted = state.cameras[image].project(Eigen::Vector3d(shape.col(point)));
    return (seen.used[static_cast<std::size_t>(point)].root * (fitted - seen.image_points.col(point))).squaredNorm();
}

LINEAMENT_FIT_INLINE double JointProblem::prior_energy(const JointState& state) const
{
    // (a - mu)^T Lambda (a - mu) up to a constant that is zero for N(0, I)
    double energy = state.alpha.dot(prior_.matrix * state.alpha) - 2 * state.alpha.dot(prior_.vector);
    for (const Eigen::VectorXd& psi : state.psi) {
        energy += (psi / options_.expression_sigma).squaredNorm();
    }
    if (has_phi()) {
        energy += std::pow(state.phi_per_mm / *options_.phi_sigma_per_mm, 2);
    }
    if (state.bias.size() > 0) {
        energy += state.bias.cwiseAbs2().cwiseQuotient(bias_variances_mm).sum();
    }
    return energy;
}

LINEAMENT_FIT_INLINE double JointProblem::energy(const JointState& state) const
{
    double energy = prior_energy(state);
    for (std::size_t f = 0; f < images.size(); ++f) {
        const Camera& camera = state.cameras[f];
        const Eigen::Matrix3Xd shape = shape_of_points(f, state);
        if (camera.phi_per_mm > 0 && !is_in_front(camera, shape)) {
            return std::numeric_limits<double>::infinity();
        }
        for (Eigen::Index i = 0; i < shape.cols(); ++i) {
            energy += robust_loss(options_.loss, squared_residual(f, i, state, shape),
                                  images[f].used[static_cast<std::size_t>(i)].num_dimensions);
        }
        energy += 2 * images[f].scale_strength * std::log(camera.scale_px_per_mm);
    }
    return energy;
}

LINEAMENT_FIT_INLINE double JointProblem::chi_square(const JointState& state) const
{
    double sum = prior_energy(state) + 2 * state.alpha.dot(prior_.vector) -
                 state.alpha.dot(prior_.matrix * state.alpha) + prior_squares(prior_, state.alpha);
    for (std::size_t f = 0; f < images.size(); ++f) {
        const Eigen::Matrix3Xd shape = shape_of_points(f, state);
        for (Eigen::Index i = 0; i < shape.cols(); ++i) {
            sum += squared_residual(f, i, state, shape);
        }
    }
    return sum;
}

/// d x / d phi of one point.
[[nodiscard]] inline Eigen::Vector2d phi_jacobian(const Camera& camera, const Eigen::Vector3d& point)
{
    const Eigen::Vector3d in_camera = camera.in_camera(point);
    const double inverse_depth = 1 / (1 + camera.phi_per_mm * in_camera.z());
    return -camera.scale_px_per_mm * inverse_depth * inverse_depth * in_camera.z() * in_camera.head<2>();
}

/// rows rows^T. What single precision leaves out of it changes the way of a step, not where the steps end: the gradient
/// is kept in double precision.
LINEAMENT_FIT_INLINE Eigen::MatrixXd JointProblem::gram_of(const Eigen::MatrixXd& rows) const
{
    const Eigen::Index size = rows.rows();
    Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(size, size);
    if (kernels == nullptr) {
        gram.selfadjointView<Eigen::Lower>().rankUpdate(rows);
    } else {
        const int width = kernels::round_up(static_cast<int>(size), kernels::width_step);
        kernels::AlignedBuffer<float> packed(static_cast<std::size_t>(width * rows.cols()));
        kernels::AlignedBuffer<float> sum(static_cast<std::size_t>(width * width));
        Eigen::Map<Eigen::MatrixXf>(packed.data(), width, rows.cols()).topRows(size) = rows.cast<float>();
        kernels->add_gram(packed.data(), static_cast<int>(rows.cols()), width, sum.data());
        gram = Eigen::Map<const Eigen::MatrixXf>(sum.data(), width, width).topLeftCorner(size, size).cast<double>();
    }
    gram.triangularView<Eigen::StrictlyUpper>() = gram.transpose();
    return gram;
}

LINEAMENT_FIT_INLINE void JointProblem::add_image(std::size_t image, const JointState& state, JointSystem& system) const
{
    const JointImage& seen = images[image];
    const Camera& camera = state.cameras[image];
    const Eigen::Matrix3Xd shape = shape_of_points(image, state);
    const Eigen::Index shared = num_shared();
    const Eigen::Index size = shared + num_own();
    const Eigen::Index num_points = shape.cols();
    const Eigen::Index num_biases = state.bias.cols();
    Eigen::MatrixXd rows(size, 2 * num_points); // J^T of this image's unknowns, times the roots of the curvatures
    Eigen::VectorXd residuals(2 * num_points);
    Eigen::MatrixXd coupling = Eigen::MatrixXd::Zero(num_biases > 0 ? size : 0, 3 * num_biases);
    const double phi_by_shared = camera.scale_px_per_mm / reference_scale;
    const double own_scale = seen.matched_scale / camera.scale_px_per_mm;
    const Eigen::Matrix3Xd moved_by_own = shape - seen.points.at(state.alpha, Eigen::VectorXd::Zero(num_expressions_));

    for (Eigen::Index i = 0; i < num_points; ++i) {
        const JointPoint& used = seen.used[static_cast<std::size_t>(i)];
        const Eigen::Vector3d point = shape.col(i);
        const Eigen::Vector2d residual = used.root * (camera.project(point) - seen.image_points.col(i));
        const double squared = residual.squaredNorm();
        const double root_curvature = std::sqrt(robust_curvature(options_.loss, squared, used.num_dimensions));
        const double weight = robust_weight(options_.loss, squared, used.num_dimensions);
        const Eigen::Matrix2d root = root_curvature * used.root;
        const Eigen::Matrix<double, 2, 3> by_point = root * camera.jacobian(point);
        auto columns = rows.middleCols<2>(2 * i);
        columns.topRows(num_shape()).noalias() = seen.points.identity.middleCols<3>(3 * i) * by_point.transpose();
        if (has_phi()) {
            columns.row(num_shape()) = (phi_by_shared * root * phi_jacobian(camera, point)).transpose();
        }
        Eigen::Matrix<double, 2, 6> by_camera = root * pose_jacobian(camera, point);
        by_camera.col(3) -= by_point * moved_by_own.col(i);
        columns.middleRows<6>(shared) = by_camera.transpose();
        columns.bottomRows(num_expressions_).noalias() =
            seen.points.expression.middleCols<3>(3 * i) * (own_scale * by_point.transpose());
        residuals.segment<2>(2 * i) = weight / root_curvature * residual;
        if (used.bias_index >= 0) {
            const Eigen::Index b = used.bias_index;
            const Eigen::Matrix<double, 2, 3> by_bias = own_scale * by_point;
            coupling.middleCols<3>(3 * b).noalias() += columns * by_bias;
            system.bias_blocks.middleCols<3>(3 * b).noalias() += by_bias.transpose() * by_bias;
            system.bias_gradient.col(b).noalias() += by_bias.transpose() * residuals.segment<2>(2 * i);
        }
    }
    Eigen::MatrixXd gram = gram_of(rows);
    const Eigen::VectorXd gradient = rows * residuals;
    const Eigen::Index begin = own_begin(image);
    system.hessian.topLeftCorner(shared, shared) += gram.topLeftCorner(shared, shared);
    system.hessian.block(begin, 0, num_own(), shared) = gram.bottomLeftCorner(num_own(), shared);
    system.hessian.block(0, begin, shared, num_own()) = gram.topRightCorner(shared, num_own());
    system.hessian.block(begin, begin, num_own(), num_own()) = gram.bottomRightCorner(num_own(), num_own());
    system.gradient.head(shared) += gradient.head(shared);
    system.gradient.segment(begin, num_own()) = gradient.tail(num_own());
    if (num_biases > 0) {
        system.bias_coupling.topRows(shared) += coupling.topRows(shared);
        system.bias_coupling.middleRows(begin, num_own()) = coupling.bottomRows(num_own());
    }
    system.image_grams.push_back(std::move(gram));
    system.image_couplings.push_back(std::move(coupling));
}

LINEAMENT_FIT_INLINE void JointProblem::eliminate_biases(const JointState& state, JointSystem& system) const
{
    const Eigen::Index num_biases = state.bias.cols();
    if (num_biases == 0) {
        return;
    }
    system.bias_inverse.resize(3, 3 * num_biases);
    Eigen::MatrixXd scaled(system.hessian.rows(), 3 * num_biases); // coupling times the inverse's root
    for (Eigen::Index b = 0; b < num_biases; ++b) {
        Eigen::Matrix3d block = system.bias_blocks.middleCols<3>(3 * b);
        block.diagonal() += bias_variances_mm.col(b).cwiseInverse();
        system.bias_gradient.col(b) += state.bias.col(b).cwiseQuotient(bias_variances_mm.col(b));
        const Eigen::Matrix3d inverse = block.inverse();
        system.bias_inverse.middleCols<3>(3 * b) = inverse;
        const Eigen::Matrix3d root = inverse.llt().matrixL();
        scaled.middleCols<3>(3 * b).noalias() = system.bias_coupling.middleCols<3>(3 * b) * root;
        system.gradient.noalias() -=
            system.bias_coupling.middleCols<3>(3 * b) * (inverse * system.bias_gradient.col(b));
    }
    system.hessian.selfadjointView<Eigen::Lower>().rankUpdate(scaled, -1.0);
    system.hessian.triangularView<Eigen::StrictlyUpper>() = system.hessian.transpose();
}

LINEAMENT_FIT_INLINE JointSystem JointProblem::linearize(const JointState& state) const
{
    JointSystem system;
    const Eigen::Index size = num_unknowns();
    system.hessian = Eigen::MatrixXd::Zero(size, size);
    system.gradient = Eigen::VectorXd::Zero(size);
    system.bias_gradient = Eigen::Matrix3Xd::Zero(3, state.bias.cols());
    system.bias_blocks = Eigen::MatrixXd::Zero(3, 3 * state.bias.cols());
    system.bias_coupling = Eigen::MatrixXd::Zero(state.bias.cols() > 0 ? size : 0, 3 * state.bias.cols());
    for (std::size_t f = 0; f < images.size(); ++f) {
        add_image(f, state, system);
    }
    system.hessian.topLeftCorner(num_shape(), num_shape()) += prior_.matrix;
    system.gradient.head(num_shape()) += prior_.matrix * state.alpha - prior_.vector;
    if (has_phi()) {
        const double precision = std::pow(*options_.phi_sigma_per_mm, -2);
        system.hessian(num_shape(), num_shape()) += precision;
        system.gradient[num_shape()] += precision * state.phi_per_mm;
    }
    const double precision = std::pow(options_.expression_sigma, -2);
    for (std::size_t f = 0; f < images.size(); ++f) {
        const Eigen::Index begin = own_begin(f);
        system.gradient[begin + 3] += images[f].scale_strength;
        system.hessian.diagonal().segment(begin + 6, num_expressions_).array() += precision;
        system.gradient.segment(begin + 6, num_expressions_) += precision * state.psi[f];
    }
    eliminate_biases(state, system);
    return system;
}

LINEAMENT_FIT_INLINE void JointProblem::room(const JointState& state, Eigen::VectorXd& down, Eigen::VectorXd& up) const
{
    const double infinity = std::numeric_limits<double>::infinity();
    down = Eigen::VectorXd::Constant(num_unknowns(), -infinity);
    up = Eigen::VectorXd::Constant(num_unknowns(), infinity);
    down.head(num_shape()).array() = -options_.max_coefficient - state.alpha.array();
    up.head(num_shape()).array() = options_.max_coefficient - state.alpha.array();
    if (has_phi()) {
        down[num_shape()] = -state.phi_per_mm;
    }
    for (std::size_t f = 0; f < images.size(); ++f) {
        const double log_scale = std::log(state.cameras[f].scale_px_per_mm / images[f].matched_scale);
        down[own_begin(f) + 3] = -max_log_scale - log_scale;
        up[own_begin(f) + 3] = max_log_scale - log_scale;
        down.segment(own_begin(f) + 6, num_expressions_) = -state.psi[f];
        up.segment(own_begin(f) + 6, num_expressions_).array() = options_.max_expression - state.psi[f].array();
        if (moves_expressions_only) {
            down.segment<6>(own_begin(f)).setZero();
            up.segment<6>(own_begin(f)).setZero();
        }
    }
    if (moves_expressions_only) {
        down.head(num_shared()).setZero();
        up.head(num_shared()).setZero();
    }
}

LINEAMENT_FIT_INLINE JointState JointProblem::moved(const JointState& state, const JointSystem& system,
                                                    const Eigen::VectorXd& step, double damping) const
{
    JointState next = state;
    const double bound = options_.max_coefficient;
    next.alpha = (state.alpha + step.head(num_shape())).cwiseMax(-bound).cwiseMin(bound);
    if (has_phi()) {
        next.phi_per_mm = std::max(0.0, state.phi_per_mm + step[num_shape()]);
    }
    for (std::size_t f = 0; f < images.size(); ++f) {
        const Eigen::Index begin = own_begin(f);
        const Camera& camera = state.cameras[f];
        const double focal_length_px = options_.focal_length_px.value_or(1.0);
        next.cameras[f] = apply_step(camera, step.segment<6>(begin), focal_length_px);
        if (!options_.focal_length_px) {
            next.cameras[f].phi_per_mm =
                has_phi() ? next.phi_per_mm * next.cameras[f].scale_px_per_mm / reference_scale : 0.0;
        }
        next.psi[f] =
            (state.psi[f] + step.segment(begin + 6, num_expressions_)).cwiseMax(0.0).cwiseMin(options_.max_expression);
    }
    for (Eigen::Index b = 0; b < state.bias.cols(); ++b) {
        const Eigen::Vector3d pull =
            system.bias_gradient.col(b) + system.bias_coupling.middleCols<3>(3 * b).transpose() * step;
        next.bias.col(b) -= system.bias_inverse.middleCols<3>(3 * b) * pull / (1 + damping);
    }
    return next;
}

} // namespace lineament::detail
