// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/joint_fitter.hpp"

#include "support/matchers.hpp"
#include "support/planted_face.hpp"

#include <limits>

namespace lineament {
namespace {

using test::IsNear;
using test::neutral_distance_mm;
using test::plant_face_from_priors;
using test::PlantedFace;
using test::synthetic_face;
using ::testing::Not;

/// Correspondences given, noise as planted, no bias.
JointOptions given(double sigma_mm = 2.0)
{
    JointOptions options;
    options.contour = ContourMode::fixed;
    options.landmark_sigma_mm = sigma_mm;
    options.contour_sigma_mm = sigma_mm;
    options.bias_sigma_mm = 0;
    return options;
}

TEST(JointFitter, FindsThePlantedFaceWithoutNoise)
{
    Random random(131);
    JointOptions options = given(0.01); // noise and prior that hold nothing back
    options.tolerance = 1e-7;
    options.max_iterations = 300;
    const JointFitter fitter(synthetic_face(), "ibug68", options);
    for (int trial = 0; trial < 3; ++trial) {
        const PlantedFace planted = plant_face_from_priors(random, 0.0);
        const JointFitResult result = fitter.fit(planted.landmarks, planted.camera.principal_point_px);
        ASSERT_EQ(result.fit.status, FitStatus::success) << result.fit.reason;
        EXPECT_EQ(result.fit.method, "joint");
        EXPECT_LE(result.fit.rms_px, 0.01);
        EXPECT_LE(neutral_distance_mm(result.fit.shape_coefficients, planted.alpha), 0.2); // mm
        EXPECT_THAT(result.fit.expression_coefficients, IsNear(planted.psi, 0.02));
        EXPECT_THAT(result.fit.camera.camera_from_model, IsNear(planted.camera.camera_from_model, 1e-3));
        // The twin: under the stated noise of 2 mm the prior holds the shape back.
        const JointFitResult held = JointFitter(synthetic_face(), "ibug68", given()).fit(planted.landmarks, {320, 240});
        EXPECT_GT(neutral_distance_mm(held.fit.shape_coefficients, planted.alpha), 0.5);
    }
}

TEST(JointFitter, EveryStepOfARoundLowersTheEnergy)
{
    Random random(132);
    for (const ContourMode mode : {ContourMode::fixed, ContourMode::both}) {
        for (const RobustLoss loss : {RobustLoss::none, RobustLoss::student_t, RobustLoss::geman_mcclure}) {
            JointOptions options;
            options.contour = mode;
            options.loss = loss;
            const JointFitter fitter(synthetic_face(), "ibug68", options);
            const PlantedFace planted = plant_face_from_priors(random, 2.0, 60);
            const JointFitResult result = fitter.fit(planted.landmarks, planted.camera.principal_point_px);
            ASSERT_EQ(result.fit.status, FitStatus::success) << result.fit.reason;
            ASSERT_GE(result.energies.size(), 6u);
            EXPECT_EQ(result.energies.back().round, options.rounds - 1);
            for (std::size_t i = 1; i < result.energies.size(); ++i) {
                if (result.energies[i].round == result.energies[i - 1].round) {
                    EXPECT_LT(result.energies[i].energy, result.energies[i - 1].energy);
                }
            }
        }
    }
}

/// How far a fit stops from where its last round ends, in posterior standard deviations; the largest of twenty faces.
double farthest_stop(double tolerance)
{
    Random random(133);
    double farthest = 0;
    for (int trial = 0; trial < 20; ++trial) {
        const PlantedFace planted = plant_face_from_priors(random, 2.0, 45);
        JointOptions options;
        options.tolerance = 1e-10;
        options.max_iterations = 500;
        const JointFitResult end =
            JointFitter(synthetic_face(), "ibug68", options).fit(planted.landmarks, planted.camera.principal_point_px);
        options.tolerance = tolerance;
        const JointFitResult stop =
            JointFitter(synthetic_face(), "ibug68", options).fit(planted.landmarks, planted.camera.principal_point_px);
        EXPECT_EQ(end.fit.status, FitStatus::success) << end.fit.reason;
        EXPECT_EQ(stop.fit.status, FitStatus::success) << stop.fit.reason;
        Eigen::VectorXd left(end.covariance.rows());
        left << stop.fit.shape_coefficients - end.fit.shape_coefficients,
            stop.minimum_expression - end.minimum_expression;
        const Eigen::VectorXd deviations = end.covariance.diagonal().cwiseSqrt();
        for (Eigen::Index i = 0; i < left.size(); ++i) {
            farthest = deviations[i] > 0 ? std::max(farthest, std::abs(left[i]) / deviations[i]) : farthest;
        }
    }
    return farthest;
}

TEST(JointFitter, StopsWithinTheToleranceOfWhereItWouldEnd)
{
    const double farthest = farthest_stop(JointOptions().tolerance);
    EXPECT_LE(farthest, 1e-4);
    EXPECT_GT(farthest_stop(0.3), 10 * farthest); // the twin
}

TEST(JointFitter, TooFewStepsAreNotConverged)
{
    Random random(133);
    const PlantedFace planted = plant_face_from_priors(random, 2.0);
    JointOptions options = given();
    options.rounds = 1;
    options.max_iterations = 2;
    const JointFitResult result =
        JointFitter(synthetic_face(), "ibug68", options).fit(planted.landmarks, planted.camera.principal_point_px);
    EXPECT_EQ(result.fit.status, FitStatus::not_converged);
    EXPECT_FALSE(result.fit.reason.empty());
}

TEST(JointFitter, AnswerDoesNotDependOnImageResolution)
{
    Random random(134);
    const PlantedFace planted = plant_face_from_priors(random, 1.0);
    for (const ContourMode mode : {ContourMode::fixed, ContourMode::both}) {
        JointOptions options;
        options.contour = mode;
        const JointFitter fitter(synthetic_face(), "ibug68", options);
        const JointFitResult base = fitter.fit(planted.landmarks, planted.camera.principal_point_px);
        for (const double factor : {0.25, 0.5, 2.0, 4.0}) {
            LandmarkSet scaled = planted.landmarks;
            for (Landmark& landmark : scaled.landmarks) {
                landmark.point_px *= factor;
            }
            const JointFitResult result = fitter.fit(scaled, factor * planted.camera.principal_point_px);
            const Eigen::VectorXf moved =
                neutral_shape_of(synthetic_face(), result.fit) - neutral_shape_of(synthetic_face(), base.fit);
            EXPECT_LE(moved.cwiseAbs().maxCoeff(), 1e-3f); // mm
            EXPECT_NEAR(result.fit.camera.scale_px_per_mm, factor * base.fit.camera.scale_px_per_mm, 1e-5 * factor);
            EXPECT_NEAR(result.fit.chi_square, base.fit.chi_square, 1e-4 * base.fit.chi_square);
        }
    }
    // The twin: noise stated in px does depend on it.
    const JointFitter fitter(synthetic_face(), "ibug68", given());
    const std::vector<Eigen::Matrix2d> noise(68, 4 * Eigen::Matrix2d::Identity());
    LandmarkSet scaled = planted.landmarks;
    for (Landmark& landmark : scaled.landmarks) {
        landmark.point_px *= 4;
    }
    EXPECT_THAT(
        fitter.fit(scaled, 4 * planted.camera.principal_point_px, nullptr, noise).fit.shape_coefficients,
        Not(IsNear(
            fitter.fit(planted.landmarks, planted.camera.principal_point_px, nullptr, noise).fit.shape_coefficients,
            1e-2)));
}

TEST(JointFitter, LandmarksWithoutAnAnswerGiveAStatusAndANeutralFace)
{
    Random random(135);
    const PlantedFace planted = plant_face_from_priors(random, 0.0);
    const JointFitter fitter(synthetic_face());
    const auto expect = [&](const LandmarkSet& landmarks, FitStatus status) {
        const JointFitResult result = fitter.fit(landmarks, Eigen::Vector2d(320, 240));
        const FitResult& fit = result.fit;
        EXPECT_EQ(fit.status, status) << fit.reason;
        EXPECT_FALSE(fit.reason.empty());
        EXPECT_TRUE(fit.shape_coefficients.isZero(0));
        EXPECT_TRUE(fit.expression_coefficients.isZero(0));
        EXPECT_EQ(fit.shape_coefficients.size(), synthetic_face().shape.num_coefficients());
        EXPECT_EQ(fit.landmarks.size(), landmarks.landmarks.size());
        EXPECT_TRUE(fit.camera.camera_from_model.allFinite());
        EXPECT_TRUE(std::isfinite(fit.rms_px) && std::isfinite(fit.chi_square));
        EXPECT_EQ(result.covariance.size(), 0);
        EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)fitter.identity_information(landmarks, result); }, "at"));
    };
    LandmarkSet set = planted.landmarks;
    set.landmarks.resize(0);
    expect(set, FitStatus::too_few_correspondences);
    set.landmarks.assign(planted.landmarks.landmarks.begin() + 30, planted.landmarks.landmarks.begin() + 33);
    expect(set, FitStatus::too_few_correspondences);
    set = planted.landmarks;
    for (Landmark& landmark : set.landmarks) {
        landmark.point_px = {100, 100};
    }
    expect(set, FitStatus::degenerate);
    for (Landmark& landmark : set.landmarks) {
        landmark.point_px.x() = random.uniform(0, 640);
    }
    expect(set, FitStatus::degenerate);
    set = planted.landmarks;
    for (Landmark& landmark : set.landmarks) {
        landmark.point_px.x() = 640 - landmark.point_px.x(); // mirrored without renaming
    }
    expect(set, FitStatus::implausible);
    set.landmarks.assign(planted.landmarks.landmarks.begin() + 27, planted.landmarks.landmarks.begin() + 31);
    expect(set, FitStatus::degenerate); // the bridge of the nose: a plane
}

