// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/face_fitter.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/fit/contour.hpp"

#include "support/matchers.hpp"
#include "support/planted_face.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <array>
#include <limits>

namespace lineament {
namespace {

using test::IsNear;
using test::plant_moderate_face;
using test::PlantedFace;
using test::synthetic_face;
using ::testing::Not;

FitOptions fixed_points()
{
    FitOptions options;
    options.contour = ContourMode::fixed;
    return options;
}

TEST(FaceFitter, RecoversThePlantedFaceWithoutNoise)
{
    Random random(31);
    FitOptions options = fixed_points();
    options.regularization = 1e-9;
    options.expression_sigma = std::numeric_limits<double>::infinity();
    options.iterations = 3000; // alternating steps converge linearly
    for (int trial = 0; trial < 3; ++trial) {
        const PlantedFace planted = plant_moderate_face(random, 0.0);
        const FitResult fit = fit_face(synthetic_face(), planted.landmarks, planted.camera.principal_point_px, options);
        ASSERT_EQ(fit.status, FitStatus::success) << fit.reason;
        EXPECT_LE(fit.rms_px, 0.02);
        const Eigen::VectorXf truth = synthetic_face().shape.instance(planted.alpha) +
                                      synthetic_face().expression_sets[0].displacement(planted.psi);
        // Scale and depth trade against shape along shallow directions, so the shape is nearer than the start, not
        // exact.
        EXPECT_LT((shape_of(synthetic_face(), fit) - truth).norm(),
                  0.5f * (synthetic_face().shape.mean - truth).norm());
    }
}

TEST(FaceFitter, GivesTheSameBitsAsFitFace)
{
    Random random(32);
    for (const ContourMode mode : {ContourMode::fixed, ContourMode::front_facing, ContourMode::both}) {
        FitOptions options;
        options.contour = mode;
        const FaceFitter fitter(synthetic_face(), "ibug68", options);
        for (int trial = 0; trial < 5; ++trial) {
            const PlantedFace planted = plant_moderate_face(random, 1.0, 60);
            const Eigen::Vector2d centre = planted.camera.principal_point_px;
            const FitResult once = fit_face(synthetic_face(), planted.landmarks, centre, options);
            const FitResult kept = fitter.fit(planted.landmarks, centre);
            EXPECT_EQ(once.shape_coefficients, kept.shape_coefficients);
            EXPECT_EQ(once.expression_coefficients, kept.expression_coefficients);
            EXPECT_EQ(once.camera.camera_from_model, kept.camera.camera_from_model);
            EXPECT_EQ(once.rms_px, kept.rms_px);
        }
    }
}

TEST(FaceFitter, FitsNoisyLandmarksToTheirNoise)
{
    Random random(33);
    double sum = 0;
    for (int trial = 0; trial < 20; ++trial) {
        const PlantedFace planted = plant_moderate_face(random, 1.0);
        const FitResult fit = fit_face(synthetic_face(), planted.landmarks, planted.camera.principal_point_px);
        ASSERT_EQ(fit.status, FitStatus::success) << fit.reason;
        sum += fit.rms_px;
    }
    EXPECT_LT(sum / 20, 2.5); // sqrt(2) px of noise and what the prior holds back
}

TEST(FaceFitter, AnswerDoesNotDependOnImageResolution)
{
    Random random(34);
    const PlantedFace planted = plant_moderate_face(random, 1.0);
    const FaceFitter fitter(synthetic_face());
    const FitResult base = fitter.fit(planted.landmarks, planted.camera.principal_point_px);
    for (const double factor : {0.25, 0.5, 2.0, 4.0}) {
        LandmarkSet scaled = planted.landmarks;
        for (Landmark& landmark : scaled.landmarks) {
            landmark.point_px *= factor;
        }
        const FitResult fit = fitter.fit(scaled, factor * planted.camera.principal_point_px);
        EXPECT_THAT(fit.shape_coefficients, IsNear(base.shape_coefficients, 1e-6));
        EXPECT_THAT(fit.expression_coefficients, IsNear(base.expression_coefficients, 1e-6));
        EXPECT_NEAR(fit.camera.scale_px_per_mm, factor * base.camera.scale_px_per_mm, 1e-6 * factor);
        EXPECT_NEAR(fit.chi_square, base.chi_square, 1e-6 * base.chi_square);
    }
    // The twin: stated in pixels it does depend on it.
    const FaceFitter published(synthetic_face(), "ibug68", FitOptions::published_prior());
    LandmarkSet scaled = planted.landmarks;
    for (Landmark& landmark : scaled.landmarks) {
        landmark.point_px *= 4;
    }
    EXPECT_THAT(
        published.fit(scaled, 4 * planted.camera.principal_point_px).shape_coefficients,
        Not(IsNear(published.fit(planted.landmarks, planted.camera.principal_point_px).shape_coefficients, 1e-2)));
}

TEST(FaceFitter, PublishedPriorWeighs30AtAVarianceOf3SquarePixels)
{
    Random random(341);
    FitOptions options = FitOptions::published_prior();
    options.contour = ContourMode::fixed;
    options.expression_set = "";
    options.iterations = 1;
    const PlantedFace planted = plant_moderate_face(random, 1.0);
    const FitResult fit = fit_face(synthetic_face(), planted.landmarks, planted.camera.principal_point_px, options);
    // (A^T A / 3 + 30 I) a = -A^T b / 3 with the camera of the one round, written out.
    const LandmarkMap& map = synthetic_face().landmark_maps[0];
    const auto points_of = [&](const Eigen::VectorXf& shape) {
        return Eigen::Matrix3Xd(
            map.points_on(Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, shape.size() / 3)).cast<double>());
    };
    const Eigen::MatrixXf basis = synthetic_face().shape.rescaled_basis();
    const Eigen::Matrix<double, 2, 3> jacobian = fit.camera.scale_px_per_mm * fit.camera.camera_from_model.topRows<2>();
    const Eigen::Matrix3Xd mean = points_of(synthetic_face().shape.mean);
    Eigen::MatrixXd a(2 * mean.cols(), basis.cols());
    for (Eigen::Index j = 0; j < basis.cols(); ++j) {
        a.col(j) = Eigen::MatrixXd(jacobian * points_of(basis.col(j))).reshaped();
    }
    Eigen::Matrix2Xd b = fit.camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(mean));
    for (Eigen::Index l = 0; l < b.cols(); ++l) {
        b.col(l) -= planted.landmarks.find(map.names[l])->point_px;
    }
    Eigen::MatrixXd system = a.transpose() * a / 3;
    system.diagonal().array() += 30;
    const Eigen::VectorXd right_side = -a.transpose() * b.reshaped() / 3;
    EXPECT_THAT(fit.shape_coefficients, IsNear(system.llt().solve(right_side), 1e-5));
    // The twin: another weight is another face.
    system.diagonal().array() -= 3;
    EXPECT_THAT(fit.shape_coefficients, Not(IsNear(system.llt().solve(right_side), 1e-3)));
}

