// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/checks.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <limits>
#include <numeric>
#include <vector>

namespace lineament {

/// The point of a triangle (a, b, c) nearest to p.
/// @par Reference  Ericson, Real-Time Collision Detection, 2005, section 5.1.5 (Voronoi regions of the triangle).
[[nodiscard]] inline Eigen::Vector3d closest_point_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                                               const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// A point of a mesh surface.
struct SurfacePoint
{
    double distance = std::numeric_limits<double>::infinity(); ///< To the point asked for, mm.
    int triangle = -1;
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
};

/// Finds the nearest point of a triangle mesh, through a tree of axis-aligned boxes built once.
///
/// Cost: O(T log T) to build, about O(log T) a query. Safe to query from several threads.
class ClosestPointTree
{
public:
    /// @param vertices   3 x V, mm.
    /// @param triangles  3 x T, T >= 1.
    /// @throws InvalidArgument if there is no triangle, an index is outside 0..V-1, or a vertex is not finite.
    ClosestPointTree(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xi& triangles);

    /// The nearest surface point to p.
    [[nodiscard]] SurfacePoint closest(const Eigen::Vector3d& p) const;

private:
    struct Node
    {
        Eigen::AlignedBox3d box;
        int begin = 0; ///< Leaf: triangles order_[begin, end). Inner: children begin and end.
        int end = 0;
        bool is_leaf = false;
    };

    int build(int begin, int end);

    Eigen::Matrix3Xd vertices_;
    Eigen::Matrix3Xi triangles_;
    Eigen::Matrix3Xd centers_;
    std::vector<int> order_;
    std::vector<Node> nodes_;
};

inline Eigen::Vector3d closest_point_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                                 const Eigen::Vector3d& b, const Eigen::Vector3d& c)
{
    const Eigen::Vector3d ab = b - a;
    const Eigen::Vector3d ac = c - a;
    const double d1 = ab.dot(p - a);
    const double d2 = ac.dot(p - a);
    if (d1 <= 0.0 && d2 <= 0.0) {
        return a;
    }
    const double d3 = ab.dot(p - b);
    const double d4 = ac.dot(p - b);
    if (d3 >= 0.0 && d4 <= d3) {
        return b;
    }
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
        return a + (d1 / (d1 - d3)) * ab;
    }
    const double d5 = ab.dot(p - c);
    const double d6 = ac.dot(p - c);
    if (d6 >= 0.0 && d5 <= d6) {
        return c;
    }
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
        return a + (d2 / (d2 - d6)) * ac;
    }
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0) {
        return b + ((d4 - d3) / ((d4 - d3) + (d5 - d6))) * (c - b);
    }
    const double sum = va + vb + vc;
    return a + (vb / sum) * ab + (vc / sum) * ac;
}

inline ClosestPointTree::ClosestPointTree(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xi& triangles)
    : vertices_(vertices), triangles_(triangles)
{
    require(triangles.cols() > 0, "ClosestPointTree", "triangles", "at least one", "none");
    require_finite(vertices, "ClosestPointTree", "vertices");
    require(triangles.minCoeff() >= 0 && triangles.maxCoeff() < vertices.cols(), "ClosestPointTree", "triangles",
            "indices 0 to " + std::to_string(vertices.cols() - 1),
            std::to_string(triangles.minCoeff()) + " to " + std::to_string(triangles.maxCoeff()));
    centers_.resize(3, triangles.cols());
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        centers_.col(t) =
            (vertices.col(triangles(0, t)) + vertices.col(triangles(1, t)) + vertices.col(triangles(2, t))) / 3.0;
    }
    order_.resize(static_cast<std::size_t>(triangles.cols()));
    std::iota(order_.begin(), order_.end(), 0);
    nodes_.reserve(order_.size());
    build(0, static_cast<int>(order_.size()));
}

inline int ClosestPointTree::build(int begin, int end)
{
    constexpr int leaf_size = 4;
    const int index = static_cast<int>(nodes_.size());
    nodes_.emplace_back();
    Node node;
    for (int i = begin; i < end; ++i) {
        for (int corner = 0; corner < 3; ++corner) {
            node.box.extend(Eigen::Vector3d(vertices_.col(triangles_(corner, order_[i]))));
        }
    }
    if (end - begin <= leaf_size) {
        node.begin = begin;
        node.end = end;
        node.is_leaf = true;
    } else {
        int axis = 0;
        node.box.sizes().maxCoeff(&axis);
        const int middle = (begin + end) / 2;
        std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                         [&](int a, int b) { return centers_(axis, a) < centers_(axis, b); });
        node.begin = build(begin, middle);
        node.end = build(middle, end);
    }
    nodes_[index] = node;
    return index;
}

inline SurfacePoint ClosestPointTree::closest(const Eigen::Vector3d& p) const
{
    SurfacePoint best;
    double best_squared = std::numeric_limits<double>::infinity();
    int stack[128];
    int top = 0;
    stack[top++] = 0;
    while (top > 0) {
        const Node& node = nodes_[stack[--top]];
        if (node.box.squaredExteriorDistance(p) >= best_squared) {
            continue;
        }
        if (node.is_leaf) {
            for (int i = node.begin; i < node.end; ++i) {
                const int t = order_[i];
                const Eigen::Vector3d point =
                    closest_point_on_triangle(p, vertices_.col(triangles_(0, t)), vertices_.col(triangles_(1, t)),
                                              vertices_.col(triangles_(2, t)));
                const double squared = (point - p).squaredNorm();
                if (squared < best_squared) {
                    best_squared = squared;
                    best = {0.0, t, point};
                }
            }
            continue;
        }
        const double first = nodes_[node.begin].box.squaredExteriorDistance(p);
        const double second = nodes_[node.end].box.squaredExteriorDistance(p);
        stack[top++] = first < second ? node.end : node.begin; // the nearer child is visited first
        stack[top++] = first < second ? node.begin : node.end;
    }
    best.distance = std::sqrt(best_squared);
    return best;
}

} // namespace lineament
