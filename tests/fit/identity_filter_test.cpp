// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/identity_filter.hpp"

#include "planted_images.hpp"
#include "support/matchers.hpp"

namespace lineament {
namespace {

using test::centre;
using test::given;
using test::IsNear;
using test::plant;
using test::Planted;
using test::synthetic_face;
using ::testing::Not;

TEST(IdentityFilter, SumOverImagesLinearisedAtTheJointFitIsTheJointFit)
{
    Random random(151);
    const Planted planted = plant(random, 5, 2.0);
    const JointFitter fitter(synthetic_face(), "ibug68", given());
    const JointFramesResult batch = fitter.fit_frames(planted.images, centre);
    ASSERT_EQ(batch.status, FitStatus::success);
    IdentityFilter filter(fitter.num_shape_coefficients());
    for (std::size_t f = 0; f < planted.images.size(); ++f) {
        filter.add(fitter.identity_information(planted.images[f], batch.frames[f]));
    }
    EXPECT_EQ(filter.num_images(), 5);
    EXPECT_THAT(filter.mean(), IsNear(batch.shape_coefficients, 1e-5));
    EXPECT_THAT(filter.covariance(), IsNear(batch.shape_covariance, 1e-9));
    // One by one, each linearised at its own fit with the earlier ones as prior: near, not equal.
    IdentityFilter online(fitter.num_shape_coefficients());
    for (const LandmarkSet& image : planted.images) {
        const JointFitResult result = fitter.fit(image, centre, nullptr, {}, &online);
        ASSERT_EQ(result.fit.status, FitStatus::success);
        online.add(fitter.identity_information(image, result, online.num_images()));
        EXPECT_THAT(online.mean(), IsNear(result.fit.shape_coefficients, 1e-3)); // the fit is the update
        EXPECT_THAT(online.covariance(),
                    IsNear(result.covariance.topLeftCorner(online.mean().size(), online.mean().size()), 1e-6));
    }
    const Eigen::VectorXd deviation = batch.shape_covariance.diagonal().cwiseSqrt();
    EXPECT_LE(((online.mean() - batch.shape_coefficients).array() / deviation.array()).abs().maxCoeff(), 1.5);
    EXPECT_THAT(online.mean(), Not(IsNear(batch.shape_coefficients, 1e-5)));
}

TEST(IdentityFilter, DepthLeavesWhatAnImageSaysOfTheIdentity)
{
    Random random(153);
    const JointFitter fitter(synthetic_face(), "ibug68", given());
    for (int trial = 0; trial < 5; ++trial) {
        const Planted planted = plant(random, 1, 2.0);
        LandmarkSet deep = planted.images[0];
        test::add_depth(synthetic_face(), planted.cameras[0], 250, deep);
        const JointFitResult result = fitter.fit(deep, centre);
        ASSERT_EQ(result.fit.status, FitStatus::success) << result.fit.reason;
        const Eigen::Index num_shape = fitter.num_shape_coefficients();
        IdentityFilter filter(num_shape);
        filter.add(fitter.identity_information(deep, result));
        EXPECT_THAT(filter.mean(), IsNear(result.fit.shape_coefficients, 1e-4));
        EXPECT_THAT(filter.covariance(), IsNear(result.covariance.topLeftCorner(num_shape, num_shape), 1e-6));

        JointFitResult turned = result; // at the turned head it would be something else
        turned.minimum_camera = result.fit.camera;
        IdentityFilter other(num_shape);
        other.add(fitter.identity_information(deep, turned));
        EXPECT_THAT(other.mean(), Not(IsNear(result.fit.shape_coefficients, 1e-3)));
    }
}

TEST(IdentityFilter, LandmarkBiasBoundsWhatManyImagesSay)
{
    Random random(152);
    const Planted planted = plant(random, 1, 2.0);
    JointOptions options = given();
    options.bias_sigma_mm = 3;
    const JointFitter fitter(synthetic_face(), "ibug68", options);
    const JointFitResult result = fitter.fit(planted.images[0], centre);
    const auto trace_after = [&](int count, bool counts_images) {
        IdentityFilter filter(fitter.num_shape_coefficients());
        for (int i = 0; i < count; ++i) {
            filter.add(fitter.identity_information(planted.images[0], result, counts_images ? i : 0));
        }
        return filter.covariance().trace();
    };
    EXPECT_LT(trace_after(1, true) - trace_after(200, true), 0.5 * (trace_after(1, true) - trace_after(200, false)));
}

TEST(IdentityFilter, BrokenInputThrows)
{
    IdentityFilter filter(3);
    EXPECT_TRUE(test::throws<InvalidArgument>(
        [&] {
            filter.add({Eigen::MatrixXd::Identity(2, 2), Eigen::VectorXd::Zero(2)});
        },
        "information.matrix"));
    EXPECT_TRUE(test::throws<InvalidArgument>(
        [&] {
            filter.add({Eigen::MatrixXd::Identity(3, 3), Eigen::VectorXd::Constant(3, std::nan(""))});
        },
        "information.vector", "nan"));
    Random random(153);
    const Planted planted = plant(random, 1, 2.0);
    EXPECT_TRUE(test::throws<InvalidArgument>(
        [&] { (void)JointFitter(synthetic_face()).fit(planted.images[0], centre, nullptr, {}, &filter); }, "earlier"));
}

} // namespace
} // namespace lineament
