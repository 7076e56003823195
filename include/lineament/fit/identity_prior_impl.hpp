// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/identity_filter.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace lineament::detail {

/// What is known of an identity before the images: a normal distribution.
struct IdentityPrior
{
    Eigen::MatrixXd matrix = {}; ///< Lambda (m x m); empty: 1.
    Eigen::VectorXd vector = {}; ///< Lambda mu.
    Eigen::VectorXd mean = {};   ///< mu.
    int num_images = 0;          ///< That it comes from.

    [[nodiscard]] double entry(Eigen::Index row, Eigen::Index column) const ///< Of Lambda.
    {
        return matrix.size() > 0 ? matrix(row, column) : row == column ? 1.0 : 0.0;
    }

    /// N(0, 1).
    explicit IdentityPrior(Eigen::Index num_coefficients)
        : vector(Eigen::VectorXd::Zero(num_coefficients)), mean(vector)
    {}

    IdentityPrior(const IdentityInformation& information, int images)
        : matrix(information.matrix), vector(information.vector), mean(vector), num_images(images)
    {
        if (!vector.isZero(0)) {
            mean = matrix.ldlt().solve(vector);
        }
    }
};

} // namespace lineament::detail
