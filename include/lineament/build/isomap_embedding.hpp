// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/mesh.hpp"

#include <Eigen/Core>

namespace lineament {

/// How to lay a surface out in the plane.
struct IsomapOptions
{
    Eigen::VectorXd importances = {}; ///< V, > 0, weight of each vertex in the stress; empty: all 1.
    int num_sources = 256;            ///< Vertices from which geodesics are measured, >= 3; all if V is smaller.
    double barrier_weight = 0.02;     ///< Weight of the barrier against folds beside the stress, > 0. Larger: more even
                                      ///< triangles; smaller: less stress.
    int max_iterations = 200;         ///< >= 1.

    /// @throws InvalidArgument naming the member and the value.
    void check(Eigen::Index num_vertices) const;
};

enum class IsomapStatus
{
    converged,
    not_converged, ///< The layout is valid, but its stress would still fall with more iterations.
    folded,        ///< Triangles are so thin that floats cannot hold them in the layout; num_folds counts them.
};

/// A fold-free layout and how good it is. Stress is Kruskal's: sqrt(sum w (|y_i - y_j| - g_ij)^2 / sum w g_ij^2).
struct IsomapEmbedding
{
    IsomapStatus status = IsomapStatus::not_converged;
    Eigen::Matrix2Xf uv_coordinates = {}; ///< 2 x V, [0, 1]^2, origin top-left.
    double scale_per_mm = 0.0;            ///< uv units a millimetre of geodesic distance.
    double start_stress = 0.0;            ///< Of the disc the layout starts from, at its best scale.
    double mds_stress = 0.0;              ///< Of plain classical MDS, which may fold; the reference.
    double stress = 0.0;                  ///< Of the layout.
    int num_mds_folds = 0;                ///< Triangles turned over by plain MDS.
    int num_folds = 0;     ///< Triangles turned over by the layout, on the floats returned: 0 unless `folded`.
    double min_area = 0.0; ///< Smallest triangle, uv units squared; > 0 unless `folded`.
    int num_iterations = 0;
};

/// A layout y of the surface in the plane without folds, with distances close to those along the surface:
///
///   min over y   sum_ij w_ij (|y_i - y_j| - g_ij)^2 / sum_ij w_ij g_ij^2  +  barrier_weight D(y),   det J_t > 0 for
///   all t
///
/// with g the geodesic distances from a spread of source vertices i to all vertices j, w_ij = importance_i
/// importance_j, J_t the Jacobian of triangle t and D the mean over the area of (|J|^2 + |J^-1|^2) / 4 - 1, which is 0
/// for an isometry and infinite at a fold. Starts from Tutte's embedding of the disc, which has no folds, and moves by
/// projected Newton steps cut before the first fold.
///
/// The longest border is the outer one; other borders are closed by a fan around their centre. With a mirror map the
/// shape is first made symmetric (each vertex averaged with its mirrored partner) and the layout is symmetric exactly:
/// u of the partner = 1 - u. The layout is upright (u towards the subject's left, v towards the chin), scaled uniformly
/// and centred in [0, 1]^2 with a margin of 1/64.
///
/// @param mesh    Vertices and triangles are read. A connected manifold disc, up to holes; every vertex used; no
///                triangle of zero area.
/// @param mirror  V, as for compute_nested_levels; empty: no symmetry.
/// @throws InvalidArgument if the mesh is not a disc (naming the edge, vertex or triangle), the mirror map is not a
///         symmetry of the triangles or does not cross the border twice, or on bad options.
/// @par Cost       One sparse Cholesky factorisation an iteration; 3,000 vertices take seconds. Same input, same bits.
/// @par Reference  Tenenbaum, de Silva and Langford, A Global Geometric Framework for Nonlinear Dimensionality
/// Reduction,
///                 Science 2000; Tutte, How to Draw a Graph, 1963; Floater, Mean Value Coordinates, CAGD 2003; Smith
///                 and Schaefer, Bijective Parameterization with Free Boundaries, SIGGRAPH 2015 (barrier and step
///                 length).
[[nodiscard]] IsomapEmbedding compute_isomap_embedding(const Mesh& mesh, const Eigen::VectorXi& mirror,
                                                       const IsomapOptions& options = {});

} // namespace lineament
