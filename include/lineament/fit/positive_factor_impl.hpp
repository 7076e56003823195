// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/arrow_factor_impl.hpp"
#include "lineament/fit/packed_points_impl.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

namespace lineament::detail {

/// The upper triangle of a symmetric matrix in single precision, row by row. It ends, filled up with zeros to a
/// multiple of 8, where rows of the kernels end, so that few vectors reach beyond it: its first row and column are
/// `begin`.
struct UpperTriangle
{
    Eigen::Index size = 0;
    AlignedBuffer<float> rows = {}; ///< width x width.

    [[nodiscard]] int width() const { return kernels::round_up(static_cast<int>(size), kernels::width_step); }
    [[nodiscard]] int begin() const { return width() - kernels::round_up(static_cast<int>(size), 8); }
    [[nodiscard]] const float* row_from_diagonal(Eigen::Index i) const
    {
        return rows.data() + (begin() + i) * (width() + 1);
    }
    [[nodiscard]] float* row_from_diagonal(Eigen::Index i) { return rows.data() + (begin() + i) * (width() + 1); }

    /// What is in it is unset.
    void resize(Eigen::Index num_unknowns)
    {
        size = num_unknowns;
        room_for(rows, width() * width());
    }
};

/// Cholesky's factor U of a positive definite matrix, A = U^T U, and what is solved with it: by kernels, where there
/// are any, or by Eigen. Buffers are kept from one matrix to the next.
class PositiveFactor
{
public:
    using Square = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

    explicit PositiveFactor(const kernels::Kernels* kernels) : kernels_(kernels) {}

    /// By kernels in single precision, unless the matrix is not positive definite to that.
    /// @param matrix   n x n, of which the lower triangle is read. What is solved with a matrix that is not positive
    ///                 definite is not a number.
    /// @param damping  The diagonal is made 1 + damping times as large.
    void factor(const Eigen::Ref<const Eigen::MatrixXd>& matrix, double damping = 0.0)
    {
        size_ = matrix.rows();
        is_arrow_ = false;
        if (kernels_ == nullptr) {
            Eigen::MatrixXd damped = matrix;
            damped.diagonal() *= 1 + damping;
            cholesky_.compute(damped);
            if (cholesky_.info() != Eigen::Success) {
                damped.setConstant(std::numeric_limits<double>::quiet_NaN());
                cholesky_.compute(damped);
            }
            return;
        }
        width_ = kernels::round_up(static_cast<int>(size_), kernels::width_step);
        begin_ = 0;
        set_upper(matrix, damping, single_);
        if (!factor_single(single_.data())) {
            width_ = kernels::round_up(static_cast<int>(size_), kernels::double_step);
            set_upper(matrix, damping, double_);
            factor_double();
        }
    }

    /// By kernels in single precision.
    /// @param num_inverted  Leading unknowns of whose block inverse_trace will ask.
    /// @return False where it is not positive definite to that.
    [[nodiscard]] bool factor(const UpperTriangle& matrix, double damping, Eigen::Index num_inverted = 0)
    {
        size_ = matrix.size;
        is_arrow_ = false;
        width_ = matrix.width();
        begin_ = matrix.begin();
        const float* rows = matrix.rows.data() + begin_ * width_;
        float* system = room_for(single_, size_ * width_);
        if (damping > 0) {
            std::copy_n(rows, size_ * width_, system);
            for (Eigen::Index i = 0; i < size_; ++i) {
                system[i * (width_ + 1) + begin_] *= static_cast<float>(1 + damping);
            }
            rows = system;
        }
        return factor_single(rows, num_inverted);
    }

    /// By kernels in single precision, of the matrix of [shared | own of each image] that eliminating the hidden
    /// unknowns leaves; it must outlive what is solved with it.
    /// @return False where it is not positive definite to that.
    [[nodiscard]] bool factor(const ArrowMatrix& matrix, double damping)
    {
        is_arrow_ = arrow_.factor(*kernels_, matrix, damping) > least_pivot;
        return is_arrow_;
    }
    [[nodiscard]] bool is_arrow() const { return is_arrow_; }

