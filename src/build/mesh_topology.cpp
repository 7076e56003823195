// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "mesh_topology.hpp"

#include "lineament/core/checks.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <string>
#include <utility>

namespace lineament::detail {

namespace {

/// (from, to) -> the triangle that walks it in this direction.
using DirectedEdges = std::map<std::pair<int, int>, int>;

std::string edge_name(int a, int b)
{
    return "edge " + std::to_string(std::min(a, b)) + "-" + std::to_string(std::max(a, b));
}

int third_vertex(const Eigen::Matrix3Xi& triangles, int t, int a, int b)
{
    return triangles(0, t) + triangles(1, t) + triangles(2, t) - a - b;
}

/// The triangle's indices, turned so that the smallest comes first.
std::array<int, 3> turned(int a, int b, int c)
{
    std::array<int, 3> corners = {a, b, c};
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    return corners;
}

} // namespace

void require_manifold(const Eigen::Matrix3Xi& triangles, Eigen::Index num_vertices, const char* function)
{
    require(triangles.cols() > 0, function, "triangles", "at least one triangle", "none");
    std::vector<int> num_triangles_at(static_cast<std::size_t>(num_vertices), 0);
    std::vector<int> first_neighbor(static_cast<std::size_t>(num_vertices), -1);
    DirectedEdges edges;
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        const std::string name = "triangles(" + std::to_string(t) + ")";
        for (int corner = 0; corner < 3; ++corner) {
            const int index = triangles(corner, t);
            require(index >= 0 && index < num_vertices, function, name.c_str(),
                    "indices 0.." + std::to_string(num_vertices - 1), std::to_string(index));
        }
        for (int corner = 0; corner < 3; ++corner) {
            const int a = triangles(corner, t);
            const int b = triangles((corner + 1) % 3, t);
            require(a != b, function, name.c_str(), "three different vertices",
                    "vertex " + std::to_string(a) + " twice");
            const bool is_new = edges.emplace(std::pair(a, b), static_cast<int>(t)).second;
            require(is_new, function, "triangles", "a manifold mesh of consistent orientation",
                    edge_name(a, b) + " walked twice from " + std::to_string(a) + " to " + std::to_string(b));
            ++num_triangles_at[static_cast<std::size_t>(a)];
            first_neighbor[static_cast<std::size_t>(a)] = b;
        }
    }
    for (const auto& [edge, t] : edges) { // a border edge starts the fan of its first vertex
        if (!edges.contains({edge.second, edge.first})) {
            first_neighbor[static_cast<std::size_t>(edge.first)] = edge.second;
        }
    }
    for (int v = 0; v < num_vertices; ++v) {
        const int num_triangles = num_triangles_at[static_cast<std::size_t>(v)];
        require(num_triangles > 0, function, "triangles", "every vertex in a triangle",
                "vertex " + std::to_string(v) + " in none");
        const int start = first_neighbor[static_cast<std::size_t>(v)];
        int num_in_fan = 0;
        int neighbor = start;
        do {
            const auto edge = edges.find({v, neighbor});
            if (edge == edges.end()) {
                break;
            }
            neighbor = third_vertex(triangles, edge->second, v, neighbor);
            ++num_in_fan;
        } while (neighbor != start);
        require(num_in_fan == num_triangles, function, "triangles", "one fan of triangles at each vertex",
                "several at vertex " + std::to_string(v));
    }
}

void require_mirror(const Eigen::VectorXi& mirror, const Eigen::Matrix3Xi& triangles, Eigen::Index num_vertices,
                    const char* function)
{
    if (mirror.size() == 0) {
        return;
    }
    require_size(mirror.size(), num_vertices, function, "mirror");
    for (Eigen::Index v = 0; v < num_vertices; ++v) {
        const int partner = mirror(v);
        const bool is_involution = partner >= 0 && partner < num_vertices && mirror(partner) == v;
        require(is_involution, function, "mirror", "partners of each other",
                "vertex " + std::to_string(v) + " -> " + std::to_string(partner));
    }
    std::set<std::array<int, 3>> known;
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        known.insert(turned(triangles(0, t), triangles(1, t), triangles(2, t)));
    }
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        const auto mirrored = turned(mirror(triangles(0, t)), mirror(triangles(2, t)), mirror(triangles(1, t)));
        require(known.contains(mirrored), function, "mirror", "a symmetry of the triangles",
                "triangle " + std::to_string(t) + " without a mirrored one");
    }
}

std::vector<std::vector<int>> border_loops(const Eigen::Matrix3Xi& triangles)
{
    std::set<std::pair<int, int>> edges;
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            edges.emplace(triangles(corner, t), triangles((corner + 1) % 3, t));
        }
    }
    std::map<int, int> next;
    for (const auto& [a, b] : edges) {
        if (!edges.contains({b, a})) {
            next[a] = b;
        }
    }
    std::vector<std::vector<int>> loops;
    while (!next.empty()) {
        std::vector<int>& loop = loops.emplace_back();
        for (auto edge = next.begin(); edge != next.end(); edge = next.find(loop.back())) {
            if (loop.empty()) {
                loop.push_back(edge->first);
            }
            if (edge->second != loop.front()) {
                loop.push_back(edge->second);
            }
            const bool is_closed = edge->second == loop.front();
            next.erase(edge);
            if (is_closed) {
                break;
            }
        }
    }
    return loops;
}

} // namespace lineament::detail
