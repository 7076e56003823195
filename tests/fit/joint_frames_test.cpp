// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The joint fit of several images of one person.
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/kernels/scalar_kernels.hpp"

#include "planted_images.hpp"
#include "support/matchers.hpp"

namespace lineament {
namespace {

using test::centre;
using test::given;
using test::IsNear;
using test::neutral_distance_mm;
using test::plant;
using test::Planted;
using test::synthetic_face;
using test::with_bias;

TEST(JointFitter, OneImageAmongSeveralIsFit)
{
    Random random(148);
    const Planted planted = plant(random, 1, 2.0);
    const JointFitter fitter(synthetic_face());
    const JointFitResult one = fitter.fit(planted.images[0], centre);
    const JointFramesResult frames = fitter.fit_frames(planted.images, centre);
    EXPECT_EQ(frames.shape_coefficients, one.fit.shape_coefficients);
    EXPECT_NEAR(frames.chi_square, one.fit.chi_square, 1e-9 * one.fit.chi_square);
    // An image without a pose is left out.
    const std::vector<LandmarkSet> with_empty{LandmarkSet{}, planted.images[0]};
    const JointFramesResult result = fitter.fit_frames(with_empty, centre);
    EXPECT_EQ(result.num_used_frames, 1);
    EXPECT_EQ(result.frames[0].fit.status, FitStatus::too_few_correspondences);
    EXPECT_EQ(result.shape_coefficients, one.fit.shape_coefficients);
    const Eigen::Index num_shape = one.fit.shape_coefficients.size();
    EXPECT_EQ(result.shape_covariance, Eigen::MatrixXd(one.covariance.topLeftCorner(num_shape, num_shape)));
    const JointFramesResult none = fitter.fit_frames({}, centre);
    EXPECT_EQ(none.status, FitStatus::too_few_correspondences);
    EXPECT_EQ(none.shape_covariance.size(), 0);
}

TEST(JointFitter, MoreImagesKnowMoreButNotWhatIsCommonToAll)
{
    Random random(149);
    double one = 0, ten = 0, ten_biased = 0, ten_ignoring = 0, one_biased = 0;
    for (int trial = 0; trial < 12; ++trial) {
        const Planted planted = plant(random, 10, 2.4);
        const JointFitter fitter(synthetic_face(), "ibug68", given());
        one += neutral_distance_mm(fitter.fit(planted.images[0], centre).fit.shape_coefficients, planted.alpha);
        ten += neutral_distance_mm(fitter.fit_frames(planted.images, centre).shape_coefficients, planted.alpha);
        const Planted biased = plant(random, 10, 2.4, 4.0);
        JointOptions options = given();
        options.bias_sigma_mm = 4.0;
        const JointFitter knowing(synthetic_face(), "ibug68", options);
        one_biased += neutral_distance_mm(knowing.fit(biased.images[0], centre).fit.shape_coefficients, biased.alpha);
        ten_biased += neutral_distance_mm(knowing.fit_frames(biased.images, centre).shape_coefficients, biased.alpha);
        ten_ignoring += neutral_distance_mm(fitter.fit_frames(biased.images, centre).shape_coefficients, biased.alpha);
    }
    EXPECT_LT(ten, 0.6 * one);
    EXPECT_LT(ten_biased, one_biased);
    EXPECT_LT(ten_biased, ten_ignoring);
}

TEST(JointFitter, FirstStepsOfSeveralImagesDoNotGoTooFar)
{
    Random random(163);
    for (int trial = 0; trial < 6; ++trial) {
        const Planted planted = plant(random, 10, 0.5, 1.0);
        const JointFitter fitter(synthetic_face(), "ibug68", JointOptions{}, &kernels::scalar_kernels());
        const JointFramesResult result = fitter.fit_frames(planted.images, centre);
        EXPECT_EQ(result.status, FitStatus::success);
        const std::vector<EnergyStep>& energies = result.frames[0].energies;
        EXPECT_LT(energies[1].energy, 0.25 * energies[0].energy);
        EXPECT_LE(result.frames[0].fit.iterations, 9);
    }
}

TEST(JointFitter, KernelsGiveTheSameFace)
{
    Random random(161);
    for (const double bias_sigma_mm : {0.0, 2.0}) {
        const Planted planted = plant(random, 4, 2.0, bias_sigma_mm);
        const JointFitter plain(synthetic_face(), "ibug68", with_bias(bias_sigma_mm));
        const JointFitter fast(synthetic_face(), "ibug68", with_bias(bias_sigma_mm), &kernels::scalar_kernels());
        const JointFramesResult expected = plain.fit_frames(planted.images, centre);
        const JointFramesResult result = fast.fit_frames(planted.images, centre);
        EXPECT_LT(neutral_distance_mm(result.shape_coefficients, expected.shape_coefficients), 1e-3);
        EXPECT_NE(result.shape_coefficients, expected.shape_coefficients); // the twin: they are used
        EXPECT_THAT(result.shape_covariance, IsNear(expected.shape_covariance, 1e-4));
        EXPECT_EQ(result.status, expected.status);
        for (std::size_t f = 0; f < planted.images.size(); ++f) {
            EXPECT_THAT(result.frames[f].fit.camera.camera_from_model,
                        IsNear(expected.frames[f].fit.camera.camera_from_model, 1e-5));
        }
    }
}

TEST(JointFitter, BiasOfStatedNoiseMayBeWiderInDepth)
{
    Random random(160);
    MorphableModel model = synthetic_face();
    LandmarkMap& map = model.landmark_maps[0];
    map.noise_mm["network"] = Eigen::VectorXf::Constant(map.num_landmarks(), 2.0f); // 1.4 mm of it bias
    const auto options_of = [](double ratio) {
        JointOptions options = with_bias(2.0);
        options.bias_depth_ratio = ratio;
        return options;
    };
    const JointFitter knowing(model, "ibug68", options_of(8)), ignoring(model, "ibug68", options_of(1));
    double with = 0, without = 0, one = 0;
    for (int trial = 0; trial < 8; ++trial) {
        const Planted planted = plant(random, 6, 1.4, 1.4, 0, 8);
        with += neutral_distance_mm(knowing.fit_frames(planted.images, centre).shape_coefficients, planted.alpha);
        without += neutral_distance_mm(ignoring.fit_frames(planted.images, centre).shape_coefficients, planted.alpha);
        one += neutral_distance_mm(knowing.fit(planted.images[0], centre).fit.shape_coefficients, planted.alpha);
    }
    EXPECT_LT(with, 0.8 * without);
    EXPECT_LT(with, one);
    // The ratio does nothing where no noise is stated.
    const Planted planted = plant(random, 3, 1.4);
    EXPECT_EQ(JointFitter(synthetic_face(), "ibug68", options_of(8)).fit_frames(planted.images, centre).chi_square,
              JointFitter(synthetic_face(), "ibug68", options_of(1)).fit_frames(planted.images, centre).chi_square);
}

TEST(JointFitter, BiasWidthDoesNotTellTheSizeOfTheHead)
{
    // A width of 2 mm where there is no bias at all: the scale stays right.
    Random random(154);
    double sum = 0;
    for (int trial = 0; trial < 8; ++trial) {
        const Planted planted = plant(random, 6, 2.4);
        const JointFramesResult result =
            JointFitter(synthetic_face(), "ibug68", with_bias(2.0)).fit_frames(planted.images, centre);
        for (std::size_t f = 0; f < planted.images.size(); ++f) {
            sum += result.frames[f].fit.camera.scale_px_per_mm / planted.cameras[f].scale_px_per_mm / 6;
        }
    }
    EXPECT_NEAR(sum / 8, 1, 0.03);
}

TEST(JointFitter, UnknownFocalLengthIsFoundFromSeveralNearImages)
{
    Random random(150);
    const Planted planted = plant(random, 8, 0.3, 0, 0.0025); // 40 cm
    JointOptions options = given(0.3);
    const JointFramesResult orthographic =
        JointFitter(synthetic_face(), "ibug68", options).fit_frames(planted.images, centre);
    options.focal_length_px = 500;
    const JointFramesResult known = JointFitter(synthetic_face(), "ibug68", options).fit_frames(planted.images, centre);
    options.focal_length_px.reset();
    options.phi_sigma_per_mm = 0.002;
    const JointFramesResult unknown =
        JointFitter(synthetic_face(), "ibug68", options).fit_frames(planted.images, centre);
    ASSERT_EQ(unknown.status, FitStatus::success) << unknown.reason;
    for (const JointFitResult& frame : unknown.frames) {
        EXPECT_NEAR(frame.fit.camera.scale_px_per_mm / frame.fit.camera.phi_per_mm, 500, 40);
    }
    EXPECT_LT(neutral_distance_mm(known.shape_coefficients, planted.alpha), 1.0);
    EXPECT_LT(neutral_distance_mm(unknown.shape_coefficients, planted.alpha), 1.2);
    EXPECT_GT(neutral_distance_mm(orthographic.shape_coefficients, planted.alpha), 1.2); // the twin
}

} // namespace
} // namespace lineament
