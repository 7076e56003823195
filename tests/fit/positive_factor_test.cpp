// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What the joint fit factors and solves, by Eigen and by the kernels of every instruction set, against Eigen's LU.
#include "lineament/fit/arrow_inverse_impl.hpp"
#include "lineament/fit/positive_factor_impl.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

namespace lineament {
namespace {

using test::IsNear;

Eigen::MatrixXd solved(detail::PositiveFactor& factor, Eigen::MatrixXd columns)
{
    factor.solve(columns);
    return columns;
}

/// NaN wherever nothing is to be read.
detail::UpperTriangle upper_triangle_of(const Eigen::MatrixXd& matrix)
{
    detail::UpperTriangle upper;
    upper.resize(matrix.rows());
    const int width = upper.width();
    std::fill_n(upper.rows.data(), width * width, std::numeric_limits<float>::quiet_NaN());
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
        float* row = upper.rows.data() + (upper.begin() + i) * width;
        std::fill(row + upper.begin() + matrix.rows(), row + width, 0.0f);
        for (Eigen::Index j = i; j < matrix.rows(); ++j) {
            row[upper.begin() + j] = static_cast<float>(matrix(i, j));
        }
    }
    return upper;
}

TEST(PositiveFactor, TheTraceOfSomeIsNotThatOfFarLargerOthers)
{
    Eigen::VectorXd diagonal = Eigen::VectorXd::Constant(14, 2);
    diagonal.segment(6, 4).setConstant(1e-9);
    const Eigen::MatrixXd matrix = diagonal.asDiagonal();
    for (const kernels::Kernels* set : kernels::supported_kernels()) {
        detail::PositiveFactor factor(set);
        for (const Eigen::Index num_inverted : {10, 0}) {
            ASSERT_TRUE(factor.factor(upper_triangle_of(matrix), 0.0, num_inverted)) << set->name;
            EXPECT_NEAR(factor.inverse_trace(10, 6, {}), 3, 1e-5) << set->name;
        }
    }
}

TEST(PositiveFactor, SolvesAndInvertsWhateverItHeldBefore)
{
    std::vector<const kernels::Kernels*> sets = kernels::supported_kernels();
    sets.push_back(nullptr);
    for (const kernels::Kernels* set : sets) {
        SCOPED_TRACE(set != nullptr ? set->name : "Eigen");
        const double rounding = set != nullptr ? 1e-4 : 1e-9; // of steps, in single precision
        Random random(821);
        detail::PositiveFactor factor(set);
        for (const Eigen::Index n : {5, 40, 1, 13, 24}) { // smaller and larger ones
            const Eigen::MatrixXd rows = test::random_normal(random, 2 * n * n).reshaped(2 * n, n);
            const Eigen::MatrixXd matrix = rows.transpose() * rows + Eigen::MatrixXd::Identity(n, n);
            const Eigen::MatrixXd b = test::random_normal(random, 11 * n).reshaped(n, 11);
            const Eigen::MatrixXd inverse = matrix.inverse();
            factor.factor(matrix);
            EXPECT_THAT(solved(factor, b), IsNear(Eigen::MatrixXd(inverse * b), rounding));
            EXPECT_THAT(solved(factor, b.leftCols(1)), IsNear(Eigen::MatrixXd(inverse * b.leftCols(1)), rounding));
            const Eigen::Index leading = (n + 1) / 2, count = (n + 2) / 3;
            const Eigen::MatrixXd of_leading = matrix.topLeftCorner(leading, leading).inverse();
            EXPECT_THAT(factor.inverse(leading), IsNear(of_leading, rounding));
            EXPECT_THAT(factor.inverse(n), IsNear(inverse, rounding));
            Eigen::MatrixXd hidden;
            EXPECT_THAT(factor.inverse_columns(leading, count, hidden),
                        IsNear(Eigen::MatrixXd(of_leading.leftCols(count)), rounding));
            EXPECT_EQ(hidden.rows(), 0);
            EXPECT_NEAR(factor.inverse_trace(leading, count, {}), of_leading.topLeftCorner(count, count).trace(),
                        rounding);
            const Eigen::MatrixXd weights = matrix.topLeftCorner(count, count);
            EXPECT_NEAR(factor.inverse_trace(leading, count, weights),
                        (weights * of_leading.topLeftCorner(count, count)).trace(), 10 * rounding);

            if (set != nullptr) {
                const detail::UpperTriangle upper = upper_triangle_of(matrix);
                for (const double damping : {0.0, 0.5}) {
                    for (const Eigen::Index num_inverted : {leading, Eigen::Index(0)}) {
                        Eigen::MatrixXd damped = matrix;
                        damped.diagonal() *= 1 + damping;
                        ASSERT_TRUE(factor.factor(upper, damping, num_inverted));
                        EXPECT_THAT(solved(factor, b), IsNear(Eigen::MatrixXd(damped.inverse() * b), rounding));
                        EXPECT_THAT(solved(factor, b.leftCols(1)),
                                    IsNear(Eigen::MatrixXd(damped.inverse() * b.leftCols(1)), rounding));
                        EXPECT_NEAR(
                            factor.inverse_trace(leading, count, {}),
                            damped.topLeftCorner(leading, leading).inverse().topLeftCorner(count, count).trace(),
                            rounding);
                    }
                }
            }
            factor.factor(matrix, 0.5); // nothing of the other stays
            Eigen::MatrixXd damped = matrix;
            damped.diagonal() *= 1.5;
            EXPECT_THAT(solved(factor, b), IsNear(Eigen::MatrixXd(damped.inverse() * b), rounding));
        }
        for (const int n : {6, 1}) {
            Eigen::MatrixXd indefinite = Eigen::MatrixXd::Identity(n, n);
            factor.factor(indefinite);
            indefinite(n / 2, n / 2) = -1;
            factor.factor(indefinite);
            EXPECT_TRUE(solved(factor, Eigen::MatrixXd::Ones(n, 1)).hasNaN()) << n;
            EXPECT_TRUE(factor.inverse(n).hasNaN()) << n;
            EXPECT_TRUE(std::isnan(factor.inverse_trace(n, n, {}))) << n;
        }
    }
}

TEST(PositiveFactor, FactorsABlockInDoublePrecision)
{
    std::vector<const kernels::Kernels*> sets = kernels::supported_kernels();
    sets.push_back(nullptr);
    for (const kernels::Kernels* set : sets) {
        SCOPED_TRACE(set != nullptr ? set->name : "Eigen");
        Random random(822);
        detail::PositiveFactor factor(set);
        const Eigen::Index n = 30;
        const Eigen::MatrixXd rows = test::random_normal(random, 2 * n * n).reshaped(2 * n, n);
        const Eigen::MatrixXd matrix = rows.transpose() * rows + Eigen::MatrixXd::Identity(n, n);
        for (const std::vector<int>& others :
             {std::vector<int>{}, {7}, {0, 3, 4, 29}, {20, 21, 22, 23, 24, 25, 26, 27, 28}}) {
            std::vector<int> block;
            for (int i = 0; i < static_cast<int>(n); ++i) {
                if (std::find(others.begin(), others.end(), i) == others.end()) {
                    block.push_back(i);
                }
            }
            const Eigen::MatrixXd lower = matrix.triangularView<Eigen::Lower>(); // nothing above is read
            detail::RoomyMatrix<Eigen::VectorXd> explained;
            factor.factor_block(lower, block, others, explained);
            const Eigen::MatrixXd inverse = Eigen::MatrixXd(matrix(block, block)).inverse();
            const Eigen::MatrixXd cross = matrix(block, others);
            EXPECT_THAT(explained, IsNear(Eigen::VectorXd((cross.transpose() * inverse * cross).diagonal()), 1e-9));
            EXPECT_THAT(factor.inverse(static_cast<Eigen::Index>(block.size())), IsNear(inverse, 1e-9));
            const Eigen::MatrixXd b = test::random_normal(random, inverse.rows());
            EXPECT_THAT(solved(factor, b), IsNear(Eigen::MatrixXd(inverse * b), 1e-9));
        }
    }
}

TEST(PositiveFactor, WhatIsNotPositiveDefiniteToSinglePrecisionIsSolvedInDouble)
{
    for (const double large : {1e6, 1e9}) { // the first is to rounding only
        Eigen::MatrixXd matrix = Eigen::MatrixXd::Constant(4, 4, large);
        matrix.diagonal().array() += 1.0;
        const Eigen::MatrixXd b = Eigen::Vector4d(1, 2, -3, 5);
        for (const kernels::Kernels* set : kernels::supported_kernels()) {
            detail::PositiveFactor factor(set);
            factor.factor(matrix);
            EXPECT_THAT(Eigen::MatrixXd(matrix * solved(factor, b)), IsNear(b, 1e-5)) << set->name;
            EXPECT_NEAR(factor.inverse_trace(4, 4, {}), 3 + 1 / (1 + 4 * large), 1e-5) << set->name;
        }
    }
}

/// [hidden | shared | own of each image], positive definite.
struct Arrow
{
    Eigen::MatrixXd all;
    detail::ArrowMatrix matrix = {};

