// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/checks.hpp"

#include <Eigen/Core>

namespace lineament {

/// What is known of an identity, as a Gaussian in information form: mean `matrix^-1 vector`, covariance `matrix^-1`.
/// As a contribution of one image the matrix may be singular.
struct IdentityInformation
{
    Eigen::MatrixXd matrix = {}; ///< m x m, symmetric.
    Eigen::VectorXd vector = {}; ///< m.
};

/// The identity of one person from images that come one by one, in constant time and memory each:
///
///   Lambda += dLambda,   eta += deta,   a = Lambda^-1 eta                               docs/joint-fit.md, Eq. (8)
///
/// from the prior Lambda = I, eta = 0. An image's contribution, with its camera and expression integrated out, comes
/// from JointFitter::identity_information. For images linearised at the same shape the sum is that of JointFitter::
/// fit_frames; where they are linearised at different shapes the filter grows too sure of the scale, so that now and
/// then the images kept should be fitted together again.
class IdentityFilter
{
public:
    /// The prior: mean shape, variance 1 in each coefficient.
    explicit IdentityFilter(Eigen::Index num_coefficients)
        : state_{Eigen::MatrixXd::Identity(num_coefficients, num_coefficients), Eigen::VectorXd::Zero(num_coefficients)}
    {}

    /// @throws InvalidArgument on another number of coefficients or non-finite numbers.
    void add(const IdentityInformation& information)
    {
        const Eigen::Index size = state_.vector.size();
        require_size(information.matrix.rows(), size, "IdentityFilter::add", "information.matrix.rows()");
        require_size(information.matrix.cols(), size, "IdentityFilter::add", "information.matrix.cols()");
        require_size(information.vector.size(), size, "IdentityFilter::add", "information.vector");
        require_finite(information.matrix, "IdentityFilter::add", "information.matrix");
        require_finite(information.vector, "IdentityFilter::add", "information.vector");
        state_.matrix += information.matrix;
        state_.vector += information.vector;
        ++num_images_;
    }

    /// The prior for the next image's fit.
    [[nodiscard]] const IdentityInformation& state() const { return state_; }
    [[nodiscard]] int num_images() const { return num_images_; }
    [[nodiscard]] Eigen::VectorXd mean() const;       ///< m.
    [[nodiscard]] Eigen::MatrixXd covariance() const; ///< m x m.

private:
    IdentityInformation state_;
    int num_images_ = 0;
};

} // namespace lineament

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/identity_filter_impl.hpp"
#endif
