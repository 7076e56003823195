// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Derivatives, optimality and certainty of the joint fit.
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/joint_image.hpp"
#include "lineament/fit/joint_solver.hpp"

#include "planted_images.hpp"
#include "support/matchers.hpp"

#include <Eigen/LU>

namespace lineament {
namespace {

using test::centre;
using test::given;
using test::IsNear;
using test::plant;
using test::Planted;
using test::synthetic_face;
using test::with_bias;

FitOptions prepared()
{
    FitOptions options;
    options.contour = ContourMode::fixed;
    return options;
}

const FaceFitter& base()
{
    static const FaceFitter fitter(synthetic_face(), "ibug68", prepared());
    return fitter;
}

/// Energy and state of a round, made of the same parts as the fitter's but from outside.
detail::JointSystem linearized(const detail::JointProblem& problem, const detail::JointState& state)
{
    std::vector<detail::PlacedPoints> placed;
    problem.place(state, placed);
    detail::JointSystem system;
    problem.linearize(state, placed, system);
    return system;
}

struct Round
{
    Round(const Planted& planted, const JointOptions& options, const std::vector<JointFitResult>& at)
        : prior(synthetic_face().shape.num_coefficients()),
          problem(options, prior, synthetic_face().expression_sets[0].num_coefficients())
    {
        state.alpha = at.front().fit.shape_coefficients;
        for (std::size_t f = 0; f < at.size(); ++f) {
            const detail::JointPoints points{detail::PackedPoints(base().landmark_points())}; // the outline is fixed
            detail::JointImageMatcher matcher;
            matcher.begin({base(), points, options}, planted.images[f], {});
            detail::JointImage image;
            matcher.set_fixed_points(image);
            matcher.match(at[f].fit.camera, state.alpha, at[f].fit.expression_coefficients,
                          {at[f].matched_scale_px_per_mm, static_cast<int>(at.size()), 0, options.bias_sigma_mm > 0},
                          image);
            image.scale_strength = at[f].scale_strength;
            problem.images.push_back(image);
            state.cameras.push_back(at[f].fit.camera);
            const double scale = at[f].fit.camera.scale_px_per_mm / at[f].matched_scale_px_per_mm;
            state.psi.push_back(scale * at[f].fit.expression_coefficients);
        }
        if (options.bias_sigma_mm > 0) {
            state.bias = Eigen::Matrix3Xd::Constant(3, base().landmark_map().num_landmarks(), 0.7);
            const double variance = options.bias_sigma_mm * options.bias_sigma_mm;
            problem.bias_variances_mm = Eigen::Matrix3Xd::Constant(3, state.bias.cols(), variance);
            problem.bias_variances_mm.row(2) *= 4; // wider in depth
        }
        problem.reference_scale = state.cameras[0].scale_px_per_mm;
        state.phi_per_mm = state.cameras[0].phi_per_mm;
    }

    /// Half the energy's derivative by each unknown but the biases, by central differences; one-sided at a bound.
    [[nodiscard]] Eigen::VectorXd numeric_gradient() const
    {
        const detail::JointSystem system = linearized(problem, state);
        Eigen::VectorXd down, up, gradient(problem.num_unknowns());
        problem.room(state, down, up);
        for (Eigen::Index i = 0; i < gradient.size(); ++i) {
            const double back = std::max(down[i], -1e-5), forth = std::min(up[i], 1e-5);
            const Eigen::VectorXd unit = Eigen::VectorXd::Unit(gradient.size(), i);
            const auto energy_at = [&](double step) {
                detail::JointState moved;
                problem.move(state, system, step * unit, 0.0, moved);
                moved.bias = state.bias;
                std::vector<detail::PlacedPoints> placed;
                problem.place(moved, placed);
                return problem.energy(moved, placed);
            };
            gradient[i] = 0.5 * (energy_at(forth) - energy_at(back)) / (forth - back);
        }
        return gradient;
    }

