// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/arrow_factor_impl.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace lineament::detail {

/// The inverse C of an ArrowMatrix H, in double precision, as far as images see it: the blocks of each image's own
/// unknowns and the shared ones. With b for [hidden | shared] and f for the own ones of an image,
///     H_ff = U_f^T U_f,  W_f = U_f^-T H_fb,  H_bb - sum_f W_f^T W_f = U^T U,  Y_f = U^-T W_f^T,
///     C_bb = U^-1 U^-T,  C_fb = -U_f^-1 Y_f^T U^-T,  C_ff = U_f^-1 (1 + Y_f^T Y_f) U_f^-T,
/// so that time and memory are O(F) for F images.
class ArrowInverse
{
public:
    /// @param free        Unknowns that the inverse is of, ascending in [shared | own of each image]; the others are
    ///                    held.
    /// @param deviations  Becomes the root of C_kk for each unknown k, of a held one as if it were free too. NaN
    ///                    where H is not positive definite to the rounding of its single precision.
    void find(const kernels::Kernels& kernels, const ArrowMatrix& matrix, const std::vector<int>& free,
              Eigen::VectorXd& deviations)
    {
        kernels_ = &kernels;
        matrix_ = &matrix;
        share_out(free);
        deviations.resize(matrix.num_shared + matrix.num_own());
        bool is_positive = true;
        for (std::size_t f = 0; f < images_.size() && is_positive; ++f) {
            is_positive = eliminate(images_[f]);
        }
        if (!is_positive || !factor_beside()) {
            deviations.setConstant(std::numeric_limits<double>::quiet_NaN());
            return;
        }
        set_shared(deviations);
        for (Image& image : images_) {
            set_own(image, deviations);
        }
    }

    /// C of the free unknowns among the shared and an image's own, and which these are.
    void set_block_of_image(std::size_t f, std::vector<int>& unknowns, Eigen::MatrixXd& block) const
    {
        const Image& image = images_[f];
        const Eigen::Index num_shared = covariance_.rows(), num_own = image.covariance.rows();
        unknowns.assign(shared_.free.begin(), shared_.free.end());
        for (const int i : image.own.free) {
            unknowns.push_back(image.first + i);
        }
        block.resize(num_shared + num_own, num_shared + num_own);
        block.topLeftCorner(num_shared, num_shared) = covariance_;
        block.bottomRightCorner(num_own, num_own) = image.covariance;
        block.bottomLeftCorner(num_own, num_shared) = image.with_shared;
        block.topRightCorner(num_shared, num_own) = image.with_shared.transpose();
    }

private:
    template <typename T>
    using RowMajor = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    using Rows = Eigen::Map<RowMajor<double>, 0, Eigen::OuterStride<>>;

    /// Free first, held from `held_begin` on.
    struct Columns
    {
        std::vector<int> free = {}, held = {};

        [[nodiscard]] int num_free() const { return static_cast<int>(free.size()); }
        [[nodiscard]] int num_held() const { return static_cast<int>(held.size()); }
        [[nodiscard]] int held_begin() const { return filled_up(num_free()); }
        [[nodiscard]] int width() const { return held_begin() + filled_up(num_held()); }
    };

    struct Image
    {
        Columns own = {};              ///< Among its own unknowns.
        int first = 0;                 ///< Of the unknowns.
        int first_row = 0;             ///< Of ArrowMatrix::own.
        int begin = 0;                 ///< Columns of `beside_`: first Y_f, then those of the held.
        Eigen::VectorXd left = {};     ///< Of the held, H_kk less what the free ones of the image explain.
        Eigen::MatrixXd root = {};     ///< U_f^-T.
        Eigen::MatrixXd with_shared{}; ///< C_fb of the shared alone.
        Eigen::MatrixXd covariance = {};
    };

    [[nodiscard]] static int filled_up(int count) { return kernels::round_up(count, kernels::double_step); }

    /// Sets where all are.
    void share_out(const std::vector<int>& free)
    {
        const ArrowMatrix& matrix = *matrix_;
        auto next = free.begin();
        const auto share = [&](int begin, int count, Columns& columns) {
            columns.free.clear();
            columns.held.clear();
            for (int i = 0; i < count; ++i) {
                if (next != free.end() && *next == begin + i) {
                    columns.free.push_back(i);
                    ++next;
                } else {
                    columns.held.push_back(i);
                }
            }
        };
        share(0, matrix.num_shared, shared_);
        num_beside_ = matrix.num_hidden + shared_.num_free();
        held_begin_ = filled_up(num_beside_);
        beside_width_ = held_begin_ + filled_up(shared_.num_held());
        own_width_ = 0;
        images_.resize(matrix.counts.size());
        int row = 0;
        int begin = beside_width_;
        for (std::size_t f = 0; f < images_.size(); ++f) {
            Image& image = images_[f];
            image.first_row = row;
            image.first = matrix.num_shared + row;
            image.begin = begin;
            share(image.first, matrix.counts[f], image.own);
            begin += image.own.width();
            row += matrix.counts[f];
            own_width_ = std::max(own_width_, image.own.width());
        }
        width_ = begin;
        const int num_rows = own_width_ + beside_width_;
        std::fill_n(room_for(gram_, num_rows * num_rows), num_rows * num_rows, 0.0);
        std::fill_n(room_for(beside_, num_beside_ * width_), num_beside_ * width_, 0.0);
    }

