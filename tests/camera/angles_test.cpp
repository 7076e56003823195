// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/camera/angles.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <Eigen/LU>

namespace lineament {
namespace {

using test::IsNear;

TEST(Angles, FrontalIsZero)
{
    const HeadAngles angles = angles_from_rotation(frontal_rotation());
    EXPECT_EQ(angles.yaw, 0.0);
    EXPECT_EQ(angles.pitch, 0.0);
    EXPECT_EQ(angles.roll, 0.0);
}

TEST(Angles, InverseOfEachOther)
{
    Random random(1);
    for (int i = 0; i < 1000; ++i) {
        const HeadAngles angles{random.uniform(-3.1, 3.1), random.uniform(-1.5, 1.5), random.uniform(-3.1, 3.1)};
        const HeadAngles back = angles_from_rotation(rotation_from_angles(angles));
        EXPECT_NEAR(back.yaw, angles.yaw, 1e-9);
        EXPECT_EQ(yaw_from_rotation(rotation_from_angles(angles)), back.yaw);
        EXPECT_NEAR(back.pitch, angles.pitch, 1e-9);
        EXPECT_NEAR(back.roll, angles.roll, 1e-9);
    }
}

TEST(Angles, PositiveYawMovesTheNoseToTheRightOfTheImage)
{
    Camera camera;
    camera.camera_from_model = rotation_from_angles({radians(30), 0, 0});
    EXPECT_GT(camera.project(Eigen::Vector3d(0, 0, 100)).x(), 40.0);
}

TEST(Angles, PositivePitchMovesTheNoseDown)
{
    Camera camera;
    camera.camera_from_model = rotation_from_angles({0, radians(30), 0});
    EXPECT_GT(camera.project(Eigen::Vector3d(0, 0, 100)).y(), 40.0);
}

TEST(Angles, PositiveRollTiltsTheHeadTowardsTheSubjectsRightShoulder)
{
    Camera camera;
    camera.camera_from_model = rotation_from_angles({0, 0, radians(30)});
    EXPECT_LT(camera.project(Eigen::Vector3d(0, 100, 0)).x(), -40.0); // the subject's right is the image's left
}

TEST(Angles, RotationIsProper)
{
    const Eigen::Matrix3d rotation = rotation_from_angles({0.3, -0.4, 2.0});
    EXPECT_NEAR(rotation.determinant(), 1.0, 1e-12);
    EXPECT_THAT(rotation * rotation.transpose(), IsNear(Eigen::Matrix3d::Identity(), 1e-12));
}

} // namespace
} // namespace lineament
