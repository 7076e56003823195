// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/packed_points_impl.hpp"

#include <Eigen/Core>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numeric>
#include <utility>
#include <vector>

namespace lineament::detail {

/// A symmetric matrix in single precision of [hidden | shared | own of each image]: those of different images are
/// coupled by the first two alone. The hidden ones come in threes, which are coupled by the others alone.
struct ArrowMatrix
{
    std::vector<int> counts = {}; ///< Of own unknowns of each image.
    int num_hidden = 0;
    int num_shared = 0;
    int own_width = 0;                ///< Of each image's own block, filled up.
    int shared_width = 0;             ///< Of [hidden | shared], filled up.
    AlignedBuffer<float> own = {};    ///< A row for each own unknown: [own block's upper triangle | hidden | shared].
    AlignedBuffer<float> shared = {}; ///< Upper triangle of [hidden | shared].

    [[nodiscard]] int width() const { return own_width + shared_width; }
    [[nodiscard]] int num_beside() const { return num_hidden + num_shared; }
    [[nodiscard]] int num_own() const
    {
        int sum = 0;
        for (const int count : counts) {
            sum += count;
        }
        return sum;
    }

    /// Whether image by image it takes fewer multiply-adds than what eliminating the hidden unknowns first leaves.
    [[nodiscard]] bool is_sparse() const
    {
        const double own_count = num_own(), beside = num_beside(), size = own_count + num_shared;
        return own_count * beside * beside / 2 + std::pow(beside, 3) / 6 <
               num_hidden * size * size / 2 + std::pow(size, 3) / 6;
    }

    /// That of the hidden unknowns and some others, ascending positions in [shared | own of each image].
    [[nodiscard]] ArrowMatrix block(const std::vector<int>& kept) const
    {
        std::vector<int> columns(static_cast<std::size_t>(num_hidden)); // of [hidden | shared]
        std::iota(columns.begin(), columns.end(), 0);
        auto next = kept.begin();
        for (; next != kept.end() && *next < num_shared; ++next) {
            columns.push_back(num_hidden + *next);
        }
        std::vector<std::vector<int>> of_images; // rows of `own`
        std::vector<int> kept_counts;
        int end = num_shared;
        for (const int count : counts) {
            end += count;
            of_images.emplace_back();
            for (; next != kept.end() && *next < end; ++next) {
                of_images.back().push_back(*next - num_shared);
            }
            kept_counts.push_back(static_cast<int>(of_images.back().size()));
        }
        ArrowMatrix block;
        block.set_zero(kept_counts, num_hidden, static_cast<int>(columns.size()) - num_hidden);
        float* to = block.shared.data();
        for (std::size_t i = 0; i < columns.size(); ++i, to += block.shared_width) {
            for (std::size_t j = i; j < columns.size(); ++j) {
                to[j] = shared.data()[columns[i] * shared_width + columns[j]];
            }
        }
        to = block.own.data();
        int first = 0; // row of the image
        for (std::size_t f = 0; f < counts.size(); first += counts[f], ++f) {
            for (std::size_t i = 0; i < of_images[f].size(); ++i, to += block.width()) {
                const float* from = own.data() + of_images[f][i] * width();
                for (std::size_t j = i; j < of_images[f].size(); ++j) {
                    to[j] = from[of_images[f][j] - first];
                }
                for (std::size_t j = 0; j < columns.size(); ++j) {
                    to[static_cast<std::size_t>(block.own_width) + j] = from[own_width + columns[j]];
                }
            }
        }
        return block;
    }

