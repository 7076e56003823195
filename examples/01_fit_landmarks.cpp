// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The first door: a model, 68 landmarks, one call. Usage: example_01_fit_landmarks MODEL
#include <lineament/camera/angles.hpp>
#include <lineament/fit/face_fitter.hpp>
#include <lineament/io/model_file.hpp>

#include <cstdio>

int main(int argc, char** argv)
{
    using namespace lineament;
    const MorphableModel model = load_model(argc > 1 ? argv[1] : default_model_path().string());

    // A detector gives these; here they are the model's own points, seen by a camera we know.
    Camera camera;
    camera.camera_from_model = rotation_from_angles({radians(20), radians(-5), 0});
    camera.scale_px_per_mm = 1.5;
    camera.principal_point_px = {320, 240};
    const LandmarkMap& map = *model.find_landmark_map("ibug68");
    const Eigen::Matrix3Xf points = map.points_on(model.mesh_of(model.shape.mean).vertices);
    LandmarkSet landmarks;
    for (Eigen::Index i = 0; i < map.num_landmarks(); ++i) {
        const Eigen::Vector3d point = points.col(i).cast<double>();
        landmarks.landmarks.push_back({map.names[i], camera.project(point)});
    }

    const FitResult fit = fit_face(model, landmarks, camera.principal_point_px, {.iterations = 5});

    const HeadAngles angles = angles_from_rotation(fit.camera.camera_from_model);
    std::printf("%s: yaw %.1f, pitch %.1f, roll %.1f degrees, %.2f px per mm, rms %.2f px\n", to_string(fit.status),
                degrees(angles.yaw), degrees(angles.pitch), degrees(angles.roll), fit.camera.scale_px_per_mm,
                fit.rms_px);
    const Eigen::VectorXf shape = shape_of(model, fit); // x0 y0 z0 x1 ..., mm
    std::printf("%d vertices, the first at %.1f %.1f %.1f mm\n", static_cast<int>(shape.size() / 3), shape[0], shape[1],
                shape[2]);
    return fit.status == FitStatus::success ? 0 : 1;
}