    /// B (n x c) becomes A^-1 B.
    void solve(Eigen::Ref<Eigen::MatrixXd> columns)
    {
        if (is_arrow_) {
            columns = arrow_.solve(columns);
        } else if (kernels_ == nullptr) {
            cholesky_.solveInPlace(columns);
        } else if (is_single_ && columns.cols() == 1) {
            float* x = room_for(single_solved_, width_);
            std::fill_n(x, width_, 0.0f);
            std::copy_n(columns.data(), size_, x + begin_);
            kernels_->solve_for_one_float(single_.data(), static_cast<int>(size_), begin_, width_,
                                          single_inverses_.data(), x);
            std::copy_n(x + begin_, size_, columns.data());
        } else if (is_single_) {
            solve_by(kernels_->solve_factored_float, single_.data() + begin_, single_inverses_, columns,
                     single_solved_);
        } else {
            solve_by(kernels_->solve_factored, double_.data(), inverses_, columns, solved_);
        }
    }

    /// The block of A^-1 of some unknowns, of an arrow.
    /// @param num_before  The first, if the last block was that of these.
    [[nodiscard]] Eigen::MatrixXd inverse_block(const std::vector<int>& unknowns, std::size_t num_before = 0)
    {
        const Eigen::Index count = static_cast<Eigen::Index>(unknowns.size());
        const int width = kernels::round_up(static_cast<int>(count), kernels::width_step), num_rows = arrow_.num_rows();
        std::swap(halves_, fewer_halves_);
        Eigen::Map<RowMajor<float>> halves(room_for(halves_, num_rows * width), num_rows, width); // U^-T e_k
        halves.setZero();
        if (num_before > 0) {
            const int fewer = static_cast<int>(num_before), fewer_width = kernels::round_up(fewer, kernels::width_step);
            halves.leftCols(fewer) =
                Eigen::Map<const RowMajor<float>>(fewer_halves_.data(), num_rows, fewer_width).leftCols(fewer);
        }
        arrow_.set_halves(unknowns, num_before, width, halves.data());
        Eigen::Map<RowMajor<float>> gram(room_for(single_gram_, width * width), width, width);
        const int num_own_rows = arrow_.num_own_rows();
        kernels_->set_gram(halves.data() + num_own_rows * width, num_rows - num_own_rows, 0, static_cast<int>(count),
                           width, gram.data());
        std::vector<std::pair<int, int>> rows_of_images;
        std::transform(unknowns.begin(), unknowns.end(), std::back_inserter(rows_of_images),
                       [&](int unknown) { return arrow_.rows_of_image_with(unknown); });
        for (Eigen::Index i = 0; i < count; ++i) {
            const auto rows = rows_of_images[static_cast<std::size_t>(i)];
            for (Eigen::Index j = i; j < count; ++j) { // of different images they have no rows in common
                if (rows_of_images[static_cast<std::size_t>(j)] == rows) {
                    gram(i, j) += halves.col(i).head(rows.second).dot(halves.col(j).head(rows.second));
                }
            }
        }
        return gram.topLeftCorner(count, count)
            .template selfadjointView<Eigen::Upper>()
            .toDenseMatrix()
            .template cast<double>();
    }

