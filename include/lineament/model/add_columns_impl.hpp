// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/kernels/kernels.hpp"

#include <Eigen/Core>

namespace lineament::detail {

/// sum += the leading columns of a matrix times the coefficients; by Eigen where there are no kernels.
inline void add_columns(const Eigen::MatrixXf& matrix, const Eigen::VectorXf& coefficients,
                        const kernels::Kernels* kernels, Eigen::VectorXf& sum)
{
    if (kernels == nullptr) {
        sum.noalias() += matrix.leftCols(coefficients.size()) * coefficients;
    } else {
        kernels->add_columns(matrix.data(), matrix.rows(), static_cast<int>(matrix.rows()),
                             static_cast<int>(coefficients.size()), coefficients.data(), sum.data());
    }
}

} // namespace lineament::detail