    /// Makes room, zeroed.
    void set_zero(std::vector<int> own_counts, int hidden_count, int shared_count)
    {
        counts = std::move(own_counts);
        num_hidden = hidden_count;
        num_shared = shared_count;
        const int most = counts.empty() ? 0 : *std::max_element(counts.begin(), counts.end());
        own_width = kernels::round_up(most, kernels::width_step);
        shared_width = kernels::round_up(num_beside(), kernels::width_step);
        std::fill_n(room_for(own, num_own() * width()), num_own() * width(), 0.0f);
        std::fill_n(room_for(shared, num_beside() * shared_width), num_beside() * shared_width, 0.0f);
    }
};

/// Cholesky's factor of an ArrowMatrix, image by image: O(F) for F images.
class ArrowFactor
{
public:
    /// @param damping  The diagonal is made larger by this times what it is with the hidden unknowns eliminated, theirs
    ///                 is not.
    /// @return The least pivot relative to the diagonal: <= 0 or NaN where the matrix is not positive definite to
    ///         rounding.
    [[nodiscard]] float factor(const kernels::Kernels& kernels, const ArrowMatrix& matrix, double damping)
    {
        kernels_ = &kernels;
        matrix_ = &matrix;
        const int num_own = matrix.num_own(), width = matrix.width(), num_beside = matrix.num_beside();
        float* own = room_for(own_, num_own * width);
        float* shared = room_for(shared_, matrix.shared_width * matrix.shared_width); // add_gram's
        std::copy_n(matrix.own.data(), num_own * width, own);
        if (damping > 0) {
            damp(damping, own);
        }
        float* inverses = room_for(own_inverses_, num_own);
        float* beside = room_for(beside_, num_own * matrix.shared_width); // U^-T of the rows beside the own blocks
        float least = 1;
        int row = 0;
        for (const int count : matrix.counts) {
            const float pivot =
                kernels.factor_positive_float(own + row * width, count, 0, width, own + row * width, inverses + row);
            least = pivot < least ? pivot : least;
            if (!(pivot > 0)) {
                return pivot;
            }
            for (const int end = row + count; row < end; ++row) {
                std::copy_n(own + row * width + matrix.own_width, matrix.shared_width,
                            beside + row * matrix.shared_width);
            }
        }
        const int step = matrix.shared_width + 1; // along the diagonal
        std::transform(matrix.shared.data(), matrix.shared.data() + num_beside * matrix.shared_width, shared,
                       std::negate<float>());
        std::vector<float> diagonal(static_cast<std::size_t>(num_beside));
        for (int i = 0; i < num_beside; ++i) {
            if (damping > 0 && i >= matrix.num_hidden) {
                shared[i * step] -= damping_[static_cast<std::size_t>(num_own + i - matrix.num_hidden)];
            }
            diagonal[static_cast<std::size_t>(i)] = -shared[i * step];
        }
        kernels.add_gram(beside, num_own, 0, num_beside, matrix.shared_width, shared);
        std::transform(shared, shared + num_beside * matrix.shared_width, shared, std::negate<float>());
        float* shared_inverses = room_for(shared_inverses_, num_beside);
        const float pivot =
            kernels.factor_positive_float(shared, num_beside, 0, matrix.shared_width, shared, shared_inverses);
        if (!(pivot > 0)) {
            return pivot;
        }
        for (int i = 0; i < num_beside; ++i) { // relative to the diagonal before the images' part was taken off
            const float root = 1 / shared_inverses[i];
            least = std::min(least, root * root / diagonal[static_cast<std::size_t>(i)]);
        }
        return least;
    }

