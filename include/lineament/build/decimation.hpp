// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/mesh.hpp"

#include <Eigen/Core>

#include <vector>

namespace lineament {

/// How to simplify a mesh to nested levels of detail.
struct DecimationOptions
{
    std::vector<int> vertex_counts = {};   ///< Vertices of each coarser level, rising, each 3 <= count < V.
    std::vector<int> locked_vertices = {}; ///< Kept at every level (landmarks, contour), and their mirror partners.
    Eigen::VectorXd importances = {};      ///< V, > 0, scales the error at each vertex; empty: all 1.
    double border_weight = 10.0;           ///< Error off the border line against error off the surface, >= 0.
    double length_weight = 1e-3;           ///< Squared edge length against squared distance, >= 0: even triangles
                                           ///< where the surface is flat and every collapse is free.
    double max_normal_turn_deg = 60.0;     ///< No collapse turns a triangle by more, 0 < angle < 90.
    double min_triangle_quality = 0.05;    ///< No collapse makes a triangle worse than this and than the worst it
                                           ///< replaces; 4 sqrt(3) area / sum of squared edges, equilateral = 1.

    /// @throws InvalidArgument naming the member and the value.
    void check(Eigen::Index num_vertices) const;
};

/// One level of detail; its vertices are the first `num_vertices` of the new numbering.
struct MeshLevel
{
    int num_vertices = 0;
    Eigen::Matrix3Xi triangles = {};      ///< 3 x T, new numbering, 0 <= index < num_vertices.
    Eigen::VectorXi triangle_groups = {}; ///< T, or empty if the mesh had none.
};

enum class DecimationStatus
{
    success,
    count_not_reached, ///< Some level has more vertices than asked: no allowed collapse was left, or the count needs
                       ///< one vertex less and only mirrored pairs could go.
};

/// Levels of detail whose vertices are nested: each coarser level is a prefix of the finer ones.
struct NestedLevels
{
    DecimationStatus status = DecimationStatus::success;
    Eigen::VectorXi vertex_order = {};  ///< V, vertex_order(new index) = old index.
    Eigen::VectorXi mirror = {};        ///< V, new numbering; its prefix is the mirror map of each level.
    std::vector<MeshLevel> levels = {}; ///< As vertex_counts, then the full mesh: coarse to fine.
};

/// Nested, left-right symmetric simplification: vertices are removed one (on the symmetry plane) or two (a mirrored
/// pair) at a time by the cheapest half-edge collapse u -> v, which removes u and moves nothing else, of cost
///
///   c(u -> v) = (Q_u + Q_v)(x_v),   Q_i(x) = importance_i sum over triangles t at i  area_t / 3 dist(x, plane t)^2 +
///   ...
///
/// where Q_v grows by Q_u with each collapse; planes along the border hold the border line. The coarse vertices are
/// thus a subset of the fine ones and every level shares one model's rows.
///
/// Guaranteed at each level: manifold with the topology of the input (link condition); symmetric under `mirror`;
/// borders and boundaries between triangle groups collapse only along themselves; locked vertices are present;
/// no triangle turned by more than max_normal_turn_deg in any collapse, nor made to stand across (over 80 degrees)
/// the input's normals at its corners.
///
/// @param mesh    Vertices, triangles, triangle_groups (uv and colours are not read). Manifold, consistently oriented,
///                every vertex used.
/// @param mirror  V, the mirror partner of each vertex, itself on the symmetry plane; maps triangles to (reversed)
///                triangles. Empty: no symmetry.
/// @throws InvalidArgument if the mesh is not as said (naming the edge or vertex), the mirror map is not a symmetry of
///         the triangles (naming the triangle), a count is below the number of locked vertices, or on bad options.
/// @par Cost       O(V log V); 3,000 vertices take well under a second. Same input, same bits.
/// @par Reference  Garland and Heckbert, Surface Simplification Using Quadric Error Metrics, SIGGRAPH 1997;
///                 Dey, Edelsbrunner, Guha and Nekhayev, Topology Preserving Edge Contraction, 1999 (link condition).
[[nodiscard]] NestedLevels compute_nested_levels(const Mesh& mesh, const Eigen::VectorXi& mirror,
                                                 const DecimationOptions& options);

} // namespace lineament
