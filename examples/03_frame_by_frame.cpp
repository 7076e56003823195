// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The third door: one person, a frame at a time. Pose and expression of each frame are its own; what it says of the
// identity is added to what is known (docs/joint-fit.md, Eq. (8)), so that the face is known ever better.
// Usage: example_03_frame_by_frame MODEL
#include <lineament/camera/angles.hpp>
#include <lineament/core/random.hpp>
#include <lineament/fit/joint_fitter.hpp>
#include <lineament/io/model_file.hpp>

#include <cmath>
#include <cstdio>

int main(int argc, char** argv)
{
    using namespace lineament;
    JointOptions options;
    options.contour = ContourMode::fixed; // the outline landmarks below lie where the model has them
    options.num_shape_coefficients = 20;
    const JointFitter fitter(load_model(argc > 1 ? argv[1] : default_model_path().string()), "ibug68", options);
    const MorphableModel& model = fitter.model();
    const LandmarkMap& map = *model.find_landmark_map("ibug68");

    // A person to find: shape coefficients a, seen from many sides with 2 px of noise.
    Random random(1);
    Eigen::VectorXd a(fitter.num_shape_coefficients());
    for (double& coefficient : a) {
        coefficient = random.normal();
    }
    const Eigen::Matrix3Xf points = map.points_on(model.mesh_of(model.shape.instance(a)).vertices);

    IdentityFilter identity(a.size());                  // the prior: a ~ N(0, I)
    JointWorkspace workspace = fitter.make_workspace(); // memory for fit after fit
    JointFitResult result;
    double first_error = 0;
    double last_error = 0;
    const int num_frames = 12;
    for (int frame = 0; frame < num_frames; ++frame) {
        Camera camera;
        camera.camera_from_model = rotation_from_angles({radians(-40 + 7 * frame), radians(5), 0});
        camera.scale_px_per_mm = 1.5;
        camera.principal_point_px = {320, 240};
        LandmarkSet landmarks;
        for (Eigen::Index i = 0; i < points.cols(); ++i) {
            const Eigen::Vector3d point = points.col(i).cast<double>();
            const Eigen::Vector2d noise{random.normal(), random.normal()};
            landmarks.landmarks.push_back({map.names[i], camera.project(point) + 2 * noise});
        }

        const FitResult* const before = frame > 0 ? &result.fit : nullptr;
        fitter.fit(landmarks, camera.principal_point_px, workspace, result, before, {}, &identity);
        if (result.fit.status != FitStatus::success) {
            std::printf("frame %d: %s\n", frame, result.fit.reason.c_str());
            return 1;
        }
        identity.add(fitter.identity_information(landmarks, result, identity.num_images()));

        last_error = std::sqrt((identity.mean() - a).squaredNorm() / static_cast<double>(a.size()));
        first_error = frame == 0 ? last_error : first_error;
        const double predicted = std::sqrt(identity.covariance().trace() / static_cast<double>(a.size()));
        std::printf("frame %2d: yaw %6.1f degrees, coefficients off by %.2f, %.2f expected\n", frame,
                    degrees(angles_from_rotation(result.fit.camera.camera_from_model).yaw), last_error, predicted);
    }
    return last_error < first_error ? 0 : 1;
}
