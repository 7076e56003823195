// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/packed_points_impl.hpp"

#include <Eigen/Cholesky>

#include <cmath>
#include <limits>

namespace lineament::detail {

/// Cholesky's factor U of a positive definite matrix, A = U^T U, and what is solved with it; by kernels, where there
/// are any, or by Eigen. Buffers are kept from one matrix to the next.
class PositiveFactor
{
public:
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    /// In memory of the factor; the next matrix or root takes it.
    using Root = Eigen::Map<RowMajor, 0, Eigen::OuterStride<>>;

    explicit PositiveFactor(const kernels::Kernels* kernels) : kernels_(kernels) {}

    /// @param matrix   n x n, of which the lower triangle is read. What is solved with a matrix that is not positive
    ///                 definite is not a number.
    /// @param damping  The diagonal is made 1 + damping times as large.
    void factor(const Eigen::MatrixXd& matrix, double damping = 0.0)
    {
        size_ = matrix.rows();
        if (kernels_ == nullptr) {
            Eigen::MatrixXd damped = matrix;
            damped.diagonal() *= 1 + damping;
            cholesky_.compute(damped);
            if (cholesky_.info() != Eigen::Success) {
                damped.setConstant(std::numeric_limits<double>::quiet_NaN());
                cholesky_.compute(damped);
            }
        } else {
            factor_beside(matrix, damping, Eigen::MatrixXd(size_, 0));
        }
    }

    /// A^-1 b.
    [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& b)
    {
        if (kernels_ == nullptr) {
            return cholesky_.solve(b);
        }
        const int n = static_cast<int>(size_), width = padded_size(size_);
        double* x = room_for(right_side_, width);
        Eigen::Map<Eigen::VectorXd> solved(x, size_);
        solved = b;
        if (is_root_known_) { // R^T R b: two products in which nothing waits for anything
            std::fill(x + n, x + width, 0.0);
            double* product = room_for(product_, width);
            kernels_->multiply_double_rows(root_.data(), n, width, x, product);
            std::fill_n(x, width, 0.0);
            kernels_->add_double_rows(root_.data(), n, width, product, x);
        } else {
            kernels_->solve_factored(system_.data(), n, width_, x);
        }
        return solved;
    }

    /// U^-T B (n x c).
    [[nodiscard]] Eigen::MatrixXd factor_and_half_solve(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& columns)
    {
        if (kernels_ == nullptr) {
            factor(matrix);
            return columns.size() > 0 ? Eigen::MatrixXd(cholesky_.matrixL().solve(columns)) : columns;
        }
        size_ = matrix.rows();
        factor_beside(matrix, 0.0, columns);
        return rows().rightCols(width_ - padded_size(size_)).leftCols(columns.cols());
    }

    /// R = U^-T of the leading n unknowns, the root of their block's inverse: its inverse is R^T R. Lower triangular.
    [[nodiscard]] Root inverse_root(Eigen::Index n)
    {
        const int width = padded_size(size_);
        Root root(room_for(root_, size_ * width), n, n, Eigen::OuterStride<>(width));
        if (kernels_ != nullptr) { // of all unknowns, for the solutions to come
            kernels_->invert_factor(system_.data(), static_cast<int>(size_), width_, root_.data(), width);
            is_root_known_ = true;
        } else if (n > 0) {
            root = cholesky_.matrixLLT().topLeftCorner(n, n).triangularView<Eigen::Lower>().solve(
                Eigen::MatrixXd::Identity(n, n));
        }
        return root;
    }

    /// R^T R of that R, lower triangle.
    [[nodiscard]] Eigen::MatrixXd lower_inverse(Eigen::Index n)
    {
        const Root root = inverse_root(n);
        if (kernels_ == nullptr) {
            Eigen::MatrixXd inverse = Eigen::MatrixXd::Zero(n, n);
            inverse.selfadjointView<Eigen::Lower>().rankUpdate(root.transpose());
            return inverse;
        }
        const int width = padded_size(size_);
        double* gram = room_for(gram_, static_cast<Eigen::Index>(width) * width);
        std::fill_n(gram, width * width, 0.0);
        kernels_->add_lower_gram(root.data(), static_cast<int>(n), width, gram);
        return Eigen::Map<const Eigen::MatrixXd>(gram, width, width).topLeftCorner(n, n); // its rows are the columns
    }

private:
    [[nodiscard]] Eigen::Map<RowMajor> rows() { return {system_.data(), size_, width_}; }

    [[nodiscard]] static int padded_size(Eigen::Index size)
    {
        return kernels::round_up(static_cast<int>(size), kernels::double_step);
    }

    /// U, with U^-T times the columns beside it.
    void factor_beside(const Eigen::MatrixXd& matrix, double damping, const Eigen::MatrixXd& columns)
    {
        is_root_known_ = false;
        const int n = static_cast<int>(size_);
        width_ = padded_size(size_) + kernels::round_up(static_cast<int>(columns.cols()), kernels::double_step);
        double* row = room_for(system_, static_cast<Eigen::Index>(n) * width_);
        for (int i = 0; i < n; ++i, row += width_) { // the lower triangle's columns are the upper one's rows
            std::copy(matrix.data() + i * (n + 1), matrix.data() + (i + 1) * n, row + i);
            std::fill(row + n, row + width_, 0.0);
            row[i] *= 1 + damping;
        }
        rows().rightCols(width_ - padded_size(size_)).leftCols(columns.cols()) = columns;
        if (!(kernels_->factor_positive(system_.data(), n, width_) > 0)) {
            rows().setConstant(std::numeric_limits<double>::quiet_NaN());
        }
    }

    const kernels::Kernels* kernels_;
    Eigen::Index size_ = 0;
    int width_ = 0;
    AlignedBuffer<double> system_ = {}; ///< U in its upper triangle.
    bool is_root_known_ = false;
    AlignedBuffer<double> root_ = {}; ///< U^-T, where known.
    AlignedBuffer<double> right_side_ = {}, product_ = {}, gram_ = {};
    Eigen::LLT<Eigen::MatrixXd> cholesky_ = {};
};

} // namespace lineament::detail
