// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/affine_camera.hpp"
#include "lineament/fit/pose.hpp"
#include "lineament/fit/pose_step_impl.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <Eigen/SVD>

#include <limits>

namespace lineament {
namespace {

using test::IsNear;
using test::random_points;
using ::testing::Not;

Eigen::Matrix2Xd project(const Camera& camera, const Eigen::Matrix3Xd& points)
{
    return camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(points));
}

Eigen::Matrix2Xd add_noise(Eigen::Matrix2Xd points, double sigma, Random& random)
{
    for (Eigen::Index i = 0; i < points.size(); ++i) {
        points(i) += sigma * random.normal();
    }
    return points;
}

TEST(EstimatePose, RecoversThePlantedCameraExactly)
{
    Random random(11);
    for (int trial = 0; trial < 100; ++trial) {
        const Camera truth = test::random_camera(random, 80);
        const Eigen::Matrix3Xd points = random_points(random, 4 + random.index(60));
        const PoseResult pose = estimate_pose(points, project(truth, points), {}, truth.principal_point_px);
        ASSERT_EQ(pose.status, FitStatus::success) << pose.reason;
        EXPECT_THAT(pose.camera.camera_from_model, IsNear(truth.camera_from_model, 1e-8));
        EXPECT_NEAR(pose.camera.scale_px_per_mm, truth.scale_px_per_mm, 1e-8);
        EXPECT_THAT(pose.camera.translation_mm, IsNear(truth.translation_mm, 1e-6));
        EXPECT_LE(pose.rms_px, 1e-7);
    }
}

TEST(EstimatePose, LosesNothingToAFarPairThatDoesNotCount)
{
    Random random(13);
    const Camera truth = test::random_camera(random, 60);
    Eigen::Matrix3Xd points = random_points(random, 20);
    Eigen::Matrix2Xd seen = project(truth, points);
    points.col(0).setConstant(1e12);
    seen.col(0).setConstant(-1e12);
    Eigen::VectorXd weights = Eigen::VectorXd::Ones(20);
    weights[0] = 0;
    const PoseResult pose = estimate_pose(points, seen, weights, truth.principal_point_px);
    ASSERT_EQ(pose.status, FitStatus::success) << pose.reason;
    EXPECT_THAT(pose.camera.camera_from_model, IsNear(truth.camera_from_model, 1e-8));
    EXPECT_NEAR(pose.camera.scale_px_per_mm, truth.scale_px_per_mm, 1e-8);
}

TEST(EstimatePose, ReturnsAProperRotation)
{
    Random random(12);
    for (int trial = 0; trial < 50; ++trial) {
        const Camera truth = test::random_camera(random);
        const Eigen::Matrix3Xd points = random_points(random, 20);
        const PoseResult pose = estimate_pose(points, add_noise(project(truth, points), 5, random));
        EXPECT_THAT(pose.camera.camera_from_model * pose.camera.camera_from_model.transpose(),
                    IsNear(Eigen::Matrix3d::Identity(), 1e-12));
        EXPECT_NEAR(pose.camera.camera_from_model.determinant(), 1.0, 1e-12);
    }
}

TEST(EstimatePose, RotationIsThePolarFactorOfTheUnitAffineRows)
{
    Random random(13);
    const Camera truth = test::random_camera(random);
    const Eigen::Matrix3Xd points = random_points(random, 20);
    const Eigen::Matrix2Xd seen = add_noise(project(truth, points), 5, random);
    Eigen::Matrix<double, 2, 3> rows = estimate_affine_camera(points, seen).image_from_model.leftCols<3>();
    rows.rowwise().normalize();
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(rows, Eigen::ComputeThinU | Eigen::ComputeThinV);
    EXPECT_THAT(estimate_pose(points, seen).camera.camera_from_model.topRows<2>(),
                IsNear(Eigen::MatrixXd(svd.matrixU() * svd.matrixV().transpose()), 1e-10));
}

TEST(EstimatePose, ScaleAndTranslationAreTheBestForItsRotation)
{
    Random random(14);
    const Camera truth = test::random_camera(random);
    const Eigen::Matrix3Xd points = random_points(random, 30);
    const Eigen::Matrix2Xd seen = add_noise(project(truth, points), 4, random);
    const PoseResult pose = estimate_pose(points, seen);
    const auto error = [&](double scale, const Eigen::Vector2d& translation_px) {
        const Eigen::Matrix2Xd residuals =
            ((scale * pose.camera.camera_from_model.topRows<2>() * points).colwise() + translation_px) - seen;
        return residuals.squaredNorm();
    };
    const double least = error(pose.camera.scale_px_per_mm, pose.camera.image_translation_px());
    for (const double step : {-1e-3, 1e-3}) {
        EXPECT_GT(error(pose.camera.scale_px_per_mm + step, pose.camera.image_translation_px()), least);
        for (int axis = 0; axis < 2; ++axis) {
            EXPECT_GT(error(pose.camera.scale_px_per_mm,
                            pose.camera.image_translation_px() + step * Eigen::Vector2d::Unit(axis)),
                      least);
        }
    }
}

TEST(EstimatePose, RepeatedPointCountsLikeDoubleWeight)
{
    Random random(15);
    const Camera truth = test::random_camera(random);
    const Eigen::Matrix3Xd points = random_points(random, 12);
    const Eigen::Matrix2Xd seen = add_noise(project(truth, points), 4, random);
    Eigen::Matrix3Xd points_twice(3, 13);
    Eigen::Matrix2Xd seen_twice(2, 13);
    points_twice << points, points.col(3);
    seen_twice << seen, seen.col(3);
    Eigen::VectorXd weights = Eigen::VectorXd::Ones(12);
    weights[3] = 2;
    const Camera repeated = estimate_pose(points_twice, seen_twice).camera;
    const Camera weighted = estimate_pose(points, seen, weights).camera;
    EXPECT_THAT(repeated.camera_from_model, IsNear(weighted.camera_from_model, 1e-12));
    EXPECT_NEAR(repeated.scale_px_per_mm, weighted.scale_px_per_mm, 1e-12);
    EXPECT_THAT(estimate_pose(points, seen).camera.camera_from_model,
                Not(IsNear(weighted.camera_from_model, 1e-6))); // the twin: weight matters
}

TEST(EstimatePose, MirroredFaceGivesTheMirroredPose)
{
    Random random(16);
    const Camera truth = test::random_camera(random);
    const Eigen::Matrix3Xd points = random_points(random, 12);
    const Eigen::Matrix2Xd seen = add_noise(project(truth, points), 3, random);
    const Eigen::Matrix3Xd mirrored_points = Eigen::Vector3d(-1, 1, 1).asDiagonal() * points;
    const Eigen::Matrix2Xd mirrored_seen = Eigen::Vector2d(-1, 1).asDiagonal() * seen;
    const HeadAngles angles = angles_from_rotation(estimate_pose(points, seen).camera.camera_from_model);
    const HeadAngles mirrored =
        angles_from_rotation(estimate_pose(mirrored_points, mirrored_seen).camera.camera_from_model);
    EXPECT_NEAR(mirrored.yaw, -angles.yaw, 1e-10);
    EXPECT_NEAR(mirrored.pitch, angles.pitch, 1e-10);
    EXPECT_NEAR(mirrored.roll, -angles.roll, 1e-10);
}

TEST(EstimatePose, DegeneratePointsGetTheirStatusAndANeutralCamera)
{
    Random random(17);
    const Camera truth = test::random_camera(random);
    const auto expect = [&](const Eigen::Matrix3Xd& points, const Eigen::Matrix2Xd& seen, FitStatus status,
                            const std::string& reason) {
        const PoseResult pose = estimate_pose(points, seen);
        EXPECT_EQ(pose.status, status) << reason;
        EXPECT_NE(pose.reason.find(reason), std::string::npos) << pose.reason;
        EXPECT_EQ(pose.camera.camera_from_model, frontal_rotation());
        EXPECT_EQ(pose.camera.scale_px_per_mm, 1.0);
    };
    const Eigen::Matrix3Xd points = random_points(random, 10);
    const Eigen::Matrix2Xd seen = project(truth, points);
    expect(points.leftCols(3), seen.leftCols(3), FitStatus::too_few_correspondences, "got 3");
    expect(Eigen::Matrix3Xd(3, 0), Eigen::Matrix2Xd(2, 0), FitStatus::too_few_correspondences, "got 0");
    expect(Eigen::Vector3d(1, 2, 3).replicate(1, 10), seen, FitStatus::degenerate, "coincide");
    const Eigen::Matrix3Xd line = Eigen::Vector3d(1, 2, 3) * Eigen::RowVectorXd::LinSpaced(10, -30, 30);
    expect(line, project(truth, line), FitStatus::degenerate, "on a line");
    Eigen::Matrix3Xd plane = points;
    plane.row(2) = 0.3 * plane.row(0);
    expect(plane, project(truth, plane), FitStatus::degenerate, "in a plane");
    expect(points, Eigen::Vector2d(5, 6).replicate(1, 10), FitStatus::degenerate, "coincide");
    Eigen::Matrix2Xd flat = seen;
    flat.row(1) = 2 * flat.row(0);
    expect(points, flat, FitStatus::degenerate, "line");
    EXPECT_EQ(estimate_pose(points, seen).status, FitStatus::success);
    EXPECT_EQ(estimate_pose(points.leftCols(4), seen.leftCols(4)).status, FitStatus::success);
}

TEST(EstimatePose, FaceThatLooksAwayIsImplausible)
{
    Random random(18);
    const Eigen::Matrix3Xd points = random_points(random, 10);
    Camera camera;
    camera.camera_from_model = rotation_from_angles({radians(99), 0, 0});
    EXPECT_EQ(estimate_pose(points, project(camera, points)).status, FitStatus::success);
    camera.camera_from_model = rotation_from_angles({radians(101), 0, 0});
    EXPECT_EQ(estimate_pose(points, project(camera, points)).status, FitStatus::implausible);
}

TEST(EstimatePose, BrokenInputThrows)
{
    const Eigen::Matrix3Xd points = Eigen::Matrix3Xd::Random(3, 5);
    Eigen::Matrix2Xd seen = Eigen::Matrix2Xd::Random(2, 5);
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)estimate_pose(points, seen.leftCols(4)); }, "image_points"));
    EXPECT_TRUE(test::throws<InvalidArgument>(
        [&] { (void)estimate_pose(points, seen, Eigen::VectorXd::Constant(5, -1)); }, "weights"));
    seen(1, 2) = std::nan("");
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)estimate_pose(points, seen); }, "image_points(1, 2)", "nan"));
    EXPECT_TRUE(
        test::throws<InvalidArgument>([&] { (void)estimate_pose_perspective(points, seen, 0.0); }, "focal_length_px"));
}

