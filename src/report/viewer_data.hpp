// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/report/face_view.hpp"

#include <string>
#include <vector>

namespace lineament::html {

/// What the viewer plays over time: one entry a frame.
struct Playback
{
    std::vector<float> times_s = {};
    std::vector<float> rotations = {};                ///< 9 a frame: H = F R, row-major; zeros where there is no face.
    std::vector<std::vector<float>> expressions = {}; ///< k a frame; zeros where there is no face.
    std::vector<std::string> statuses = {};
};

/// The face as the JSON object that src/report/web/viewer.js reads: sizes and names in plain text, arrays as base64 of
/// little-endian values; morph offsets as int16 with one scale each (error at most 2^-16 of the largest offset).
/// `rotation_of_view` (H = F R) is the pose of the button "as in the picture".
/// @throws InvalidArgument if the mesh, the morph targets and the values disagree in size, or an index is out of range.
[[nodiscard]] std::string viewer_json(const FaceView& view, const Eigen::Matrix3d& rotation_of_view,
                                      const Playback& playback = {});

} // namespace lineament::html
