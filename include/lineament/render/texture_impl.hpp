// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/texture.hpp" // IWYU pragma: keep

#include "lineament/core/image.hpp"
#include "lineament/render/background.hpp"
#include "lineament/render/inline.hpp"
#include "lineament/render/rasterizer_support_impl.hpp"
#include "lineament/render/texture_layout.hpp"
#include "lineament/render/visibility.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <vector>

namespace lineament {

namespace detail {

/// Half the size by averaging 2 x 2 pixels (border repeated), so that point x of the picture is x / 2 of the result.
inline ImageU8 halved(const ImageU8& picture)
{
    ImageU8 half((picture.width + 1) / 2, (picture.height + 1) / 2, picture.channels);
    for (int row = 0; row < half.height; ++row) {
        const int next_row = std::min(2 * row + 1, picture.height - 1);
        for (int column = 0; column < half.width; ++column) {
            const int next_column = std::min(2 * column + 1, picture.width - 1);
            for (int channel = 0; channel < picture.channels; ++channel) {
                const int sum = picture.at(2 * column, 2 * row, channel) + picture.at(next_column, 2 * row, channel) +
                                picture.at(2 * column, next_row, channel) + picture.at(next_column, next_row, channel);
                half.at(column, row, channel) = static_cast<std::uint8_t>((sum + 2) / 4);
            }
        }
    }
    return half;
}

/// The part of a picture in which a mesh is seen, as a camera of its own: x_part = zoom (x - origin).
struct PictureWindow
{
    Eigen::Vector2d origin = Eigen::Vector2d::Zero();
    double zoom = 1.0;
    int width = 0;
    int height = 0;

