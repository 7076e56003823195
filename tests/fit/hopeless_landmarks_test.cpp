// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Landmarks that no pose explains get their status whatever the face, its turn and the fitter.
#include "lineament/camera/angles.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/face_model.hpp"
#include "support/planted_face.hpp"

#include <gtest/gtest.h>

#include <functional>

namespace lineament {
namespace {

using test::face_model;

const Eigen::Vector2d centre(320, 240);
constexpr int num_trials = 200;

/// Drawn from the priors, yaw uniform within 60 degrees, 1 px of noise.
LandmarkSet draw_landmarks(Random& random)
{
    Camera camera;
    camera.camera_from_model = rotation_from_angles(
        {radians(random.uniform(-60, 60)), radians(8 * random.normal()), radians(5 * random.normal())});
    camera.scale_px_per_mm = random.uniform(0.4, 4);
    camera.translation_mm = {20 * random.normal(), 20 * random.normal()};
    camera.principal_point_px = centre;
    const Eigen::VectorXd alpha = test::random_normal(random, face_model().shape.num_coefficients());
    return test::project_landmarks(face_model(), "ibug68", alpha, test::draw_expression(random), camera, 1, random);
}

using Fit = std::function<FitResult(const LandmarkSet&)>;

struct NamedFit
{
    const char* name;
    Fit fit;
};

std::vector<NamedFit> fits()
{
    static const FaceFitter face_fitter(face_model(), "ibug68");
    static const RealtimeFitter realtime_fitter(face_model(), "ibug68", {}, kernels::dispatched_kernels());
    static const JointFitter joint_fitter(face_model(), "ibug68", {}, &kernels::dispatched_kernels());
    return {{"FaceFitter", [](const LandmarkSet& set) { return face_fitter.fit(set, centre); }},
            {"RealtimeFitter",
             [](const LandmarkSet& set) {
                 RealtimeWorkspace workspace = realtime_fitter.make_workspace();
                 FitResult result;
                 realtime_fitter.fit(set, centre, workspace, result);
                 return result;
             }},
            {"JointFitter", [](const LandmarkSet& set) { return joint_fitter.fit(set, centre).fit; }}};
}

/// How many of the drawn faces, once `spoil` is through with their landmarks, have that status.
int count(const Fit& fit, FitStatus status, const std::function<void(LandmarkSet&, Random&)>& spoil)
{
    Random random(261);
    int num_found = 0;
    for (int trial = 0; trial < num_trials; ++trial) {
        LandmarkSet set = draw_landmarks(random);
        spoil(set, random);
        const FitResult result = fit(set);
        num_found += result.status == status;
        EXPECT_TRUE(result.camera.camera_from_model.allFinite() && result.shape_coefficients.allFinite() &&
                    result.expression_coefficients.allFinite() && std::isfinite(result.rms_px));
    }
    return num_found;
}

void expect_of_all(FitStatus status, const std::function<void(LandmarkSet&, Random&)>& spoil)
{
    for (const auto& [name, fit] : fits()) {
        EXPECT_EQ(count(fit, status, spoil), num_trials) << name;
    }
}

TEST(HopelessLandmarks, AMirroredFaceIsImplausible)
{
    expect_of_all(FitStatus::implausible, [](LandmarkSet& set, Random&) {
        for (Landmark& landmark : set.landmarks) {
            landmark.point_px.x() = 640 - landmark.point_px.x(); // without renaming
        }
    });
}

TEST(HopelessLandmarks, ThoseOnALineAreDegenerate)
{
    expect_of_all(FitStatus::degenerate, [](LandmarkSet& set, Random& random) {
        const double angle = random.uniform(0, 3.14159265);
        const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
        for (Landmark& landmark : set.landmarks) {
            landmark.point_px = centre + direction * direction.dot(landmark.point_px - centre);
        }
    });
}

TEST(HopelessLandmarks, ThoseInOnePlaceAreDegenerate)
{
    expect_of_all(FitStatus::degenerate, [](LandmarkSet& set, Random&) {
        const Eigen::Vector2d place = set.landmarks[30].point_px;
        for (Landmark& landmark : set.landmarks) {
            landmark.point_px = place;
        }
    });
}

TEST(HopelessLandmarks, FourOfTheBridgeOfTheNoseWhichLieInAPlaneAreDegenerate)
{
    expect_of_all(FitStatus::degenerate, [](LandmarkSet& set, Random&) {
        set.landmarks = {set.landmarks.begin() + 27, set.landmarks.begin() + 31};
    });
}

TEST(HopelessLandmarks, LeftAsTheyAreTheyAreNot) // the twin
{
    for (const auto& [name, fit] : fits()) {
        EXPECT_GE(count(fit, FitStatus::success, [](LandmarkSet&, Random&) {}), num_trials - 2) << name;
    }
}

} // namespace
} // namespace lineament
