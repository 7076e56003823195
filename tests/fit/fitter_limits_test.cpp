// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Numbers that no fitter takes: noise, coordinates and confidences out of reach.
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/realtime_fitter.hpp"

#include "planted_images.hpp"
#include "support/matchers.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace lineament {
namespace {

using test::centre;
using test::plant;
using test::synthetic_face;

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

TEST(FitterLimits, NumbersThatOverflowGiveNoFaceAndNoNumberThatIsNone)
{
    Random random(616);
    const LandmarkSet set = plant(random, 1, 1.0).images[0];
    const JointFitter fitter(synthetic_face());
    for (const double variance_px : {1e100, 1e300, 1.5e308}) { // its inverse squared is 0, its double too large
        const std::vector<Eigen::Matrix2d> noise(set.landmarks.size(), variance_px * Eigen::Matrix2d::Identity());
        const JointFitResult result = fitter.fit(set, centre, nullptr, noise);
        EXPECT_EQ(result.fit.status, variance_px == 1e100 ? FitStatus::success : FitStatus::degenerate);
        EXPECT_TRUE(result.fit.shape_coefficients.allFinite() && result.fit.expression_coefficients.allFinite() &&
                    result.fit.camera.camera_from_model.allFinite() && result.covariance.allFinite() &&
                    std::isfinite(result.fit.rms_px) && std::isfinite(result.fit.chi_square));
        if (variance_px >= 1e300) {
            EXPECT_EQ(result.fit.reason, "landmarks or noise of such sizes give no finite fit");
            EXPECT_EQ(result.fit.shape_coefficients.norm(), 0);
            EXPECT_EQ(result.covariance.size(), 0);
        }
    }
    for (const double sigma_mm : {1e-160, 1e160}) { // its square is 0, or infinite
        JointOptions options;
        options.landmark_sigma_mm = sigma_mm;
        options.bias_sigma_mm = 0;
        const JointFitResult result = JointFitter(synthetic_face(), "ibug68", options).fit(set, centre);
        EXPECT_NE(result.fit.status, FitStatus::success) << sigma_mm;
        EXPECT_TRUE(result.fit.shape_coefficients.allFinite() && result.fit.camera.camera_from_model.allFinite() &&
                    std::isfinite(result.fit.rms_px));
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