    detail::IdentityPrior prior;
    detail::JointProblem problem;
    detail::JointState state;
};

TEST(JointFitter, GradientAgreesWithDifferencesOfTheEnergy)
{
    Random random(141);
    for (const double bias_sigma_mm : {0.0, 1.5}) {
        const bool has_phi = bias_sigma_mm > 0;
        JointOptions options = given();
        options.bias_sigma_mm = bias_sigma_mm;
        if (has_phi) {
            options.phi_sigma_per_mm = 0.002;
        }
        const Planted planted = plant(random, 2, 2.0, 0, has_phi ? 0.0025 : 0);
        JointFramesResult result = JointFitter(synthetic_face(), "ibug68", options).fit_frames(planted.images, centre);
        for (JointFitResult& frame : result.frames) { // away from the solution
            frame.fit.shape_coefficients.array() += 0.3;
            frame.fit.expression_coefficients.array() = 0.4;
        }
        const Round round(planted, options, result.frames);
        const Eigen::VectorXd numeric = round.numeric_gradient();
        const detail::JointSystem system = linearized(round.problem, round.state);
        Eigen::VectorXd analytic = system.gradient; // with the part that eliminating the biases took off
        for (Eigen::Index b = 0; b < round.state.bias.cols(); ++b) {
            analytic += system.bias_coupling.middleCols<3>(3 * b) *
                        (system.bias_inverse.middleCols<3>(3 * b) * system.bias_gradient.col(b));
        }
        EXPECT_GT(numeric.norm(), 10);
        EXPECT_THAT(analytic, IsNear(numeric, 5e-4 * numeric.cwiseAbs().maxCoeff()));
    }
}

TEST(JointFitter, GradientIsZeroWhereFreeAndPointsOutAtBounds)
{
    Random random(142);
    int num_held = 0;
    for (int trial = 0; trial < 8; ++trial) {
        const Planted planted = plant(random, 1, 2.0);
        const JointFitter fitter(synthetic_face(), "ibug68", given());
        const JointFitResult result = fitter.fit(planted.images[0], centre);
        ASSERT_EQ(result.fit.status, FitStatus::success) << result.fit.reason;
        const Round round(planted, fitter.options(), {result});
        const Eigen::VectorXd gradient = round.numeric_gradient();
        const Eigen::Index begin = round.problem.own_begin(0);
        EXPECT_LE(gradient.head(begin).cwiseAbs().maxCoeff(), 2e-3);
        EXPECT_LE(gradient.tail<6>().cwiseAbs().maxCoeff(), 2e-3);
        for (Eigen::Index k = 0; k < result.fit.expression_coefficients.size(); ++k) {
            const double psi = result.fit.expression_coefficients[k];
            EXPECT_GE(psi, 0);
            EXPECT_LE(psi, 1);
            if (psi == 0) {
                EXPECT_GE(gradient[begin + k], -1e-3);
                ++num_held;
            } else if (psi == 1) {
                EXPECT_LE(gradient[begin + k], 1e-3);
            } else {
                EXPECT_NEAR(gradient[begin + k], 0, 2e-3);
            }
        }
        // The twin: without the scale term the energy still falls as the scale grows.
        Round without(planted, fitter.options(), {result});
        without.problem.images[0].scale_strength = 0;
        EXPECT_LT(without.numeric_gradient()[round.problem.camera_begin(0) + 3], -1);
    }
    EXPECT_GT(num_held, 0);
}

/// The shape coefficients and expressions among the unknowns.
std::vector<int> linear_unknowns(const detail::JointProblem& problem)
{
    std::vector<int> linear;
    for (int i = 0; i < static_cast<int>(problem.num_unknowns()); ++i) {
        if (!problem.is_camera(i)) {
            linear.push_back(i);
        }
    }
    return linear;
}

double log_determinant(const Eigen::MatrixXd& matrix)
{
    const Eigen::MatrixXd root = matrix.llt().matrixL();
    return 2 * root.diagonal().array().log().sum();
}

TEST(JointFitter, BiasesEliminatedAreBiasesAmongTheUnknowns)
{
    // The same offsets once as biases and once as coefficients of a model with a component for each.
    Random random(143);
    const JointOptions options = with_bias(1.5);
    const Planted planted = plant(random, 3, 2.0, 1.5);
    Round round(planted, options,
                JointFitter(synthetic_face(), "ibug68", options).fit_frames(planted.images, centre).frames);
    round.state.bias.setZero();
    const Eigen::Index num_shape = synthetic_face().shape.num_coefficients();
    const Eigen::Index num_biases = round.state.bias.size();
    const detail::IdentityPrior wide_prior(num_shape + num_biases);
    detail::JointProblem wide(options, wide_prior, synthetic_face().expression_sets[0].num_coefficients());
    detail::JointState wide_state = round.state;
    wide_state.bias.resize(3, 0);
    wide_state.alpha = Eigen::VectorXd::Zero(num_shape + num_biases);
    wide_state.alpha.head(num_shape) = round.state.alpha;
    for (std::size_t f = 0; f < round.problem.images.size(); ++f) {
        round.problem.images[f].matched_scale = round.state.cameras[f].scale_px_per_mm; // there both mean the same
        detail::JointImage image = round.problem.images[f];
        const detail::PackedRows narrow = image.points.identity;
        image.points.identity = detail::PackedRows(image.points.num_points, num_shape + num_biases);
        for (Eigen::Index i = 0; i < image.points.num_points; ++i) {
            auto rows = image.points.identity.of_point(i);
            rows.topRows(num_shape) = narrow.of_point(i);
            int& bias_index = image.used[static_cast<std::size_t>(i)].bias_index;
            rows.block<3, 3>(num_shape + 3 * bias_index, 0).diagonal() << 1.5, 1.5, 3.0;
            bias_index = -1;
        }
        wide.images.push_back(image);
    }
    const detail::JointSystem system = linearized(round.problem, round.state);
    const detail::JointSystem wide_system = linearized(wide, wide_state);
    std::vector<int> kept, biases;
    for (int i = 0; i < static_cast<int>(wide.num_unknowns()); ++i) {
        (i < num_shape || i >= num_shape + num_biases ? kept : biases).push_back(i);
    }
    const Eigen::MatrixXd all = wide_system.hessian.selfadjointView<Eigen::Lower>();
    const Eigen::MatrixXd cross = all(biases, kept);
    const Eigen::LLT<Eigen::MatrixXd> block(Eigen::MatrixXd(all(biases, biases)));
    const Eigen::MatrixXd expected = Eigen::MatrixXd(all(kept, kept)) - cross.transpose() * block.solve(cross);
    const Eigen::VectorXd bias_gradient = wide_system.gradient(biases);
    const Eigen::VectorXd expected_gradient =
        Eigen::VectorXd(wide_system.gradient(kept)) - cross.transpose() * block.solve(bias_gradient);
    EXPECT_THAT(Eigen::MatrixXd(system.hessian.selfadjointView<Eigen::Lower>()),
                IsNear(expected, 1e-9 * expected.cwiseAbs().maxCoeff()));
    EXPECT_THAT(system.gradient, IsNear(expected_gradient, 1e-8 * (1 + bias_gradient.cwiseAbs().maxCoeff())));
    EXPECT_GT((cross.transpose() * block.solve(cross)).norm(), 1); // the twin: they do matter
    const Eigen::VectorXd step = 0.01 * test::random_normal(random, round.problem.num_unknowns());
    detail::JointState next;
    round.problem.move(round.state, system, step, 0.0, next);
    const Eigen::Matrix3Xd& moved = next.bias;
    const Eigen::VectorXd deviations = Eigen::Vector3d(1.5, 1.5, 3.0).replicate(num_biases / 3, 1);
    const Eigen::VectorXd expected_bias =
        -deviations.cwiseProduct(Eigen::VectorXd(block.solve(bias_gradient + cross * step)));
    EXPECT_THAT(Eigen::Map<const Eigen::VectorXd>(moved.data(), num_biases), IsNear(expected_bias, 1e-8));
}

TEST(JointFitter, ScaleStrengthIsTheDerivativeOfTheLogDeterminant)
{
    // Eq. (14) against differences of log det Lambda over one image's scale.
    Random random(144);
    const Planted planted = plant(random, 2, 2.0);
    for (const double bias_sigma_mm : {0.0, 1.5}) {
        JointOptions options = with_bias(bias_sigma_mm);
        options.loss = RobustLoss::none; // weights that do not move with the scale
        Round round(planted, options,
                    JointFitter(synthetic_face(), "ibug68", options).fit_frames(planted.images, centre).frames);
        for (Eigen::VectorXd& psi : round.state.psi) {
            psi.setConstant(0.5); // none at a bound
        }
        round.problem.images[1].matched_scale = round.state.cameras[1].scale_px_per_mm;
        const auto log_determinant_at = [&](double log_factor) {
            detail::JointState state = round.state;
            state.cameras[1].scale_px_per_mm *= std::exp(log_factor);
            const detail::JointSystem system = linearized(round.problem, state);
            const std::vector<int> linear = linear_unknowns(round.problem);
            double sum = log_determinant(system.hessian(linear, linear));
            for (Eigen::Index b = 0; b < state.bias.cols(); ++b) {
                sum -= log_determinant(system.bias_inverse.middleCols<3>(3 * b));
            }
            return sum;
        };
        const double numeric = (log_determinant_at(1e-4) - log_determinant_at(-1e-4)) / 2e-4;
        detail::JointSystem system = linearized(round.problem, round.state);
        detail::PositiveFactor factor(nullptr);
        factor.factor(system.hessian);
        detail::refresh_scale_strengths(round.problem, round.state, system, factor);
        EXPECT_NEAR(2 * round.problem.images[1].scale_strength, numeric, 1e-4 * numeric);
        EXPECT_GT(numeric, 2);
    }
}

TEST(JointFitter, ScaleIsUnbiased)
{
    Random random(145);
    double sum = 0;
    const int count = 60;
    for (int trial = 0; trial < count; ++trial) {
        const Planted planted = plant(random, 1, 2.4);
        const JointFitResult result = JointFitter(synthetic_face(), "ibug68", given()).fit(planted.images[0], centre);
        sum += result.fit.camera.scale_px_per_mm / planted.cameras[0].scale_px_per_mm;
    }
    EXPECT_NEAR(sum / count, 1, 0.02);
}

TEST(JointFitter, IntervalsCoverThePlantedTruth)
{
    Random random(146);
    int num_inside = 0, num_inside_known_pose = 0, num_all = 0;
    double chi_square = 0;
    for (int trial = 0; trial < 120; ++trial) {
        const Planted planted = plant(random, 1, 2.4);
        const JointFitter fitter(synthetic_face(), "ibug68", given());
        const JointFitResult result = fitter.fit(planted.images[0], centre);
        ASSERT_EQ(result.fit.status, FitStatus::success);
        const Eigen::Index num_shape = planted.alpha.size();
        const Eigen::VectorXd deviation = result.covariance.diagonal().head(num_shape).cwiseSqrt();
        const Round round(planted, fitter.options(), {result});
        const Eigen::MatrixXd hessian = linearized(round.problem, round.state).hessian.selfadjointView<Eigen::Lower>();
        const Eigen::MatrixXd information = hessian.topLeftCorner(num_shape, num_shape);
        const Eigen::VectorXd known_pose = information.inverse().diagonal().cwiseSqrt();
        for (Eigen::Index j = 0; j < num_shape; ++j) {
            const double error = std::abs(result.fit.shape_coefficients[j] - planted.alpha[j]);
            num_inside += error <= 1.645 * deviation[j];
            num_inside_known_pose += error <= 1.645 * known_pose[j];
            ++num_all;
        }
        chi_square += result.fit.chi_square / result.fit.degrees_of_freedom;
    }
    EXPECT_GE(num_inside, 0.85 * num_all);
    EXPECT_LE(num_inside, 0.95 * num_all);
    EXPECT_LT(num_inside_known_pose, 0.8 * num_all); // the twin: as if the pose were known
    EXPECT_NEAR(chi_square / 120, 1, 0.15);
}

TEST(JointFitter, CertaintyIsLeftOutOnRequestAndNothingElse)
{
    Random random(161);
    const Planted planted = plant(random, 3, 2.0);
    JointOptions options = with_bias(2.0);
    const JointFitter fitter(synthetic_face(), "ibug68", options);
    options.with_covariance = false;
    const JointFitter plain(synthetic_face(), "ibug68", options);
    const JointFramesResult full = fitter.fit_frames(planted.images, centre);
    const JointFramesResult bare = plain.fit_frames(planted.images, centre);
    EXPECT_EQ(bare.status, full.status);
    EXPECT_EQ(bare.shape_coefficients, full.shape_coefficients);
    EXPECT_EQ(bare.chi_square, full.chi_square);
    EXPECT_GT(full.shape_covariance.size(), 0);
    EXPECT_EQ(bare.shape_covariance.size(), 0);
    for (std::size_t f = 0; f < full.frames.size(); ++f) {
        EXPECT_EQ(bare.frames[f].fit.expression_coefficients, full.frames[f].fit.expression_coefficients);
        EXPECT_EQ(bare.frames[f].covariance.size(), 0);
        EXPECT_EQ(bare.frames[f].expression_deviations.size(), 0);
        EXPECT_EQ(plain.identity_information(planted.images[f], bare.frames[f]).matrix,
                  fitter.identity_information(planted.images[f], full.frames[f]).matrix);
    }
}

TEST(JointFitter, UnobservableExpressionsAreThoseTheLandmarksHardlySee)
{
    Random random(225);
    const Eigen::Index at = synthetic_face().shape.num_coefficients() + 1;
    MorphableModel dim = synthetic_face();
    dim.expression_sets[0].offsets.col(1) *= 1e-3f;
    const JointFitter fitter(dim, "ibug68", given());
    const double prior = fitter.options().expression_sigma;
    int num_held = 0; // the noise pulls it up, or down to its bound 0
    const int count = 12;
    for (int trial = 0; trial < count; ++trial) {
        const JointFitResult result = fitter.fit(plant(random, 1, 2.0).images[0], centre);
        ASSERT_EQ(result.fit.status, FitStatus::success) << result.fit.reason;
        EXPECT_EQ(result.unobservable_expressions, std::vector<std::string>{dim.expression_sets[0].names[1]});
        num_held += result.covariance(at, at) == 0;
        EXPECT_EQ(result.covariance(at, at) == 0, result.fit.expression_coefficients[1] == 0);
        EXPECT_NEAR(result.expression_deviations[1], prior, 0.01 * prior);
        EXPECT_LT(result.expression_deviations[0], 0.7 * prior);
        for (Eigen::Index k = 0; k < result.expression_deviations.size(); ++k) {
            const double variance = result.covariance(at - 1 + k, at - 1 + k);
            if (variance > 0) {
                EXPECT_NEAR(result.expression_deviations[k], std::sqrt(variance), 1e-9);
            }
        }
    }
    EXPECT_GT(num_held, 0);
    EXPECT_LT(num_held, count);
    const JointFitter seeing(synthetic_face(), "ibug68", given()); // the twin: nothing is hidden
    EXPECT_TRUE(seeing.fit(plant(random, 1, 2.0).images[0], centre).unobservable_expressions.empty());
}

TEST(UnobservableExpressions, AreToldOfAFitByAnotherMethodToo)
{
    Random random(149);
    MorphableModel dim = synthetic_face();
    dim.expression_sets[0].offsets.col(1) *= 1e-3f; // moves nothing that can be seen
    FitOptions options;
    options.contour = ContourMode::fixed;
    const LandmarkSet set = plant(random, 1, 2.0).images[0];
    const FitResult fit = FaceFitter(dim, "ibug68", options).fit(set, centre);
    ASSERT_EQ(fit.status, FitStatus::success) << fit.reason;
    const JointFitter joint(dim, "ibug68", given());
    EXPECT_EQ(joint.unobservable_expressions(set, fit), std::vector<std::string>{dim.expression_sets[0].names[1]});
    // Of its own fits it says what they say.
    const JointFitResult own = joint.fit(set, centre);
    EXPECT_EQ(joint.unobservable_expressions(set, own.fit), own.unobservable_expressions);
    const JointFitter seeing(synthetic_face(), "ibug68", given());
    EXPECT_TRUE(
        seeing.unobservable_expressions(set, FaceFitter(synthetic_face(), "ibug68", options).fit(set, centre)).empty());
    FitResult neutral = fit;
    neutral.status = FitStatus::degenerate;
    EXPECT_TRUE(joint.unobservable_expressions(set, neutral).empty());
    neutral.shape_coefficients.resize(3);
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)joint.unobservable_expressions(set, neutral); },
                                              "shape_coefficients"));
}