TEST(EstimatePoseExactly, NoCameraNearbyHasASmallerError)
{
    Random random(22);
    for (int trial = 0; trial < 20; ++trial) {
        const Camera truth = test::random_camera(random, 60);
        const Eigen::Matrix3Xd points = random_points(random, 20);
        const Eigen::Matrix2Xd seen = add_noise(project(truth, points), 5, random);
        const Eigen::VectorXd weights = Eigen::VectorXd::NullaryExpr(20, [&] { return random.uniform(0.1, 2.0); });
        const auto error_of = [&](const Camera& camera) {
            return (project(camera, points) - seen).colwise().squaredNorm().dot(weights);
        };
        const PoseResult closed = estimate_pose(points, seen, weights, truth.principal_point_px);
        const PoseResult exact = estimate_pose_exactly(points, seen, weights, truth.principal_point_px);
        ASSERT_EQ(exact.status, FitStatus::success) << exact.reason;
        EXPECT_EQ(exact.camera.phi_per_mm, 0);
        const double least = error_of(exact.camera);
        EXPECT_NEAR(exact.rms_px, std::sqrt(least / weights.sum()), 1e-9);
        EXPECT_LT(least, error_of(closed.camera)); // the closed form is near, but not there
        for (int unknown = 0; unknown < 6; ++unknown) {
            for (const double step : {-1e-3, 1e-3}) {
                Camera moved = exact.camera;
                if (unknown < 3) {
                    moved.camera_from_model =
                        Eigen::AngleAxisd(step, Eigen::Vector3d::Unit(unknown)) * moved.camera_from_model;
                } else if (unknown == 3) {
                    moved.scale_px_per_mm *= 1 + step;
                } else {
                    moved.translation_mm[unknown - 4] += 100 * step;
                }
                EXPECT_GT(error_of(moved), least) << unknown;
            }
        }
    }
    const Eigen::Matrix3Xd plane = Eigen::Vector3d(1, 1, 0).asDiagonal() * random_points(random, 10);
    EXPECT_EQ(estimate_pose_exactly(plane, project(Camera{}, plane)).status, FitStatus::degenerate);
}

