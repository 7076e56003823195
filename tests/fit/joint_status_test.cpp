// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What the fitters say of landmarks that are no face, and what some wild or doubted ones do to the joint fit.
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/realtime_fitter.hpp"

#include "support/matchers.hpp"
#include "support/planted_face.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace lineament {
namespace {

using test::angle_between_deg;
using test::plant_moderate_face;
using test::PlantedFace;
using test::synthetic_face;

const Eigen::Vector2d centre(320, 240);

void permute(LandmarkSet& set, Random& random)
{
    for (std::size_t i = set.landmarks.size() - 1; i > 0; --i) {
        const auto other = static_cast<std::size_t>(random.index(static_cast<int>(i) + 1));
        std::swap(set.landmarks[i].point_px, set.landmarks[other].point_px);
    }
}

void put_about_a_line(LandmarkSet& set, double noise_px, Random& random)
{
    const double angle = random.uniform(0, 6.28);
    const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
    for (Landmark& landmark : set.landmarks) {
        landmark.point_px =
            centre + along.dot(landmark.point_px - centre) * along + noise_px * test::random_normal(random, 2);
    }
}

void expect_flagged_and_finite(const LandmarkSet& set)
{
    static const JointFitter joint(synthetic_face());
    static const FaceFitter thesis(synthetic_face());
    const JointFitResult result = joint.fit(set, centre);
    EXPECT_NE(result.fit.status, FitStatus::success);
    EXPECT_NE(result.fit.reason, "");
    EXPECT_TRUE(result.covariance.allFinite() && result.expression_deviations.allFinite());
    EXPECT_TRUE(std::isfinite(result.fit.chi_square) && std::isfinite(result.fit.rms_px));
    EXPECT_TRUE(result.fit.camera.translation_mm.allFinite() && result.fit.camera.scale_px_per_mm > 0);
    EXPECT_NE(thesis.fit(set, centre).status, FitStatus::success);
    static const RealtimeFitter realtime(synthetic_face());
    RealtimeWorkspace workspace = realtime.make_workspace();
    FitResult fit;
    realtime.fit(set, centre, workspace, fit);
    EXPECT_NE(fit.status, FitStatus::success);
}

TEST(JointStatus, LandmarksThatAreNoFaceAreNeverASuccess)
{
    Random random(641);
    for (int trial = 0; trial < 20; ++trial) {
        const LandmarkSet face = plant_moderate_face(random, 1.0).landmarks;
        LandmarkSet set = face;
        permute(set, random);
        expect_flagged_and_finite(set);
        for (const double spread_px : {0.1, 2.0, 60.0}) {
            for (Landmark& landmark : set.landmarks) {
                landmark.point_px = centre + spread_px * test::random_normal(random, 2);
            }
            expect_flagged_and_finite(set);
        }
        for (const double noise_px : {0.1, 0.5, 3.0}) {
            set = face;
            put_about_a_line(set, noise_px, random);
            expect_flagged_and_finite(set);
        }
    }
}

TEST(JointStatus, OneOfSeveralImagesThatIsNoFaceIsNamed)
{
    Random random(642);
    const JointFitter fitter(synthetic_face());
    for (int trial = 0; trial < 10; ++trial) {
        std::vector<LandmarkSet> images(3, plant_moderate_face(random, 1.0).landmarks);
        EXPECT_EQ(fitter.fit_frames(images, centre).status, FitStatus::success);
        permute(images[1], random);
        const JointFramesResult result = fitter.fit_frames(images, centre);
        EXPECT_NE(result.frames[1].fit.status, FitStatus::success);
        EXPECT_TRUE(result.num_used_frames < 3 || result.status != FitStatus::success);
        EXPECT_TRUE(result.shape_covariance.allFinite() && std::isfinite(result.chi_square));
    }
}

/// Landmarks of a face up to `reach_px` off, all to one side: largest angle to the truth [degrees], 180 without
/// success.
double worst_angle_deg(int num_wild, double reach_px)
{
    Random random(643);
    const JointFitter fitter(synthetic_face());
    double worst = 0;
    for (int trial = 0; trial < 10; ++trial) {
        PlantedFace planted = plant_moderate_face(random, 1.0);
        for (int wild = 0; wild < num_wild; ++wild) {
            Landmark& landmark = planted.landmarks.landmarks[static_cast<std::size_t>(18 + 5 * wild)];
            landmark.point_px += Eigen::Vector2d(random.uniform(-reach_px, reach_px), reach_px);
        }
        const FitResult fit = fitter.fit(planted.landmarks, planted.camera.principal_point_px).fit;
        const double angle = angle_between_deg(fit.camera.camera_from_model, planted.camera.camera_from_model);
        worst = std::max(worst, fit.status == FitStatus::success ? angle : 180.0);
    }
    return worst;
}

TEST(JointStatus, WildLandmarksDoNotSwayTheFirstPose)
{
    EXPECT_LT(worst_angle_deg(1, 1e4), 10.0);
    EXPECT_LT(worst_angle_deg(1, 1e5), 10.0);
    EXPECT_LT(worst_angle_deg(7, 1e3), 10.0);
    EXPECT_LT(worst_angle_deg(0, 0.0), 10.0);
}

TEST(JointStatus, DoubtedLandmarksCountLessInTheFirstPose)
{
    Random random(644);
    const JointFitter fitter(synthetic_face());
    double doubted = 0;
    double trusted = 0;
    for (int trial = 0; trial < 20; ++trial) {
        PlantedFace planted = plant_moderate_face(random, 1.0);
        std::vector<Landmark>& landmarks = planted.landmarks.landmarks;
        for (std::size_t wrong = 18; wrong < 68; wrong += wrong % 3 == 0 ? 1 : 2) { // most: too many to be told as wild
            landmarks[wrong].point_px = {random.uniform(0, 640), random.uniform(0, 480)};
        }
        const auto error_deg = [&] {
            const FitResult fit = fitter.fit(planted.landmarks, planted.camera.principal_point_px).fit;
            return angle_between_deg(fit.camera.camera_from_model, planted.camera.camera_from_model) / 20;
        };
        trusted += error_deg();
        for (std::size_t wrong = 18; wrong < 68; wrong += wrong % 3 == 0 ? 1 : 2) {
            landmarks[wrong].confidence = 0.01;
        }
        doubted += error_deg();
    }
    EXPECT_LT(doubted, 6.0);
    EXPECT_GT(trusted, 2 * doubted);
}

} // namespace
} // namespace lineament