TEST(VertexStandardDeviations, AreTheRootsOfTheDiagonalOfTheVertexCovariance)
{
    Random random(147);
    const Planted planted = plant(random, 1, 2.0);
    const JointFitResult result = JointFitter(synthetic_face(), "ibug68", given()).fit(planted.images[0], centre);
    const Eigen::Index num_shape = planted.alpha.size();
    const Eigen::MatrixXd basis = synthetic_face().shape.rescaled_basis().cast<double>();
    const Eigen::MatrixXd offsets = synthetic_face().expression_sets[0].offsets.cast<double>();
    const Eigen::MatrixXd shape_covariance = result.covariance.topLeftCorner(num_shape, num_shape);
    const Eigen::Matrix3Xf neutral = vertex_standard_deviations(synthetic_face(), shape_covariance);
    const Eigen::Matrix3Xf whole = vertex_standard_deviations(synthetic_face(), result);
    for (const int vertex : {0, 100, 700}) {
        Eigen::MatrixXd rows(3, num_shape + offsets.cols());
        rows << basis.middleRows<3>(3 * vertex), offsets.middleRows<3>(3 * vertex);
        const Eigen::Vector3d expected = (rows * result.covariance * rows.transpose()).diagonal().cwiseSqrt();
        EXPECT_THAT(whole.col(vertex), IsNear(expected, 1e-3));
        const Eigen::MatrixXd neutral_rows = rows.leftCols(num_shape);
        const Eigen::Vector3d expected_neutral =
            (neutral_rows * shape_covariance * neutral_rows.transpose()).diagonal().cwiseSqrt();
        EXPECT_THAT(neutral.col(vertex), IsNear(expected_neutral, 1e-3));
    }
    EXPECT_TRUE(test::throws<InvalidArgument>(
        [&] { (void)vertex_standard_deviations(synthetic_face(), Eigen::MatrixXd::Zero(13, 13)); }, "at most 12"));
    EXPECT_TRUE(test::throws<InvalidArgument>(
        [&] { (void)vertex_standard_deviations(synthetic_face(), JointFitResult{}); }, "result.covariance"));
}

