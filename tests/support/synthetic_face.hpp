// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/angles.hpp"
#include "lineament/core/landmarks.hpp"
#include "lineament/core/random.hpp"
#include "lineament/model/morphable_model.hpp"

namespace lineament::test {

struct SyntheticFaceOptions
{
    int half_columns = 16; ///< The grid has 2 half_columns + 1 columns and 2 half_rows + 1 rows; both even.
    int half_rows = 16;
    int num_shape_coefficients = 12;
    int num_expressions = 4;
    bool with_color = true;
};

/// A small left-right symmetric face-like model: the front half of an ellipsoid (semi-axes 75, 105, 85 mm) with a nose,
/// smooth modes of falling size, local expression bumps (set "ekman6"), two levels, uv, the scheme ibug68, contour
/// lists, mirror map and masks. The same options give the same model on every machine.
[[nodiscard]] MorphableModel make_synthetic_face(const SyntheticFaceOptions& options = {});

/// N(0, 1) draws.
[[nodiscard]] Eigen::VectorXd random_normal(Random& random, Eigen::Index size);

/// Uniform draws in [low, high).
[[nodiscard]] Eigen::VectorXd random_uniform(Random& random, Eigen::Index size, double low, double high);

/// Points spread like a face, some 150 mm wide (3 x count).
[[nodiscard]] Eigen::Matrix3Xd random_points(Random& random, int count);

/// A scaled orthographic camera that sees the face about `outer_eye_distance`-like 100 px wide in the middle of a
/// 640 x 480 picture: yaw uniform in +-max_yaw, pitch and roll within a third of it.
[[nodiscard]] Camera random_camera(Random& random, double max_yaw_deg = 45.0);

/// The model's landmarks on S(alpha, psi) seen by the camera, each coordinate with N(0, noise_px) added.
[[nodiscard]] LandmarkSet project_landmarks(const MorphableModel& model, const std::string& scheme,
                                            const Eigen::VectorXd& shape_coefficients,
                                            const Eigen::VectorXd& expression_coefficients, const Camera& camera,
                                            double noise_px, Random& random);

/// Gives the landmarks the depth that they have on the model's mean face, seen by the camera from `origin_px`.
void add_depth(const MorphableModel& model, const Camera& camera, double origin_px, LandmarkSet& set);

[[nodiscard]] LandmarkSet without_depth(LandmarkSet set);

/// Angle of the rotation from one camera's orientation to another's.
[[nodiscard]] double angle_between_deg(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b);

} // namespace lineament::test
