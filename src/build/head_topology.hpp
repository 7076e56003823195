// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/build/makehuman_package.hpp"

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include <array>
#include <vector>

namespace lineament::build {

/// Triangle groups of the default model, in this order.
enum TriangleGroup
{
    skin = 0,
    eyes = 1,
    mouth_interior = 2,
};

/// The surface that closes the opening of one eye: columns of three vertices between the upper and the lower lid.
struct EyeCap
{
    static constexpr int num_columns = 13;
    static constexpr int num_rows = 3;

    std::array<int, num_columns> upper = {}; ///< Lid vertices, outer to inner corner.
    std::array<int, num_columns> lower = {};
    std::array<std::array<int, num_rows>, num_columns> vertices = {}; ///< From the upper lid down.
    Eigen::Vector3d eyeball_center = Eigen::Vector3d::Zero();         ///< In the reference shape, mm.
};

/// The front of the head cut out of the base mesh, eyes and mouth closed. Every vertex is a fixed affine function of
/// the base vertices, so every target of the package moves it linearly:
///
///   x_v = sum_b weights(v, b) base_b + offset_v
struct HeadTopology
{
    Eigen::SparseMatrix<double, Eigen::RowMajor> weights = {}; ///< V x base vertices, rows sum to 1.
    Eigen::Matrix3Xd offsets = {};                             ///< 3 x V, mm; zero but on the eyes.
    Eigen::Matrix3Xi triangles = {};                           ///< 3 x T.
    Eigen::VectorXi triangle_groups = {};                      ///< T, TriangleGroup.
    Eigen::VectorXi mirror = {};                               ///< V.
    std::vector<int> uv_of_vertex = {};                        ///< V, index into the base's uv; -1 on the eyes.
    std::vector<int> vertex_of_base = {};                      ///< Base vertex -> vertex, or -1.
    std::array<EyeCap, 2> eyes = {};                           ///< Right, left.
    std::vector<int> lip_loop = {};                            ///< The vertices that bound the mouth's opening.

    [[nodiscard]] Eigen::Index num_vertices() const { return offsets.cols(); }

    /// Displacements of the vertices (3 x V) for displacements of the base vertices.
    [[nodiscard]] Eigen::Matrix3Xd displacement(const Eigen::Matrix3Xd& base_displacement) const
    {
        return (weights * base_displacement.transpose()).transpose();
    }

    /// Vertices (3 x V) for positions of the base vertices.
    [[nodiscard]] Eigen::Matrix3Xd vertices(const Eigen::Matrix3Xd& base_vertices) const
    {
        return displacement(base_vertices) + offsets;
    }

    /// The columns as seen in a mirror: x reversed, partners exchanged.
    [[nodiscard]] Eigen::Matrix3Xd mirrored(const Eigen::Matrix3Xd& values) const;
};

/// @param reference  3 x base vertices, mm: the adult shape in which the cut is made and the eyeballs are placed.
/// @throws IoError (content) if the mesh is not the known one.
[[nodiscard]] HeadTopology make_head_topology(const MakeHumanBase& base, const Eigen::Matrix3Xd& reference);

} // namespace lineament::build