TEST(FaceFitter, ContourFindsTheJawThatPointsOnTheOutlineShow)
{
    // Outline landmarks put where the planted face's silhouette is seen tell of the face; leaving them out is worse.
    Random random(342);
    const ContourModel contour(synthetic_face());
    std::array<double, 2> distance = {};
    for (int trial = 0; trial < 24; ++trial) {
        PlantedFace planted = plant_moderate_face(random, 0.5);
        planted.camera.camera_from_model = rotation_from_angles({radians(trial % 2 ? 35.0 : -35.0), 0, 0});
        const Eigen::VectorXf shape = synthetic_face().shape.instance(planted.alpha) +
                                      synthetic_face().expression_sets[0].displacement(planted.psi);
        const Eigen::Matrix3Xf vertices =
            Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, synthetic_face().num_vertices());
        const FaceSide away = trial % 2 ? FaceSide::left : FaceSide::right;
        planted.landmarks = test::project_landmarks(synthetic_face(), "ibug68", planted.alpha, planted.psi,
                                                    planted.camera, 0.5, random);
        Eigen::Matrix2Xd seen(2, 0);
        for (const int vertex : contour.silhouette_vertices(vertices, planted.camera, away)) {
            seen.conservativeResize(2, seen.cols() + 1);
            seen.rightCols<1>() = planted.camera.project(Eigen::Vector3d(vertices.col(vertex).cast<double>()));
        }
        ASSERT_GE(seen.cols(), 8);
        for (Landmark& landmark : planted.landmarks.landmarks) {
            if (outline_side("ibug68", landmark.name) == away) {
                Eigen::Index nearest;
                (seen.colwise() - landmark.point_px).colwise().squaredNorm().minCoeff(&nearest);
                landmark.point_px = seen.col(nearest);
            }
        }
        const std::array modes = {ContourMode::both, ContourMode::ignored};
        for (std::size_t m = 0; m < modes.size(); ++m) {
            FitOptions options;
            options.contour = modes[m];
            const FitResult fit =
                fit_face(synthetic_face(), planted.landmarks, planted.camera.principal_point_px, options);
            ASSERT_EQ(fit.status, FitStatus::success) << fit.reason;
            distance[m] += test::neutral_distance_mm(fit.shape_coefficients, planted.alpha);
        }
    }
    EXPECT_LT(distance[0], 0.97 * distance[1]);
}

