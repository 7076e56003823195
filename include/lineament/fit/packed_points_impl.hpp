// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Points of a model in double precision, and the products with them, for the kernels.
#pragma once

#include "lineament/fit/model_points.hpp"
#include "lineament/kernels/aligned_buffer.hpp"
#include "lineament/kernels/kernels.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>

namespace lineament::detail {

using kernels::AlignedBuffer;

/// Room for `size` numbers; what was there is lost where it is not enough.
template <typename T>
T* room_for(AlignedBuffer<T>& buffer, Eigen::Index size)
{
    if (static_cast<Eigen::Index>(buffer.size()) < size) {
        buffer = AlignedBuffer<T>(static_cast<std::size_t>(size));
    }
    return buffer.data();
}

/// One matrix of rows, three a point, each filled up with zeros to a multiple of double_step.
class PackedRows
{
public:
    PackedRows() = default;
    PackedRows(Eigen::Index num_points, Eigen::Index num_coefficients)
        : num_coefficients_(num_coefficients),
          width_(kernels::round_up(static_cast<int>(num_coefficients), kernels::double_step)),
          rows_(static_cast<std::size_t>(3 * num_points * width_))
    {}

    [[nodiscard]] int width() const { return width_; }
    [[nodiscard]] const double* data() const { return rows_.data(); }

    template <typename Matrix>
    using Columns = Eigen::Map<Matrix, 0, Eigen::OuterStride<>>;

    /// The rows of a point as ModelPoints has them (num_coefficients x 3).
    [[nodiscard]] Columns<Eigen::MatrixX3d> of_point(Eigen::Index point)
    {
        return {rows_.data() + 3 * point * width_, num_coefficients_, 3, Eigen::OuterStride<>(width_)};
    }
    [[nodiscard]] Columns<const Eigen::MatrixX3d> of_point(Eigen::Index point) const
    {
        return {rows_.data() + 3 * point * width_, num_coefficients_, 3, Eigen::OuterStride<>(width_)};
    }

    /// Those of the leading points (num_coefficients x 3N).
    [[nodiscard]] Columns<const Eigen::MatrixXd> leading(Eigen::Index num_points) const
    {
        return {rows_.data(), num_coefficients_, 3 * num_points, Eigen::OuterStride<>(width_)};
    }

    /// Products with x of the leading points' rows, a point in each column of the result; by Eigen where there are no
    /// kernels.
    /// @param padded  Kept for its room.
    void multiply(const kernels::Kernels* kernels, Eigen::Index num_points, const Eigen::VectorXd& x,
                  AlignedBuffer<double>& padded, Eigen::Matrix3Xd& products) const
    {
        products.resize(3, num_points);
        if (kernels == nullptr) {
            Eigen::Map<Eigen::VectorXd>(products.data(), products.size()).noalias() =
                leading(num_points).transpose() * x;
            return;
        }
        double* factors = room_for(padded, width_);
        std::fill(std::copy_n(x.data(), x.size(), factors), factors + width_, 0.0);
        kernels->multiply_double_rows(rows_.data(), static_cast<int>(3 * num_points), width_, factors, products.data());
    }

private:
    Eigen::Index num_coefficients_ = 0;
    int width_ = 0;
    AlignedBuffer<double> rows_ = {};
};

/// As ModelPoints, laid out for the kernels, with room for more points than there are.
struct PackedPoints
{
    PackedPoints() = default;
    PackedPoints(Eigen::Index room, Eigen::Index num_shape, Eigen::Index num_expressions)
        : mean(3, room), identity(room, num_shape), expression(room, num_expressions)
    {}

    Eigen::Index num_points = 0; ///< The leading ones.
    Eigen::Matrix3Xd mean = {};
    PackedRows identity = {};
    PackedRows expression = {};

    /// S_i for every point (3 x N).
    [[nodiscard]] Eigen::Matrix3Xd at(const kernels::Kernels* kernels, const Eigen::VectorXd& alpha,
                                      const Eigen::VectorXd& psi) const
    {
        AlignedBuffer<double> padded;
        Eigen::Matrix3Xd points, products;
        identity.multiply(kernels, num_points, alpha, padded, points);
        expression.multiply(kernels, num_points, psi, padded, products);
        points += mean.leftCols(num_points) + products;
        return points;
    }

    /// Sets point `to` to point `from` of `other`, which has the same numbers of coefficients.
    void assign(Eigen::Index to, const ModelPoints& other, Eigen::Index from)
    {
        mean.col(to) = other.mean.col(from);
        identity.of_point(to) = other.identity.middleCols<3>(3 * from);
        expression.of_point(to) = other.expression.middleCols<3>(3 * from);
    }
};

} // namespace lineament::detail
