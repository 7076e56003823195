// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <vector>

/// Checks and border walks shared by the algorithms of this module; not a public header.
namespace lineament::detail {

/// Every vertex is used, every edge has one or two triangles of consistent orientation, and the triangles at each
/// vertex form one fan.
/// @throws InvalidArgument naming `function`, "triangles" and the triangle, edge or vertex.
void require_manifold(const Eigen::Matrix3Xi& triangles, Eigen::Index num_vertices, const char* function);

/// `mirror` is empty, or an involution of the V vertices that maps every triangle to a triangle of opposite
/// orientation.
/// @throws InvalidArgument naming `function`, "mirror" and the vertex or triangle.
void require_mirror(const Eigen::VectorXi& mirror, const Eigen::Matrix3Xi& triangles, Eigen::Index num_vertices,
                    const char* function);

/// The closed border loops of a manifold mesh, each walked with the surface on its left; in order of their smallest
/// vertex, which comes first in its loop.
[[nodiscard]] std::vector<std::vector<int>> border_loops(const Eigen::Matrix3Xi& triangles);

} // namespace lineament::detail