TEST(FaceFitter, OrderOfLandmarksDoesNotMatter)
{
    Random random(35);
    const PlantedFace planted = plant_moderate_face(random, 1.0);
    const FaceFitter fitter(synthetic_face());
    LandmarkSet reversed = planted.landmarks;
    std::reverse(reversed.landmarks.begin(), reversed.landmarks.end());
    const FitResult a = fitter.fit(planted.landmarks, planted.camera.principal_point_px);
    const FitResult b = fitter.fit(reversed, planted.camera.principal_point_px);
    EXPECT_THAT(a.shape_coefficients, IsNear(b.shape_coefficients, 1e-6));
}

TEST(FaceFitter, UnknownAndUnseenLandmarksGetWeightZeroAndChangeNothing)
{
    Random random(36);
    const PlantedFace planted = plant_moderate_face(random, 1.0);
    const FaceFitter fitter(synthetic_face());
    const FitResult base = fitter.fit(planted.landmarks, planted.camera.principal_point_px);
    LandmarkSet more = planted.landmarks;
    more.landmarks.push_back({"antenna", {1, 2}, 1.0});
    more.landmarks.push_back({"31", {1, 2}, 0.0});
    const FitResult fit = fitter.fit(more, planted.camera.principal_point_px);
    ASSERT_EQ(fit.landmarks.size(), more.landmarks.size());
    EXPECT_EQ(fit.landmarks[68].weight, 0.0);
    EXPECT_EQ(fit.landmarks[69].weight, 0.0);
    EXPECT_EQ(fit.landmarks[30].weight, 1.0);
    EXPECT_EQ(fit.shape_coefficients, base.shape_coefficients);
    EXPECT_EQ(fit.rms_px, base.rms_px);
}

TEST(FaceFitter, LandmarksWithoutAnAnswerGiveAStatusAndANeutralFace)
{
    Random random(37);
    const PlantedFace planted = plant_moderate_face(random, 0.0);
    const FaceFitter fitter(synthetic_face());
    const auto expect = [&](const LandmarkSet& landmarks, FitStatus status) {
        const FitResult fit = fitter.fit(landmarks, Eigen::Vector2d(320, 240));
        EXPECT_EQ(fit.status, status) << fit.reason;
        EXPECT_FALSE(fit.reason.empty());
        EXPECT_TRUE(fit.shape_coefficients.isZero(0));
        EXPECT_TRUE(fit.expression_coefficients.isZero(0));
        EXPECT_EQ(fit.shape_coefficients.size(), synthetic_face().shape.num_coefficients());
        EXPECT_TRUE(fit.camera.camera_from_model.allFinite());
        EXPECT_TRUE(std::isfinite(fit.rms_px) && std::isfinite(fit.chi_square));
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
    set = planted.landmarks;
    for (Landmark& landmark : set.landmarks) {
        landmark.point_px.y() = 100;
    }
    expect(set, FitStatus::degenerate);
    set = planted.landmarks;
    for (Landmark& landmark : set.landmarks) {
        landmark.point_px.x() = 640 - landmark.point_px.x(); // mirrored without renaming
    }
    expect(set, FitStatus::implausible);
}

TEST(FaceFitter, BrokenInputThrowsNamingTheLandmark)
{
    Random random(38);
    PlantedFace planted = plant_moderate_face(random, 0.0);
    const FaceFitter fitter(synthetic_face());
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
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)FaceFitter(synthetic_face(), "other"); }, "scheme"));
    FitOptions options;
    options.expression_set = "none-such";
    EXPECT_TRUE(
        test::throws<InvalidArgument>([&] { (void)FaceFitter(synthetic_face(), "ibug68", options); }, "none-such"));
    options = {};
    options.iterations = 0;
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { options.check(); }, "iterations"));
    options = {};
    options.num_shape_coefficients = 99;
    EXPECT_TRUE(
        test::throws<InvalidArgument>([&] { (void)FaceFitter(synthetic_face(), "ibug68", options); }, "at most 12"));
}