    /// The solution for right sides that are 0 for the hidden unknowns, these left out.
    /// @param columns  Rows in the order [shared | own of each image].
    [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& columns)
    {
        constexpr int step = kernels::num_right_sides;
        using SideBySide = Eigen::Matrix<float, Eigen::Dynamic, step, Eigen::RowMajor>;
        const ArrowMatrix& matrix = *matrix_;
        const int num_own = matrix.num_own(), width = matrix.width(), num_beside = matrix.num_beside();
        Eigen::Map<SideBySide> own(room_for(solved_, num_own * step), num_own, step);
        Eigen::Map<SideBySide> more(room_for(more_, num_own * step), num_own, step);
        Eigen::Map<SideBySide> beside(room_for(beside_solved_, num_beside * step), num_beside, step);
        float* sums = room_for(sums_, width);
        float* factors = room_for(factors_, num_own);
        double* x = room_for(x_, width);
        double* products = room_for(products_, num_own);
        Eigen::MatrixXd result(columns.rows(), columns.cols());
        for (Eigen::Index begin = 0; begin < columns.cols(); begin += step) {
            const int count = static_cast<int>(std::min<Eigen::Index>(columns.cols() - begin, step));
            const auto right_sides = columns.middleCols(begin, count);
            own.setZero();
            own.leftCols(count) = right_sides.bottomRows(num_own).cast<float>();
            beside.setZero();
            beside.bottomLeftCorner(matrix.num_shared, count) = right_sides.topRows(matrix.num_shared).cast<float>();
            int row = 0;
            for (const int num_rows : matrix.counts) {
                if (!own.middleRows(row, num_rows).isZero(0)) { // most columns of a bound have zeros here
                    solve_own(row, num_rows, own.data());
                    for (int q = 0; q < count; ++q) {
                        Eigen::Map<Eigen::VectorXf>(factors, num_rows) = own.col(q).segment(row, num_rows);
                        std::fill_n(sums, width, 0.0f);
                        kernels_->add_rows(matrix.own.data() + row * width, num_rows, width, factors, sums);
                        beside.col(q) -= Eigen::Map<const Eigen::VectorXf>(sums + matrix.own_width, num_beside);
                    }
                }
                row += num_rows;
            }
            if (count == 1 && matrix.shared_width <= kernels::max_width_for_one) {
                float* alone = room_for(sums_, width);
                std::fill_n(alone, matrix.shared_width, 0.0f);
                Eigen::Map<Eigen::VectorXf>(alone, num_beside) = beside.col(0);
                kernels_->solve_for_one_float(shared_.data(), num_beside, 0, matrix.shared_width,
                                              shared_inverses_.data(), alone);
                beside.col(0) = Eigen::Map<const Eigen::VectorXf>(alone, num_beside);
            } else {
                kernels_->solve_factored_float(shared_.data(), num_beside, matrix.shared_width, shared_inverses_.data(),
                                               beside.data());
            }
            more.setZero();
            std::fill_n(x, width, 0.0);
            for (int q = 0; q < count; ++q) {
                Eigen::Map<Eigen::VectorXd>(x + matrix.own_width, num_beside) = beside.col(q).cast<double>();
                kernels_->multiply_wide(matrix.own.data(), num_own, width, x, products);
                more.col(q) = Eigen::Map<const Eigen::VectorXd>(products, num_own).cast<float>();
            }
            row = 0;
            for (const int num_rows : matrix.counts) {
                solve_own(row, num_rows, more.data());
                row += num_rows;
            }
            result.middleCols(begin, count).topRows(matrix.num_shared) =
                beside.bottomLeftCorner(matrix.num_shared, count).cast<double>();
            result.middleCols(begin, count).bottomRows(num_own) =
                (own.leftCols(count) - more.leftCols(count)).cast<double>();
        }
        return result;
    }

