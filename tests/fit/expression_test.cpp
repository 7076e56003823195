// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/expression.hpp"
#include "lineament/fit/nnls.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <limits>

namespace lineament {
namespace {

using test::IsNear;

constexpr double infinity = std::numeric_limits<double>::infinity();

double objective(const Eigen::MatrixXd& gram, const Eigen::VectorXd& b, const Eigen::VectorXd& x)
{
    return 0.5 * x.dot(gram * x) - b.dot(x);
}

/// The least objective over all 3^n ways to hold variables at their bounds.
double least_by_enumeration(const Eigen::MatrixXd& gram, const Eigen::VectorXd& b, double lower, double upper)
{
    const int size = static_cast<int>(b.size());
    int ways = 1;
    for (int i = 0; i < size; ++i) {
        ways *= 3;
    }
    double least = infinity;
    for (int way = 0; way < ways; ++way) {
        Eigen::VectorXd x = Eigen::VectorXd::Zero(size);
        std::vector<int> free;
        bool is_finite = true;
        for (int i = 0, code = way; i < size; ++i, code /= 3) {
            if (code % 3 == 0) {
                free.push_back(i);
            } else {
                x[i] = code % 3 == 1 ? lower : upper;
                is_finite = is_finite && std::isfinite(x[i]);
            }
        }
        if (!is_finite) {
            continue;
        }
        const Eigen::VectorXd rest = b - gram * x;
        const Eigen::MatrixXd block = gram(free, free);
        const Eigen::VectorXd solution = block.ldlt().solve(Eigen::VectorXd(rest(free)));
        x(free) = solution;
        if ((x.array() >= lower).all() && (x.array() <= upper).all()) {
            least = std::min(least, objective(gram, b, x));
        }
    }
    return least;
}

TEST(BoundedLeastSquares, FindsTheLeastOfAllActiveSets)
{
    Random random(1);
    for (int trial = 0; trial < 200; ++trial) {
        const Eigen::MatrixXd a = test::random_normal(random, 40).reshaped(8, 5);
        const Eigen::MatrixXd gram = a.transpose() * a;
        const Eigen::VectorXd b = 4 * test::random_normal(random, 5);
        const Eigen::VectorXd zero = Eigen::VectorXd::Zero(5);
        const Eigen::VectorXd upper = Eigen::VectorXd::Constant(5, 0.4);
        const BoundedLeastSquaresResult bounded = solve_bounded_least_squares(gram, b, zero, upper, zero, 100);
        ASSERT_EQ(bounded.status, FitStatus::success);
        EXPECT_NEAR(objective(gram, b, bounded.solution), least_by_enumeration(gram, b, 0, 0.4), 1e-10);
        const BoundedLeastSquaresResult nnls = solve_nnls(gram, b, 100);
        ASSERT_EQ(nnls.status, FitStatus::success);
        EXPECT_NEAR(objective(gram, b, nnls.solution), least_by_enumeration(gram, b, 0, infinity), 1e-10);
        // From the inside (all free) the same answer.
        const BoundedLeastSquaresResult inside =
            solve_bounded_least_squares(gram, b, zero, upper, Eigen::VectorXd::Constant(5, 0.2), 100);
        EXPECT_THAT(inside.solution, IsNear(bounded.solution, 1e-10));
    }
}

TEST(Nnls, MeetsTheOptimalityConditions)
{
    Random random(2);
    for (int trial = 0; trial < 20; ++trial) {
        const Eigen::MatrixXd a = test::random_normal(random, 60 * 40).reshaped(60, 40);
        const Eigen::VectorXd b = a.transpose() * test::random_normal(random, 60);
        const BoundedLeastSquaresResult nnls = solve_nnls(a.transpose() * a, b, 500);
        ASSERT_EQ(nnls.status, FitStatus::success);
        EXPECT_GE(nnls.solution.minCoeff(), 0);
        EXPECT_GE(nnls.gradient.minCoeff(), -1e-9);
        EXPECT_LE(nnls.solution.cwiseProduct(nnls.gradient).cwiseAbs().maxCoeff(), 1e-9);
        EXPECT_EQ(nnls.num_at_bound, (nnls.solution.array() == 0).count());
    }
}

TEST(Nnls, SaysSoWhenTheIterationsDoNotSuffice)
{
    Random random(3);
    const Eigen::MatrixXd a = test::random_normal(random, 60 * 20).reshaped(60, 20);
    const Eigen::VectorXd b = a.transpose() * a * Eigen::VectorXd::Ones(20);
    EXPECT_EQ(solve_nnls(a.transpose() * a, b, 3).status, FitStatus::not_converged);
    EXPECT_GE(solve_nnls(a.transpose() * a, b, 3).solution.minCoeff(), 0);
    EXPECT_EQ(solve_nnls(a.transpose() * a, b, 100).status, FitStatus::success);
}

TEST(Nnls, RepeatedAndEmptyColumnsAreHarmless)
{
    Random random(4);
    Eigen::MatrixXd a = test::random_normal(random, 30 * 4).reshaped(30, 4);
    a.col(2) = a.col(1);
    a.col(3).setZero();
    const Eigen::VectorXd b = a.transpose() * (a * Eigen::Vector4d(1, 1, 1, 1));
    const BoundedLeastSquaresResult nnls = solve_nnls(a.transpose() * a, b, 100);
    EXPECT_EQ(nnls.status, FitStatus::success);
    EXPECT_EQ(nnls.solution[3], 0);
    EXPECT_NEAR(nnls.solution[1] + nnls.solution[2], 2, 1e-9);
}

TEST(BoundedLeastSquares, BrokenInputThrows)
{
    const Eigen::MatrixXd gram = Eigen::MatrixXd::Identity(2, 2);
    const Eigen::VectorXd one = Eigen::VectorXd::Ones(2);
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)solve_nnls(gram, Eigen::VectorXd::Ones(3), 9); }, "gram"));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)solve_nnls(gram * infinity, one, 9); }, "gram(0, 0)"));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)solve_bounded_least_squares(gram, one, one, one, one, 9); },
                                              "lower"));
    EXPECT_TRUE(test::throws<InvalidArgument>(
        [&] { (void)solve_bounded_least_squares(gram, one, -one, one, 3 * one, 9); }, "start"));
}

