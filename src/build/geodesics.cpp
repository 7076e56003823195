// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Based on: Dijkstra's shortest paths on the mesh graph (Tenenbaum et al., Science 2000), the graph made denser by
// unfolding strips of triangles as in Chen and Han, Shortest Paths on a Polyhedron, SoCG 1990, to a fixed depth.
#include "geodesics.hpp"

#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <queue>

namespace lineament::detail {

namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b)
{
    return a.x() * b.y() - a.y() * b.x();
}

/// Position, on the right of the line from `a` to `b`, of the point at the given distances from both.
Eigen::Vector2d unfold(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double from_a, double from_b)
{
    const double length = (b - a).norm();
    const Eigen::Vector2d along = (b - a) / length;
    const double x = (from_a * from_a - from_b * from_b + length * length) / (2.0 * length);
    const double y = std::sqrt(std::max(0.0, from_a * from_a - x * x));
    return a + x * along + y * Eigen::Vector2d(along.y(), -along.x());
}

/// Looks from a vertex at the origin through a strip of triangles laid in the plane.
class Unfolding
{
public:
    Unfolding(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xi& triangles) : vertices_(vertices)
    {
        for (int t = 0; t < triangles.cols(); ++t) {
            for (int corner = 0; corner < 3; ++corner) {
                third_[{triangles(corner, t), triangles((corner + 1) % 3, t)}] = triangles((corner + 2) % 3, t);
            }
        }
    }

    using Report = std::function<void(int vertex, double distance)>;

    /// Continues through the edge from `left` to `right` of the next triangle, as far as the window between the
    /// directions `window_right` and `window_left` lets one see.
    void look(int right, const Eigen::Vector2d& at_right, int left, const Eigen::Vector2d& at_left,
              const Eigen::Vector2d& window_right, const Eigen::Vector2d& window_left, int depth,
              const Report& report) const
    {
        const auto next = third_.find({left, right});
        if (depth == 0 || next == third_.end()) {
            return;
        }
        const int apex = next->second;
        const Eigen::Vector2d at_apex = unfold(at_right, at_left, (vertices_.col(apex) - vertices_.col(right)).norm(),
                                               (vertices_.col(apex) - vertices_.col(left)).norm());
        const bool is_left_of_right = cross(window_right, at_apex) >= 0.0;
        const bool is_right_of_left = cross(at_apex, window_left) >= 0.0;
        if (is_left_of_right && is_right_of_left) {
            report(apex, at_apex.norm());
        }
        if (is_left_of_right) { // something is seen between the right side and the apex
            look(right, at_right, apex, at_apex, window_right, is_right_of_left ? at_apex : window_left, depth - 1,
                 report);
        }
        if (is_right_of_left) {
            look(apex, at_apex, left, at_left, is_left_of_right ? at_apex : window_right, window_left, depth - 1,
                 report);
        }
    }

private:
    const Eigen::Matrix3Xd& vertices_;
    std::map<std::pair<int, int>, int> third_; // directed edge -> third vertex of its triangle
};

} // namespace

Geodesics::Geodesics(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xi& triangles, int num_unfolded)
{
    std::vector<std::map<int, double>> shortest(static_cast<std::size_t>(vertices.cols()));
    const auto connect = [&](int a, int b, double length) {
        for (const auto& [from, to] : {std::pair(a, b), std::pair(b, a)}) {
            const auto [entry, is_new] = shortest[from].emplace(to, length);
            if (!is_new && length < entry->second) {
                entry->second = length;
            }
        }
    };
    const Unfolding unfolding(vertices, triangles);
    for (int t = 0; t < triangles.cols(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            const int source = triangles(corner, t);
            const int right = triangles((corner + 1) % 3, t);
            const int left = triangles((corner + 2) % 3, t);
            const double to_right = (vertices.col(right) - vertices.col(source)).norm();
            const double to_left = (vertices.col(left) - vertices.col(source)).norm();
            connect(source, right, to_right);
            connect(source, left, to_left);
            const Eigen::Vector2d at_right(to_right, 0.0);
            const double across = (vertices.col(left) - vertices.col(right)).norm();
            const double x = (to_right * to_right + to_left * to_left - across * across) / (2.0 * to_right);
            const Eigen::Vector2d at_left(x, std::sqrt(std::max(0.0, to_left * to_left - x * x)));
            unfolding.look(right, at_right, left, at_left, at_right, at_left, num_unfolded,
                           [&](int vertex, double distance) { connect(source, vertex, distance); });
        }
    }
    neighbors_.reserve(shortest.size());
    for (const auto& edges : shortest) {
        neighbors_.emplace_back(edges.begin(), edges.end());
    }
}

Eigen::VectorXd Geodesics::distances_from(int source) const
{
    Eigen::VectorXd distances = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(neighbors_.size()),
                                                          std::numeric_limits<double>::infinity());
    std::priority_queue<std::pair<double, int>, std::vector<std::pair<double, int>>, std::greater<>> queue;
    distances(source) = 0.0;
    queue.emplace(0.0, source);
    while (!queue.empty()) {
        const auto [distance, vertex] = queue.top();
        queue.pop();
        if (distance > distances(vertex)) {
            continue;
        }
        for (const auto& [neighbor, length] : neighbors_[vertex]) {
            if (distance + length < distances(neighbor)) {
                distances(neighbor) = distance + length;
                queue.emplace(distances(neighbor), neighbor);
            }
        }
    }
    return distances;
}

} // namespace lineament::detail