TEST(FaceFitter, ABlendshapeTheLandmarksHardlySeeStaysSmall)
{
    // A blendshape of 10 mm somewhere on the forehead that moves the landmarks by micrometres.
    MorphableModel face = synthetic_face();
    Blendshapes& set = face.expression_sets[0];
    set.offsets.col(1) *= 1e-4f / set.offsets.col(1).cwiseAbs().maxCoeff();
    for (int v = 0; v < 30; ++v) {
        const bool is_landmark = (face.landmark_maps[0].vertices.row(0).array() == v).any();
        set.offsets(3 * v + 2, 1) = is_landmark ? set.offsets(3 * v + 2, 1) : 10.0f;
    }
    Random random(44);
    const PlantedFace planted = plant_moderate_face(random, 1.0);
    const Eigen::Vector2d centre = planted.camera.principal_point_px;
    FitOptions options = fixed_points();
    const FitResult fit = fit_face(face, planted.landmarks, centre, options);
    EXPECT_EQ(fit.status, FitStatus::success) << fit.reason;
    EXPECT_LE(fit.expression_coefficients[1], 0.1);
    // The twin: without the prior the bound holds it, and the status says so.
    options.expression_sigma = std::numeric_limits<double>::infinity();
    bool was_held = false;
    for (int trial = 0; trial < 10; ++trial) {
        const FitResult held = fit_face(face, plant_moderate_face(random, 1.0).landmarks, centre, options);
        EXPECT_LE(held.expression_coefficients.maxCoeff(), options.max_expression);
        EXPECT_EQ(held.status == FitStatus::implausible,
                  held.expression_coefficients.maxCoeff() >= options.max_expression);
        was_held = was_held || held.status == FitStatus::implausible;
    }
    EXPECT_TRUE(was_held);
}

/// The synthetic face with another scheme, whose landmarks are those of ibug68 by other names.
MorphableModel model_with_noise(const Eigen::VectorXf& noise_mm)
{
    MorphableModel face = synthetic_face();
    LandmarkMap map = face.landmark_maps[0];
    map.scheme = "noisy";
    map.noise_mm["first"] = noise_mm;
    face.landmark_maps.push_back(map);
    return face;
}

TEST(FaceFitter, NoiseOfTheLandmarkMapReplacesTheSigmasOfTheOptions)
{
    Random random(47);
    PlantedFace planted = plant_moderate_face(random, 1.0);
    const Eigen::Vector2d centre = planted.camera.principal_point_px;
    const Eigen::Index count = synthetic_face().landmark_maps[0].num_landmarks();
    // The same sigmas from either place give the same bits; without outline, whose default sigma differs.
    planted.landmarks.landmarks.erase(planted.landmarks.landmarks.begin(), planted.landmarks.landmarks.begin() + 17);
    const FitResult stated = fit_face(synthetic_face(), planted.landmarks, centre, fixed_points());
    planted.landmarks.scheme = "noisy";
    const auto fit_with = [&](const Eigen::VectorXf& noise_mm) {
        return fit_face(model_with_noise(noise_mm), planted.landmarks, centre); // default options
    };
    const float sigma_mm = static_cast<float>(fixed_points().landmark_sigma_mm);
    const FitResult same = fit_with(Eigen::VectorXf::Constant(count, sigma_mm));
    EXPECT_EQ(same.shape_coefficients, stated.shape_coefficients);
    EXPECT_EQ(same.expression_coefficients, stated.expression_coefficients);
    // The twin: another noise gives another face, the larger the nearer to the mean.
    const FitResult vague = fit_with(Eigen::VectorXf::Constant(count, 20.0f));
    EXPECT_LT(vague.shape_coefficients.norm(), 0.5 * same.shape_coefficients.norm());
    // Weights go as 1 / noise^2.
    Eigen::VectorXf noise_mm = Eigen::VectorXf::Constant(count, 2.0f);
    noise_mm[30] = 4.0f;
    EXPECT_NEAR(fit_with(noise_mm).landmarks[13].weight, 0.25, 1e-12); // 31 stands 13 places after 18
}