    /// Of the block of a matrix's lower triangle with those rows and columns, ascending, in double precision.
    /// @param others  Further columns, ascending.
    /// @param explained  |U^-T H_Fk|^2 of each of them, k, with F the block's.
    void factor_block(const Eigen::Ref<const Eigen::MatrixXd>& matrix, const std::vector<int>& block,
                      const std::vector<int>& others, RoomyMatrix<Eigen::VectorXd>& explained)
    {
        size_ = static_cast<Eigen::Index>(block.size());
        is_arrow_ = false;
        const Eigen::Index num_others = static_cast<Eigen::Index>(others.size());
        const int width = kernels::round_up(static_cast<int>(size_), kernels::double_step);
        width_ = width + kernels::round_up(static_cast<int>(num_others), kernels::double_step);
        std::size_t num_same = 0; // the first, which are the matrix's first
        while (num_same < block.size() && block[num_same] == static_cast<int>(num_same)) {
            ++num_same;
        }
        double* row = room_for(double_, size_ * width_);
        for (std::size_t i = 0; i < block.size(); ++i, row += width_) { // the upper triangle's rows
            const double* column = matrix.data() + matrix.rows() * block[i];
            std::copy(column + std::min(i, num_same), column + num_same, row + std::min(i, num_same));
            for (std::size_t j = std::max(i, num_same); j < block.size(); ++j) {
                row[j] = column[block[j]];
            }
            std::fill(row + size_, row + width_, 0.0);
            for (std::size_t k = 0; k < others.size(); ++k) {
                row[static_cast<std::size_t>(width) + k] =
                    others[k] > block[i] ? column[others[k]] : matrix(block[i], others[k]);
            }
        }
        Eigen::Map<RowMajor<double>> beside_block(double_.data(), size_, width_);
        if (kernels_ == nullptr) {
            factor(beside_block.leftCols(size_).transpose());
            const Eigen::MatrixXd beside = beside_block.middleCols(width, num_others);
            explained.resize(num_others);
            if (!others.empty()) {
                explained = cholesky_.matrixL().solve(beside).colwise().squaredNorm().transpose();
            }
            return;
        }
        factor_double();
        explained.setZero(num_others);
        for (Eigen::Index i = 0; i < size_; ++i) { // row by row, as they lie
            explained += beside_block.row(i).segment(width, num_others).cwiseAbs2().transpose();
        }
    }

    /// tr(P C) of the leading `count` unknowns, C the inverse of the leading n's block of A.
    /// @param weights  P; empty: 1.
    [[nodiscard]] double inverse_trace(Eigen::Index n, Eigen::Index count, const Eigen::MatrixXd& weights)
    {
        const auto trace = [&](const auto& root) { // U^-T, 0 above the diagonal
            if (weights.size() > 0) {
                const Eigen::MatrixXd leading = root.leftCols(count).template cast<double>();
                return (leading * weights).cwiseProduct(leading).sum();
            }
            double sum = 0;
            for (Eigen::Index i = 0; i < n; ++i) { // a row at a time: their entries lie side by side
                sum += static_cast<double>(root.row(i).head(std::min(i + 1, count)).squaredNorm());
            }
            return sum;
        };
        if (kernels_ != nullptr && is_single_) {
            const auto root = single_inverse_root(n);
            return weights.size() > 0 ? trace(root) : leading_squares(root, count);
        }
        return trace(inverse_root(n));
    }

    /// The leading `count` columns of the inverse of the leading n unknowns' block.
    /// @param hidden  Their rows of the hidden unknowns of an arrow, or empty.
    [[nodiscard]] Eigen::MatrixXd inverse_columns(Eigen::Index n, Eigen::Index count, Eigen::MatrixXd& hidden)
    {
        if (is_arrow_) { // n is all
            return arrow_.inverse_columns(static_cast<int>(count), hidden);
        }
        hidden.resize(0, count);
        if (kernels_ == nullptr || !is_single_) {
            return inverse(n).leftCols(count);
        }
        const auto root = single_inverse_root(n);
        const int width = static_cast<int>(root.outerStride());
        const int num_rows = kernels::round_up(static_cast<int>(count), 4);
        Eigen::Map<RowMajor<float>> gram(room_for(single_gram_, num_rows * width), num_rows, width);
        kernels_->set_gram(root.data(), static_cast<int>(n), 0, static_cast<int>(count), width, gram.data());
        Eigen::MatrixXd columns = gram.topLeftCorner(count, n).transpose().template cast<double>();
        columns.topRows(count).triangularView<Eigen::StrictlyUpper>() = columns.topRows(count).transpose();
        return columns;
    }