TEST(JointFitter, BrokenInputThrowsNamingWhatIsBroken)
{
    Random random(136);
    const PlantedFace planted = plant_face_from_priors(random, 0.0);
    const JointFitter fitter(synthetic_face());
    const Eigen::Vector2d centre(320, 240);
    LandmarkSet set = planted.landmarks;
    set.landmarks[40].point_px.y() = std::nan("");
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)fitter.fit(set, centre); }, "landmark \"41\"", "nan"));
    set = planted.landmarks;
    set.landmarks[5].confidence = 1.5;
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)fitter.fit(set, centre); }, "landmark \"6\".confidence"));
    set = planted.landmarks;
    set.scheme = "other";
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)fitter.fit(set, centre); }, "scheme", "ibug68", "other"));
    std::vector<Eigen::Matrix2d> noise(68, Eigen::Matrix2d::Identity());
    noise[2] = Eigen::Matrix2d::Ones(); // singular
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)fitter.fit(planted.landmarks, centre, nullptr, noise); },
                                              "landmark \"3\".covariance_px"));
    noise.pop_back();
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)fitter.fit(planted.landmarks, centre, nullptr, noise); },
                                              "covariances_px", "67"));
    const FitResult wrong_size;
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)fitter.fit(planted.landmarks, centre, &wrong_size); },
                                              "start->shape_coefficients"));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)JointFitter(synthetic_face(), "other"); }, "scheme"));
    const auto expect_bad = [&](auto change, const char* member) {
        JointOptions options;
        change(options);
        EXPECT_TRUE(
            test::throws<InvalidArgument>([&] { (void)JointFitter(synthetic_face(), "ibug68", options); }, member));
    };
    expect_bad([](JointOptions& o) { o.landmark_sigma_mm = 0; }, "landmark_sigma_mm");
    expect_bad([](JointOptions& o) { o.bias_sigma_mm = -1; }, "bias_sigma_mm");
    expect_bad([](JointOptions& o) { o.bias_depth_ratio = 0.9; }, "bias_depth_ratio");
    expect_bad([](JointOptions& o) { o.contour_trim = 1; }, "contour_trim");
    expect_bad([](JointOptions& o) { o.rounds = 0; }, "rounds");
    expect_bad([](JointOptions& o) { o.tolerance = std::nan(""); }, "tolerance");
    expect_bad([](JointOptions& o) { o.covariances_mm["9"] = -Eigen::Matrix2d::Identity(); }, "covariances_mm[\"9\"]");
    expect_bad([](JointOptions& o) { o.focal_length_px = o.phi_sigma_per_mm = 1; }, "focal_length_px");
    expect_bad([](JointOptions& o) { o.expression_set = "none-such"; }, "none-such");
}

