// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <string>
#include <vector>

namespace lineament {

/// A triangle mesh in model space: right-handed, millimetres, y up, z out of the face, x to the subject's left.
///
/// Empty members are absent. uv space: [0, 1]^2, origin top-left, v down. The uv triangles index `uv_coordinates`
/// the way `triangles` index `vertices`, so a vertex may have several uv points at a seam.
struct Mesh
{
    Eigen::Matrix3Xf vertices = {};            ///< 3 x V, mm.
    Eigen::Matrix3Xi triangles = {};           ///< 3 x T, counter-clockwise seen from outside, 0 <= index < V.
    Eigen::VectorXi triangle_groups = {};      ///< T, index into group_names; empty: all one group.
    std::vector<std::string> group_names = {}; ///< For example "skin", "eyes", "mouth_interior".
    Eigen::Matrix2Xf uv_coordinates = {};      ///< 2 x U.
    Eigen::Matrix3Xi uv_triangles = {};        ///< 3 x T, 0 <= index < U.
    Eigen::Matrix3Xf colors = {};              ///< 3 x V, sRGB-encoded, [0, 1].

    [[nodiscard]] Eigen::Index num_vertices() const { return vertices.cols(); }
    [[nodiscard]] Eigen::Index num_triangles() const { return triangles.cols(); }
};

/// Unit vertex normals (3 x V): the area-weighted mean of the normals of the triangles at each vertex, pointing
/// outwards; zero for a vertex without a triangle of positive area.
[[nodiscard]] inline Eigen::Matrix3Xf compute_vertex_normals(const Eigen::Matrix3Xf& vertices,
                                                             const Eigen::Matrix3Xi& triangles)
{
    Eigen::Matrix3Xf normals = Eigen::Matrix3Xf::Zero(3, vertices.cols());
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        const Eigen::Vector3f a = vertices.col(triangles(0, t));
        const Eigen::Vector3f b = vertices.col(triangles(1, t));
        const Eigen::Vector3f c = vertices.col(triangles(2, t));
        const Eigen::Vector3f normal = (b - a).cross(c - a);
        for (int corner = 0; corner < 3; ++corner) {
            normals.col(triangles(corner, t)) += normal;
        }
    }
    for (Eigen::Index v = 0; v < normals.cols(); ++v) {
        const float length = normals.col(v).norm();
        if (length > 0) {
            normals.col(v) /= length;
        }
    }
    return normals;
}

} // namespace lineament