    /// The first `count` columns of the inverse, of shared unknowns, without their rows of the hidden ones.
    /// @param hidden  Those rows.
    [[nodiscard]] Eigen::MatrixXd inverse_columns(int count, Eigen::MatrixXd& hidden)
    {
        constexpr int step = kernels::num_right_sides;
        using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
        using SideBySide = Eigen::Matrix<float, Eigen::Dynamic, step, Eigen::RowMajor>;
        const ArrowMatrix& matrix = *matrix_;
        const int num_own = matrix.num_own(), num_beside = matrix.num_beside();
        const int width = kernels::round_up(count, kernels::width_step);
        Eigen::Map<Rows> beside(room_for(columns_, (num_beside + num_own) * width), num_beside, width);
        Eigen::Map<Rows> own(beside.data() + num_beside * width, num_own, width);
        beside.setZero();
        own.setZero();
        for (int begin = 0; begin < count; begin += step) {
            const int num_units = std::min(step, count - begin);
            Eigen::Map<SideBySide> units(room_for(beside_solved_, num_beside * step), num_beside, step);
            units.setZero();
            units.middleRows(matrix.num_hidden + begin, num_units).leftCols(num_units).setIdentity();
            kernels_->solve_factored_float(shared_.data(), num_beside, matrix.shared_width, shared_inverses_.data(),
                                           units.data());
            beside.middleCols(begin, num_units) = units.leftCols(num_units);
        }
        for (int row = 0; row < num_own; ++row) {
            kernels_->add_rows(beside.data(), num_beside, width,
                               matrix.own.data() + row * matrix.width() + matrix.own_width, own.row(row).data());
        }
        for (int begin = 0; begin < count; begin += step) {
            const int num_units = std::min(step, count - begin);
            Eigen::Map<SideBySide> solved(room_for(solved_, num_own * step), num_own, step);
            solved.setZero();
            solved.leftCols(num_units) = own.middleCols(begin, num_units);
            int row = 0;
            for (const int num_rows : matrix.counts) {
                solve_own(row, num_rows, solved.data());
                row += num_rows;
            }
            own.middleCols(begin, num_units) = -solved.leftCols(num_units);
        }
        Eigen::MatrixXd columns(matrix.num_shared + num_own, count);
        columns.topRows(matrix.num_shared) = beside.bottomLeftCorner(matrix.num_shared, count).cast<double>();
        columns.bottomRows(num_own) = own.leftCols(count).cast<double>();
        hidden = beside.topLeftCorner(matrix.num_hidden, count).cast<double>();
        return columns;
    }

    /// U^-T e_k for some unknowns k of [shared | own of each image], as columns of num_rows() rows of `width`: those of
    /// the image whose own one k is, num_own_rows(), the other images' being 0, and those of [hidden | shared].
    /// @param num_before  The first, whose columns are set.
    void set_halves(const std::vector<int>& unknowns, std::size_t num_before, int width, float* halves)
    {
        constexpr int step = kernels::num_right_sides;
        using SideBySide = Eigen::Matrix<float, Eigen::Dynamic, step, Eigen::RowMajor>;
        const ArrowMatrix& matrix = *matrix_;
        const int num_own = matrix.num_own(), num_beside = matrix.num_beside();
        Eigen::Map<SideBySide> own(room_for(solved_, num_own * step), num_own, step);
        Eigen::Map<SideBySide> beside(room_for(beside_solved_, num_beside * step), num_beside, step);
        float* sums = room_for(sums_, matrix.shared_width);
        float* factors = room_for(factors_, num_own);
        for (std::size_t begin = num_before; begin < unknowns.size(); begin += step) {
            const int count = static_cast<int>(std::min<std::size_t>(unknowns.size() - begin, step));
            own.setZero();
            beside.setZero();
            for (int q = 0; q < count; ++q) {
                const int unknown = unknowns[begin + static_cast<std::size_t>(q)];
                (unknown < matrix.num_shared ? beside(matrix.num_hidden + unknown, q)
                                             : own(unknown - matrix.num_shared, q)) = 1;
            }
            int row = 0;
            for (const int num_rows : matrix.counts) {
                auto of_image = own.middleRows(row, num_rows);
                if (!of_image.isZero(0)) {
                    kernels_->solve_lower_float(own_.data() + row * matrix.width(), num_rows, matrix.width(),
                                                own_inverses_.data() + row, of_image.data());
                    for (int q = 0; q < count; ++q) {
                        Eigen::Map<Eigen::VectorXf>(factors, num_rows) = of_image.col(q);
                        std::fill_n(sums, matrix.shared_width, 0.0f);
                        kernels_->add_rows(beside_.data() + row * matrix.shared_width, num_rows, matrix.shared_width,
                                           factors, sums);
                        beside.col(q) -= Eigen::Map<const Eigen::VectorXf>(sums, num_beside);
                    }
                }
                row += num_rows;
            }
            kernels_->solve_lower_float(shared_.data(), num_beside, matrix.shared_width, shared_inverses_.data(),
                                        beside.data());
            for (int q = 0; q < count; ++q) {
                const auto [first, num_rows] = rows_of_image_with(unknowns[begin + static_cast<std::size_t>(q)]);
                float* column = halves + begin + q;
                for (int i = 0; i < num_own_rows(); ++i) {
                    column[i * width] = i < num_rows ? own(first + i, q) : 0.0f;
                }
            }
            for (int i = 0; i < num_beside; ++i) {
                std::copy_n(beside.data() + i * step, count, halves + (num_own_rows() + i) * width + begin);
            }
        }
    }
    [[nodiscard]] int num_own_rows() const { return matrix_->own_width; }
    [[nodiscard]] int num_rows() const { return num_own_rows() + matrix_->num_beside(); }

