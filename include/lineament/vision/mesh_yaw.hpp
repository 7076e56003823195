// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/landmarks.hpp"

#include <optional>

namespace lineament {

/// The yaw of a head that the depth of its mesh points tells [rad], as HeadAngles::yaw: how far the line from its right
/// to its left side is turned out of the image, from eye and mouth corners and the ends of the oval.
/// @param set  Scheme mediapipe478. Nothing if one of those points or its depth is missing.
/// @throws InvalidArgument if the scheme is another.
[[nodiscard]] std::optional<double> mesh_yaw(const LandmarkSet& set);

/// Takes confidence from the points of the side turned away (to 0.2) where mesh_yaw is beyond 50 degrees, which is a
/// head turned by about 54: there the networks fold them onto the visible outline. The fit still needs them a little,
/// as they hold the head in its turn. Otherwise, and without depth, the set stays as it is. Allocates nothing.
/// @throws InvalidArgument if the scheme is another than mediapipe478.                   docs/vision.md, docs/decisions
void doubt_folded_points(LandmarkSet& set);

} // namespace lineament