TEST(FaceFitter, ALandmarkOfInfiniteNoiseIsNotUsed)
{
    Random random(48);
    PlantedFace planted = plant_moderate_face(random, 1.0);
    planted.landmarks.scheme = "noisy";
    const Eigen::Vector2d centre = planted.camera.principal_point_px;
    Eigen::VectorXf noise_mm = Eigen::VectorXf::Constant(synthetic_face().landmark_maps[0].num_landmarks(), 2.0f);
    noise_mm[30] = std::numeric_limits<float>::infinity();
    const FaceFitter fitter(model_with_noise(noise_mm), "noisy");
    const FitResult base = fitter.fit(planted.landmarks, centre);
    planted.landmarks.landmarks[30].point_px += Eigen::Vector2d(300, 0);
    const FitResult moved = fitter.fit(planted.landmarks, centre);
    EXPECT_EQ(moved.landmarks[30].weight, 0.0);
    EXPECT_EQ(moved.shape_coefficients, base.shape_coefficients);
    EXPECT_EQ(moved.rms_px, base.rms_px);
    // The twin: a finite one is.
    noise_mm[30] = 2.0f;
    EXPECT_NE(FaceFitter(model_with_noise(noise_mm), "noisy").fit(planted.landmarks, centre).shape_coefficients,
              base.shape_coefficients);
}

TEST(FaceFitter, TheNoiseOfSeveralDetectorsMustBeNamed)
{
    const Eigen::Index count = synthetic_face().landmark_maps[0].num_landmarks();
    MorphableModel face = model_with_noise(Eigen::VectorXf::Constant(count, 2.0f));
    face.landmark_maps.back().noise_mm["second"] = Eigen::VectorXf::Constant(count, 3.0f);
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)FaceFitter(face, "noisy"); }, "noise_detector"));
    FitOptions options;
    options.noise_detector = "third";
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)FaceFitter(face, "noisy", options); }, "third"));
    options.noise_detector = "second";
    EXPECT_EQ((*FaceFitter(face, "noisy", options).landmark_noise_mm())[0], 3.0f);
    EXPECT_EQ(FaceFitter(face, "ibug68").landmark_noise_mm(), nullptr);
    face.landmark_maps.back().noise_mm["second"].resize(3);
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)FaceFitter(face, "noisy", options); }, "noise_mm"));
}

TEST(FaceFitter, FixedIdentityIsLeftAlone)
{
    Random random(39);
    const PlantedFace planted = plant_moderate_face(random, 0.5);
    const FaceFitter fitter(synthetic_face(), "ibug68", fixed_points());
    const FitResult fit =
        fitter.fit_pose_and_expression(planted.landmarks, planted.camera.principal_point_px, planted.alpha);
    EXPECT_EQ(fit.shape_coefficients, planted.alpha);
    EXPECT_EQ(fit.status, FitStatus::success);
    EXPECT_NEAR(fit.camera.scale_px_per_mm, planted.camera.scale_px_per_mm, 0.02);
}

TEST(FaceFitter, WarmStartContinuesWhereTheFitBeforeEnded)
{
    Random random(40);
    const PlantedFace planted = plant_moderate_face(random, 1.0);
    FitOptions options = fixed_points();
    options.iterations = 1;
    const FaceFitter one(synthetic_face(), "ibug68", options);
    options.iterations = 60;
    const FaceFitter many(synthetic_face(), "ibug68", options);
    const Eigen::Vector2d centre = planted.camera.principal_point_px;
    const FitResult settled = many.fit(planted.landmarks, centre);
    const FitResult cold = one.fit(planted.landmarks, centre);
    const FitResult warm = one.fit(planted.landmarks, centre, &settled);
    EXPECT_LT((warm.shape_coefficients - settled.shape_coefficients).norm(),
              0.2 * (cold.shape_coefficients - settled.shape_coefficients).norm());
}

} // namespace
} // namespace lineament
