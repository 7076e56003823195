// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/landmarks.hpp"
#include "lineament/fit/fit_result.hpp"
#include "support/synthetic_face.hpp"

namespace lineament::test {

/// make_synthetic_face(), made once.
[[nodiscard]] const MorphableModel& synthetic_face();

/// A face whose truth is known, as 68 landmarks of synthetic_face().
struct PlantedFace
{
    Eigen::VectorXd alpha;
    Eigen::VectorXd psi;
    Camera camera;
    LandmarkSet landmarks;
};

/// Coefficients inside their bounds: alpha with half the prior's deviation, psi uniform in [0, 0.6).
[[nodiscard]] PlantedFace plant_moderate_face(Random& random, double noise_px, double max_yaw_deg = 30);

/// Coefficients drawn from the priors: alpha ~ N(0, 1), psi ~ |N(0, 0.3)|, at most 1.
[[nodiscard]] PlantedFace plant_face_from_priors(Random& random, double noise_px, double max_yaw_deg = 30);

/// psi of plant_face_from_priors.
[[nodiscard]] Eigen::VectorXd draw_expression(Random& random);

/// Mean distance of the vertices of two neutral faces of synthetic_face() [mm].
[[nodiscard]] double neutral_distance_mm(const Eigen::VectorXd& alpha, const Eigen::VectorXd& other);

/// Largest distance of a vertex between the shapes with expression of two fits of one model [mm].
[[nodiscard]] double largest_vertex_distance_mm(const MorphableModel& model, const FitResult& a, const FitResult& b);

} // namespace lineament::test
