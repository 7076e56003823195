// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/identity.hpp"

#include "support/matchers.hpp"
#include "support/planted_face.hpp"

#include <Eigen/QR>

namespace lineament {
namespace {

using test::IsNear;
using test::synthetic_face;
using ::testing::Not;

const ModelPoints& points()
{
    static const ModelPoints packed =
        landmark_points(synthetic_face(), synthetic_face().landmark_maps[0], &synthetic_face().expression_sets[0], 12);
    return packed;
}

Eigen::Matrix2Xd project(const Camera& camera, const Eigen::Matrix3Xd& shape)
{
    return camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(shape));
}

struct Problem
{
    Camera camera;
    Eigen::VectorXd alpha;
    Eigen::VectorXd psi;
    Eigen::Matrix2Xd seen;
};

Problem plant(Random& random, double noise_px)
{
    Problem problem;
    problem.camera = test::random_camera(random);
    problem.alpha = test::random_normal(random, 12);
    problem.psi = test::random_uniform(random, 4, 0, 1);
    problem.seen = project(problem.camera, points().at(problem.alpha, problem.psi));
    for (Eigen::Index i = 0; i < problem.seen.size(); ++i) {
        problem.seen(i) += noise_px * random.normal();
    }
    return problem;
}

/// A and b of Eq. (4), written out from the model in a second way.
std::pair<Eigen::MatrixXd, Eigen::VectorXd> design(const Problem& problem)
{
    const Eigen::MatrixXd basis = synthetic_face().shape.rescaled_basis().cast<double>();
    const LandmarkMap& map = synthetic_face().landmark_maps[0];
    const Eigen::VectorXf shape =
        synthetic_face().shape.mean + synthetic_face().expression_sets[0].displacement(problem.psi);
    Eigen::MatrixXd a(136, 12);
    Eigen::VectorXd b(136);
    for (int i = 0; i < 68; ++i) {
        const int row = 3 * map.vertices(0, i);
        const Eigen::Matrix<double, 2, 3> scaled =
            problem.camera.scale_px_per_mm * problem.camera.camera_from_model.topRows<2>();
        a.middleRows<2>(2 * i) = scaled * basis.middleRows<3>(row);
        b.segment<2>(2 * i) =
            scaled * shape.segment<3>(row).cast<double>() + problem.camera.image_translation_px() - problem.seen.col(i);
    }
    return {a, b};
}

TEST(FitIdentity, RecoversThePlantedCoefficientsExactly)
{
    Random random(1);
    IdentityOptions options;
    options.regularization = 0;
    for (int trial = 0; trial < 20; ++trial) {
        const Problem problem = plant(random, 0);
        const IdentityResult fit = fit_identity(points(), problem.seen, problem.camera, {}, problem.psi, options);
        ASSERT_EQ(fit.status, FitStatus::success) << fit.reason;
        EXPECT_THAT(fit.coefficients, IsNear(problem.alpha, 1e-6));
    }
}

TEST(FitIdentity, WithoutRegularizationItIsLeastSquaresByQr)
{
    Random random(2);
    const Problem problem = plant(random, 2);
    IdentityOptions options;
    options.regularization = 0;
    options.max_coefficient = 50;
    const auto [a, b] = design(problem);
    const Eigen::VectorXd expected = a.colPivHouseholderQr().solve(-b);
    EXPECT_THAT(fit_identity(points(), problem.seen, problem.camera, {}, problem.psi, options).coefficients,
                IsNear(expected, 1e-4)); // the design here is rounded to float where the solver's is not
}

TEST(FitIdentity, GradientIsZeroAtTheSolution)
{
    Random random(3);
    const Problem problem = plant(random, 3);
    IdentityOptions options;
    options.regularization = 2.5;
    options.landmark_sigma_px = 1.7;
    const Eigen::VectorXd alpha =
        fit_identity(points(), problem.seen, problem.camera, {}, problem.psi, options).coefficients;
    const auto [a, b] = design(problem);
    const double weight = 1 / (1.7 * 1.7);
    const Eigen::VectorXd gradient = weight * a.transpose() * (a * alpha + b) + 2.5 * alpha;
    EXPECT_LE(gradient.norm(), 1e-5 * (weight * a.transpose() * b).norm());
}

TEST(FitIdentity, InfiniteRegularizationGivesTheMean)
{
    Random random(4);
    const Problem problem = plant(random, 3);
    IdentityOptions options;
    options.regularization = 1e14;
    EXPECT_THAT(fit_identity(points(), problem.seen, problem.camera, {}, problem.psi, options).coefficients,
                IsNear(Eigen::VectorXd::Zero(12), 1e-6));
}

TEST(FitIdentity, VarianceTimesCWithRegularizationOverCChangesNothing)
{
    Random random(5);
    const Problem problem = plant(random, 3);
    IdentityOptions one, other;
    one.regularization = 1;
    one.landmark_sigma_px = 3;
    other.regularization = 0.25;
    other.landmark_sigma_px = 6;
    const auto fit = [&](const IdentityOptions& options) {
        return fit_identity(points(), problem.seen, problem.camera, {}, problem.psi, options).coefficients;
    };
    EXPECT_THAT(fit(one), IsNear(fit(other), 1e-10));
    other.regularization = 1;
    EXPECT_THAT(fit(one), Not(IsNear(fit(other), 1e-3)));
}

TEST(FitIdentity, ErrorsAreAsThePosteriorPredicts)
{
    // Truth from the prior, stated noise: (a - truth)^T Lambda (a - truth) is chi-square with m degrees of freedom.
    Random random(6);
    const double sigma_px = 3;
    IdentityOptions options;
    options.landmark_sigma_px = sigma_px;
    options.max_coefficient = 50;
    double sum = 0;
    const int trials = 400;
    for (int trial = 0; trial < trials; ++trial) {
        const Problem problem = plant(random, sigma_px);
        const Eigen::VectorXd error =
            fit_identity(points(), problem.seen, problem.camera, {}, problem.psi, options).coefficients - problem.alpha;
        const Eigen::MatrixXd a = design(problem).first;
        sum += error.dot(a.transpose() * (a * error)) / (sigma_px * sigma_px) + error.squaredNorm();
    }
    EXPECT_NEAR(sum / trials, 12.0, 4 * std::sqrt(2 * 12.0 / trials));
}

TEST(FitIdentity, CoefficientsAreHeldAtFiveAndTheRestIsOptimal)
{
    Random random(7);
    Problem problem = plant(random, 0);
    problem.alpha[2] = 9;
    problem.seen = project(problem.camera, points().at(problem.alpha, problem.psi));
    IdentityOptions options;
    options.regularization = 1e-6;
    const IdentityResult fit = fit_identity(points(), problem.seen, problem.camera, {}, problem.psi, options);
    EXPECT_EQ(fit.status, FitStatus::implausible);
    EXPECT_GE(fit.num_at_bound, 1);
    EXPECT_EQ(fit.coefficients[2], 5.0);
    EXPECT_LE(fit.coefficients.cwiseAbs().maxCoeff(), 5.0);
    const auto [a, b] = design(problem);
    const Eigen::VectorXd gradient = a.transpose() * (a * fit.coefficients + b) / 9;
    const double rounding = 1e-4 * (a.transpose() * b).norm();
    for (int j = 0; j < 12; ++j) {
        if (std::abs(fit.coefficients[j]) < 5) {
            EXPECT_NEAR(gradient[j], 0, rounding);
        } else {
            EXPECT_LT(gradient[j] * fit.coefficients[j], 0);
        }
    }
    options.max_coefficient = 20;
    EXPECT_EQ(fit_identity(points(), problem.seen, problem.camera, {}, problem.psi, options).status,
              FitStatus::success);
}

TEST(FitIdentity, UndeterminedWithoutRegularizationIsDegenerate)
{
    Random random(8);
    const Problem problem = plant(random, 0);
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(68);
    weights.head(5).setOnes(); // 10 equations, 12 unknowns
    IdentityOptions options;
    options.regularization = 0;
    const IdentityResult fit = fit_identity(points(), problem.seen, problem.camera, weights, problem.psi, options);
    EXPECT_EQ(fit.status, FitStatus::degenerate);
    EXPECT_TRUE(fit.coefficients.isZero(0));
    options.regularization = 1;
    EXPECT_EQ(fit_identity(points(), problem.seen, problem.camera, weights, problem.psi, options).status,
              FitStatus::success);
    weights.setZero();
    EXPECT_EQ(fit_identity(points(), problem.seen, problem.camera, weights, problem.psi, options).status,
              FitStatus::too_few_correspondences);
}

TEST(FitIdentity, PerspectiveConvergesToThePlantedCoefficients)
{
    Random random(9);
    Problem problem = plant(random, 0);
    problem.camera.phi_per_mm = 1.0 / 500;
    problem.seen = project(problem.camera, points().at(problem.alpha, problem.psi));
    IdentityOptions options;
    options.regularization = 0;
    Eigen::VectorXd alpha = Eigen::VectorXd::Zero(12);
    for (int iteration = 0; iteration < 20; ++iteration) {
        alpha = fit_identity(points(), problem.seen, problem.camera, {}, problem.psi, options, alpha).coefficients;
    }
    EXPECT_THAT(alpha, IsNear(problem.alpha, 1e-6));
}

TEST(IdentitySystem, StackedImagesComeNearerTheTruthAsThePosteriorPredicts)
{
    Random random(10);
    const double sigma_px = 3;
    const int persons = 100;
    double error_one = 0, error_ten = 0, predicted = 0;
    IdentityOptions options;
    options.max_coefficient = 50;
    for (int person = 0; person < persons; ++person) {
        const Eigen::VectorXd alpha = test::random_normal(random, 12);
        IdentitySystem system(12);
        for (int image = 1; image <= 10; ++image) {
            Problem problem = plant(random, 0);
            problem.seen = project(problem.camera, points().at(alpha, problem.psi));
            for (Eigen::Index i = 0; i < problem.seen.size(); ++i) {
                problem.seen(i) += sigma_px * random.normal();
            }
            system.add(points(), problem.seen, Eigen::VectorXd::Constant(68, 1 / (sigma_px * sigma_px)), problem.camera,
                       problem.psi, Eigen::VectorXd());
            if (image == 1) {
                error_one += (system.solve(options).coefficients - alpha).squaredNorm();
            }
        }
        const Eigen::VectorXd error = system.solve(options).coefficients - alpha;
        const Eigen::MatrixXd gram = system.gram().selfadjointView<Eigen::Lower>();
        error_ten += error.squaredNorm();
        predicted += error.dot(gram * error) + error.squaredNorm(); // chi-square with 12 degrees of freedom
    }
    EXPECT_LT(error_ten, error_one);
    EXPECT_NEAR(predicted / persons, 12.0, 4 * std::sqrt(2 * 12.0 / persons));
}

TEST(FitIdentity, BrokenInputThrows)
{
    Random random(11);
    const Problem problem = plant(random, 0);
    const auto fit = [&](const Eigen::VectorXd& weights, const Eigen::VectorXd& psi, const IdentityOptions& options) {
        (void)fit_identity(points(), problem.seen, problem.camera, weights, psi, options);
    };
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { fit(Eigen::VectorXd::Ones(3), {}, {}); }, "weights"));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { fit({}, Eigen::VectorXd::Ones(5), {}); }, "at most 4"));
    IdentityOptions options;
    options.regularization = -1;
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { fit({}, {}, options); }, "regularization"));
}

} // namespace
} // namespace lineament
