// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The pose of points with depth, alone and as the last step of the fitters.
#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/multi_frame.hpp"
#include "lineament/fit/pose.hpp"

#include "support/matchers.hpp"
#include "support/planted_face.hpp"

#include <Eigen/Geometry>

#include <cmath>
#include <limits>

namespace lineament {
namespace {

using test::angle_between_deg;
using test::IsNear;
using test::plant_moderate_face;
using test::PlantedFace;
using test::random_points;
using test::synthetic_face;
using test::throws;
using test::without_depth;
using ::testing::Not;

/// Image point and depth, from an origin of depth that is none of the camera's.
Eigen::Matrix3Xd see(const Camera& camera, const Eigen::Matrix3Xd& points, double noise_px, Random& random)
{
    Eigen::Matrix3Xd seen(3, points.cols());
    seen.topRows<2>() = camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(points));
    seen.row(2) = camera.scale_px_per_mm * camera.camera_from_model.row(2) * points;
    seen.row(2).array() += 37.0;
    for (Eigen::Index i = 0; i < seen.size(); ++i) {
        seen(i) += noise_px * random.normal();
    }
    return seen;
}

TEST(EstimatePoseWithDepth, RecoversThePlantedCameraExactly)
{
    Random random(401);
    for (int trial = 0; trial < 100; ++trial) {
        const Camera truth = test::random_camera(random, 80);
        const Eigen::Matrix3Xd points = random_points(random, 3 + random.index(60));
        const PoseResult pose =
            estimate_pose_with_depth(points, see(truth, points, 0, random), {}, truth.principal_point_px);
        ASSERT_EQ(pose.status, FitStatus::success) << pose.reason;
        EXPECT_THAT(pose.camera.camera_from_model, IsNear(truth.camera_from_model, 1e-7));
        EXPECT_NEAR(pose.camera.scale_px_per_mm, truth.scale_px_per_mm, 1e-7);
        EXPECT_THAT(pose.camera.translation_mm, IsNear(truth.translation_mm, 1e-5));
        EXPECT_LE(pose.rms_px, 1e-6);
    }
}

/// min over s and t of sum w |s R X + t - y|^2.
double least_cost(const Eigen::Matrix3d& rotation, const Eigen::Matrix3Xd& points, const Eigen::Matrix3Xd& seen,
                  const Eigen::VectorXd& weights)
{
    const Eigen::Vector3d mean = points * weights / weights.sum(), mean_seen = seen * weights / weights.sum();
    const Eigen::Matrix3Xd x = rotation * (points.colwise() - mean), y = seen.colwise() - mean_seen;
    const double scale = (x.cwiseProduct(y) * weights).sum() / (x.cwiseAbs2() * weights).sum();
    return ((scale * x - y).cwiseAbs2() * weights).sum();
}

TEST(EstimatePoseWithDepth, NoOtherTurnHasALowerCost)
{
    Random random(402);
    const Camera truth = test::random_camera(random, 40);
    const Eigen::Matrix3Xd points = random_points(random, 20);
    const Eigen::Matrix3Xd seen = see(truth, points, 6, random);
    const Eigen::VectorXd weights = test::random_uniform(random, 20, 0.1, 2);
    const PoseResult pose = estimate_pose_with_depth(points, seen, weights);
    ASSERT_EQ(pose.status, FitStatus::success);
    const Eigen::Matrix3d& rotation = pose.camera.camera_from_model;
    const double cost = least_cost(rotation, points, seen, weights);
    for (int trial = 0; trial < 200; ++trial) {
        const Eigen::Vector3d axis = test::random_normal(random, 3);
        const double angle = random.uniform(0.001, trial < 100 ? 0.02 : 3.0);
        const Eigen::Matrix3d other = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix() * rotation;
        EXPECT_LT(cost, least_cost(other, points, seen, weights));
    }
    // The twin: the turn from the image points alone does cost more.
    const PoseResult flat = estimate_pose(points, seen.topRows<2>(), weights);
    EXPECT_GT(least_cost(flat.camera.camera_from_model, points, seen, weights), 1.001 * cost);
}

TEST(EstimatePoseWithDepth, ScaleAndTranslationAreThoseOfTheImagePoints)
{
    Random random(403);
    const Camera truth = test::random_camera(random, 40);
    const Eigen::Matrix3Xd points = random_points(random, 15);
    const Eigen::Matrix3Xd seen = see(truth, points, 4, random);
    const PoseResult pose = estimate_pose_with_depth(points, seen);
    for (int trial = 0; trial < 50; ++trial) {
        Camera other = pose.camera;
        other.scale_px_per_mm *= 1 + 0.01 * random.normal();
        other.translation_mm += Eigen::Vector2d{random.normal(), random.normal()};
        const double error =
            (other.project(Eigen::Ref<const Eigen::Matrix3Xd>(points)) - seen.topRows<2>()).squaredNorm();
        EXPECT_GT(error, pose.rms_px * pose.rms_px * 15);
    }
}

TEST(EstimatePoseWithDepth, TurnIsNearerThanWithoutDepth)
{
    Random random(404);
    double with_depth = 0, without = 0;
    for (int trial = 0; trial < 200; ++trial) {
        const Camera truth = test::random_camera(random, 40);
        const Eigen::Matrix3Xd points = random_points(random, 20);
        const Eigen::Matrix3Xd seen = see(truth, points, 5, random);
        with_depth +=
            angle_between_deg(estimate_pose_with_depth(points, seen).camera.camera_from_model, truth.camera_from_model);
        without += angle_between_deg(estimate_pose(points, seen.topRows<2>()).camera.camera_from_model,
                                     truth.camera_from_model);
    }
    EXPECT_LT(with_depth, 0.8 * without);
}

TEST(EstimatePoseWithDepth, UnusablePointsGetTheirStatus)
{
    Random random(405);
    const Camera camera = test::random_camera(random, 20);
    const Eigen::Matrix3Xd points = random_points(random, 10);
    const Eigen::Matrix3Xd seen = see(camera, points, 0, random);
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(10);
    weights.head(2).setOnes();
    EXPECT_EQ(estimate_pose_with_depth(points, seen, weights).status, FitStatus::too_few_correspondences);

    Eigen::Matrix3Xd line = points;
    line.topRows<2>().setZero();
    EXPECT_EQ(estimate_pose_with_depth(line, see(camera, line, 0, random)).status, FitStatus::degenerate);
    EXPECT_EQ(estimate_pose_with_depth(Eigen::Matrix3Xd::Ones(3, 10), seen).status, FitStatus::degenerate);
    EXPECT_EQ(estimate_pose_with_depth(points, Eigen::Matrix3Xd::Ones(3, 10)).status, FitStatus::degenerate);

    Camera behind = camera;
    behind.camera_from_model = Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY()) * camera.camera_from_model;
    EXPECT_EQ(estimate_pose_with_depth(points, see(behind, points, 0, random)).status, FitStatus::implausible);
    // A plane is enough, unlike without depth.
    Eigen::Matrix3Xd plane = points;
    plane.row(2).setZero();
    EXPECT_EQ(estimate_pose_with_depth(plane, see(camera, plane, 0, random)).status, FitStatus::success);
    EXPECT_EQ(estimate_pose(plane, see(camera, plane, 0, random).topRows<2>()).status, FitStatus::degenerate);
}