TEST(EstimatePosePerspective, RecoversThePlantedCameraExactly)
{
    Random random(19);
    for (int trial = 0; trial < 50; ++trial) {
        Camera truth = test::random_camera(random, 60);
        const double focal_length_px = truth.scale_px_per_mm * random.uniform(300, 3000);
        truth.phi_per_mm = truth.scale_px_per_mm / focal_length_px;
        const Eigen::Matrix3Xd points = random_points(random, 20);
        const PoseResult pose =
            estimate_pose_perspective(points, project(truth, points), focal_length_px, {}, truth.principal_point_px);
        ASSERT_EQ(pose.status, FitStatus::success) << pose.reason;
        EXPECT_THAT(pose.camera.camera_from_model, IsNear(truth.camera_from_model, 1e-8));
        EXPECT_NEAR(pose.camera.scale_px_per_mm, truth.scale_px_per_mm, 1e-8);
        EXPECT_NEAR(pose.camera.phi_per_mm, truth.phi_per_mm, 1e-10);
        EXPECT_THAT(pose.camera.translation_mm, IsNear(truth.translation_mm, 1e-6));
    }
}

TEST(EstimatePosePerspective, FarAwayItIsTheBestScaledOrthographicPose)
{
    Random random(20);
    const Camera truth = test::random_camera(random);
    const Eigen::Matrix3Xd points = random_points(random, 20);
    const Eigen::Matrix2Xd seen = add_noise(project(truth, points), 3, random);
    const PoseResult exact = estimate_pose_exactly(points, seen);
    const PoseResult far = estimate_pose_perspective(points, seen, 1e9);
    EXPECT_EQ(far.status, FitStatus::success);
    EXPECT_THAT(far.camera.camera_from_model, IsNear(exact.camera.camera_from_model, 1e-6));
    const PoseResult near = estimate_pose_perspective(points, seen, 500 * truth.scale_px_per_mm);
    EXPECT_THAT(near.camera.camera_from_model, testing::Not(IsNear(exact.camera.camera_from_model, 1e-3)));
}

