// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/frame_selection.hpp"
#include "lineament/fit/multi_frame.hpp"

#include "support/matchers.hpp"
#include "support/planted_face.hpp"

namespace lineament {
namespace {

using test::IsNear;
using test::plant_moderate_face;
using test::PlantedFace;
using test::synthetic_face;
using ::testing::Not;

TEST(FitFrames, OneFrameIsFitFace)
{
    Random random(41);
    const PlantedFace planted = plant_moderate_face(random, 1.0);
    const std::vector<LandmarkSet> frames{planted.landmarks};
    const MultiFrameResult many = fit_frames(synthetic_face(), frames, planted.camera.principal_point_px);
    const FitResult one = fit_face(synthetic_face(), planted.landmarks, planted.camera.principal_point_px);
    EXPECT_EQ(many.shape_coefficients, one.shape_coefficients);
    EXPECT_EQ(many.frames[0].rms_px, one.rms_px);
}

TEST(FitFrames, ThePriorCountsOnceOrOnceAFrame)
{
    // Ten times the same picture under a prior counted ten times is one picture; under one prior it is not.
    Random random(42);
    const PlantedFace planted = plant_moderate_face(random, 1.0);
    const std::vector<LandmarkSet> frames(10, planted.landmarks);
    const Eigen::Vector2d centre = planted.camera.principal_point_px;
    const Eigen::VectorXd one = fit_face(synthetic_face(), planted.landmarks, centre).shape_coefficients;
    MultiFrameOptions options;
    options.prior_count = PriorCount::per_frame;
    EXPECT_THAT(fit_frames(synthetic_face(), frames, centre, options).shape_coefficients, IsNear(one, 1e-6));
    const Eigen::VectorXd ten = fit_frames(synthetic_face(), frames, centre).shape_coefficients;
    EXPECT_THAT(ten, Not(IsNear(one, 0.05)));
    FitOptions tenth;
    tenth.regularization = 0.1; // the expressions' prior is each frame's own
    EXPECT_THAT(ten, IsNear(fit_face(synthetic_face(), planted.landmarks, centre, tenth).shape_coefficients, 1e-6));
}

TEST(FitFrames, FrameWithoutAPoseIsLeftOut)
{
    Random random(43);
    const PlantedFace planted = plant_moderate_face(random, 1.0);
    LandmarkSet empty;
    const std::vector<LandmarkSet> frames{planted.landmarks, empty};
    const MultiFrameResult result = fit_frames(synthetic_face(), frames, planted.camera.principal_point_px);
    EXPECT_EQ(result.num_used_frames, 1);
    EXPECT_EQ(result.frames[1].status, FitStatus::too_few_correspondences);
    EXPECT_EQ(result.shape_coefficients,
              fit_face(synthetic_face(), planted.landmarks, planted.camera.principal_point_px).shape_coefficients);
    EXPECT_EQ(fit_frames(synthetic_face(), {}, Eigen::Vector2d(0, 0)).status, FitStatus::too_few_correspondences);
}

TEST(SelectSpreadFrames, TakesTheBestOfEachBinAndTheWidestSpread)
{
    std::vector<FitResult> fits;
    const auto add = [&](double yaw_deg, double rms, FitStatus status) {
        FitResult fit;
        fit.status = status;
        fit.camera.camera_from_model = rotation_from_angles({radians(yaw_deg), 0, 0});
        fit.rms_px = rms;
        fits.push_back(fit);
    };
    add(0, 2.0, FitStatus::success);
    add(1, 1.0, FitStatus::success); // same bin, better
    add(20, 1.0, FitStatus::success);
    add(40, 1.0, FitStatus::success);
    add(-40, 1.0, FitStatus::success);
    add(60, 1.0, FitStatus::implausible); // left out
    EXPECT_EQ(select_spread_frames(fits), (std::vector<int>{1, 2, 3, 4}));
    EXPECT_EQ(select_spread_frames(fits, {10.0, 3}), (std::vector<int>{1, 3, 4}));
    EXPECT_TRUE(select_spread_frames({}).empty());
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)select_spread_frames(fits, {0.0, 3}); }, "bin_deg"));
}

} // namespace
} // namespace lineament