TEST(EstimatePoseWithDepth, BrokenInputThrows)
{
    Random random(406);
    const Eigen::Matrix3Xd points = random_points(random, 6);
    Eigen::Matrix3Xd seen = points;
    seen(2, 3) = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)estimate_pose_with_depth(points, seen); }, "seen_points"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)estimate_pose_with_depth(points, points.leftCols(5)); }, "6", "5"));
}

PlantedFace with_depth(PlantedFace planted)
{
    test::add_depth(synthetic_face(), planted.camera, 250, planted.landmarks);
    return planted;
}

TEST(FaceFitter, DepthMovesThePoseAndLeavesTheIdentity)
{
    Random random(407);
    for (const ContourMode mode : {ContourMode::fixed, ContourMode::both}) {
        FitOptions options;
        options.contour = mode;
        const FaceFitter fitter(synthetic_face(), "ibug68", options);
        double with = 0, without = 0;
        for (int trial = 0; trial < 30; ++trial) {
            const PlantedFace planted = with_depth(plant_moderate_face(random, 2.0, 40));
            const Eigen::Vector2d centre = planted.camera.principal_point_px;
            const FitResult deep = fitter.fit(planted.landmarks, centre);
            const FitResult flat = fitter.fit(without_depth(planted.landmarks), centre);
            ASSERT_EQ(deep.status, FitStatus::success) << deep.reason;
            EXPECT_EQ(deep.shape_coefficients, flat.shape_coefficients);
            with += angle_between_deg(deep.camera.camera_from_model, planted.camera.camera_from_model);
            without += angle_between_deg(flat.camera.camera_from_model, planted.camera.camera_from_model);
            const FitResult known = fitter.fit_pose_and_expression(planted.landmarks, centre, planted.alpha);
            EXPECT_LT(angle_between_deg(known.camera.camera_from_model, planted.camera.camera_from_model), 3.5);
        }
        EXPECT_LT(with, 0.8 * without);
    }
}