    Arrow(Random& random, const std::vector<int>& counts, int num_hidden, int num_shared)
    {
        matrix.set_zero(counts, num_hidden, num_shared);
        const int num_beside = matrix.num_beside(), size = num_beside + matrix.num_own();
        all = Eigen::MatrixXd::Zero(size, size);
        const auto couple = [&](int i, int j) { all(i, j) = all(j, i) = 0.2 * random.normal(); };
        for (int j = 0; j < num_beside; ++j) {
            for (int i = 0; i <= j; ++i) {
                if (j >= num_hidden || i / 3 == j / 3) {
                    couple(i, j);
                }
            }
        }
        int begin = num_beside;
        for (const int count : counts) {
            for (int j = begin; j < begin + count; ++j) {
                for (int i = 0; i < num_beside; ++i) {
                    couple(i, j);
                }
                for (int i = begin; i <= j; ++i) {
                    couple(i, j);
                }
            }
            begin += count;
        }
        all.diagonal().array() += 0.5 * std::sqrt(size) + 1;
        pack();
    }

    void pack()
    {
        const int num_beside = matrix.num_beside();
        for (int i = 0; i < num_beside; ++i) {
            for (int j = i; j < num_beside; ++j) {
                matrix.shared[i * matrix.shared_width + j] = static_cast<float>(all(i, j));
            }
        }
        int first = num_beside;
        for (const int count : matrix.counts) {
            for (int i = first; i < first + count; ++i) {
                float* row = matrix.own.data() + (i - num_beside) * matrix.width();
                for (int j = i; j < first + count; ++j) {
                    row[j - first] = static_cast<float>(all(i, j));
                }
                for (int j = 0; j < num_beside; ++j) {
                    row[matrix.own_width + j] = static_cast<float>(all(i, j));
                }
            }
            first += count;
        }
    }

