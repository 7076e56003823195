// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lineament {

/// What the head's yaw shows: both sides alike, or one side turned to the camera and the other away from it.
enum class ContourView
{
    frontal,
    shows_right, ///< yaw > 0: the subject's right side faces the camera, the left one is seen as a silhouette.
    shows_left,
};

} // namespace lineament
