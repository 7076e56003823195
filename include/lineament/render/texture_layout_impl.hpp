// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/texture_layout.hpp" // IWYU pragma: keep

#include "lineament/core/image.hpp"
#include "lineament/core/mesh.hpp"
#include "lineament/render/checks.hpp"
#include "lineament/render/draw.hpp"
#include "lineament/render/inline.hpp"
#include "lineament/render/triangle_coverage.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <string>
#include <vector>

namespace lineament {

LINEAMENT_RENDER_INLINE TextureLayout::TextureLayout(const Mesh& mesh, int size,
                                                     const std::vector<std::string>& excluded_groups)
    : size_(size)
{
    const char* const function = "TextureLayout";
    constexpr int max_size = 8192;
    require(size >= 1 && size <= max_size, function, "size", "1 to " + std::to_string(max_size), std::to_string(size));
    require(mesh.uv_triangles.cols() > 0, function, "mesh.uv_triangles", "at least one triangle", "none");
    require_finite(mesh.uv_coordinates, function, "mesh.uv_coordinates");
    require_triangles(mesh.uv_triangles, mesh.uv_coordinates.cols(), function, "mesh.uv_triangles");
    const Eigen::Index num_triangles = mesh.uv_triangles.cols();
    const bool has_groups = mesh.triangle_groups.size() > 0 && !excluded_groups.empty();
    if (has_groups) {
        require_size(mesh.triangle_groups.size(), num_triangles, function, "mesh.triangle_groups");
    }
    const auto is_excluded = [&](Eigen::Index triangle) {
        if (!has_groups) {
            return false;
        }
        const int group = mesh.triangle_groups[triangle];
        return group >= 0 && group < static_cast<int>(mesh.group_names.size()) &&
               std::find(excluded_groups.begin(), excluded_groups.end(), mesh.group_names[group]) !=
                   excluded_groups.end();
    };

    texel_areas_ = Eigen::VectorXf::Zero(num_triangles);
    std::vector<bool> is_taken(static_cast<std::size_t>(size) * size, false);
    for (Eigen::Index t = 0; t < num_triangles; ++t) {
        Eigen::Vector2d corners[3];
        bool is_drawable = !is_excluded(t);
        for (int i = 0; i < 3; ++i) {
            corners[i] = size * mesh.uv_coordinates.col(mesh.uv_triangles(i, t)).cast<double>();
            is_drawable = is_drawable && GridPoint::holds(corners[i]);
        }
        if (!is_drawable) {
            continue;
        }
        const Eigen::Vector2d ab = corners[1] - corners[0];
        const Eigen::Vector2d ac = corners[2] - corners[0];
        texel_areas_[t] = static_cast<float>(0.5 * std::abs(ab.x() * ac.y() - ab.y() * ac.x()));
        for_each_covered_pixel(GridPoint::nearest(corners[0]), GridPoint::nearest(corners[1]),
                               GridPoint::nearest(corners[2]), size, size,
                               [&](int column, int row, double weight_b, double weight_c) {
                                   const int index = row * size + column;
                                   if (!is_taken[index]) {
                                       is_taken[index] = true;
                                       texels_.push_back({index, static_cast<int>(t), static_cast<float>(weight_b),
                                                          static_cast<float>(weight_c)});
                                   }
                               });
    }
}

LINEAMENT_RENDER_INLINE ImageU8 draw_uv_layout(const Eigen::Ref<const Eigen::Matrix2Xf>& uv_coordinates,
                                               const Eigen::Ref<const Eigen::Matrix3Xi>& uv_triangles, int size)
{
    require(size >= 1, "draw_uv_layout", "size", "at least 1", std::to_string(size));
    if (uv_triangles.size() > 0) {
        const int least = uv_triangles.minCoeff(), largest = uv_triangles.maxCoeff();
        require(least >= 0 && largest < uv_coordinates.cols(), "draw_uv_layout", "uv_triangles",
                "indices below " + std::to_string(uv_coordinates.cols()),
                std::to_string(least) + " to " + std::to_string(largest));
    }
    const Color ink = {40, 70, 120};
    ImageU8 picture(size, size, 3, 255);
    for (Eigen::Index t = 0; t < uv_triangles.cols(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            const int from = uv_triangles(corner, t), to = uv_triangles((corner + 1) % 3, t);
            draw_line(picture, uv_coordinates.col(from).cast<double>() * size,
                      uv_coordinates.col(to).cast<double>() * size, ink, 1.0);
        }
    }
    return picture;
}

} // namespace lineament