    /// Hidden unknowns eliminated.
    [[nodiscard]] Eigen::MatrixXd visible() const
    {
        const int num_hidden = matrix.num_hidden, size = static_cast<int>(all.rows()) - num_hidden;
        const Eigen::MatrixXd cross = all.topRightCorner(num_hidden, size);
        return all.bottomRightCorner(size, size) -
               cross.transpose() * all.topLeftCorner(num_hidden, num_hidden).inverse() * cross;
    }
};

TEST(PositiveFactor, SolvesImageByImage)
{
    for (const kernels::Kernels* set : kernels::supported_kernels()) {
        SCOPED_TRACE(set->name);
        Random random(823);
        detail::PositiveFactor factor(set);
        for (const int num_hidden : {0, 6}) {
            for (const std::vector<int>& counts : {std::vector<int>{4, 19, 0, 7}, {3, 3}}) {
                Arrow arrow(random, counts, num_hidden, 9);
                const Eigen::MatrixXd visible = arrow.visible();
                const Eigen::MatrixXd b = test::random_normal(random, 11 * visible.rows()).reshaped(visible.rows(), 11);
                for (const double damping : {0.5, 0.0}) {
                    Eigen::MatrixXd damped = visible;
                    damped.diagonal() *= 1 + damping;
                    ASSERT_TRUE(factor.factor(arrow.matrix, damping));
                    EXPECT_THAT(solved(factor, b), IsNear(Eigen::MatrixXd(damped.inverse() * b), 1e-4));
                    EXPECT_THAT(solved(factor, b.leftCols(1)),
                                IsNear(Eigen::MatrixXd(damped.inverse() * b.leftCols(1)), 1e-4));
                    const std::vector<int> some = {12, 0, 13, 10, 3, 9, 14, 8, 11}; // more than a kernel takes at once
                    EXPECT_THAT(factor.inverse_block(some),
                                IsNear(Eigen::MatrixXd(damped.inverse()(some, some)), 1e-4));
                    for (const std::size_t num_before : {3, 7}) { // one after the other
                        const std::vector<int> more(some.begin(), some.begin() + static_cast<int>(num_before) + 2);
                        (void)factor.inverse_block({some.begin(), some.begin() + static_cast<int>(num_before)});
                        EXPECT_THAT(factor.inverse_block(more, num_before),
                                    IsNear(Eigen::MatrixXd(damped.inverse()(more, more)), 1e-4));
                    }
                }
                Eigen::MatrixXd hidden;
                EXPECT_THAT(factor.inverse_columns(visible.rows(), 7, hidden),
                            IsNear(Eigen::MatrixXd(visible.inverse().leftCols(7)), 1e-4));
                EXPECT_THAT(hidden,
                            IsNear(Eigen::MatrixXd(arrow.all.inverse().block(0, num_hidden, num_hidden, 7)), 1e-4));
                const std::vector<int> kept = {0, 2, 7, 8, 9, 11, static_cast<int>(visible.rows()) - 1};
                const detail::ArrowMatrix block = arrow.matrix.block(kept);
                ASSERT_TRUE(factor.factor(block, 0.0));
                EXPECT_THAT(factor.inverse_columns(7, 4, hidden),
                            IsNear(Eigen::MatrixXd(Eigen::MatrixXd(visible(kept, kept)).inverse().leftCols(4)), 1e-4));
                factor.factor(visible); // nothing of the arrow stays
                EXPECT_THAT(solved(factor, b), IsNear(Eigen::MatrixXd(visible.inverse() * b), 1e-4));
                for (const int bad : {num_hidden, static_cast<int>(arrow.all.rows()) - 1}) { // shared, own
                    Arrow indefinite = arrow;
                    indefinite.all(bad, bad) = -1;
                    indefinite.pack();
                    EXPECT_FALSE(factor.factor(indefinite.matrix, 0.0)) << bad;
                }
            }
        }
    }
}

TEST(PositiveFactor, SolvesForOneOfAnyWidth)
{
    for (const int num_hidden : {kernels::max_width_for_one - 26, kernels::max_width_for_one + 4}) { // in threes
        Random random(826);
        const Arrow arrow(random, {3, 2}, num_hidden, 9);
        const Eigen::MatrixXd visible = arrow.visible();
        const Eigen::MatrixXd b = test::random_normal(random, visible.rows());
        const bool is_within = arrow.matrix.shared_width <= kernels::max_width_for_one;
        EXPECT_EQ(is_within, num_hidden < kernels::max_width_for_one);
        for (const kernels::Kernels* set : kernels::supported_kernels()) {
            detail::PositiveFactor factor(set);
            ASSERT_TRUE(factor.factor(arrow.matrix, 0.0)) << set->name;
            EXPECT_THAT(solved(factor, b), IsNear(Eigen::MatrixXd(visible.inverse() * b), 1e-4)) << set->name;
        }
    }
}

/// The inverse of some unknowns' block, and each other unknown's deviation if it were among them.
void expect_inverse(detail::ArrowInverse& inverse, const kernels::Kernels& set, const Arrow& arrow,
                    const std::vector<int>& held)
{
    const Eigen::MatrixXd visible = arrow.visible();
    std::vector<int> free;
    for (int i = 0; i < static_cast<int>(visible.rows()); ++i) {
        if (std::find(held.begin(), held.end(), i) == held.end()) {
            free.push_back(i);
        }
    }
    const Eigen::MatrixXd expected = Eigen::MatrixXd(visible(free, free)).inverse();
    Eigen::VectorXd deviations;
    inverse.find(set, arrow.matrix, free, deviations);
    ASSERT_EQ(deviations.size(), visible.rows());
    EXPECT_THAT(Eigen::VectorXd(deviations(free)), IsNear(Eigen::VectorXd(expected.diagonal().cwiseSqrt()), 1e-6));
    for (const int k : held) {
        std::vector<int> with_k = free;
        with_k.push_back(k);
        const Eigen::MatrixXd of_both = Eigen::MatrixXd(visible(with_k, with_k)).inverse();
        EXPECT_NEAR(deviations[k], std::sqrt(of_both.bottomRightCorner<1, 1>().value()), 1e-6) << k;
    }
    int begin = arrow.matrix.num_shared;
    for (std::size_t f = 0; f < arrow.matrix.counts.size(); ++f) {
        std::vector<int> positions; // of shared and the image's own among the free
        const int end = begin + arrow.matrix.counts[f];
        for (std::size_t i = 0; i < free.size(); ++i) {
            if (free[i] < arrow.matrix.num_shared || (free[i] >= begin && free[i] < end)) {
                positions.push_back(static_cast<int>(i));
            }
        }
        std::vector<int> unknowns;
        Eigen::MatrixXd block;
        inverse.set_block_of_image(f, unknowns, block);
        ASSERT_EQ(unknowns.size(), positions.size());
        for (std::size_t i = 0; i < positions.size(); ++i) {
            EXPECT_EQ(unknowns[i], free[static_cast<std::size_t>(positions[i])]);
        }
        EXPECT_THAT(block, IsNear(Eigen::MatrixXd(expected(positions, positions)), 1e-6)) << "image " << f;
        begin = end;
    }
}

TEST(ArrowInverse, IsThatOfTheWholeMatrix)
{
    for (const kernels::Kernels* set : kernels::supported_kernels()) {
        Random random(824);
        detail::ArrowInverse inverse; // whatever it held before
        for (const int num_hidden : {0, 6}) {
            for (const std::vector<int>& held :
                 {std::vector<int>{}, {2, 8, 9, 20, 27, 38}, {9, 10, 11, 12, 37}, {0, 1, 2, 3, 4, 5, 6, 7, 8}}) {
                SCOPED_TRACE(set->name + std::string(", hidden ") + std::to_string(num_hidden) + ", held " +
                             std::to_string(held.size()));
                expect_inverse(inverse, *set, Arrow(random, {4, 19, 0, 7}, num_hidden, 9), held);
            }
        }
    }
}

TEST(ArrowInverse, OfWhatIsNotPositiveDefiniteToSinglePrecisionIsNotANumber)
{
    for (const kernels::Kernels* set : kernels::supported_kernels()) {
        Random random(825);
        const Arrow arrow(random, {4, 19}, 6, 9);
        std::vector<int> free(32);
        std::iota(free.begin(), free.end(), 0);
        // Hidden, shared, own; and the one eliminated last, to rounding only.
        for (const auto& [bad, pivot] :
             {std::pair(0, -1.0), std::pair(6, -1.0), std::pair(37, -1.0), std::pair(14, 1e-7)}) {
            Arrow indefinite = arrow;
            const double least = arrow.all(bad, bad) - 1 / arrow.all.inverse()(bad, bad); // singular
            indefinite.all(bad, bad) = least + pivot * arrow.all(bad, bad);
            indefinite.pack();
            detail::ArrowInverse inverse;
            Eigen::VectorXd deviations;
            inverse.find(*set, indefinite.matrix, free, deviations);
            EXPECT_TRUE(deviations.array().isNaN().all()) << set->name << " " << bad << " " << pivot;
        }
    }
}

TEST(PositiveFactor, ManyImagesAreSparse)
{
    detail::ArrowMatrix matrix;
    for (const int num_images : {2, 10, 100}) { // of 51 biases and 60 coefficients
        matrix.set_zero(std::vector<int>(num_images, 12), 153, 60);
        EXPECT_EQ(matrix.is_sparse(), num_images == 100) << num_images;
    }
}

} // namespace
} // namespace lineament