    [[nodiscard]] Camera camera(const Camera& of_picture) const
    {
        Camera part = of_picture;
        part.scale_px_per_mm *= zoom;
        part.principal_point_px = zoom * (of_picture.principal_point_px - origin);
        return part;
    }
};

/// The window around the vertices, no longer than 1024 px: the depth test needs no finer image.
inline PictureWindow window_around(const Eigen::Matrix3Xf& vertices, const Camera& camera, int width, int height)
{
    constexpr double longest_px = 1024.0;
    const Bounds bounds = bounds_in_picture(vertices, camera);
    PictureWindow window;
    constexpr double border_px = 2.0; // so that the outline lies inside
    window.origin = (bounds.low.array() - border_px).max(0.0).floor();
    const Eigen::Vector2d end = (bounds.high.array() + border_px).min(Eigen::Array2d(width, height));
    const Eigen::Vector2d extent = end - window.origin;
    if (!(extent.minCoeff() > 0)) {
        return window; // nothing of the mesh lies in the picture
    }
    window.zoom = std::min(1.0, longest_px / extent.maxCoeff());
    window.width = static_cast<int>(std::ceil(window.zoom * extent.x()));
    window.height = static_cast<int>(std::ceil(window.zoom * extent.y()));
    return window;
}

/// 1 for pixels within a radius of the mesh's outline, or of a step in depth steeper than a face turned away by 85 deg.
inline Image<std::uint8_t> outline_mask(const ImageF& depth, double mm_per_px, double radius_px)
{
    Image<std::uint8_t> mask(depth.width, depth.height, 1);
    if (!(radius_px > 0)) {
        return mask;
    }
    const auto largest_step = static_cast<float>(std::max(6.0, 11.4 * mm_per_px));
    std::vector<int> half_widths; // of the disc, by the distance from its middle row
    for (int j = 0; j <= radius_px; ++j) {
        int half = 0;
        while ((half + 1) * (half + 1) + j * j <= radius_px * radius_px) {
            ++half;
        }
        half_widths.push_back(half);
    }
    const int reach = static_cast<int>(half_widths.size()) - 1;
    const auto mark_around = [&](int column, int row) {
        for (int j = std::max(0, row - reach); j <= std::min(depth.height - 1, row + reach); ++j) {
            const int half = half_widths[std::abs(j - row)];
            const int first = std::max(0, column - half);
            std::fill_n(mask.pixel(first, j), std::min(depth.width - 1, column + half) - first + 1, std::uint8_t{1});
        }
    };
    const auto is_step = [&](float a, float b) { // inf - inf is not a number, and no step
        return std::abs(a - b) > largest_step;
    };
    for (int row = 0; row < depth.height; ++row) {
        for (int column = 0; column < depth.width; ++column) {
            const float here = depth.at(column, row);
            const bool is_step_right = column + 1 < depth.width && is_step(here, depth.at(column + 1, row));
            const bool is_step_down = row + 1 < depth.height && is_step(here, depth.at(column, row + 1));
            if (is_step_right || is_step_down) {
                mark_around(column, row);
            }
            if (is_step_right) {
                mark_around(column + 1, row);
            }
            if (is_step_down) {
                mark_around(column, row + 1);
            }
        }
    }
    return mask;
}

} // namespace detail

LINEAMENT_RENDER_INLINE void TextureOptions::check() const
{
    const char* const function = "TextureOptions";
    require(depth_tolerance_mm >= 0, function, "depth_tolerance_mm", "a number >= 0", to_text(depth_tolerance_mm));
    require(outline_margin_mm >= 0 && outline_margin_mm <= 20, function, "outline_margin_mm", "a number in [0, 20]",
            to_text(outline_margin_mm));
    require(vertex_trust.size() == 0 || (vertex_trust.minCoeff() >= 0 && vertex_trust.maxCoeff() <= 1), function,
            "vertex_trust", "numbers in [0, 1]", "others");
    require(vertex_skin.size() == 0 || (vertex_skin.minCoeff() >= 0 && vertex_skin.maxCoeff() <= 1), function,
            "vertex_skin", "numbers in [0, 1]", "others");
}

LINEAMENT_RENDER_INLINE TextureMap extract_texture(const TextureLayout& layout, const Eigen::Matrix3Xf& vertices,
                                                   const Eigen::Matrix3Xi& triangles, const Camera& camera,
                                                   const ImageU8& picture, const TextureOptions& options)
{
    const char* const function = "extract_texture";
    options.check();
    detail::require_scene(vertices, triangles, camera, picture.width, picture.height, function);
    require_size(triangles.cols(), layout.num_triangles(), function, "triangles");
    const Eigen::VectorXf& trust = options.vertex_trust;
    require(trust.size() == 0 || trust.size() == vertices.cols(), function, "options.vertex_trust",
            "empty, or " + std::to_string(vertices.cols()) + " numbers", std::to_string(trust.size()));
    const Eigen::VectorXf& skin = options.vertex_skin;
    require(skin.size() == 0 || skin.size() == vertices.cols(), function, "options.vertex_skin",
            "empty, or " + std::to_string(vertices.cols()) + " numbers", std::to_string(skin.size()));
    require(picture.empty() || picture.channels == 1 || picture.channels == 3 || picture.channels == 4, function,
            "picture", "1, 3 or 4 channels", std::to_string(picture.channels));

    const int size = layout.size();
    TextureMap map{ImageU8(size, size, 3), ImageF(size, size, 1),
                   Image<std::uint8_t>(size, size, 1, static_cast<std::uint8_t>(Visibility::unmapped))};

    const detail::PictureWindow window = detail::window_around(vertices, camera, picture.width, picture.height);
    const Camera window_camera = window.camera(camera);
    const DepthTest depth_test(vertices, triangles, window_camera, window.width, window.height,
                               {.depth_tolerance_mm = options.depth_tolerance_mm});

    Eigen::Matrix3Xd points(3, vertices.cols()); // in camera space
    for (Eigen::Index v = 0; v < vertices.cols(); ++v) {
        points.col(v) = camera.in_camera(vertices.col(v).cast<double>());
    }
    const Eigen::Matrix3Xd normals =
        camera.camera_from_model * compute_vertex_normals(vertices, triangles).cast<double>();

    // Pixels per texel under s alone.
    Eigen::VectorXd densities = Eigen::VectorXd::Zero(triangles.cols());
    double pixel_area = 0.0;
    const double scale2 = camera.scale_px_per_mm * camera.scale_px_per_mm;
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        const Eigen::Vector3d a = points.col(triangles(0, t));
        const double area_mm2 = 0.5 * (points.col(triangles(1, t)) - a).cross(points.col(triangles(2, t)) - a).norm();
        if (layout.texel_areas()[t] > 0) {
            densities[t] = scale2 * area_mm2 / layout.texel_areas()[t];
            pixel_area += scale2 * area_mm2;
        }
    }

