// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What the joint fit factors and solves, by Eigen and by the kernels of every instruction set, against Eigen's LU.
#include "lineament/fit/positive_factor_impl.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <vector>

namespace lineament {
namespace {

using test::IsNear;

Eigen::MatrixXd solved(detail::PositiveFactor& factor, Eigen::MatrixXd columns)
{
    factor.solve(columns);
    return columns;
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
            EXPECT_NEAR(factor.inverse_trace(leading, count, {}), of_leading.topLeftCorner(count, count).trace(),
                        rounding);
            const Eigen::MatrixXd weights = matrix.topLeftCorner(count, count);
            EXPECT_NEAR(factor.inverse_trace(leading, count, weights),
                        (weights * of_leading.topLeftCorner(count, count)).trace(), 10 * rounding);

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
            const Eigen::VectorXd explained = factor.factor_block(lower, block, others);
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

} // namespace
} // namespace lineament
