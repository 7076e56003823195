// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/gaze.hpp"

#include "lineament/camera/angles.hpp"
#include "support/matchers.hpp"

#include <limits>

namespace lineament {
namespace {

/// A fit whose right eye looks somewhere else than the fitted face, which looks straight ahead: two balls in space.
FitResult looking(const HeadAngles& head, double gaze_yaw, double gaze_pitch, double phi_per_mm = 0.0)
{
    FitResult fit;
    fit.camera.camera_from_model = rotation_from_angles(head);
    fit.camera.scale_px_per_mm = 1.7;
    fit.camera.principal_point_px = {320, 240};
    fit.camera.translation_mm = {12, -30};
    fit.camera.phi_per_mm = phi_per_mm;
    const Eigen::Vector3d center(-32, 30, 40);
    const Eigen::Vector3d direction(std::sin(gaze_yaw) * std::cos(gaze_pitch), std::sin(gaze_pitch),
                                    std::cos(gaze_yaw) * std::cos(gaze_pitch));
    const auto project = [&](const Eigen::Vector3d& point) { return fit.camera.project(point); };
    const Eigen::Vector2d shift_px(3, -2); // the fit misses the whole eye by that much
    fit.landmarks = {
        {"468", project(center + pupil_distance_mm * direction) + shift_px,
         project(center + pupil_distance_mm * Eigen::Vector3d::UnitZ()), 0.0},
        {"33", project({-46, 29, 43}) + shift_px, project({-46, 29, 43}), 1.0},
        {"133", project({-18, 29, 46}) + shift_px, project({-18, 29, 46}), 1.0},
    };
    return fit;
}

TEST(Gaze, FindsWhereAnEyeLooksWhateverTheHeadDoes)
{
    for (const HeadAngles& head : {HeadAngles{0, 0, 0}, HeadAngles{0.5, 0.2, -0.3}, HeadAngles{-0.7, -0.2, 0.1}}) {
        for (const double yaw : {-0.4, 0.0, 0.35}) {
            for (const double pitch : {-0.25, 0.0, 0.2}) {
                const Gaze gaze = measure_gaze(looking(head, yaw, pitch));
                ASSERT_TRUE(gaze.right.has_value());
                EXPECT_FALSE(gaze.left.has_value()); // its points are not there
                EXPECT_NEAR(gaze.right->yaw, yaw, 1e-9);
                EXPECT_NEAR(gaze.right->pitch, pitch, 1e-9);
                EXPECT_NEAR(gaze.right->offset_mm.y(), pupil_distance_mm * std::sin(pitch), 1e-9);
                // Under perspective the eye's depth is not known: off by up to 7 degrees at 40 cm.
                const Gaze near_gaze = measure_gaze(looking(head, yaw, pitch, 1.0 / 400));
                EXPECT_NEAR(near_gaze.right->yaw, yaw, radians(7));
                EXPECT_NEAR(near_gaze.right->pitch, pitch, radians(7));
            }
        }
    }
}

TEST(Gaze, OfAnEyeThatIsNotSeenIsUnknown)
{
    EXPECT_TRUE(measure_gaze(looking({radians(65), 0, 0}, 0, 0)).right.has_value());
    EXPECT_FALSE(measure_gaze(looking({radians(75), 0, 0}, 0, 0)).right.has_value());
    FitResult fit = looking({}, 0, 0);
    fit.landmarks[0].point_px.x() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(measure_gaze(fit).right.has_value());
    fit = looking({}, 0, 0);
    fit.landmarks.pop_back();
    EXPECT_FALSE(measure_gaze(fit).right.has_value());
    EXPECT_FALSE(measure_gaze(FitResult()).left.has_value());
}

TEST(Gaze, FartherThanAnEyeCanTurnIsItsEdge)
{
    FitResult fit = looking({}, 0.3, 0.0);
    fit.landmarks[0].point_px.x() += 100.0; // in the picture to the right: the subject's left
    const std::optional<EyeGaze> gaze = measure_gaze(fit).right;
    ASSERT_TRUE(gaze.has_value());
    EXPECT_NEAR(gaze->yaw, radians(90), 1e-3);
}

TEST(Gaze, MeanIsOfTheEyesThatHaveOne)
{
    const EyeGaze right{{1, 2}, 0.1, 0.3};
    const EyeGaze left{{3, -2}, 0.2, -0.1};
    const std::optional<EyeGaze> both = Gaze{right, left}.mean();
    ASSERT_TRUE(both.has_value());
    EXPECT_EQ(both->offset_mm, Eigen::Vector2d(2, 0));
    EXPECT_NEAR(both->yaw, 0.15, 1e-15);
    EXPECT_NEAR(both->pitch, 0.1, 1e-15);
    EXPECT_EQ(Gaze({right, std::nullopt}).mean()->yaw, 0.1);
    EXPECT_EQ(Gaze({std::nullopt, left}).mean()->yaw, 0.2);
    EXPECT_FALSE(Gaze().mean().has_value());
}

} // namespace
} // namespace lineament
