// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/camera/camera.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

namespace lineament {
namespace {

using test::IsNear;

TEST(Camera, WithoutPhiItIsScaledOrthographic)
{
    Random random(1);
    const Camera camera = test::random_camera(random);
    const Eigen::Vector3d point(12, -30, 45);
    EXPECT_THAT(camera.project(point),
                IsNear(Eigen::Vector2d(camera.scale_px_per_mm * (camera.camera_from_model * point).head<2>() +
                                       camera.image_translation_px()),
                       1e-11));
}

TEST(Camera, WithPhiItIsThePinholeCameraOfFocalLengthScaleOverPhi)
{
    Random random(2);
    Camera camera = test::random_camera(random);
    camera.phi_per_mm = 1.0 / 450;
    const double focal_length_px = camera.scale_px_per_mm / camera.phi_per_mm;
    const Eigen::Vector3d point(12, -30, 45);
    const Eigen::Vector3d in_camera =
        camera.camera_from_model * point + Eigen::Vector3d(camera.translation_mm.x(), camera.translation_mm.y(), 450);
    EXPECT_THAT(camera.project(point),
                IsNear(Eigen::Vector2d(camera.principal_point_px + focal_length_px * in_camera.hnormalized()), 1e-10));
}

TEST(Camera, ManyPointsProjectLikeEach)
{
    Random random(3);
    const Camera camera = test::random_camera(random);
    const Eigen::Matrix3Xd points = test::random_normal(random, 30).reshaped(3, 10);
    const Eigen::Matrix2Xd seen = camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(points));
    for (int i = 0; i < 10; ++i) {
        EXPECT_EQ(seen.col(i), camera.project(Eigen::Vector3d(points.col(i))));
    }
}

TEST(Camera, JacobianAgreesWithCentralDifferences)
{
    Random random(22);
    for (const double phi : {0.0, 1.0 / 400}) {
        Camera camera = test::random_camera(random);
        camera.phi_per_mm = phi;
        const Eigen::Vector3d point(20, -30, 50);
        for (int axis = 0; axis < 3; ++axis) {
            const Eigen::Vector3d step = 1e-3 * Eigen::Vector3d::Unit(axis);
            const Eigen::Vector2d difference =
                (camera.project(Eigen::Vector3d(point + step)) - camera.project(Eigen::Vector3d(point - step))) / 2e-3;
            EXPECT_THAT(camera.jacobian(point).col(axis), IsNear(difference, 1e-8));
        }
    }
}

} // namespace
} // namespace lineament
