// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/identity_filter.hpp"
#include "lineament/fit/inline.hpp"

#include <Eigen/Cholesky>

namespace lineament {

LINEAMENT_FIT_INLINE Eigen::VectorXd IdentityFilter::mean() const
{
    return state_.matrix.ldlt().solve(state_.vector);
}

LINEAMENT_FIT_INLINE Eigen::MatrixXd IdentityFilter::covariance() const
{
    const Eigen::Index size = state_.vector.size();
    return state_.matrix.ldlt().solve(Eigen::MatrixXd::Identity(size, size));
}

} // namespace lineament