    /// The columns of the matrix's [hidden | shared], the held last.
    template <typename From>
    void copy_beside(const From* from, double* to) const
    {
        std::copy_n(from, matrix_->num_hidden, to);
        std::transform(shared_.free.begin(), shared_.free.end(), to + matrix_->num_hidden,
                       [&](int i) { return from[matrix_->num_hidden + i]; });
        std::transform(shared_.held.begin(), shared_.held.end(), to + held_begin_,
                       [&](int i) { return from[matrix_->num_hidden + i]; });
    }

    /// Adds W_f^T W_f to the sum; sets the root and the columns W_f^T.
    [[nodiscard]] bool eliminate(Image& image)
    {
        const ArrowMatrix& matrix = *matrix_;
        const Columns& own = image.own;
        const int n = own.num_free(), width = own_width_ + beside_width_;
        Rows rows(room_for(rows_, n * width), n, width, Eigen::OuterStride<>(width));
        rows.setZero();
        const auto entry = [&](int i, int j) { // of the upper triangle
            return matrix.own.data()[(image.first_row + std::min(i, j)) * matrix.width() + std::max(i, j)];
        };
        for (int i = 0; i < n; ++i) {
            const int from = own.free[static_cast<std::size_t>(i)];
            for (int j = i; j < n; ++j) {
                rows(i, j) = entry(from, own.free[static_cast<std::size_t>(j)]);
            }
            for (int k = 0; k < own.num_held(); ++k) {
                rows(i, own.held_begin() + k) = entry(from, own.held[static_cast<std::size_t>(k)]);
            }
            copy_beside(matrix.own.data() + (image.first_row + from) * matrix.width() + matrix.own_width,
                        rows.row(i).data() + own_width_);
        }
        double* inverses = room_for(inverses_, n);
        if (!(kernels_->factor_positive(rows.data(), n, 0, width, rows.data(), inverses) > least_pivot)) {
            return false;
        }
        Rows gram(gram_.data(), width, width, Eigen::OuterStride<>(width));
        gram.middleRows(own.held_begin(), own.width() - own.held_begin()).setZero();
        kernels_->add_gram_double(rows.data(), n, own.held_begin(), own.width(), width, gram.data());
        kernels_->add_gram_double(rows.data(), n, own_width_, width, width, gram.data());

        const int root_width = filled_up(n);
        kernels_->invert_factor(rows.data(), n, width, inverses, room_for(root_, n * root_width), root_width);
        image.root = Rows(root_.data(), n, n, Eigen::OuterStride<>(root_width));
        Rows columns(beside_.data() + image.begin, num_beside_, own.width(), Eigen::OuterStride<>(width_));
        columns.leftCols(n) = rows.middleCols(own_width_, num_beside_).transpose();

        image.left.resize(own.num_held());
        double* of_held = room_for(held_row_, beside_width_);
        for (int k = 0; k < own.num_held(); ++k) {
            const int i = own.held[static_cast<std::size_t>(k)], at = own.held_begin() + k;
            image.left[k] = entry(i, i) - gram(at, at);
            copy_beside(matrix.own.data() + (image.first_row + i) * matrix.width() + matrix.own_width, of_held);
            columns.col(at) = Eigen::Map<const Eigen::VectorXd>(of_held, num_beside_) -
                              gram.row(at).segment(own_width_, num_beside_).transpose();
        }
        return true;
    }

    /// U, and U^-T of what is beside it.
    [[nodiscard]] bool factor_beside()
    {
        const ArrowMatrix& matrix = *matrix_;
        const int num_rows = own_width_ + beside_width_;
        const Rows taken(gram_.data() + own_width_ * (num_rows + 1), beside_width_, beside_width_,
                         Eigen::OuterStride<>(num_rows));
        Rows beside(beside_.data(), num_beside_, width_, Eigen::OuterStride<>(width_));
        const auto entry = [&](int i, int j) {
            return matrix.shared.data()[std::min(i, j) * matrix.shared_width + std::max(i, j)];
        };
        const auto position = [&](int i) { // in [hidden | shared]
            return i < matrix.num_hidden
                       ? i
                       : matrix.num_hidden + shared_.free[static_cast<std::size_t>(i - matrix.num_hidden)];
        };
        Eigen::VectorXd diagonal(num_beside_);
        left_.resize(shared_.num_held());
        for (int i = 0; i < num_beside_; ++i) {
            const int from = position(i);
            diagonal[i] = entry(from, from);
            for (int j = i; j < num_beside_; ++j) {
                beside(i, j) = entry(from, position(j)) - taken(i, j);
            }
            for (int k = 0; k < shared_.num_held(); ++k) {
                const int at = held_begin_ + k;
                beside(i, at) =
                    entry(from, matrix.num_hidden + shared_.held[static_cast<std::size_t>(k)]) - taken(i, at);
            }
        }
        for (int k = 0; k < shared_.num_held(); ++k) {
            const int from = matrix.num_hidden + shared_.held[static_cast<std::size_t>(k)], at = held_begin_ + k;
            left_[k] = entry(from, from) - taken(at, at);
        }
        double* inverses = room_for(beside_inverses_, num_beside_);
        if (!(kernels_->factor_positive(beside.data(), num_beside_, 0, width_, beside.data(), inverses) > 0)) {
            return false;
        }
        // Relative to the diagonal before the images' part was taken off, which has rounded.
        return num_beside_ == 0 ||
               (Eigen::Map<const Eigen::VectorXd>(inverses, num_beside_).array().square() * diagonal.array())
                       .maxCoeff() < 1 / least_pivot;
    }