    /// The inverse of the leading n unknowns' block, in memory of the factor, which the next one takes.
    [[nodiscard]] Square inverse(Eigen::Index n)
    {
        const auto root = inverse_root(n);
        if (kernels_ == nullptr) {
            Square inverse(room_for(gram_, n * n), n, n, Eigen::OuterStride<>(n));
            inverse = root.transpose() * root;
            return inverse;
        }
        const int width = static_cast<int>(root.outerStride());
        double* gram = room_for(gram_, static_cast<Eigen::Index>(width) * width);
        std::fill_n(gram, width * width, 0.0);
        kernels_->add_lower_gram(root.data(), static_cast<int>(n), width, gram);
        constexpr int step = kernels::double_step;               // blocks, which stay in the nearest cache
        Eigen::Map<Eigen::MatrixXd> inverse(gram, width, width); // its columns are the rows of the upper triangle
        for (int j = 0; j < width; j += step) {
            inverse.block<step, step>(j, j).triangularView<Eigen::StrictlyUpper>() =
                inverse.block<step, step>(j, j).transpose();
            for (int i = j + step; i < width; i += step) {
                inverse.block<step, step>(j, i) = inverse.block<step, step>(i, j).transpose();
            }
        }
        return {gram, n, n, Eigen::OuterStride<>(width)};
    }

private:
    /// Below this share of its diagonal a pivot may be rounding.
    static constexpr float least_pivot = 1e-5f;

    template <typename T>
    using RowMajor = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    template <typename T>
    using Rows = Eigen::Map<RowMajor<T>, 0, Eigen::OuterStride<>>;

    /// The matrix's lower columns as the upper rows of `system`.
    template <typename T>
    T* set_upper(const Eigen::Ref<const Eigen::MatrixXd>& matrix, double damping, AlignedBuffer<T>& system)
    {
        const int n = static_cast<int>(size_);
        T* row = room_for(system, static_cast<Eigen::Index>(n) * width_);
        for (int i = 0; i < n; ++i, row += width_) {
            std::copy(matrix.data() + i * (n + 1), matrix.data() + (i + 1) * n, row + i);
            std::fill(row + n, row + width_, T(0));
            row[i] *= static_cast<T>(1 + damping);
        }
        return system.data();
    }

    /// Into `single_`, of rows there or elsewhere.
    [[nodiscard]] bool factor_single(const float* rows, Eigen::Index num_inverted = 0)
    {
        const int size = static_cast<int>(size_), count = static_cast<int>(num_inverted);
        const int root_width = kernels::round_up(count, kernels::width_step);
        float* inverses = room_for(single_inverses_, size_);
        const float pivot = kernels_->factor_and_invert_float(
            rows, size, begin_, width_, single_.data(), inverses, count,
            room_for(single_root_, kernels::round_up(count, 4) * root_width), root_width);
        is_single_ = pivot > least_pivot;
        num_inverted_ = is_single_ ? num_inverted : 0;
        return is_single_;
    }

    /// U^-T of the leading n unknowns in single precision.
    [[nodiscard]] Rows<float> single_inverse_root(Eigen::Index n)
    {
        if (n > 0 && n == num_inverted_) {
            const int width = kernels::round_up(static_cast<int>(n), kernels::width_step);
            return {single_root_.data(), n, n, Eigen::OuterStride<>(width)};
        }
        num_inverted_ = 0;
        return set_root(n, single_.data() + begin_, single_inverses_, single_root_, kernels_->invert_factor_float);
    }

    /// The squares of the leading columns of what set_root has set, without any of the others, which may be far larger.
    [[nodiscard]] double leading_squares(const Rows<float>& root, Eigen::Index count) const
    {
        const int width = static_cast<int>(root.outerStride()), size = static_cast<int>(count);
        const int whole = size / kernels::width_step * kernels::width_step;
        double sum = kernels_->sum_squares_float(root.data(), size * width); // 0 above the diagonal
        for (Eigen::Index i = count; i < root.rows(); ++i) {
            sum += static_cast<double>(kernels_->sum_squares_float(root.data() + i * width, whole)) +
                   static_cast<double>(root.row(i).segment(whole, size - whole).squaredNorm());
        }
        return sum;
    }

