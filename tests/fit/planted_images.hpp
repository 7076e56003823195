// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Planted images of one synthetic person, and options that know how they were made.
#pragma once

#include "lineament/fit/joint_fitter.hpp"

#include "support/planted_face.hpp"

#include <vector>

namespace lineament::test {

inline const Eigen::Vector2d centre(320, 240);

struct Planted
{
    Eigen::VectorXd alpha;
    std::vector<Camera> cameras;
    std::vector<LandmarkSet> images;
};

/// Images of one person drawn from the priors; each landmark with an offset of its own in all images, along z the given
/// times as wide.
[[nodiscard]] inline Planted plant(Random& random, int num_images, double noise_px, double bias_mm = 0,
                                   double phi_per_mm = 0, double bias_depth_ratio = 1)
{
    Planted planted;
    planted.alpha = random_normal(random, synthetic_face().shape.num_coefficients());
    MorphableModel biased = synthetic_face(); // a model whose mean has the landmarks' vertices moved
    const LandmarkMap& map = biased.landmark_maps[0];
    for (Eigen::Index l = 0; l < map.num_landmarks(); ++l) {
        Eigen::Vector3d offset = bias_mm * random_normal(random, 3);
        offset.z() *= bias_depth_ratio;
        biased.shape.mean.segment<3>(3 * map.vertices(0, l)) += offset.cast<float>();
    }
    for (int f = 0; f < num_images; ++f) {
        const Eigen::VectorXd psi = draw_expression(random);
        Camera camera = random_camera(random, 40);
        camera.phi_per_mm = phi_per_mm;
        if (phi_per_mm > 0) {
            camera.scale_px_per_mm = 500 * phi_per_mm;
        }
        planted.cameras.push_back(camera);
        planted.images.push_back(project_landmarks(biased, "ibug68", planted.alpha, psi, camera, noise_px, random));
    }
    return planted;
}

/// Correspondences given, noise known, no bias.
[[nodiscard]] inline JointOptions given(double sigma_mm = 2.0)
{
    JointOptions options;
    options.contour = ContourMode::fixed;
    options.landmark_sigma_mm = sigma_mm;
    options.contour_sigma_mm = sigma_mm;
    options.bias_sigma_mm = 0;
    options.tolerance = 1e-6;
    return options;
}

/// The same with landmark biases.
[[nodiscard]] inline JointOptions with_bias(double bias_sigma_mm)
{
    JointOptions options = given();
    options.bias_sigma_mm = bias_sigma_mm;
    return options;
}

} // namespace lineament::test
