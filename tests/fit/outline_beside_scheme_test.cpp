// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Outline landmarks of ibug68 beside the landmarks of another scheme. The other scheme here names the points of ibug68
// anew, so that a fit of ibug68 itself is the oracle.
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/realtime_fitter.hpp"

#include "lineament/fit/contour.hpp"

#include "support/matchers.hpp"
#include "support/planted_face.hpp"

#include <gtest/gtest.h>

namespace lineament {
namespace {

using test::PlantedFace;
using test::synthetic_face;

/// With the inner points of ibug68 under the scheme "inner", called "p18" ... "p68", and the chin.
MorphableModel model_with_inner_scheme()
{
    MorphableModel model = synthetic_face();
    const LandmarkMap& all = *model.find_landmark_map("ibug68");
    LandmarkMap inner;
    inner.scheme = "inner";
    inner.vertices.resize(3, 0);
    inner.weights.resize(3, 0);
    for (Eigen::Index l = 0; l < all.num_landmarks(); ++l) {
        if (!outline_side("ibug68", all.names[static_cast<std::size_t>(l)])) {
            inner.names.push_back("p" + all.names[static_cast<std::size_t>(l)]);
            inner.vertices.conservativeResize(3, inner.vertices.cols() + 1);
            inner.weights.conservativeResize(3, inner.weights.cols() + 1);
            inner.vertices.rightCols<1>() = all.vertices.col(l);
            inner.weights.rightCols<1>() = all.weights.col(l);
        }
    }
    model.landmark_maps.push_back(inner);
    return model;
}

LandmarkSet in_inner_scheme(LandmarkSet set)
{
    set.scheme = "inner";
    for (Landmark& landmark : set.landmarks) {
        landmark.name = (outline_side("ibug68", landmark.name) ? "ibug68:" : "p") + landmark.name;
    }
    return set;
}

/// Turned faces, so that one side's outline is an occluding one, and a frontal one.
std::vector<PlantedFace> planted_faces()
{
    Random random(77);
    std::vector<PlantedFace> faces;
    for (int trial = 0; trial < 6; ++trial) {
        faces.push_back(test::plant_moderate_face(random, 1.0));
    }
    return faces;
}

void expect_same_face(const FitResult& fit, const FitResult& expected)
{
    EXPECT_EQ(fit.status, expected.status);
    EXPECT_EQ(fit.shape_coefficients, expected.shape_coefficients);
    EXPECT_EQ(fit.expression_coefficients, expected.expression_coefficients);
    EXPECT_EQ(fit.camera.camera_from_model, expected.camera.camera_from_model);
    ASSERT_EQ(fit.landmarks.size(), expected.landmarks.size());
    for (std::size_t l = 0; l < fit.landmarks.size(); ++l) {
        EXPECT_EQ(fit.landmarks[l].weight, expected.landmarks[l].weight) << fit.landmarks[l].name;
        EXPECT_EQ(fit.landmarks[l].fitted_px, expected.landmarks[l].fitted_px) << fit.landmarks[l].name;
    }
}

template <typename Fitter, typename Options, typename Fit>
void expect_outline_counts(const Fit& fit)
{
    const MorphableModel model = model_with_inner_scheme();
    Options options;
    const Fitter reference(model, "ibug68", options);
    const Fitter without(model, "inner", options);
    options.outline_beside_scheme = true;
    const Fitter with(model, "inner", options);
    for (const PlantedFace& planted : planted_faces()) {
        const LandmarkSet renamed = in_inner_scheme(planted.landmarks);
        const Eigen::Vector2d center = planted.camera.principal_point_px;
        const FitResult expected = fit(reference, planted.landmarks, center);
        FitResult found = fit(with, renamed, center);
        ASSERT_EQ(expected.status, FitStatus::success) << expected.reason;
        for (std::size_t l = 0; l < found.landmarks.size();
             ++l) { // of a landmark without a map point that found no match
            if (found.landmarks[l].weight == 0) {
                found.landmarks[l].fitted_px = expected.landmarks[l].fitted_px;
            }
        }
        expect_same_face(found, expected);
        EXPECT_NE(fit(without, renamed, center).shape_coefficients, expected.shape_coefficients);
    }
}

TEST(OutlineBesideScheme, CountsForFaceFitterAsInIbug68)
{
    expect_outline_counts<FaceFitter, FitOptions>(
        [](const FaceFitter& fitter, const LandmarkSet& set, const Eigen::Vector2d& center) {
            return fitter.fit(set, center);
        });
}

TEST(OutlineBesideScheme, CountsForJointFitterAsInIbug68)
{
    expect_outline_counts<JointFitter, JointOptions>(
        [](const JointFitter& fitter, const LandmarkSet& set, const Eigen::Vector2d& center) {
            return fitter.fit(set, center).fit;
        });
}

TEST(OutlineBesideScheme, RealtimeFitterLeavesItToFaceFitter)
{
    FitOptions options;
    options.outline_beside_scheme = true;
    const MorphableModel model = model_with_inner_scheme();
    const FaceFitter reference(model, "inner", options);
    const RealtimeFitter fitter(model, "inner", options);
    RealtimeWorkspace workspace = fitter.make_workspace();
    for (const PlantedFace& planted : planted_faces()) {
        const LandmarkSet renamed = in_inner_scheme(planted.landmarks);
        FitResult result;
        fitter.fit(renamed, planted.camera.principal_point_px, workspace, result);
        expect_same_face(result, reference.fit(renamed, planted.camera.principal_point_px));
    }
}

TEST(OutlineBesideScheme, HasNoFixedPoints)
{
    FitOptions options;
    options.outline_beside_scheme = true;
    options.contour = ContourMode::fixed;
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { FaceFitter(model_with_inner_scheme(), "inner", options); },
                                              "options.contour"));
    JointOptions joint;
    joint.outline_beside_scheme = true;
    joint.contour = ContourMode::fixed;
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { JointFitter(model_with_inner_scheme(), "inner", joint); },
                                              "options.contour"));
    joint.contour = ContourMode::ignored;
    EXPECT_NO_THROW(JointFitter(model_with_inner_scheme(), "inner", joint));
}

TEST(OutlineBesideScheme, IsNotUsedUnlessAsked)
{
    const FaceFitter fitter(model_with_inner_scheme(), "inner");
    const PlantedFace planted = planted_faces().front();
    const FitResult fit = fitter.fit(in_inner_scheme(planted.landmarks), planted.camera.principal_point_px);
    for (const FittedLandmark& landmark : fit.landmarks) {
        EXPECT_EQ(landmark.weight > 0, !landmark.name.starts_with(outline_prefix)) << landmark.name;
    }
}

} // namespace
} // namespace lineament