TEST(EstimatePosePerspective, FaceTooNearIsImplausible)
{
    Random random(21);
    const Camera truth = test::random_camera(random);
    const Eigen::Matrix3Xd points = random_points(random, 20);
    const PoseResult pose = estimate_pose_perspective(points, project(truth, points), 100 * truth.scale_px_per_mm);
    EXPECT_EQ(pose.status, FitStatus::implausible);
    EXPECT_TRUE(pose.camera.camera_from_model.allFinite());
}

TEST(EstimateAffineCamera, RecoversAnyAffineCameraExactly)
{
    Random random(23);
    const Eigen::Matrix3Xd points = random_points(random, 9);
    Eigen::Matrix<double, 2, 4> truth;
    truth << 1.2, 0.1, -0.3, 310, 0.05, -2.4, 0.2, 205; // non-uniform scale and shear
    const Eigen::Matrix2Xd seen = truth * points.colwise().homogeneous();
    const AffineCameraResult result = estimate_affine_camera(points, seen);
    ASSERT_EQ(result.status, FitStatus::success);
    EXPECT_THAT(result.image_from_model, IsNear(truth, 1e-9));
}

TEST(EstimateAffineCamera, IsTheLeastSquaresSolution)
{
    Random random(24);
    const Eigen::Matrix3Xd points = random_points(random, 15);
    const Eigen::Matrix2Xd seen = add_noise(project(test::random_camera(random), points), 5, random);
    const Eigen::MatrixXd design = points.colwise().homogeneous().transpose();
    const Eigen::MatrixXd expected =
        Eigen::JacobiSVD<Eigen::MatrixXd>(design, Eigen::ComputeThinU | Eigen::ComputeThinV)
            .solve(Eigen::MatrixXd(seen.transpose()))
            .transpose();
    EXPECT_THAT(estimate_affine_camera(points, seen).image_from_model, IsNear(expected, 1e-9));
}

