// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The bounded step of a joint fit, against the plain way to take it: fix what leaves its bounds, solve the rest anew.
#include "lineament/core/random.hpp"
#include "lineament/fit/joint_solver.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <Eigen/Cholesky>

#include <limits>
#include <numeric>
#include <vector>

namespace lineament {
namespace {

using test::IsNear;

detail::JointSystem random_system(Random& random, int size)
{
    detail::JointSystem system;
    const Eigen::MatrixXd rows = test::random_normal(random, 2 * size * size).reshaped(2 * size, size);
    system.hessian = rows.transpose() * rows + Eigen::MatrixXd::Identity(size, size);
    system.gradient = system.hessian * test::random_normal(random, size);
    system.unknowns.resize(static_cast<std::size_t>(size));
    std::iota(system.unknowns.begin(), system.unknowns.end(), 0);
    return system;
}

Eigen::VectorXd bounded_step(const detail::JointSystem& system, detail::PositiveFactor& factor)
{
    detail::StepRoom room;
    Eigen::VectorXd step;
    detail::bounded_step(system, system.gradient, factor, room, step);
    return step;
}

Eigen::VectorXd informed_step(const detail::JointSystem& system, const detail::StepTaken& last,
                              detail::PositiveFactor& factor)
{
    detail::StepRoom room;
    Eigen::VectorXd step;
    detail::informed_step(system, last, factor, room, step);
    return step;
}

/// @return How often it was solved.
int plain_step(const detail::JointSystem& system, Eigen::VectorXd& step)
{
    const Eigen::VectorXd &down = system.down, &up = system.up;
    std::vector<int> free = system.unknowns;
    step.setZero(system.gradient.size());
    for (int count = 1;; ++count) {
        const Eigen::VectorXd right_side = -system.gradient - system.hessian * step;
        const Eigen::VectorXd solved =
            Eigen::MatrixXd(system.hessian(free, free)).llt().solve(Eigen::VectorXd(right_side(free)));
        std::vector<int> inside;
        for (std::size_t i = 0; i < free.size(); ++i) {
            const double goal = solved[static_cast<Eigen::Index>(i)];
            if (goal >= down[free[i]] && goal <= up[free[i]]) {
                inside.push_back(free[i]);
            } else {
                step[free[i]] = goal < down[free[i]] ? down[free[i]] : up[free[i]];
            }
        }
        if (inside.size() == free.size()) {
            step(free) = solved;
            return count;
        }
        if (inside.empty()) {
            return count;
        }
        free = inside;
    }
}

TEST(JointStep, IsThatOfFixingAndSolvingAnew)
{
    std::vector<const kernels::Kernels*> sets = kernels::supported_kernels();
    sets.push_back(nullptr);
    for (const kernels::Kernels* set : sets) {
        SCOPED_TRACE(set != nullptr ? set->name : "Eigen");
        Random random(831);
        detail::PositiveFactor factor(set);
        int most = 0;
        for (const double room : {0.0, 0.3, 1.0, 5.0}) { // all held, many, few, none
            for (int trial = 0; trial < 10; ++trial) {
                const int size = 20;
                detail::JointSystem system = random_system(random, size);
                system.down = -room * test::random_uniform(random, size, 0.5, 1.0);
                system.up = room * test::random_uniform(random, size, 0.5, 1.0);
                factor.factor(system.hessian);
                Eigen::VectorXd expected;
                most = std::max(most, plain_step(system, expected));
                EXPECT_THAT(bounded_step(system, factor), IsNear(expected, set != nullptr ? 1e-3 : 1e-9));
            }
        }
        EXPECT_GE(most, 3); // more is held by what the first ones push
    }
}

TEST(JointStep, LearnsFromTheLastOneWhatItsMatrixGetsWrong)
{
    Random random(833);
    detail::JointSystem system = random_system(random, 12);
    const Eigen::MatrixXd hessian = system.hessian;
    detail::PositiveFactor factor(nullptr);
    factor.factor(3 * hessian); // a third of each step
    system.up = Eigen::VectorXd::Constant(12, 100);
    system.down = -system.up;
    const detail::StepTaken last{bounded_step(system, factor), system.gradient};
    system.gradient += hessian * last.step;
    const Eigen::VectorXd expected = -hessian.llt().solve(system.gradient);
    EXPECT_THAT(informed_step(system, last, factor), IsNear(expected, 1e-9));
    const Eigen::VectorXd plain = bounded_step(system, factor);
    EXPECT_THAT(plain, IsNear(Eigen::VectorXd(expected / 3), 1e-9)); // the twin
    system.up = 0.5 * expected.cwiseAbs();                           // no room for all of it
    system.down = -system.up;
    EXPECT_THAT(informed_step(system, last, factor), IsNear(plain, 1e-9));
}

TEST(JointStep, OfAMatrixThatIsNotPositiveDefiniteIsNotANumber)
{
    Random random(832);
    for (const kernels::Kernels* set :
         {static_cast<const kernels::Kernels*>(nullptr), &kernels::dispatched_kernels()}) {
        detail::JointSystem system = random_system(random, 6);
        system.hessian(2, 2) = -1;
        detail::PositiveFactor factor(set);
        factor.factor(system.hessian);
        system.up = Eigen::VectorXd::Constant(6, std::numeric_limits<double>::infinity());
        system.down = -system.up;
        EXPECT_FALSE(bounded_step(system, factor).allFinite());
    }
}

} // namespace
} // namespace lineament
