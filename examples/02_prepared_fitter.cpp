// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The second door: many images, one fitter that keeps what does not change and a workspace that it fits in without
// allocation, each fit started from the one before.
// Usage: example_02_prepared_fitter MODEL
#include <lineament/camera/angles.hpp>
#include <lineament/fit/realtime_fitter.hpp>
#include <lineament/io/model_file.hpp>

#include <cstdio>

int main(int argc, char** argv)
{
    using namespace lineament;
    FitOptions options;
    options.iterations = 2; // enough from a warm start
    // With kernels::dispatched_kernels() of the library lineament::kernels it is several times as fast.
    const RealtimeFitter fitter(load_model(argc > 1 ? argv[1] : default_model_path().string()), "ibug68", options);
    RealtimeWorkspace workspace = fitter.make_workspace(); // one a thread
    const MorphableModel& model = fitter.reference().model();
    const LandmarkMap& map = fitter.reference().landmark_map();
    const Eigen::Matrix3Xf points = map.points_on(model.mesh_of(model.shape.mean).vertices);

    // A head that turns from left to right: stand-ins for the landmarks of a video.
    FitResult fit;
    for (int frame = 0; frame <= 10; ++frame) {
        Camera camera;
        camera.camera_from_model = rotation_from_angles({radians(-30 + 6 * frame), 0, 0});
        camera.principal_point_px = {320, 240};
        LandmarkSet landmarks;
        for (Eigen::Index i = 0; i < points.cols(); ++i) {
            const Eigen::Vector3d point = points.col(i).cast<double>();
            landmarks.landmarks.push_back({map.names[i], camera.project(point)});
        }
        fitter.fit(landmarks, camera.principal_point_px, workspace, fit, frame > 0 ? &fit : nullptr);
        std::printf("frame %2d: %s, yaw %6.1f degrees, rms %.2f px, %.0f us\n", frame, to_string(fit.status),
                    degrees(angles_from_rotation(fit.camera.camera_from_model).yaw), fit.rms_px, fit.timing.total_us);
        if (fit.status != FitStatus::success) {
            return 1;
        }
    }
    return 0;
}
