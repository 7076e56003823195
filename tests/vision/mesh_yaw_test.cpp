// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/vision/mesh_yaw.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/camera/camera.hpp"
#include "lineament/io/model_file.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <cmath>

namespace lineament {
namespace {

using test::throws;
using test::without_depth;

/// The points of the default model's mean face, which is symmetric, with their true depth.
LandmarkSet mesh_points(const HeadAngles& angles)
{
    static const MorphableModel model = load_model(default_model_path().string());
    static const LandmarkMap& map = *model.find_landmark_map("mediapipe478");
    static const Eigen::Matrix3Xf points =
        map.points_on(Eigen::Map<const Eigen::Matrix3Xf>(model.shape.mean.data(), 3, model.num_vertices()));
    Camera camera;
    camera.camera_from_model = rotation_from_angles(angles);
    camera.scale_px_per_mm = 2.0;
    camera.principal_point_px = {320, 240};
    LandmarkSet set = {.scheme = "mediapipe478"};
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
        const Eigen::Vector3d point = points.col(i).cast<double>();
        set.landmarks.push_back({map.names[static_cast<std::size_t>(i)], camera.project(point), 1.0,
                                 camera.scale_px_per_mm * camera.in_camera(point).z()});
    }
    return set;
}

TEST(MeshYaw, IsThatOfTheCameraAtAnyPitch)
{
    for (const double yaw : {-75.0, -40.0, 0.0, 25.0, 60.0}) {
        for (const double pitch : {-20.0, 0.0, 15.0}) {
            const std::optional<double> found = mesh_yaw(mesh_points({radians(yaw), radians(pitch), 0.0}));
            ASSERT_TRUE(found);
            EXPECT_NEAR(degrees(*found), yaw, 0.1) << pitch;
        }
    }
}

TEST(MeshYaw, NeedsDepth)
{
    EXPECT_EQ(mesh_yaw(without_depth(mesh_points({0.3, 0.0, 0.0}))), std::nullopt);
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)mesh_yaw({}); }, "mediapipe478", "ibug68"));
}

TEST(DoubtFoldedPoints, OfTheSideTurnedAwayBeyondTheLimitAlone)
{
    for (const double yaw : {-70.0, -53.0, -47.0, 0.0, 47.0, 53.0, 70.0}) {
        const LandmarkSet before = mesh_points({radians(yaw), 0.1, 0.0});
        LandmarkSet set = before;
        doubt_folded_points(set);
        const LandmarkSet frontal = mesh_points({});
        for (std::size_t i = 0; i < set.landmarks.size(); ++i) {
            const double to_left = frontal.landmarks[i].point_px.x() - 320.0; // the subject's left
            const bool is_away = std::abs(yaw) > 50.0 && (yaw > 0 ? to_left : -to_left) > 1.0;
            if (std::abs(to_left) > 1.0) { // else in the middle
                EXPECT_EQ(set.landmarks[i].confidence, is_away ? 0.2 : 1.0) << yaw << " " << i;
            }
            EXPECT_EQ(set.landmarks[i].point_px, before.landmarks[i].point_px);
        }
    }
}

TEST(DoubtFoldedPoints, LeavesPointsWithoutDepthAlone)
{
    const LandmarkSet flat = without_depth(mesh_points({1.3, 0.0, 0.0}));
    LandmarkSet set = flat;
    doubt_folded_points(set);
    EXPECT_EQ(set, flat);
    EXPECT_TRUE(throws<InvalidArgument>(
        [] {
            LandmarkSet other;
            doubt_folded_points(other);
        },
        "mediapipe478", "ibug68"));
}

} // namespace
} // namespace lineament
