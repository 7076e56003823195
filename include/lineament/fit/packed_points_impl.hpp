// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Points of a model, and the products with them, for the kernels.
#pragma once

#include "lineament/fit/model_points.hpp"
#include "lineament/fit/roomy_matrix_impl.hpp"
#include "lineament/kernels/kernels.hpp"
#include "lineament/kernels/scalar_kernels.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

namespace lineament::detail {

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

    /// Takes the rows of some points of `other`, with room, zeroed, for more.
    void assign(const PackedRows& other, std::span<const int> points, Eigen::Index num_points)
    {
        num_coefficients_ = other.num_coefficients_;
        width_ = other.width_;
        float* to = room_for(rows_, 3 * num_points * width_);
        for (const int point : points) {
            to = std::copy_n(other.rows_.data() + 3 * point * width_, 3 * width_, to);
        }
        std::fill(to, rows_.data() + 3 * num_points * width_, 0.0f);
    }

    /// Row by row (1 - fraction) times those of one point of `other` and fraction times those of another.
    /// @param kernels  May be nullptr.
    void set_between(const kernels::Kernels* kernels, Eigen::Index to, const PackedRows& other, Eigen::Index first,
                     Eigen::Index next, float fraction)
    {
        const auto blend_rows = kernels != nullptr ? kernels->blend_rows : kernels::scalar_kernels().blend_rows;
        const Eigen::Index size = 3 * width_;
        blend_rows(other.rows_.data() + first * size, other.rows_.data() + next * size, fraction,
                   static_cast<int>(size), rows_.data() + to * size);
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
                  AlignedBuffer<double>& padded, RoomyMatrix<Eigen::Matrix3Xd>& products) const
    {
        products.resize(3, num_points);
        multiply(kernels, 0, num_points, x, padded, products);
    }

    /// The same of the points from `begin` to `end`, into their columns.
    void multiply(const kernels::Kernels* kernels, Eigen::Index begin, Eigen::Index end, const Eigen::VectorXd& x,
                  AlignedBuffer<double>& padded, RoomyMatrix<Eigen::Matrix3Xd>& products) const
    {
        if (width_ == 0) {
            products.middleCols(begin, end - begin).setZero();
            return;
        }
        double* to = products.data() + 3 * begin;
        if (kernels == nullptr) {
            Eigen::Map<Eigen::VectorXd>(to, 3 * (end - begin)).noalias() =
                leading(end).rightCols(3 * (end - begin)).cast<double>().transpose() * x;
            return;
        }
        double* factors = room_for(padded, width_);
        std::fill(std::copy_n(x.data(), x.size(), factors), factors + width_, 0.0);
        kernels->multiply_wide(rows_.data() + 3 * begin * width_, static_cast<int>(3 * (end - begin)), width_, factors,
                               to);
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

    /// Takes some points of `other`, with room for more. Rows that it holds already stay.
    void assign(const PackedPoints& other, const std::vector<int>& points, Eigen::Index room)
    {
        num_points = static_cast<Eigen::Index>(points.size());
        if (points != taken_ || mean.cols() != room || identity.width() != other.identity.width()) {
            identity.assign(other.identity, points, room);
            expression.assign(other.expression, points, room);
            taken_ = points;
        }
        mean.resize(3, room);
        for (Eigen::Index i = 0; i < num_points; ++i) {
            mean.col(i) = other.mean.col(points[static_cast<std::size_t>(i)]);
        }
    }

    /// S_i of one point.
    [[nodiscard]] Eigen::Vector3d at(Eigen::Index point, const Eigen::VectorXd& alpha, const Eigen::VectorXd& psi) const
    {
        return mean.col(point) + identity.of_point(point).cast<double>().transpose() * alpha +
               expression.of_point(point).cast<double>().transpose() * psi;
    }

    /// The point between two neighbours of `other`.
    void set_between(const kernels::Kernels* kernels, Eigen::Index to, const PackedPoints& other, Eigen::Index first,
                     Eigen::Index next, double fraction)
    {
        mean.col(to) = (1 - fraction) * other.mean.col(first) + fraction * other.mean.col(next);
        identity.set_between(kernels, to, other.identity, first, next, static_cast<float>(fraction));
        expression.set_between(kernels, to, other.expression, first, next, static_cast<float>(fraction));
    }

    /// The points of one person: the identity's columns are in the mean.
    [[nodiscard]] PackedPoints of_person(const Eigen::VectorXd& alpha) const
    {
        PackedPoints points = *this;
        AlignedBuffer<double> padded;
        RoomyMatrix<Eigen::Matrix3Xd> products;
        identity.multiply(nullptr, num_points, alpha, padded, products);
        points.mean.leftCols(num_points) += products;
        points.identity = PackedRows(num_points, 0);
        return points;
    }

    Eigen::Index num_points = 0; ///< The leading ones.
    Eigen::Matrix3Xd mean = {};
    PackedRows identity = {};
    PackedRows expression = {};

    /// Room for the products of a point set.
    struct Products
    {
        AlignedBuffer<double> padded = {};
        RoomyMatrix<Eigen::Matrix3Xd> by_expression = {};
    };

    /// Mean and identity of the points from `begin` on, in as many columns as the mean has.
    void evaluate_shape(const kernels::Kernels* kernels, const Eigen::VectorXd& alpha, Eigen::Index begin,
                        AlignedBuffer<double>& padded, RoomyMatrix<Eigen::Matrix3Xd>& shape) const
    {
        shape.resize(3, mean.cols()); // what is in it stays, where it was as large
        identity.multiply(kernels, begin, num_points, alpha, padded, shape);
        shape.middleCols(begin, num_points - begin) += mean.middleCols(begin, num_points - begin);
    }

    /// S_i for every point (3 x N).
    void evaluate(const kernels::Kernels* kernels, const Eigen::VectorXd& alpha, const Eigen::VectorXd& psi,
                  Products& room, RoomyMatrix<Eigen::Matrix3Xd>& points) const
    {
        identity.multiply(kernels, num_points, alpha, room.padded, points);
        expression.multiply(kernels, num_points, psi, room.padded, room.by_expression);
        points += mean.leftCols(num_points) + room.by_expression;
    }

private:
    std::vector<int> taken_ = {}; ///< By `assign`, from points of the same rows.
};

/// What joint fits take of a model, packed once.
struct JointPoints
{
    PackedPoints landmarks = {};  ///< Of the landmark map.
    PackedPoints candidates = {}; ///< Of the outline's left side, then of its right one, or none.
};

} // namespace lineament::detail
