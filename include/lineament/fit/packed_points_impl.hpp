// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Points of a model, and the products with them, for the kernels.
#pragma once

#include "lineament/fit/model_points.hpp"
#include "lineament/kernels/aligned_buffer.hpp"
#include "lineament/kernels/kernels.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <span>

namespace lineament::detail {

using kernels::AlignedBuffer;

/// Room for `size` numbers, which are to be written before they are read; what was there is lost where it is not
/// enough.
template <typename T>
T* room_for(AlignedBuffer<T>& buffer, Eigen::Index size)
{
    if (static_cast<Eigen::Index>(buffer.size()) < size) {
        buffer = AlignedBuffer<T>(static_cast<std::size_t>(size), kernels::unset);
    }
    return buffer.data();
}

/// One matrix of rows, three a point, each filled up with zeros to a multiple of double_step. They are in single
/// precision, as the model is; what is multiplied with them is not.
class PackedRows
{
public:
    PackedRows() = default;
    PackedRows(Eigen::Index num_points, Eigen::Index num_coefficients)
        : num_coefficients_(num_coefficients),
          width_(kernels::round_up(static_cast<int>(num_coefficients), kernels::double_step)),
          rows_(static_cast<std::size_t>(3 * num_points * width_))
    {}

    /// Those of some points of `other`, and room, zeroed, for more.
    PackedRows(const PackedRows& other, std::span<const int> points, Eigen::Index num_points)
        : num_coefficients_(other.num_coefficients_), width_(other.width_),
          rows_(static_cast<std::size_t>(3 * num_points * width_), kernels::unset)
    {
        float* to = rows_.data();
        for (const int point : points) {
            to = std::copy_n(other.rows_.data() + 3 * point * width_, 3 * width_, to);
        }
        std::fill(to, rows_.data() + rows_.size(), 0.0f);
    }

    [[nodiscard]] int width() const { return width_; }
    [[nodiscard]] const float* data() const { return rows_.data(); }

    template <typename Matrix>
    using Columns = Eigen::Map<Matrix, 0, Eigen::OuterStride<>>;

    /// The rows of a point as ModelPoints has them (num_coefficients x 3).
    [[nodiscard]] Columns<Eigen::MatrixX3f> of_point(Eigen::Index point)
    {
        return {rows_.data() + 3 * point * width_, num_coefficients_, 3, Eigen::OuterStride<>(width_)};
    }
    [[nodiscard]] Columns<const Eigen::MatrixX3f> of_point(Eigen::Index point) const
    {
        return {rows_.data() + 3 * point * width_, num_coefficients_, 3, Eigen::OuterStride<>(width_)};
    }

    /// Those of the leading points (num_coefficients x 3N).
    [[nodiscard]] Columns<const Eigen::MatrixXf> leading(Eigen::Index num_points) const
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
                leading(num_points).cast<double>().transpose() * x;
            return;
        }
        double* factors = room_for(padded, width_);
        std::fill(std::copy_n(x.data(), x.size(), factors), factors + width_, 0.0);
        kernels->multiply_wide(rows_.data(), static_cast<int>(3 * num_points), width_, factors, products.data());
    }

private:
    Eigen::Index num_coefficients_ = 0;
    int width_ = 0;
    AlignedBuffer<float> rows_ = {};
};

/// As ModelPoints, laid out for the kernels, with room for more points than there are.
struct PackedPoints
{
    PackedPoints() = default;
    explicit PackedPoints(const ModelPoints& points)
        : num_points(points.num_points()), mean(points.mean), identity(num_points, points.num_shape_coefficients()),
          expression(num_points, points.num_expression_coefficients())
    {
        for (Eigen::Index i = 0; i < num_points; ++i) {
            identity.of_point(i) = points.identity.middleCols<3>(3 * i).cast<float>();
            expression.of_point(i) = points.expression.middleCols<3>(3 * i).cast<float>();
        }
    }

    /// Some points of `other`, and room for more.
    PackedPoints(const PackedPoints& other, std::span<const int> points, Eigen::Index room)
        : num_points(static_cast<Eigen::Index>(points.size())), mean(3, room), identity(other.identity, points, room),
          expression(other.expression, points, room)
    {
        for (Eigen::Index i = 0; i < num_points; ++i) {
            mean.col(i) = other.mean.col(points[static_cast<std::size_t>(i)]);
        }
    }

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
};

/// What joint fits take of a model, packed once.
struct JointPoints
{
    PackedPoints landmarks = {};  ///< Of the landmark map.
    PackedPoints candidates = {}; ///< Of the outline's left side, then of its right one, or none.
};

} // namespace lineament::detail
