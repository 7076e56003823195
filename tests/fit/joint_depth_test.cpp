// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What depth does to the joint fit: it turns the head and nothing else.
#include "lineament/fit/joint_fitter.hpp"

#include "planted_images.hpp"
#include "support/matchers.hpp"

#include <Eigen/Geometry>

#include <cmath>

namespace lineament {
namespace {

using test::angle_between_deg;
using test::centre;
using test::given;
using test::IsNear;
using test::plant;
using test::Planted;
using test::synthetic_face;
using test::with_bias;
using ::testing::Not;

std::vector<LandmarkSet> with_depth(const Planted& planted)
{
    std::vector<LandmarkSet> images = planted.images;
    for (std::size_t f = 0; f < images.size(); ++f) {
        test::add_depth(synthetic_face(), planted.cameras[f], 250, images[f]);
    }
    return images;
}

TEST(JointFitter, DepthTurnsTheHeadAndLeavesTheIdentity)
{
    Random random(451);
    const JointFitter fitter(synthetic_face());
    double with = 0, without = 0;
    for (int trial = 0; trial < 20; ++trial) {
        const Planted planted = plant(random, 1, 2.0);
        const JointFitResult deep = fitter.fit(with_depth(planted)[0], centre);
        const JointFitResult flat = fitter.fit(planted.images[0], centre);
        EXPECT_EQ(deep.fit.shape_coefficients, flat.fit.shape_coefficients);
        EXPECT_EQ(deep.covariance, flat.covariance);
        EXPECT_EQ(deep.fit.chi_square, flat.fit.chi_square);
        with += angle_between_deg(deep.fit.camera.camera_from_model, planted.cameras[0].camera_from_model);
        without += angle_between_deg(flat.fit.camera.camera_from_model, planted.cameras[0].camera_from_model);
    }
    EXPECT_LT(with, 0.8 * without);
}

TEST(JointFitter, DepthTurnsAKnownFaceAsItIs)
{
    Random random(453);
    const Planted planted = plant(random, 1, 2.0);
    const LandmarkSet deep = with_depth(planted)[0];
    Eigen::VectorXd alpha = planted.alpha;
    alpha[0] = 6;
    JointOptions options; // whose bounds a known identity need not keep
    const JointFitResult beyond =
        JointFitter(synthetic_face(), "ibug68", options).fit_pose_and_expression(deep, centre, alpha);
    options.max_coefficient = 10;
    const JointFitResult within =
        JointFitter(synthetic_face(), "ibug68", options).fit_pose_and_expression(deep, centre, alpha);
    EXPECT_EQ(beyond.fit.expression_coefficients, within.fit.expression_coefficients);
    EXPECT_EQ(beyond.fit.camera.camera_from_model, within.fit.camera.camera_from_model);
    EXPECT_NE(beyond.fit.camera.camera_from_model, JointFitter(synthetic_face())
                                                       .fit_pose_and_expression(planted.images[0], centre, alpha)
                                                       .fit.camera.camera_from_model); // the twin: depth turned it
}

TEST(JointFitter, DepthTurnsEachOfSeveralImages)
{
    Random random(452);
    const Planted planted = plant(random, 12, 2.0, 2.0);
    const JointFitter fitter(synthetic_face(), "ibug68", with_bias(2.0));
    const JointFramesResult deep = fitter.fit_frames(with_depth(planted), centre);
    const JointFramesResult flat = fitter.fit_frames(planted.images, centre);
    EXPECT_EQ(deep.shape_coefficients, flat.shape_coefficients);
    EXPECT_EQ(deep.landmark_bias_mm, flat.landmark_bias_mm);
    EXPECT_EQ(deep.chi_square, flat.chi_square);
    for (std::size_t f = 0; f < planted.images.size(); ++f) {
        EXPECT_THAT(deep.frames[f].fit.camera.camera_from_model,
                    Not(IsNear(flat.frames[f].fit.camera.camera_from_model, 1e-6)));
    }
}

TEST(JointFitter, ExpressionBelongsToTheTurnedHead)
{
    // With least squares and one image the weight of each coordinate is 1 / (s_0 sigma)^2: write the cost down anew.
    Random random(453);
    JointOptions options = given();
    options.loss = RobustLoss::none;
    const JointFitter fitter(synthetic_face(), "ibug68", options);
    const LandmarkMap& map = synthetic_face().landmark_maps[0];
    for (int trial = 0; trial < 10; ++trial) {
        const Planted planted = plant(random, 1, 2.0);
        const LandmarkSet landmarks = with_depth(planted)[0];
        const JointFitResult deep = fitter.fit(landmarks, centre);
        const Eigen::VectorXd& psi = deep.fit.expression_coefficients;
        const auto cost = [&](const Eigen::VectorXd& expression) {
            FitResult other = deep.fit;
            other.expression_coefficients = expression;
            const Eigen::VectorXf shape = shape_of(synthetic_face(), other);
            const Eigen::Matrix3Xf points =
                map.points_on(Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, shape.size() / 3));
            double sum = (expression / options.expression_sigma).squaredNorm();
            for (const Landmark& landmark : landmarks.landmarks) {
                const Eigen::Vector3d point = points.col(map.index_of(landmark.name)).cast<double>();
                sum += (deep.fit.camera.project(point) - landmark.point_px).squaredNorm() /
                       std::pow(deep.matched_scale_px_per_mm * options.landmark_sigma_mm, 2);
            }
            return sum;
        };
        const double least = cost(psi);
        for (int step = 0; step < 50; ++step) {
            const Eigen::VectorXd other =
                (psi + random.uniform(0.01, 0.3) * test::random_normal(random, psi.size())).cwiseMax(0.0).cwiseMin(1.0);
            EXPECT_GE(cost(other), least - 1e-4);
        }
        // The twin: the expression that goes with the pose of the image points alone.
        EXPECT_GT(cost(fitter.fit(planted.images[0], centre).fit.expression_coefficients), least + 1e-3);
    }
}

TEST(JointFitter, DepthIsLeftAloneWhereItCannotServe)
{
    Random random(454);
    const Planted planted = plant(random, 1, 1.0);
    const LandmarkSet deep = with_depth(planted)[0];
    const auto turns = [&](const JointOptions& options, const LandmarkSet& landmarks) {
        const JointFitter fitter(synthetic_face(), "ibug68", options);
        return fitter.fit(landmarks, centre).fit.camera.camera_from_model !=
               fitter.fit(planted.images[0], centre).fit.camera.camera_from_model;
    };
    EXPECT_TRUE(turns({}, deep));
    JointOptions known;
    known.focal_length_px = 2000;
    EXPECT_FALSE(turns(known, deep));
    JointOptions unknown;
    unknown.phi_sigma_per_mm = 0.002;
    EXPECT_FALSE(turns(unknown, deep));

    LandmarkSet few = planted.images[0];
    for (std::size_t i = 30; i < 33; ++i) {
        few.landmarks[i].depth_px = deep.landmarks[i].depth_px;
    }
    EXPECT_FALSE(turns({}, few));
    few.landmarks[40].depth_px = deep.landmarks[40].depth_px;
    EXPECT_TRUE(turns({}, few));
}

} // namespace
} // namespace lineament
