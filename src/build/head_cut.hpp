// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/build/makehuman_package.hpp"

#include <Eigen/Core>

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace lineament::build {

/// The front of the head as triangles of base vertices, open at the eyes and the mouth.
struct HeadCut
{
    std::vector<Eigen::Vector3i> triangles = {};
    std::map<int, std::pair<int, double>> slide = {}; ///< Border vertex -> neighbour and fraction of the way to it.
    std::vector<int> base_mirror = {};                ///< Base vertex -> partner; -1 for those outside the body.
    std::vector<int> uv_of_base = {};                 ///< Base vertex -> base uv, on the face's island where possible.
};

/// Cuts the body (without eye sockets and mouth cavity) by a vertical plane behind the ears and a plane across the
/// neck. Border vertices slide along an edge onto the cut, so the border is clean; the same for both sides exactly.
/// @throws IoError (content) if the mesh is not the known one.
[[nodiscard]] HeadCut cut_head(const MakeHumanBase& base, const Eigen::Matrix3Xd& reference);

/// The border loops of a mesh of triangles, each in the direction of its border edges.
[[nodiscard]] std::vector<std::vector<int>> find_border_loops(const std::vector<Eigen::Vector3i>& triangles);

/// @throws IoError (content): the base mesh is not that of the package.
[[noreturn]] void throw_unknown_mesh(const std::string& found);

} // namespace lineament::build
