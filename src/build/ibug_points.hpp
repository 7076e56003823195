// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/model/morphable_model.hpp"

#include <Eigen/Core>

#include <vector>

namespace lineament::build {

/// How far the points of ibug68 lie from their vertices as annotators place them: 2 x 68, to the subject's left and up
/// [mm on the mean face], 0 for the outline. bench/landmark_offsets measures them; docs/model.md, "Landmarks".
[[nodiscard]] Eigen::Matrix2Xd annotator_offsets_mm();

/// The landmark map "ibug68": each point at its vertex or, if it has an offset, at the point of the coarsest level's
/// skin nearest to the vertex moved by it. Left and right are mirror images; points of the symmetry plane stay in it.
/// @param vertices    68, of the coarsest level, each with its mirror partner.
/// @param offsets_mm  2 x 68; those of the subject's left are not read.
[[nodiscard]] LandmarkMap make_ibug_map(const MorphableModel& model, const std::vector<int>& vertices,
                                        const Eigen::Matrix2Xd& offsets_mm);

} // namespace lineament::build
