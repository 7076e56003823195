// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/build/decimation.hpp"

#include <Eigen/Core>

#include <queue>
#include <tuple>
#include <vector>

namespace lineament::detail {

/// A neighbour of a vertex and what the edge to it separates.
struct Spoke
{
    int vertex = 0;
    int num_triangles = 0;
    int group = 0;
    bool is_group_boundary = false;

    /// Borders and group boundaries: lines of the mesh that collapse only along themselves.
    [[nodiscard]] bool is_feature() const { return num_triangles == 1 || is_group_boundary; }
};

struct Collapse
{
    double cost = 0.0;
    int removed = 0;
    int kept = 0;
    int stamp = 0; ///< Sum of the stamps of both ends when pushed; older ones are void.

    /// For a queue with the cheapest on top; ties by index, so that the order is the same everywhere.
    bool operator<(const Collapse& other) const
    {
        return std::tie(cost, removed, kept) > std::tie(other.cost, other.removed, other.kept);
    }
};

/// A mesh that shrinks by half-edge collapses, mirrored pairs together.
class Decimator
{
public:
    Decimator(const Mesh& mesh, const Eigen::VectorXi& mirror, const DecimationOptions& options);

    /// Collapses until `count` vertices are left or nothing more is allowed.
    void reduce_to(int count);

    [[nodiscard]] int num_left() const { return num_left_; }
    [[nodiscard]] const std::vector<int>& removed() const { return removed_; }
    /// Triangles left, in the old numbering.
    [[nodiscard]] MeshLevel level(bool with_groups) const;

private:
    void add_quadrics(const DecimationOptions& options);
    [[nodiscard]] std::vector<Spoke> spokes(int vertex) const;
    [[nodiscard]] bool has_corner(int triangle, int vertex) const;
    [[nodiscard]] double cost(int removed, int kept) const;
    [[nodiscard]] bool keeps_topology(int removed, int kept) const;
    [[nodiscard]] bool keeps_geometry(int removed, int kept) const;
    void push(int removed, int kept);
    void push_around(int vertex);
    bool collapse(int removed, int kept);
    bool collapse_with_mirror(int removed, int kept);

    Eigen::Matrix3Xd vertices_;
    Eigen::Matrix3Xi triangles_;
    Eigen::VectorXi groups_;
    Eigen::VectorXi mirror_;
    std::vector<char> is_alive_;                 // T
    std::vector<char> is_locked_;                // V
    std::vector<std::vector<int>> triangles_at_; // V; dead triangles may stay listed
    std::vector<Eigen::Matrix4d> quadrics_;      // V
    Eigen::Matrix3Xd normals_;                   // of the input at its vertices, unit
    std::vector<int> stamps_;                    // V
    std::priority_queue<Collapse> queue_;
    std::vector<int> removed_;
    int num_left_ = 0;
    double min_cosine_ = 0.5;
    double min_quality_ = 0.0;
};

} // namespace lineament::detail