TEST(EstimateAffineCamera, DegeneratePointsGetTheirStatus)
{
    Random random(25);
    Eigen::Matrix3Xd points = random_points(random, 9);
    const Eigen::Matrix2Xd seen = project(test::random_camera(random), points);
    EXPECT_EQ(estimate_affine_camera(points.leftCols(3), seen.leftCols(3)).status, FitStatus::too_few_correspondences);
    points.row(2).setZero();
    EXPECT_EQ(estimate_affine_camera(points, seen).status, FitStatus::degenerate);
    points.setZero();
    EXPECT_EQ(estimate_affine_camera(points, seen).status, FitStatus::degenerate);
}

TEST(SeePoint, DerivativesAreDifferencesOfProjections)
{
    Random random(812);
    for (const double phi : {0.0, 0.002}) {
        Camera camera = test::random_camera(random, 60);
        camera.phi_per_mm = phi;
        const Eigen::Vector3d point = 60 * test::random_normal(random, 3);
        const detail::SeenPoint seen = detail::see_point(camera, point);
        EXPECT_THAT(seen.at_px, IsNear(camera.project(point), 1e-10));
        EXPECT_THAT(seen.by_point, IsNear(camera.jacobian(point), 1e-12));
        const double focal_length_px = phi > 0 ? camera.scale_px_per_mm / phi : std::numeric_limits<double>::infinity();
        for (int k = 0; k < 6; ++k) {
            const detail::PoseStep step = 1e-5 * detail::PoseStep::Unit(k);
            const Eigen::Vector2d forth = detail::apply_step(camera, step, focal_length_px).project(point);
            const Eigen::Vector2d back = detail::apply_step(camera, -step, focal_length_px).project(point);
            EXPECT_THAT(seen.by_camera.col(k), IsNear(Eigen::Vector2d((forth - back) / 2e-5), 1e-6)) << k;
        }
        Camera nearer = camera, farther = camera;
        nearer.phi_per_mm += 1e-8;
        farther.phi_per_mm -= 1e-8;
        const Eigen::Vector2d slope = (nearer.project(point) - farther.project(point)) / 2e-8;
        EXPECT_THAT(seen.by_phi, IsNear(slope, 1e-4));
        EXPECT_GT(seen.by_phi.norm(), 1); // the twin
    }
}

} // namespace
} // namespace lineament
