// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/build/decimation.hpp"

#include "decimator.hpp"
#include "lineament/core/checks.hpp"
#include "mesh_topology.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

namespace lineament {

namespace {

constexpr const char* function_name = "compute_nested_levels";

} // namespace

void DecimationOptions::check(Eigen::Index num_vertices) const
{
    const char* function = "DecimationOptions";
    int previous = 2;
    for (const int count : vertex_counts) {
        require(count > previous && count < num_vertices, function, "vertex_counts",
                "rising counts of 3.." + std::to_string(num_vertices - 1), std::to_string(count));
        previous = count;
    }
    for (const int v : locked_vertices) {
        require(v >= 0 && v < num_vertices, function, "locked_vertices",
                "indices 0.." + std::to_string(num_vertices - 1), std::to_string(v));
    }
    if (importances.size() != 0) {
        require_size(importances.size(), num_vertices, function, "importances");
        require_finite(importances, function, "importances");
        require(importances.minCoeff() > 0.0, function, "importances", "numbers > 0", to_text(importances.minCoeff()));
    }
    const auto is_weight = [](double weight) { return std::isfinite(weight) && weight >= 0.0; };
    require(is_weight(border_weight), function, "border_weight", "a number >= 0", to_text(border_weight));
    require(is_weight(length_weight), function, "length_weight", "a number >= 0", to_text(length_weight));
    require(max_normal_turn_deg > 0.0 && max_normal_turn_deg < 90.0, function, "max_normal_turn_deg",
            "an angle in (0, 90)", to_text(max_normal_turn_deg));
    require(min_triangle_quality >= 0.0 && min_triangle_quality < 1.0, function, "min_triangle_quality",
            "a number in [0, 1)", to_text(min_triangle_quality));
}

NestedLevels compute_nested_levels(const Mesh& mesh, const Eigen::VectorXi& mirror, const DecimationOptions& options)
{
    const Eigen::Index num_vertices = mesh.num_vertices();
    options.check(num_vertices);
    require_finite(mesh.vertices, function_name, "vertices");
    detail::require_manifold(mesh.triangles, num_vertices, function_name);
    detail::require_mirror(mirror, mesh.triangles, num_vertices, function_name);
    const bool with_groups = mesh.triangle_groups.size() != 0;
    if (with_groups) {
        require_size(mesh.triangle_groups.size(), mesh.num_triangles(), function_name, "triangle_groups");
    }
    std::set<int> locked(options.locked_vertices.begin(), options.locked_vertices.end());
    for (const int v : options.locked_vertices) {
        locked.insert(mirror.size() == 0 ? v : mirror(v));
    }
    if (!options.vertex_counts.empty()) {
        require(options.vertex_counts.front() >= static_cast<int>(locked.size()), function_name, "vertex_counts",
                "at least the " + std::to_string(locked.size()) + " locked vertices and their partners",
                std::to_string(options.vertex_counts.front()));
    }

    NestedLevels result;
    detail::Decimator decimator(mesh, mirror, options);
    result.levels.push_back(decimator.level(with_groups));
    const std::vector<int> fine_to_coarse(options.vertex_counts.rbegin(), options.vertex_counts.rend());
    for (const int count : fine_to_coarse) {
        decimator.reduce_to(count);
        result.levels.push_back(decimator.level(with_groups));
        if (decimator.num_left() != count) {
            result.status = DecimationStatus::count_not_reached;
        }
    }
    std::ranges::reverse(result.levels);

    // Survivors in their old order, then the last removed first.
    std::vector<char> is_removed(static_cast<std::size_t>(num_vertices), 0);
    for (const int v : decimator.removed()) {
        is_removed[v] = 1;
    }
    result.vertex_order.resize(num_vertices);
    Eigen::Index next = 0;
    for (int v = 0; v < num_vertices; ++v) {
        if (is_removed[v] == 0) {
            result.vertex_order(next++) = v;
        }
    }
    const std::vector<int> last_removed_first(decimator.removed().rbegin(), decimator.removed().rend());
    for (const int v : last_removed_first) {
        result.vertex_order(next++) = v;
    }
    Eigen::VectorXi new_from_old(num_vertices);
    for (int v = 0; v < num_vertices; ++v) {
        new_from_old(result.vertex_order(v)) = v;
    }
    for (MeshLevel& level : result.levels) {
        level.triangles = level.triangles.unaryExpr([&](int v) { return new_from_old(v); }).eval();
    }
    if (mirror.size() != 0) {
        result.mirror = result.vertex_order.unaryExpr([&](int v) { return new_from_old(mirror(v)); });
    }
    return result;
}

} // namespace lineament
