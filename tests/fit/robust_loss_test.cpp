// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/robust_loss.hpp"

#include "lineament/core/random.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace lineament {
namespace {

TEST(RobustLoss, WeightIsTheDerivativeAndTheLossNeverFalls)
{
    for (const RobustLoss loss : {RobustLoss::none, RobustLoss::student_t, RobustLoss::geman_mcclure}) {
        for (const int dimensions : {1, 2}) {
            EXPECT_EQ(robust_loss(loss, 0.0, dimensions), 0.0);
            for (const double u : {0.1, 1.0, 10.0, 1000.0}) {
                const double step = 1e-5 * u;
                const double numeric =
                    (robust_loss(loss, u + step, dimensions) - robust_loss(loss, u - step, dimensions)) / (2 * step);
                EXPECT_NEAR(robust_weight(loss, u, dimensions), numeric, 1e-6);
                EXPECT_GE(numeric, 0);
                const double slope =
                    (robust_weight(loss, u + step, dimensions) - robust_weight(loss, u - step, dimensions)) /
                    (2 * step);
                EXPECT_NEAR(robust_derivatives(loss, u, dimensions).curvature,
                            std::max(0.1 * numeric, numeric + 2.0 / dimensions * u * slope), 1e-6);
                EXPECT_EQ(robust_derivatives(loss, u, dimensions, 1.0).curvature, robust_weight(loss, u, dimensions));
            }
        }
    }
    EXPECT_EQ(robust_weight(RobustLoss::none, 1e6, 2), 1.0); // the twin: least squares never doubts
    EXPECT_LT(robust_weight(RobustLoss::student_t, 1e6, 2), 1e-4);
    EXPECT_LT(robust_weight(RobustLoss::geman_mcclure, 1e6, 2), 1e-9);
}

TEST(RobustLoss, SumIsThatOfTheLosses)
{
    Random random(811);
    for (const RobustLoss loss : {RobustLoss::none, RobustLoss::student_t, RobustLoss::geman_mcclure}) {
        RobustSum sum(loss);
        EXPECT_EQ(sum.sum(), 0);
        double expected = 0;
        for (int i = 0; i < 400; ++i) {
            const double u =
                std::pow(10.0, random.uniform(-20, i % 10 == 0 ? 160 : 20)); // products far beyond a double
            const int num_dimensions = 1 + i % 2;
            sum.add(u, num_dimensions);
            expected += robust_loss(loss, u, num_dimensions);
        }
        EXPECT_NEAR(sum.sum() / expected, 1, 1e-13);
    }
    RobustSum sum(RobustLoss::student_t);
    sum.add(std::numeric_limits<double>::infinity(), 2);
    EXPECT_EQ(sum.sum(), std::numeric_limits<double>::infinity());
    sum.add(std::numeric_limits<double>::quiet_NaN(), 2);
    EXPECT_TRUE(std::isnan(sum.sum()));
}

} // namespace
} // namespace lineament
