// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/color_scale.hpp" // IWYU pragma: keep

#include "lineament/core/checks.hpp"
#include "lineament/render/draw.hpp"
#include "lineament/render/inline.hpp"
#include "lineament/render/shading.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>

namespace lineament {

LINEAMENT_RENDER_INLINE Color scale_color(double value)
{
    require(std::isfinite(value), "scale_color", "value", "a finite number", to_text(value));
    static constexpr std::array<std::array<double, 3>, 5> stops = {
        {{41, 38, 115}, {33, 107, 153}, {46, 168, 133}, {173, 212, 77}, {252, 232, 92}}};
    const double place = std::clamp(value, 0.0, 1.0) * static_cast<double>(stops.size() - 1);
    const std::size_t low = std::min(static_cast<std::size_t>(place), stops.size() - 2);
    const double part = place - static_cast<double>(low);
    const auto channel = [&](std::size_t c) {
        return static_cast<std::uint8_t>(std::lround((1 - part) * stops[low][c] + part * stops[low + 1][c]));
    };
    return {channel(0), channel(1), channel(2)};
}

LINEAMENT_RENDER_INLINE Eigen::Matrix3Xf scale_colors(const Eigen::VectorXf& values, double largest)
{
    require(std::isfinite(largest) && largest > 0, "scale_colors", "largest", "a finite number > 0", to_text(largest));
    Eigen::Matrix3Xf colors(3, values.size());
    for (Eigen::Index i = 0; i < values.size(); ++i) {
        const Color color = scale_color(values[i] / largest);
        colors.col(i) = Eigen::Vector3f(color.red, color.green, color.blue) / 255.0f;
    }
    return colors;
}

LINEAMENT_RENDER_INLINE ImageU8 draw_color_bar(double largest, const std::string& unit, int width)
{
    require(std::isfinite(largest) && largest > 0, "draw_color_bar", "largest", "a finite number > 0",
            to_text(largest));
    require(width >= 16, "draw_color_bar", "width", ">= 16", std::to_string(width));
    ImageU8 image(width, 42, 3, 255);
    const Color ink = {40, 40, 44};
    const int left = width / 4;
    const int length = width / 2;
    for (int x = 0; x < length; ++x) {
        fill_rectangle(image, left + x, 4, 1, 16, scale_color(static_cast<double>(x) / (length - 1)));
    }
    for (int tick = 0; tick <= 4; ++tick) {
        const int x = left + (length - 1) * tick / 4;
        char text[32];
        std::snprintf(text, sizeof text, "%.3g", largest * tick / 4);
        fill_rectangle(image, x, 20, 1, 4, ink);
        const int begin = x - text_width_px(text) / 2;
        draw_text(image, begin, 27, tick == 4 ? text + (" " + unit) : text, ink);
    }
    return image;
}

LINEAMENT_RENDER_INLINE ImageU8 add_color_bar(const ImageU8& picture, double largest, const std::string& unit)
{
    require_size(picture.channels, 3, "add_color_bar", "picture.channels");
    const ImageU8 bar = draw_color_bar(largest, unit, picture.width);
    ImageU8 both(picture.width, picture.height + bar.height, 3);
    std::copy(picture.data.begin(), picture.data.end(), both.data.begin());
    std::copy(bar.data.begin(), bar.data.end(), both.data.begin() + static_cast<std::ptrdiff_t>(picture.data.size()));
    return both;
}

LINEAMENT_RENDER_INLINE ImageU8 render_values(Mesh mesh, const Eigen::VectorXf& values, double largest,
                                              const Camera& camera, int width, int height)
{
    require_size(values.size(), mesh.vertices.cols(), "render_values", "values");
    ShadingOptions options;
    options.background = {255, 255, 255};
    options.clay = {255, 255, 255};
    options.surface = SurfaceColor::clay;
    const ImageU8 light = render_mesh(mesh, camera, width, height, options);
    mesh.colors = scale_colors(values, largest);
    options.surface = SurfaceColor::automatic;
    options.lighting = Lighting::unlit;
    options.ambient_occlusion = 0;
    ImageU8 picture = render_mesh(mesh, camera, width, height, options);
    for (std::size_t i = 0; i < picture.data.size(); ++i) {
        picture.data[i] = static_cast<std::uint8_t>(std::lround(picture.data[i] * (0.45 + 0.55 * light.data[i] / 255)));
    }
    return picture;
}

} // namespace lineament