TEST(JointFitter, UnknownAndUnseenLandmarksGetWeightZeroAndChangeNothing)
{
    Random random(137);
    const PlantedFace planted = plant_face_from_priors(random, 1.0);
    const JointFitter fitter(synthetic_face());
    const JointFitResult base = fitter.fit(planted.landmarks, planted.camera.principal_point_px);
    LandmarkSet more = planted.landmarks;
    more.landmarks.push_back({"antenna", {1, 2}, 1.0});
    more.landmarks.push_back({"31", {1, 2}, 0.0});
    const JointFitResult result = fitter.fit(more, planted.camera.principal_point_px);
    ASSERT_EQ(result.fit.landmarks.size(), more.landmarks.size());
    EXPECT_EQ(result.fit.landmarks[68].weight, 0.0);
    EXPECT_EQ(result.fit.landmarks[69].weight, 0.0);
    EXPECT_GT(result.fit.landmarks[30].weight, 0.0);
    EXPECT_EQ(result.fit.shape_coefficients, base.fit.shape_coefficients);
}

TEST(JointFitter, WildLandmarksHardlyMoveTheFace)
{
    Random random(138);
    double clean = 0, student_t = 0, geman_mcclure = 0, none = 0;
    for (int trial = 0; trial < 30; ++trial) {
        PlantedFace planted = plant_face_from_priors(random, 2.0);
        JointOptions options = given();
        const auto error = [&](RobustLoss loss) {
            options.loss = loss;
            const JointFitter fitter(synthetic_face(), "ibug68", options);
            return neutral_distance_mm(fitter.fit(planted.landmarks, {320, 240}).fit.shape_coefficients, planted.alpha);
        };
        clean += error(RobustLoss::student_t);
        for (int i = 0; i < 7; ++i) {
            planted.landmarks.landmarks[static_cast<std::size_t>(random.index(68))].point_px +=
                Eigen::Vector2d{random.uniform(-40, 40), random.uniform(-40, 40)};
        }
        student_t += error(RobustLoss::student_t);
        geman_mcclure += error(RobustLoss::geman_mcclure);
        none += error(RobustLoss::none);
    }
    EXPECT_LT(student_t, 1.12 * clean);
    EXPECT_LT(geman_mcclure, 1.12 * clean);
    EXPECT_GT(none, 1.25 * clean); // the twin
}

