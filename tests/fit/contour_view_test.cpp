// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Which outline is matched, from frame to frame.
#include "lineament/camera/angles.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/realtime_fitter.hpp"

#include "support/face_model.hpp"
#include "support/planted_face.hpp"

#include <gtest/gtest.h>

#include <functional>

namespace lineament {
namespace {

using test::face_model;

/// The mean face, turned.
LandmarkSet turned_face(double yaw_deg)
{
    Random random(181);
    Camera camera;
    camera.camera_from_model = rotation_from_angles({radians(yaw_deg), 0, 0});
    camera.scale_px_per_mm = 1.2;
    camera.principal_point_px = {320, 240};
    return test::project_landmarks(face_model(), "ibug68", Eigen::VectorXd::Zero(0), Eigen::VectorXd::Zero(0), camera,
                                   0, random);
}

using Fit = std::function<FitResult(const LandmarkSet&, const FitResult*)>;

/// A head that turns to one side and back again; at 7.5 degrees both views are near enough to stay.
void expect_to_keep_its_view(const char* method, const Fit& fit)
{
    const FitResult aside = fit(turned_face(14), nullptr);
    EXPECT_EQ(aside.contour_view, ContourView::shows_right) << method;
    const FitResult at_the_limit = fit(turned_face(7.5), &aside);
    EXPECT_EQ(at_the_limit.contour_view, ContourView::shows_right) << method;
    EXPECT_EQ(fit(turned_face(7.5), &at_the_limit).contour_view, ContourView::shows_right) << method;
    const FitResult ahead = fit(turned_face(2), &at_the_limit);
    EXPECT_EQ(ahead.contour_view, ContourView::frontal) << method;
    EXPECT_EQ(fit(turned_face(7.5), &ahead).contour_view, ContourView::frontal) << method;
    EXPECT_EQ(fit(turned_face(7.5), nullptr).contour_view, ContourView::frontal) << method;
    EXPECT_EQ(fit(turned_face(-14), &aside).contour_view, ContourView::shows_left) << method;
}

TEST(ContourView, AFitKeepsToThatOfItsStartUntilTheHeadHasTurned)
{
    const MorphableModel& model = face_model();
    const Eigen::Vector2d centre(320, 240);
    FitOptions options;
    options.contour = ContourMode::both;
    const FaceFitter face_fitter(model, "ibug68", options);
    expect_to_keep_its_view("FaceFitter", [&](const LandmarkSet& set, const FitResult* start) {
        return face_fitter.fit(set, centre, start);
    });
    const RealtimeFitter realtime_fitter(model, "ibug68", options);
    RealtimeWorkspace workspace = realtime_fitter.make_workspace();
    expect_to_keep_its_view("RealtimeFitter", [&](const LandmarkSet& set, const FitResult* start) {
        FitResult result;
        realtime_fitter.fit(set, centre, workspace, result, start);
        return result;
    });
    const JointFitter joint_fitter(model);
    expect_to_keep_its_view("JointFitter", [&](const LandmarkSet& set, const FitResult* start) {
        return joint_fitter.fit(set, centre, start).fit;
    });
}

} // namespace
} // namespace lineament
