// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <utility>
#include <vector>

namespace lineament::detail {

/// Distances along a manifold triangle mesh; not a public header.
///
/// Shortest paths in a graph of the vertices whose edges are the mesh edges and the straight lines to vertices that are
/// seen by unfolding up to `num_unfolded` further triangles into the plane. Each is the length of a path on the
/// surface, so never below the geodesic, and exact where the straight line crosses no more triangles than that.
class Geodesics
{
public:
    Geodesics(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xi& triangles, int num_unfolded = 8);

    /// V distances from the vertex (Dijkstra); infinite where no path leads.
    [[nodiscard]] Eigen::VectorXd distances_from(int source) const;

private:
    std::vector<std::vector<std::pair<int, double>>> neighbors_;
};

} // namespace lineament::detail