TEST(JointFitter, AKnownIdentityIsLeftAlone)
{
    Random random(134);
    double known_error = 0, fitted_error = 0;
    for (int trial = 0; trial < 20; ++trial) {
        const PlantedFace planted = plant_face_from_priors(random, 2.0, 45);
        const Eigen::Vector2d centre = planted.camera.principal_point_px;
        const JointFitter fitter(synthetic_face());
        const JointFitResult known = fitter.fit_pose_and_expression(planted.landmarks, centre, planted.alpha);
        ASSERT_EQ(known.fit.status, FitStatus::success) << known.fit.reason;
        EXPECT_EQ(known.fit.shape_coefficients, planted.alpha);
        const Eigen::Index num_shape = planted.alpha.size();
        EXPECT_EQ(known.covariance.topRows(num_shape).norm(), 0.0);
        for (Eigen::Index k = 0; k < planted.psi.size(); ++k) {
            const double psi = known.fit.expression_coefficients[k];
            EXPECT_EQ(known.covariance(num_shape + k, num_shape + k) > 0, psi > 0 && psi < 1) << k;
        }
        // The same minimum: a fit from there, with a prior that pins the identity to the truth.
        IdentityFilter pinned(num_shape);
        const double strength = 1e10;
        pinned.add({strength * Eigen::MatrixXd::Identity(num_shape, num_shape), strength * planted.alpha});
        JointOptions options;
        options.bias_sigma_mm = 0;
        const JointFitter plain(synthetic_face(), "ibug68", options);
        const JointFitResult by_prior = plain.fit(planted.landmarks, centre, nullptr, {}, &pinned);
        const JointFitResult held = plain.fit_pose_and_expression(planted.landmarks, centre, planted.alpha);
        EXPECT_THAT(held.fit.expression_coefficients, IsNear(by_prior.fit.expression_coefficients, 2e-3));
        EXPECT_THAT(held.fit.camera.camera_from_model, IsNear(by_prior.fit.camera.camera_from_model, 2e-3));

        const JointFitResult fitted = fitter.fit(planted.landmarks, centre);
        known_error += (known.fit.expression_coefficients - planted.psi).norm();
        fitted_error += (fitted.fit.expression_coefficients - planted.psi).norm();
    }
    EXPECT_LT(known_error, 0.9 * fitted_error); // who knows the face sees more of its expression
    const PlantedFace planted = plant_face_from_priors(random, 2.0, 45);
    const JointFitter fitter(synthetic_face());
    const JointFitResult mean = fitter.fit_pose_and_expression(planted.landmarks, {320, 240}, Eigen::VectorXd());
    EXPECT_TRUE(mean.fit.shape_coefficients.isZero(0));
    const Eigen::VectorXd beyond = Eigen::VectorXd::Constant(planted.alpha.size(), 6); // no fit goes there
    EXPECT_EQ(fitter.fit_pose_and_expression(planted.landmarks, {320, 240}, beyond).fit.shape_coefficients, beyond);
    for (const Eigen::VectorXd& wrong : {Eigen::VectorXd(Eigen::VectorXd::Zero(planted.alpha.size() + 1)),
                                         Eigen::VectorXd(Eigen::VectorXd::Constant(1, std::nan("")))}) {
        EXPECT_TRUE(test::throws<InvalidArgument>(
            [&] {
                (void)fitter.fit_pose_and_expression(planted.landmarks, {320, 240}, wrong);
            },
            "shape_coefficients"));
    }
}

