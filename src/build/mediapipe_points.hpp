// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/model/morphable_model.hpp"

#include <array>

namespace lineament::build {

/// Parts of MediaPipe's face mesh whose points err together.
enum class MeshRegion
{
    eyes,
    brows,
    nose,
    mouth,
    skin,
    oval,
    iris,
};

/// A point of MediaPipe's face mesh on the mean face, and its left-right partner (itself in the symmetry plane).
struct MeshPoint
{
    int point = 0;
    int partner = 0;
    MeshRegion region = MeshRegion::skin;
    double x = 0.0; ///< From the middle between the outer eye corners, in units of their distance; <= 0: the
    double y = 0.0; ///< subject's right. Axes of model space.
    double z = 0.0;
};

/// The points of the subject's right and of the symmetry plane; the others are their mirror images. Where the table
/// comes from: models/README.md.
extern const std::array<MeshPoint, 253> mediapipe_points;

/// The landmark map "mediapipe478" of a model with a mirror map and the groups "skin" and "eyes": each point of the
/// table at the nearest point of the coarsest level's skin, the irises on its eyes. Left and right are mirror images.
/// Noise "mediapipe": docs/model.md; infinite for the irises, which look where they like.
/// @param right_eye_corner  Vertex at the outer corner of the subject's right eye.
[[nodiscard]] LandmarkMap make_mediapipe_map(const MorphableModel& model, int right_eye_corner);

} // namespace lineament::build