struct Problem
{
    MorphableModel model = test::make_synthetic_face();
    ModelPoints points = landmark_points(model, model.landmark_maps[0], &model.expression_sets[0], 12);
    Camera camera = {};
    Eigen::VectorXd alpha = {};
    Eigen::VectorXd psi = {};

    explicit Problem(std::uint64_t seed)
    {
        Random random(seed);
        camera = test::random_camera(random);
        alpha = test::random_normal(random, 12);
        psi = test::random_uniform(random, 4, 0, 1);
    }

    [[nodiscard]] Eigen::Matrix2Xd seen() const
    {
        const Eigen::Matrix3Xd shape = points.at(alpha, psi);
        return camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(shape));
    }
};

TEST(FitExpression, RecoversThePlantedCoefficientsExactly)
{
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
        Problem problem(seed);
        problem.psi[seed % 4] = 0;
        const ExpressionResult fit = fit_expression(problem.points, problem.seen(), problem.camera, {}, problem.alpha);
        ASSERT_EQ(fit.status, FitStatus::success) << fit.reason;
        EXPECT_THAT(fit.coefficients, IsNear(problem.psi, 1e-8));
    }
}

TEST(FitExpression, PerspectiveConvergesToThePlantedCoefficients)
{
    Problem problem(20);
    problem.camera.phi_per_mm = 1.0 / 500;
    Eigen::VectorXd psi = Eigen::VectorXd::Zero(4);
    for (int iteration = 0; iteration < 20; ++iteration) {
        psi = fit_expression(problem.points, problem.seen(), problem.camera, {}, problem.alpha, {}, psi).coefficients;
    }
    EXPECT_THAT(psi, IsNear(problem.psi, 1e-8));
}

TEST(FitExpression, IsNeverNegativeAndHasNoUpperBoundUnlessAsked)
{
    Problem problem(21);
    problem.psi << 1.7, -0.8, 0.5, 0.0;
    const ExpressionResult open = fit_expression(problem.points, problem.seen(), problem.camera, {}, problem.alpha);
    EXPECT_GE(open.coefficients.minCoeff(), 0);
    EXPECT_GT(open.coefficients[0], 1.2);
    ExpressionOptions options;
    options.upper_bound = 1;
    const ExpressionResult closed =
        fit_expression(problem.points, problem.seen(), problem.camera, {}, problem.alpha, options);
    EXPECT_EQ(closed.coefficients[0], 1.0);
}

TEST(FitExpression, APriorDrawsTowardsZero)
{
    Problem problem(22);
    ExpressionOptions options;
    options.prior_standard_deviations = Eigen::VectorXd::Constant(4, 1e-6);
    const ExpressionResult fit =
        fit_expression(problem.points, problem.seen(), problem.camera, {}, problem.alpha, options);
    EXPECT_THAT(fit.coefficients, IsNear(Eigen::VectorXd::Zero(4), 1e-6));
}

TEST(FitExpression, WithoutPointsItSaysSo)
{
    Problem problem(23);
    const ExpressionResult fit =
        fit_expression(problem.points, problem.seen(), problem.camera, Eigen::VectorXd::Zero(68), problem.alpha);
    EXPECT_EQ(fit.status, FitStatus::too_few_correspondences);
    EXPECT_TRUE(fit.coefficients.isZero(0));
}

} // namespace
} // namespace lineament
