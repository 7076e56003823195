// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What the joint fit says of landmarks that are no face, that are doubted, or that are out of reach.
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/realtime_fitter.hpp"

#include "planted_images.hpp"
#include "support/matchers.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

namespace lineament {
namespace {

using test::angle_between_deg;
using test::centre;
using test::plant;
using test::Planted;
using test::synthetic_face;

bool is_finite(const JointFitResult& result)
{
    bool is_finite = result.fit.shape_coefficients.allFinite() && result.fit.expression_coefficients.allFinite() &&
                     result.fit.camera.camera_from_model.allFinite() && result.fit.camera.translation_mm.allFinite() &&
                     std::isfinite(result.fit.camera.scale_px_per_mm) && std::isfinite(result.fit.rms_px) &&
                     std::isfinite(result.fit.chi_square) && result.covariance.allFinite() &&
                     result.expression_deviations.allFinite();
    for (const FittedLandmark& landmark : result.fit.landmarks) {
        is_finite = is_finite && landmark.fitted_px.allFinite() && std::isfinite(landmark.weight);
    }
    return is_finite;
}

void permute(LandmarkSet& set, Random& random)
{
    for (std::size_t i = set.landmarks.size() - 1; i > 0; --i) {
        const std::size_t other = static_cast<std::size_t>(random.index(static_cast<int>(i) + 1));
        std::swap(set.landmarks[i].point_px, set.landmarks[other].point_px);
    }
}

struct NoFace
{
    const char* name;
    std::function<void(LandmarkSet&, Random&)> make;
};

void PrintTo(const NoFace& family, std::ostream* out)
{
    *out << family.name;
}

std::function<void(LandmarkSet&, Random&)> heap_of(double spread_px)
{
    return [spread_px](LandmarkSet& set, Random& random) {
        for (Landmark& landmark : set.landmarks) {
            landmark.point_px = centre + spread_px * test::random_normal(random, 2);
        }
    };
}

std::function<void(LandmarkSet&, Random&)> line_of(double noise_px)
{
    return [noise_px](LandmarkSet& set, Random& random) {
        const double angle = random.uniform(0, 6.28);
        const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
        for (Landmark& landmark : set.landmarks) {
            const double place = along.dot(landmark.point_px - centre);
            landmark.point_px = centre + place * along + noise_px * test::random_normal(random, 2);
        }
    };
}

class NoFaceTest : public testing::TestWithParam<NoFace>
{};

TEST_P(NoFaceTest, IsNeverASuccessAndAlwaysFinite)
{
    Random random(611);
    const JointFitter fitter(synthetic_face());
    for (int trial = 0; trial < 25; ++trial) {
        LandmarkSet set = plant(random, 1, 1.0).images[0];
        const JointFitResult face = fitter.fit(set, centre);
        EXPECT_EQ(face.fit.status, FitStatus::success) << face.fit.reason; // what it was before
        GetParam().make(set, random);
        const JointFitResult result = fitter.fit(set, centre);
        EXPECT_NE(result.fit.status, FitStatus::success) << trial;
        EXPECT_FALSE(result.fit.reason.empty()) << trial;
        EXPECT_TRUE(is_finite(result)) << trial;
    }
}

INSTANTIATE_TEST_SUITE_P(Joint, NoFaceTest,
                         testing::Values(NoFace{"permuted", permute}, NoFace{"point", heap_of(0.1)},
                                         NoFace{"heap", heap_of(2)}, NoFace{"cloud", heap_of(60)},
                                         NoFace{"line", line_of(0.1)}, NoFace{"noisy_line", line_of(0.5)},
                                         NoFace{"wide_line", line_of(2)}),
                         [](const auto& info) { return std::string(info.param.name); });

TEST(JointJudgement, OneOfSeveralImagesThatIsNoFaceIsNamed)
{
    Random random(612);
    const JointFitter fitter(synthetic_face());
    for (int trial = 0; trial < 10; ++trial) {
        Planted planted = plant(random, 3, 1.0);
        permute(planted.images[1], random);
        const JointFramesResult result = fitter.fit_frames(planted.images, centre);
        const bool is_used = result.num_used_frames == 3; // it may have no usable pose at all
        EXPECT_EQ(result.status == FitStatus::success, !is_used);
        EXPECT_NE(result.frames[1].fit.status, FitStatus::success);
        EXPECT_TRUE(result.shape_covariance.allFinite());
        for (const JointFitResult& frame : result.frames) {
            EXPECT_TRUE(is_finite(frame));
        }
    }
}

TEST(JointJudgement, NoiseFarAboveTheStatedOneIsImplausible)
{
    Random random(613);
    const LandmarkSet set = plant(random, 1, 3.0).images[0];
    JointOptions options = test::given(3.0);
    EXPECT_EQ(JointFitter(synthetic_face(), "ibug68", options).fit(set, centre).fit.status, FitStatus::success);
    options.landmark_sigma_mm = options.contour_sigma_mm = 0.05;
    const FitResult fit = JointFitter(synthetic_face(), "ibug68", options).fit(set, centre).fit;
    EXPECT_EQ(fit.status, FitStatus::implausible);
    EXPECT_NE(fit.reason, "");
}

/// Mean angle of the pose error [degrees] where 15 inner landmarks lie anywhere in the picture.
double pose_error_deg(double confidence_of_wrong)
{
    Random random(614);
    const JointFitter fitter(synthetic_face());
    double sum = 0;
    const int num_trials = 20;
    for (int trial = 0; trial < num_trials; ++trial) {
        Planted planted = plant(random, 1, 1.0);
        for (int wrong = 0; wrong < 15; ++wrong) {
            Landmark& landmark = planted.images[0].landmarks[static_cast<std::size_t>(17 + 3 * wrong)];
            landmark.point_px = {random.uniform(0, 640), random.uniform(0, 480)};
            landmark.confidence = confidence_of_wrong;
        }
        const FitResult fit = fitter.fit(planted.images[0], centre).fit;
        sum += angle_between_deg(fit.camera.camera_from_model, planted.cameras[0].camera_from_model) / num_trials;
    }
    return sum;
}

TEST(JointJudgement, ConfidencesCountFromTheFirstPoseOn)
{
    EXPECT_LT(pose_error_deg(0.01), 4.0);
    EXPECT_GT(pose_error_deg(1.0), 8.0); // such landmarks do harm where they count in full
}

TEST(FitterLimits, StatedNoiseMustBePositive)
{
    for (const float noise_mm : {0.0f, -1.0f, std::numeric_limits<float>::quiet_NaN()}) {
        MorphableModel model = synthetic_face();
        Eigen::VectorXf noise = Eigen::VectorXf::Constant(68, 2.0f);
        noise[30] = noise_mm;
        model.landmark_maps[0].noise_mm["detector"] = noise;
        EXPECT_TRUE(test::throws<InvalidArgument>([&] { FaceFitter{model}; }, "noise_mm[30]"));
        EXPECT_TRUE(test::throws<InvalidArgument>([&] { JointFitter{model}; }, "noise_mm[30]"));
        EXPECT_TRUE(test::throws<InvalidArgument>([&] { RealtimeFitter{model}; }, "noise_mm[30]"));
        model.landmark_maps[0].noise_mm["detector"][30] = std::numeric_limits<float>::infinity();
        EXPECT_NO_THROW(JointFitter{model});
    }
}

TEST(FitterLimits, CoordinatesBeyondAnyPictureAreRefused)
{
    Random random(615);
    const JointFitter joint(synthetic_face());
    const RealtimeFitter realtime(synthetic_face());
    RealtimeWorkspace workspace = realtime.make_workspace();
    for (const double factor : {1.0, 1e8, 1e100, 1e154, 1e300}) {
        LandmarkSet set = plant(random, 1, 1.0).images[0];
        for (Landmark& landmark : set.landmarks) {
            landmark.point_px *= factor;
        }
        FitResult result;
        if (factor == 1.0) {
            EXPECT_EQ(joint.fit(set, centre).fit.status, FitStatus::success);
            continue;
        }
        EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)joint.fit(set, centre); }, "at most 10000000 px"));
        EXPECT_TRUE(
            test::throws<InvalidArgument>([&] { (void)realtime.reference().fit(set, centre); }, "at most 10000000 px"));
        EXPECT_TRUE(test::throws<InvalidArgument>([&] { realtime.fit(set, centre, workspace, result); },
                                                  "at most 10000000 px"));
        set = plant(random, 1, 1.0).images[0];
        set.landmarks[20].depth_px = factor;
        EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)joint.fit(set, centre); }, "depth_px"));
    }
}

TEST(FitterLimits, LandmarksOfNextToNoConfidenceAreNotSeen)
{
    Random random(616);
    const JointFitter joint(synthetic_face());
    const RealtimeFitter realtime(synthetic_face());
    RealtimeWorkspace workspace = realtime.make_workspace();
    LandmarkSet set = plant(random, 1, 1.0).images[0];
    for (const double confidence : {1e-5, 1e-7, 1e-100}) {
        for (Landmark& landmark : set.landmarks) {
            landmark.confidence = confidence;
        }
        const FitStatus expected = confidence > 1e-6 ? FitStatus::success : FitStatus::too_few_correspondences;
        FitResult result;
        realtime.fit(set, centre, workspace, result);
        EXPECT_EQ(result.status, expected) << confidence;
        EXPECT_EQ(realtime.reference().fit(set, centre).status, expected) << confidence;
        const JointFitResult fit = joint.fit(set, centre);
        EXPECT_EQ(fit.fit.status, expected) << confidence;
        EXPECT_TRUE(fit.fit.shape_coefficients.allFinite() && fit.covariance.allFinite());
    }
}

} // namespace
} // namespace lineament
