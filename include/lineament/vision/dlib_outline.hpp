// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/core/landmarks.hpp"
#include "lineament/vision/dlib_detector.hpp"

namespace lineament {

/// Adds what a mesh lacks: the visible edge of jaw and cheeks, as the 16 outline landmarks of ibug68 that dlib finds on
/// the face whose mesh points these are. They are named with outline_prefix; fitters whose options say
/// outline_beside_scheme match them to the model's outline.
/// @param mesh_points  Scheme mediapipe478.
/// @throws InvalidArgument if the scheme is another, points that ibug68_from_mediapipe needs are missing, or the face
///         does not overlap the picture.
void add_dlib_outline(LandmarkSet& mesh_points, DlibDetector& detector, const ImageU8& picture);

} // namespace lineament