TEST(JointFitter, CovariancesInPixelsAndMillimetresAgree)
{
    Random random(155);
    const PlantedFace planted = plant_face_from_priors(random, 1.0);
    JointOptions options = given(2.0);
    options.rounds = 20; // so that the scale that makes px of mm is that of the last round
    const JointFitResult base = JointFitter(synthetic_face(), "ibug68", options).fit(planted.landmarks, {320, 240});
    const double s0 = base.matched_scale_px_per_mm;
    const std::vector<Eigen::Matrix2d> pixels(68, s0 * s0 * 4 * Eigen::Matrix2d::Identity());
    options.landmark_sigma_mm = options.contour_sigma_mm = 9; // not used
    const JointFitter other(synthetic_face(), "ibug68", options);
    const JointFitResult in_px = other.fit(planted.landmarks, {320, 240}, nullptr, pixels);
    EXPECT_THAT(in_px.fit.shape_coefficients, IsNear(base.fit.shape_coefficients, 1e-3));
    const std::vector<LandmarkSet> frames{planted.landmarks};
    const std::vector<std::vector<Eigen::Matrix2d>> of_frames{pixels};
    EXPECT_EQ(other.fit_frames(frames, {320, 240}, {}, of_frames).shape_coefficients, in_px.fit.shape_coefficients);
    for (const LandmarkMap& map : synthetic_face().landmark_maps) {
        for (const std::string& name : map.names) {
            options.covariances_mm[name] = 4 * Eigen::Matrix2d::Identity();
        }
    }
    const JointFitter named(synthetic_face(), "ibug68", options);
    EXPECT_EQ(named.fit(planted.landmarks, {320, 240}).fit.shape_coefficients, base.fit.shape_coefficients);
    // The twin: a direction that a landmark does not know pulls less.
    options.covariances_mm["31"] = Eigen::Vector2d(400, 4).asDiagonal();
    const JointFitter blind(synthetic_face(), "ibug68", options);
    LandmarkSet moved = planted.landmarks;
    moved.landmarks[30].point_px.x() += 10;
    const Eigen::VectorXd with = named.fit(moved, {320, 240}).fit.shape_coefficients - base.fit.shape_coefficients;
    const Eigen::VectorXd without = blind.fit(moved, {320, 240}).fit.shape_coefficients -
                                    blind.fit(planted.landmarks, {320, 240}).fit.shape_coefficients;
    EXPECT_LT(without.norm(), 0.3 * with.norm());
}