    ImageU8 reduced;
    const ImageU8* source = &picture;
    double reduction = 1.0;
    constexpr double finest_density = 4.0;
    for (double density = pixel_area / std::max(1.0, static_cast<double>(layout.texel_areas().sum()));
         density > finest_density && source->width > 1 && source->height > 1; density /= 4.0) {
        reduced = detail::halved(*source);
        source = &reduced;
        reduction *= 0.5;
    }
    const double mm_per_px = 1.0 / window_camera.scale_px_per_mm;
    const double interpolated_px = 1.5 * window.zoom / reduction;
    const double outline_margin_px =
        options.outline_margin_mm > 0 ? std::max(options.outline_margin_mm / mm_per_px, interpolated_px) : 0.0;
    const Image<std::uint8_t> outline = detail::outline_mask(depth_test.depth(), mm_per_px, outline_margin_px);

    std::optional<ForegroundTest> foreground;
    if (skin.size() > 0) {
        foreground.emplace(vertices, triangles, camera, picture);
    }

    for (const Texel& texel : layout.texels()) {
        const int a = triangles(0, texel.triangle);
        const int b = triangles(1, texel.triangle);
        const int c = triangles(2, texel.triangle);
        const double weight_b = texel.weight_b;
        const double weight_c = texel.weight_c;
        const double weight_a = 1.0 - weight_b - weight_c;
        const Eigen::Vector3d point = weight_a * points.col(a) + weight_b * points.col(b) + weight_c * points.col(c);
        const Eigen::Vector3d normal =
            (weight_a * normals.col(a) + weight_b * normals.col(b) + weight_c * normals.col(c)).normalized();
        Visibility visibility = depth_test(point, normal);
        const double range = 1.0 + camera.phi_per_mm * point.z();
        const Eigen::Vector2d picture_point_px =
            camera.principal_point_px + (camera.scale_px_per_mm / range) * point.head<2>();
        if (visibility == Visibility::visible && // the window may reach a fraction of its pixel beyond the picture
            !(picture_point_px.x() < picture.width && picture_point_px.y() < picture.height)) {
            visibility = Visibility::outside_image;
        }
        map.visibility.data[texel.index] = static_cast<std::uint8_t>(visibility);
        if (visibility != Visibility::visible) {
            continue;
        }
        const Eigen::Vector2d window_point_px = window.zoom * (picture_point_px - window.origin);
        const bool is_near_outline =
            outline.at(std::clamp(static_cast<int>(window_point_px.x()), 0, outline.width - 1),
                       std::clamp(static_cast<int>(window_point_px.y()), 0, outline.height - 1)) != 0;
        const Eigen::Vector2d point_px = reduction * picture_point_px;
        const BilinearSample seen(*source, static_cast<float>(point_px.x()), static_cast<float>(point_px.y()));
        for (int channel = 0; channel < 3; ++channel) {
            const float value = seen(source->channels == 1 ? 0 : channel);
            map.color.data[3 * static_cast<std::size_t>(texel.index) + channel] =
                static_cast<std::uint8_t>(value + 0.5f); // value >= 0
        }
        const double facing = -normal.dot(view_ray(camera, point).normalized());
        const double density = densities[texel.triangle] / (range * range);
        const auto at_texel = [&](const Eigen::VectorXf& values, double otherwise) {
            return values.size() > 0 ? weight_a * values[a] + weight_b * values[b] + weight_c * values[c] : otherwise;
        };
        double trusted = at_texel(trust, 1.0);
        if (foreground && at_texel(skin, 0.0) > 0.5) {
            const double probability = (*foreground)(picture_point_px);
            trusted *= std::max(0.0, 2.0 * probability - 1.0);
        }
        map.weight.data[texel.index] =
            is_near_outline ? 0.0f : static_cast<float>(trusted * facing * std::min(1.0, density));
    }
    return map;
}

LINEAMENT_RENDER_INLINE ImageU8 mark_holes(const TextureMap& map, HoleMark mark)
{
    const bool is_checkered = mark == HoleMark::checkered;
    ImageU8 marked(map.color.width, map.color.height, is_checkered ? 3 : 4);
    const int field = std::max(2, map.color.width / 64);
    for (int row = 0; row < marked.height; ++row) {
        for (int column = 0; column < marked.width; ++column) {
            const bool is_hole = !(map.weight.at(column, row) > 0);
            const std::uint8_t checker = (column / field + row / field) % 2 == 0 ? 208 : 184;
            for (int channel = 0; channel < 3; ++channel) {
                marked.at(column, row, channel) =
                    is_hole ? (is_checkered ? checker : std::uint8_t{0}) : map.color.at(column, row, channel);
            }
            if (!is_checkered) {
                marked.at(column, row, 3) = is_hole ? 0 : 255;
            }
        }
    }
    return marked;
}

} // namespace lineament
