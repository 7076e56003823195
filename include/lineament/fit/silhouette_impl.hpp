// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/contour.hpp"

#include "lineament/fit/contour_support_impl.hpp"
#include "lineament/fit/depth_buffer_impl.hpp"
#include "lineament/fit/inline.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <utility>
#include <vector>

namespace lineament {

LINEAMENT_FIT_INLINE ContourModel::ContourModel(const MorphableModel& model) : num_vertices_(model.num_vertices())
{
    require(!model.levels.empty(), "ContourModel", "model.levels", "at least one level", "none");
    triangles_ = model.levels.back().triangles;
    occluders_ = model.levels.front().triangles;
    num_occluder_vertices_ = model.levels.front().num_vertices;
    left_.candidates = model.contour_left;
    right_.candidates = model.contour_right;
    add_edges(model);
}

LINEAMENT_FIT_INLINE const std::vector<int>& ContourModel::candidates(FaceSide side) const
{
    return side_of(side).candidates;
}

LINEAMENT_FIT_INLINE void ContourModel::add_edges(const MorphableModel& model)
{
    const LandmarkMap* map = model.find_landmark_map("ibug68");
    require(map != nullptr, "ContourModel", "model.landmark_maps", "a map of the scheme ibug68", "none");
    const Eigen::Map<const Eigen::Matrix3Xf> mean(model.shape.mean.data(), 3, model.num_vertices());
    const Eigen::Matrix3Xf points = map->points_on(mean);
    const auto height_of = [&](const char* name) {
        const int index = map->index_of(name);
        return index < 0 ? std::numeric_limits<float>::infinity() : points(1, index);
    };
    const float top_mm = std::max(height_of("1"), height_of("17")) + 15.0f;
    const float mouth_mm = std::min(height_of("49"), height_of("55"));
    const auto is_masked = [&](const char* region, int vertex) {
        const auto mask = model.masks.find(region);
        return mask != model.masks.end() && mask->second[vertex] > 0.5f;
    };
    const auto is_outline = [&](int vertex) {
        const Eigen::Vector3f point = mean.col(vertex);
        return point.y() <= top_mm && (point.y() <= mouth_mm || std::abs(point.x()) > 30.0f) &&
               !is_masked("ears", vertex) && !is_masked("neck", vertex);
    };
    const auto skin = std::find(model.triangle_group_names.begin(), model.triangle_group_names.end(), "skin");
    const int skin_group =
        skin == model.triangle_group_names.end() ? -1 : static_cast<int>(skin - model.triangle_group_names.begin());
    const Eigen::VectorXi& groups = model.levels.back().triangle_groups;

    std::map<std::pair<int, int>, Edge> edges; // both ends, ascending
    for (int t = 0; t < static_cast<int>(triangles_.cols()); ++t) {
        if (skin_group >= 0 && groups.size() > 0 && groups[t] != skin_group) {
            continue;
        }
        for (int corner = 0; corner < 3; ++corner) {
            const auto ends = std::minmax(triangles_(corner, t), triangles_((corner + 1) % 3, t));
            const std::pair<int, int> key(ends.first, ends.second);
            const auto [edge, is_new] = edges.try_emplace(key, Edge{{key.first, key.second}, {t, -1}});
            if (!is_new) {
                edge->second.triangles[1] = t;
            }
        }
    }
    for (const auto& [ends, edge] : edges) {
        if (edge.triangles[1] < 0 || !is_outline(ends.first) || !is_outline(ends.second)) {
            continue;
        }
        for (Side* side : {&left_, &right_}) {
            const float sign = side == &left_ ? 1.0f : -1.0f;
            if (sign * mean(0, ends.first) > 0 && sign * mean(0, ends.second) > 0) {
                side->edges.push_back(edge);
                side->triangles.insert(side->triangles.end(), edge.triangles.begin(), edge.triangles.end());
            }
        }
    }
    for (Side* side : {&left_, &right_}) {
        detail::sort_unique(side->triangles);
        for (const int triangle : side->triangles) {
            for (int corner = 0; corner < 3; ++corner) {
                if (triangles_(corner, triangle) >= num_occluder_vertices_) {
                    side->vertices.push_back(triangles_(corner, triangle));
                }
            }
        }
        detail::sort_unique(side->vertices);
    }
}

LINEAMENT_FIT_INLINE std::vector<int>
ContourModel::silhouette_vertices(const Eigen::Ref<const Eigen::Matrix3Xf>& shape_vertices, const Camera& camera,
                                  FaceSide side_name, double occlusion_depth_mm) const
{
    require_size(shape_vertices.cols(), num_vertices_, "ContourModel::silhouette_vertices", "shape_vertices");
    const Side& side = side_of(side_name);
    // Where each vertex that matters is seen, in mm at the origin's depth, and its depth.
    const Eigen::Matrix3f rotation = camera.camera_from_model.cast<float>();
    const Eigen::Vector2f translation = camera.translation_mm.cast<float>();
    const float phi = static_cast<float>(camera.phi_per_mm);
    Eigen::Matrix3Xf seen(3, num_vertices_);
    const auto see = [&](Eigen::Index vertex) {
        Eigen::Vector3f point = rotation * shape_vertices.col(vertex);
        point.head<2>() = (point.head<2>() + translation) / (1.0f + phi * point.z());
        seen.col(vertex) = point;
    };
    for (Eigen::Index vertex = 0; vertex < num_occluder_vertices_; ++vertex) {
        see(vertex);
    }
    for (const int vertex : side.vertices) {
        see(vertex);
    }
    const auto faces_camera = [&](int triangle) {
        const Eigen::Vector3f a = seen.col(triangles_(0, triangle));
        const Eigen::Vector3f b = seen.col(triangles_(1, triangle));
        const Eigen::Vector3f c = seen.col(triangles_(2, triangle));
        return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x()) < 0; // y points down
    };
    std::vector<char> is_facing(triangles_.cols());
    for (const int triangle : side.triangles) {
        is_facing[triangle] = faces_camera(triangle);
    }
    std::vector<int> vertices;
    for (const Edge& edge : side.edges) {
        if (is_facing[edge.triangles[0]] != is_facing[edge.triangles[1]]) {
            vertices.insert(vertices.end(), edge.vertices.begin(), edge.vertices.end());
        }
    }
    detail::sort_unique(vertices);
    if (vertices.empty()) {
        return vertices;
    }
    float farthest = -std::numeric_limits<float>::infinity();
    for (const int vertex : vertices) {
        farthest = std::max(farthest, seen(2, vertex));
    }
    const float depth_mm = static_cast<float>(occlusion_depth_mm);
    const detail::DepthBuffer buffer(seen, occluders_, num_occluder_vertices_, vertices, farthest - depth_mm, 2.0f);
    std::erase_if(vertices, [&](int vertex) {
        return buffer.depth_at(seen(0, vertex), seen(1, vertex)) < seen(2, vertex) - depth_mm;
    });
    return vertices;
}

} // namespace lineament