TEST(JointFitter, NoiseOfTheLandmarkMapIsSplitIntoNoiseAndBias)
{
    Random random(156);
    JointOptions options; // sigma and bias 2 mm each
    options.bias_depth_ratio = 1.0;
    options.contour = ContourMode::fixed;
    options.contour_sigma_mm = 2.0;
    const PlantedFace planted = plant_face_from_priors(random, 2.0);
    const std::vector<LandmarkSet> frames{planted.landmarks, plant_face_from_priors(random, 2.0).landmarks};
    const JointFitter plain(synthetic_face(), "ibug68", options);
    MorphableModel stated = synthetic_face();
    stated.landmark_maps[0].noise_mm["detector"] = Eigen::VectorXf::Constant(68, std::sqrt(8.0f));
    const JointFitter same(stated, "ibug68", options);
    EXPECT_THAT(same.fit(planted.landmarks, {320, 240}).fit.shape_coefficients,
                IsNear(plain.fit(planted.landmarks, {320, 240}).fit.shape_coefficients, 1e-4));
    EXPECT_THAT(same.fit_frames(frames, {320, 240}).shape_coefficients,
                IsNear(plain.fit_frames(frames, {320, 240}).shape_coefficients, 1e-4));
    // The twins: other noise is another fit; infinite noise is no measurement.
    stated.landmark_maps[0].noise_mm["detector"].setConstant(8.0f);
    stated.landmark_maps[0].noise_mm["detector"][30] = std::numeric_limits<float>::infinity();
    const JointFitter other(stated, "ibug68", options);
    const JointFitResult result = other.fit(planted.landmarks, {320, 240});
    EXPECT_THAT(result.fit.shape_coefficients,
                Not(IsNear(plain.fit(planted.landmarks, {320, 240}).fit.shape_coefficients, 1e-2)));
    EXPECT_EQ(result.fit.landmarks[30].weight, 0.0);
    EXPECT_GT(result.fit.landmarks[31].weight, 0.0);
    options.noise_detector = "another";
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)JointFitter(stated, "ibug68", options); }, "another"));
}

/// Moves the outline landmarks to where people mark them: to the outline that is seen, where the ray from the nose base
/// through each of them leaves the head.
void move_to_seen_outline(PlantedFace& planted)
{
    const MorphableModel& model = synthetic_face();
    const Eigen::VectorXf shape =
        model.shape.instance(planted.alpha) + model.expression_sets[0].displacement(planted.psi);
    const Eigen::Map<const Eigen::Matrix3Xf> vertices(shape.data(), 3, model.num_vertices());
    const Eigen::Matrix2Xd seen =
        planted.camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(Eigen::Matrix3Xd(vertices.cast<double>())));
    const Eigen::Matrix3Xi& triangles = model.levels.back().triangles;
    const Eigen::Vector2d nose_base = planted.landmarks.landmarks[33].point_px;
    for (std::size_t l = 0; l < 17; ++l) {
        const Eigen::Vector2d ray = (planted.landmarks.landmarks[l].point_px - nose_base).normalized();
        const Eigen::Vector2d across(-ray.y(), ray.x());
        double last = 0;
        for (Eigen::Index i = 0; i < triangles.size(); ++i) {
            const Eigen::Vector2d a = seen.col(triangles(i)) - nose_base;
            const Eigen::Vector2d b = seen.col(triangles((i + 1) % 3, i / 3)) - nose_base;
            if ((across.dot(a) < 0) != (across.dot(b) < 0)) {
                last = std::max(last, ray.dot(a + across.dot(a) / across.dot(a - b) * (b - a)));
            }
        }
        planted.landmarks.landmarks[l].point_px = nose_base + last * ray;
    }
}

TEST(JointFitter, OutlineMatchesBeatAFixedOutlineWhereTheOutlineIsWhatIsSeen)
{
    Random random(139);
    JointOptions fixed = given(1.0);
    JointOptions matched = given(1.0);
    matched.contour = ContourMode::both;
    const JointFitter fixed_fitter(synthetic_face(), "ibug68", fixed);
    const JointFitter matched_fitter(synthetic_face(), "ibug68", matched);
    double fixed_mm = 0;
    double matched_mm = 0;
    const int count = 20;
    for (int trial = 0; trial < count; ++trial) {
        PlantedFace planted = plant_face_from_priors(random, 0.0, 0);
        planted.camera.camera_from_model = rotation_from_angles({radians(trial % 2 == 0 ? 35 : -35), 0.1, 0});
        planted.landmarks = test::project_landmarks(synthetic_face(), "ibug68", planted.alpha, planted.psi,
                                                    planted.camera, 0.5, random);
        move_to_seen_outline(planted);
        const auto error = [&](const JointFitter& fitter) {
            return neutral_distance_mm(fitter.fit(planted.landmarks, {320, 240}).fit.shape_coefficients, planted.alpha);
        };
        fixed_mm += error(fixed_fitter) / count;
        matched_mm += error(matched_fitter) / count;
    }
    EXPECT_LT(matched_mm, 0.85 * fixed_mm);
}

} // namespace
} // namespace lineament