    /// Of what `double_` holds.
    void factor_double()
    {
        is_single_ = false;
        if (!(kernels_->factor_positive(double_.data(), static_cast<int>(size_), 0, width_, double_.data(),
                                        room_for(inverses_, size_)) > 0)) {
            std::fill_n(double_.data(), size_ * width_, std::numeric_limits<double>::quiet_NaN());
            std::fill_n(inverses_.data(), size_, std::numeric_limits<double>::quiet_NaN());
        }
    }

    template <typename T, typename Solve>
    void solve_by(Solve solve_factored, const T* system, const AlignedBuffer<T>& inverses,
                  Eigen::Ref<Eigen::MatrixXd> columns, AlignedBuffer<T>& solved)
    {
        using SideBySide = Eigen::Matrix<T, Eigen::Dynamic, kernels::num_right_sides, Eigen::RowMajor>;
        Eigen::Map<SideBySide> x(room_for(solved, size_ * kernels::num_right_sides), size_, kernels::num_right_sides);
        for (Eigen::Index begin = 0; begin < columns.cols(); begin += kernels::num_right_sides) {
            const Eigen::Index count = std::min<Eigen::Index>(columns.cols() - begin, kernels::num_right_sides);
            x.setZero();
            x.leftCols(count) = columns.middleCols(begin, count).template cast<T>();
            solve_factored(system, static_cast<int>(size_), width_, inverses.data(), x.data());
            columns.middleCols(begin, count) = x.leftCols(count).template cast<double>();
        }
    }

    /// U^-T of the leading n unknowns.
    template <typename T, typename Invert>
    Rows<T> set_root(Eigen::Index n, const T* system, const AlignedBuffer<T>& inverses, AlignedBuffer<T>& root,
                     Invert invert)
    {
        const int width = kernels::round_up(static_cast<int>(n), kernels::width_step);
        invert(system, static_cast<int>(n), width_, inverses.data(), room_for(root, n * width), width);
        return {root.data(), n, n, Eigen::OuterStride<>(width)};
    }

    /// The same in double precision.
    Rows<double> inverse_root(Eigen::Index n)
    {
        if (kernels_ != nullptr && !is_single_) {
            return set_root(n, double_.data(), inverses_, root_, kernels_->invert_factor);
        }
        const int width = kernels::round_up(static_cast<int>(n), kernels::width_step);
        Rows<double> root(room_for(root_, n * width), n, n, Eigen::OuterStride<>(width));
        if (kernels_ != nullptr) {
            Rows<double>(root.data(), n, width, Eigen::OuterStride<>(width)).setZero();
            root = single_inverse_root(n).template cast<double>();
        } else if (n > 0) {
            root = cholesky_.matrixLLT().topLeftCorner(n, n).triangularView<Eigen::Lower>().solve(
                Eigen::MatrixXd::Identity(n, n));
        }
        return root;
    }

    const kernels::Kernels* kernels_;
    Eigen::Index size_ = 0;
    int width_ = 0;
    int begin_ = 0;                 ///< The first column in `single_`.
    Eigen::Index num_inverted_ = 0; ///< Leading unknowns whose U^-T `single_root_` holds.
    bool is_arrow_ = false;         ///< What is solved is by `arrow_`.
    ArrowFactor arrow_ = {};
    bool is_single_ = false;            ///< U is in `single_`.
    AlignedBuffer<double> double_ = {}; ///< U in its upper triangle.
    AlignedBuffer<float> single_ = {};
    AlignedBuffer<double> inverses_ = {}; ///< 1 / U_ii.
    AlignedBuffer<float> single_inverses_ = {};
    AlignedBuffer<double> solved_ = {}, root_ = {}, gram_ = {};
    AlignedBuffer<float> single_solved_ = {}, single_root_ = {}, single_gram_ = {};
    AlignedBuffer<float> halves_ = {}, fewer_halves_ = {}; ///< Of an arrow's last block, and of the one before.
    Eigen::LLT<Eigen::MatrixXd> cholesky_ = {};
};

} // namespace lineament::detail