TEST(PredictedRms, IsTheErrorOfFacesDrawnFromThePosterior)
{
    Random random(148);
    const Planted planted = plant(random, 1, 2.0);
    const JointFitResult result = JointFitter(synthetic_face(), "ibug68", given()).fit(planted.images[0], centre);
    const Eigen::Index num_shape = planted.alpha.size();
    const Eigen::MatrixXd covariance = result.covariance.topLeftCorner(num_shape, num_shape);
    const double predicted = predicted_rms_mm(synthetic_face(), covariance);
    const Eigen::MatrixXd root = covariance.llt().matrixL();
    const Eigen::VectorXf neutral = synthetic_face().shape.instance(result.fit.shape_coefficients);
    double sum = 0;
    const int num_draws = 4000;
    for (int draw = 0; draw < num_draws; ++draw) {
        const Eigen::VectorXd alpha = result.fit.shape_coefficients + root * test::random_normal(random, num_shape);
        sum += (synthetic_face().shape.instance(alpha) - neutral).cast<double>().squaredNorm();
    }
    const double drawn = std::sqrt(sum / num_draws / static_cast<double>(synthetic_face().num_vertices()));
    EXPECT_NEAR(predicted, drawn, 0.03 * drawn);
    EXPECT_NEAR(predicted_rms_mm(synthetic_face(), 4 * covariance), 2 * predicted, 1e-6 * predicted);
    EXPECT_TRUE(test::throws<InvalidArgument>(
        [&] { (void)predicted_rms_mm(synthetic_face(), Eigen::MatrixXd::Zero(2, 3)); }, "shape_covariance", "2 x 3"));
}

} // namespace
} // namespace lineament