TEST(FaceFitter, DepthIsLeftAloneWhereItCannotServe)
{
    Random random(408);
    const PlantedFace planted = with_depth(plant_moderate_face(random, 1.0));
    const Eigen::Vector2d centre = planted.camera.principal_point_px;
    const LandmarkSet flat = without_depth(planted.landmarks);

    FitOptions perspective;
    perspective.focal_length_px = 2000;
    const FaceFitter near(synthetic_face(), "ibug68", perspective);
    EXPECT_EQ(near.fit(planted.landmarks, centre).camera.camera_from_model,
              near.fit(flat, centre).camera.camera_from_model);

    const FaceFitter fitter(synthetic_face());
    LandmarkSet three = flat;
    for (int i = 30; i < 33; ++i) {
        three.landmarks[i].depth_px = planted.landmarks.landmarks[i].depth_px;
    }
    EXPECT_EQ(fitter.fit(three, centre).camera.camera_from_model, fitter.fit(flat, centre).camera.camera_from_model);
    three.landmarks[40].depth_px = planted.landmarks.landmarks[40].depth_px; // four serve
    EXPECT_THAT(fitter.fit(three, centre).camera.camera_from_model,
                Not(IsNear(fitter.fit(flat, centre).camera.camera_from_model, 1e-9)));

    LandmarkSet behind = planted.landmarks; // depth that turns the face away
    for (Landmark& landmark : behind.landmarks) {
        landmark.point_px.x() = 2 * centre.x() - landmark.point_px.x();
    }
    EXPECT_NE(fitter.fit(behind, centre).status, FitStatus::success);

    LandmarkSet broken = planted.landmarks;
    broken.landmarks[5].depth_px = std::numeric_limits<double>::infinity();
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)fitter.fit(broken, centre); }, "depth_px", "6"));
}

TEST(FitFrames, DepthTurnsEachFrameNearerToTheTruth)
{
    Random random(409);
    std::vector<PlantedFace> planted;
    std::vector<LandmarkSet> deep, flat;
    for (int f = 0; f < 20; ++f) {
        planted.push_back(with_depth(plant_moderate_face(random, 2.0)));
        deep.push_back(planted.back().landmarks);
        flat.push_back(without_depth(deep.back()));
    }
    const Eigen::Vector2d centre = planted[0].camera.principal_point_px;
    const FaceFitter fitter(synthetic_face());
    const MultiFrameResult with = fit_frames(fitter, deep, centre);
    const MultiFrameResult without = fit_frames(fitter, flat, centre);
    EXPECT_EQ(with.shape_coefficients, without.shape_coefficients);
    double with_deg = 0, without_deg = 0;
    for (std::size_t f = 0; f < planted.size(); ++f) {
        const Eigen::Matrix3d& truth = planted[f].camera.camera_from_model;
        with_deg += angle_between_deg(with.frames[f].camera.camera_from_model, truth);
        without_deg += angle_between_deg(without.frames[f].camera.camera_from_model, truth);
    }
    EXPECT_LT(with_deg, 0.8 * without_deg);
}

} // namespace
} // namespace lineament
