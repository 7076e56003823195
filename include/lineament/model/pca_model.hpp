// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/checks.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <utility>

namespace lineament {

/// A principal component model of stacked vectors x0 y0 z0 x1 y1 z1 ... (shape in mm, or colour in [0, 1]):
///
///   instance(a) = mean + U diag(sigma) a,     a ~ N(0, I)                                  docs/maths.md, Eq. (1)
///
/// U has orthonormal columns at the full resolution; a coarser level keeps its leading rows only.
struct PcaModel
{
    Eigen::VectorXf mean = {};                ///< 3V.
    Eigen::MatrixXf basis = {};               ///< 3V x m, U.
    Eigen::VectorXf standard_deviations = {}; ///< m, sigma, > 0, descending.

    [[nodiscard]] Eigen::Index num_coefficients() const { return basis.cols(); }
    [[nodiscard]] Eigen::Index num_vertices() const { return mean.size() / 3; }

    /// B = U diag(sigma), 3V x m: columns in the unit of the mean, one standard deviation each.
    [[nodiscard]] Eigen::MatrixXf rescaled_basis() const { return basis * standard_deviations.asDiagonal(); }

    /// mean + B a (3V). Missing trailing coefficients are 0.
    /// @throws InvalidArgument if there are more coefficients than components, or one is not finite.
    [[nodiscard]] Eigen::VectorXf instance(const Eigen::Ref<const Eigen::VectorXd>& coefficients) const
    {
        require(coefficients.size() <= num_coefficients(), "PcaModel::instance", "coefficients",
                "at most " + std::to_string(num_coefficients()), std::to_string(coefficients.size()));
        require_finite(coefficients, "PcaModel::instance", "coefficients");
        const Eigen::Index count = coefficients.size();
        const Eigen::VectorXf scaled = standard_deviations.head(count).cwiseProduct(coefficients.cast<float>());
        return mean + basis.leftCols(count) * scaled;
    }

    /// Least-squares coefficients (m) of a vector (3V): diag(1/sigma) U^T (v - mean) at the full level, the solution
    /// of the normal equations below it.
    /// @throws InvalidArgument if the size is not 3V or an entry is not finite.
    template <typename Derived> // compiled where it is called only: solving takes long to compile
    [[nodiscard]] Eigen::VectorXd coefficients(const Eigen::MatrixBase<Derived>& vector) const
    {
        require_size(vector.size(), mean.size(), "PcaModel::coefficients", "vector");
        require_finite(vector, "PcaModel::coefficients", "vector");
        const Eigen::MatrixXd scaled = rescaled_basis().cast<double>();
        const Eigen::VectorXd difference = vector.template cast<double>() - mean.cast<double>();
        return (scaled.transpose() * scaled).ldlt().solve(scaled.transpose() * difference);
    }

    /// The model with its leading `count` components.
    /// @throws InvalidArgument unless 0 <= count <= m.
    [[nodiscard]] PcaModel truncate(Eigen::Index count) const
    {
        require(count >= 0 && count <= num_coefficients(), "PcaModel::truncate", "count",
                "0 to " + std::to_string(num_coefficients()), std::to_string(count));
        return {mean, basis.leftCols(count), standard_deviations.head(count)};
    }

    /// The rows of the leading `count` vertices.
    /// @throws InvalidArgument unless 0 <= count <= V.
    [[nodiscard]] PcaModel first_vertices(Eigen::Index count) const
    {
        require(count >= 0 && count <= num_vertices(), "PcaModel::first_vertices", "count",
                "0 to " + std::to_string(num_vertices()), std::to_string(count));
        return {mean.head(3 * count), basis.topRows(3 * count), standard_deviations};
    }
};

} // namespace lineament
