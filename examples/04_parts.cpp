// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The fourth door: the parts, each on its own, put together to a fit in a page. Usage: example_04_parts MODEL
#include <lineament/camera/angles.hpp>
#include <lineament/fit/expression.hpp>
#include <lineament/fit/identity.hpp>
#include <lineament/fit/pose.hpp>
#include <lineament/io/model_file.hpp>

#include <cstdio>

int main(int argc, char** argv)
{
    using namespace lineament;
    const MorphableModel model = load_model(argc > 1 ? argv[1] : default_model_path().string());
    const Blendshapes& expressions = *model.find_expression_set("ekman6");
    const ModelPoints points = landmark_points(model, *model.find_landmark_map("ibug68"), &expressions, 20);

    // A planted face: two identity coefficients, one expression.
    Eigen::VectorXd true_alpha = Eigen::VectorXd::Zero(20);
    true_alpha.head<2>() << 1.0, -0.8;
    Eigen::VectorXd true_psi = Eigen::VectorXd::Zero(expressions.num_coefficients());
    true_psi[3 % true_psi.size()] = 0.5;
    Camera camera;
    camera.camera_from_model = rotation_from_angles({radians(25), 0, 0});
    const Eigen::Matrix3Xd truth = points.at(true_alpha, true_psi);
    const Eigen::Matrix2Xd seen = camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(truth));

    Eigen::VectorXd alpha = Eigen::VectorXd::Zero(20);
    Eigen::VectorXd psi = Eigen::VectorXd::Zero(true_psi.size());
    const IdentityOptions identity_options{.regularization = 1.0, .landmark_sigma_px = 1.0};
    for (int iteration = 0; iteration < 5; ++iteration) {
        const PoseResult pose = estimate_pose(points.at(alpha, psi), seen);
        if (pose.status != FitStatus::success) {
            std::printf("pose: %s: %s\n", to_string(pose.status), pose.reason.c_str());
            return 1;
        }
        alpha = fit_identity(points, seen, pose.camera, {}, psi, identity_options).coefficients;
        psi = fit_expression(points, seen, pose.camera, {}, alpha).coefficients;
        std::printf("round %d: pose rms %.3f px, alpha %.2f %.2f, expression %.2f\n", iteration + 1, pose.rms_px,
                    alpha[0], alpha[1], psi[3 % psi.size()]);
    }
    return 0;
}
