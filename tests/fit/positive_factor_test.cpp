// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What the joint fit factors and solves, by Eigen and by the kernels of every instruction set, against Eigen's LU.
#include "lineament/fit/positive_factor_impl.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <Eigen/LU>

#include <vector>

namespace lineament {
namespace {

using test::IsNear;

Eigen::MatrixXd mirrored(const Eigen::MatrixXd& lower)
{
    return lower.selfadjointView<Eigen::Lower>();
}

TEST(PositiveFactor, SolvesAndInvertsWhateverItHeldBefore)
{
    std::vector<const kernels::Kernels*> sets = kernels::supported_kernels();
    sets.push_back(nullptr);
    for (const kernels::Kernels* set : sets) {
        SCOPED_TRACE(set != nullptr ? set->name : "Eigen");
        Random random(821);
        detail::PositiveFactor factor(set);
        for (const Eigen::Index n : {5, 40, 1, 13, 24}) { // smaller and larger ones
            const Eigen::MatrixXd rows = test::random_normal(random, 2 * n * n).reshaped(2 * n, n);
            const Eigen::MatrixXd matrix = rows.transpose() * rows + Eigen::MatrixXd::Identity(n, n);
            const Eigen::VectorXd b = test::random_normal(random, n);
            const Eigen::MatrixXd inverse = matrix.inverse();
            factor.factor(matrix);
            EXPECT_THAT(factor.solve(b), IsNear(Eigen::VectorXd(inverse * b), 1e-9));
            const Eigen::Index leading = (n + 1) / 2;
            EXPECT_THAT(mirrored(factor.lower_inverse(leading)),
                        IsNear(Eigen::MatrixXd(matrix.topLeftCorner(leading, leading).inverse()), 1e-9));
            EXPECT_THAT(factor.solve(b), IsNear(Eigen::VectorXd(inverse * b), 1e-9)); // by the root now
            EXPECT_THAT(mirrored(factor.lower_inverse(n)), IsNear(inverse, 1e-9));

            factor.factor(matrix, 0.5); // nothing of the root stays
            Eigen::MatrixXd damped = matrix;
            damped.diagonal() *= 1.5;
            EXPECT_THAT(factor.solve(b), IsNear(Eigen::VectorXd(damped.inverse() * b), 1e-9));

            const Eigen::MatrixXd columns = test::random_normal(random, 3 * n).reshaped(n, 3);
            const Eigen::MatrixXd half = factor.factor_and_half_solve(matrix, columns);
            EXPECT_THAT(Eigen::MatrixXd(half.transpose() * half),
                        IsNear(Eigen::MatrixXd(columns.transpose() * inverse * columns), 1e-9));
        }
        Eigen::MatrixXd indefinite = Eigen::MatrixXd::Identity(6, 6);
        indefinite(3, 3) = -1;
        factor.factor(indefinite);
        EXPECT_TRUE(factor.solve(Eigen::VectorXd::Ones(6)).hasNaN());
        EXPECT_TRUE(factor.lower_inverse(6).hasNaN());
    }
}

} // namespace
} // namespace lineament