    /// The first row among the own ones of the image whose own unknown that is, and how many they are; none of a shared
    /// one.
    [[nodiscard]] std::pair<int, int> rows_of_image_with(int unknown) const
    {
        int first = 0;
        for (const int count : matrix_->counts) {
            if (unknown >= matrix_->num_shared && unknown - matrix_->num_shared < first + count) {
                return {first, count};
            }
            first += count;
        }
        return {first, 0};
    }

private:
    void solve_own(int row, int num_rows, float* x)
    {
        kernels_->solve_factored_float(own_.data() + row * matrix_->width(), num_rows, matrix_->width(),
                                       own_inverses_.data() + row, x + row * kernels::num_right_sides);
    }

    /// Sets what is added to the diagonals, [own of each image | shared], and adds that of the own ones.
    void damp(double damping, float* own)
    {
        const ArrowMatrix& matrix = *matrix_;
        const int num_own = matrix.num_own();
        damping_.assign(static_cast<std::size_t>(num_own + matrix.num_shared), 0.0f);
        std::vector<Eigen::Matrix3f> inverses;
        for (int h = 0; h < matrix.num_hidden; h += 3) {
            Eigen::Matrix3f block;
            for (int axis = 0; axis < 3; ++axis) {
                const float* row = matrix.shared.data() + (h + axis) * matrix.shared_width + h;
                for (int other = axis; other < 3; ++other) {
                    block(axis, other) = block(other, axis) = row[other];
                }
            }
            inverses.emplace_back(block.inverse());
        }
        const auto hidden_part = [&](const float* coupling, int step) {
            float sum = 0;
            for (const Eigen::Matrix3f& inverse : inverses) {
                const Eigen::Vector3f c(coupling[0], coupling[step], coupling[2 * step]);
                sum += c.dot(inverse * c);
                coupling += 3 * step;
            }
            return sum;
        };
        int row = 0;
        for (const int count : matrix.counts) {
            for (int i = 0; i < count; ++i, ++row) {
                const float* from = matrix.own.data() + row * matrix.width();
                float& added = damping_[static_cast<std::size_t>(row)];
                added = static_cast<float>(damping) * (from[i] - hidden_part(from + matrix.own_width, 1));
                own[row * matrix.width() + i] += added;
            }
        }
        for (int j = 0; j < matrix.num_shared; ++j) {
            const float* column = matrix.shared.data() + matrix.num_hidden + j;
            damping_[static_cast<std::size_t>(num_own + j)] =
                static_cast<float>(damping) *
                (column[(matrix.num_hidden + j) * matrix.shared_width] - hidden_part(column, matrix.shared_width));
        }
    }

    const kernels::Kernels* kernels_ = nullptr;
    const ArrowMatrix* matrix_ = nullptr;
    AlignedBuffer<float> own_ = {};    ///< U of each own block, and U^-T of what is beside it.
    AlignedBuffer<float> beside_ = {}; ///< That without the own blocks.
    AlignedBuffer<float> shared_ = {}; ///< U of [hidden | shared], the own ones eliminated.
    AlignedBuffer<float> own_inverses_ = {}, shared_inverses_ = {};
    std::vector<float> damping_ = {};
    AlignedBuffer<float> solved_ = {}, more_ = {}, beside_solved_ = {}, sums_ = {}, factors_ = {}, columns_ = {};
    AlignedBuffer<double> x_ = {}, products_ = {};
};

} // namespace lineament::detail