    void set_shared(Eigen::VectorXd& deviations)
    {
        const int n = shared_.num_free(), hidden = matrix_->num_hidden, root_width = filled_up(n);
        kernels_->invert_factor(beside_.data() + hidden * (width_ + 1), n, width_, beside_inverses_.data() + hidden,
                                room_for(shared_root_, n * root_width), root_width);
        const Rows root = shared_root();
        covariance_.noalias() = root.transpose() * root;
        for (int i = 0; i < n; ++i) {
            deviations[shared_.free[static_cast<std::size_t>(i)]] = std::sqrt(covariance_(i, i));
        }
        const Rows beside(beside_.data(), num_beside_, width_, Eigen::OuterStride<>(width_));
        for (int k = 0; k < shared_.num_held(); ++k) {
            deviations[shared_.held[static_cast<std::size_t>(k)]] =
                1 / std::sqrt(left_[k] - beside.col(held_begin_ + k).squaredNorm());
        }
    }

    /// U^-T of the shared alone.
    [[nodiscard]] Rows shared_root()
    {
        const int n = shared_.num_free();
        return {shared_root_.data(), n, n, Eigen::OuterStride<>(filled_up(n))};
    }

    void set_own(Image& image, Eigen::VectorXd& deviations)
    {
        const int n = image.own.num_free(), width = image.own.width();
        Rows y(room_for(rows_, num_beside_ * width), num_beside_, width, Eigen::OuterStride<>(width));
        y = Rows(beside_.data() + image.begin, num_beside_, width, Eigen::OuterStride<>(width_));
        Rows gram(room_for(own_gram_, width * width), width, width, Eigen::OuterStride<>(width));
        gram.setZero();
        kernels_->add_gram_double(y.data(), num_beside_, 0, width, width, gram.data());
        gram.diagonal().head(n).array() += 1;
        const Eigen::MatrixXd squares = gram.topLeftCorner(n, n).selfadjointView<Eigen::Upper>();
        image.covariance.noalias() = image.root.transpose() * (squares * image.root).eval();
        image.with_shared.noalias() =
            -image.root.transpose() * (y.bottomLeftCorner(shared_.num_free(), n).transpose() * shared_root()).eval();
        for (int i = 0; i < n; ++i) {
            deviations[image.first + image.own.free[static_cast<std::size_t>(i)]] = std::sqrt(image.covariance(i, i));
        }
        for (int k = 0; k < image.own.num_held(); ++k) {
            const int at = image.own.held_begin() + k;
            deviations[image.first + image.own.held[static_cast<std::size_t>(k)]] =
                1 / std::sqrt(image.left[k] - gram(at, at));
        }
    }

    /// Below this share of its diagonal a pivot may be the rounding of single precision.
    static constexpr double least_pivot = 1e-5;

    const kernels::Kernels* kernels_ = nullptr;
    const ArrowMatrix* matrix_ = nullptr;
    Columns shared_ = {};
    std::vector<Image> images_ = {};
    Eigen::MatrixXd covariance_ = {}; ///< Of the shared.
    Eigen::VectorXd left_ = {};       ///< Of the shared that are held, as those of an image.
    int num_beside_ = 0;              ///< Hidden and free shared.
    int held_begin_ = 0;              ///< Where behind them those shared are that are held.
    int beside_width_ = 0;            ///< Of both, filled up.
    int own_width_ = 0;               ///< Of any image's own.
    int width_ = 0;                   ///< Of `beside_`.
    AlignedBuffer<double> rows_ = {}, root_ = {}, shared_root_ = {}, own_gram_ = {}, held_row_ = {};
    AlignedBuffer<double> gram_ = {};   ///< Of [own | beside]; of the latter summed over images.
    AlignedBuffer<double> beside_ = {}; ///< U of the free beside, and U^-T of the held, and of each image's columns.
    AlignedBuffer<double> inverses_ = {}, beside_inverses_ = {};
};

} // namespace lineament::detail
