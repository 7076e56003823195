// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/inline.hpp"
#include "lineament/render/rasterizer_support_impl.hpp"
#include "lineament/render/shading.hpp" // IWYU pragma: keep
#include "lineament/render/visibility.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

namespace lineament {

LINEAMENT_RENDER_INLINE void ShadingOptions::check() const
{
    const char* const function = "ShadingOptions";
    require(std::isfinite(wire_width_px) && wire_width_px > 0, function, "wire_width_px", "a finite number > 0",
            to_text(wire_width_px));
    require(opacity >= 0 && opacity <= 1, function, "opacity", "a number in [0, 1]", to_text(opacity));
    require(ambient_occlusion >= 0 && ambient_occlusion <= 1, function, "ambient_occlusion", "a number in [0, 1]",
            to_text(ambient_occlusion));
    require(std::isfinite(occlusion_radius_mm) && occlusion_radius_mm > 0, function, "occlusion_radius_mm",
            "a finite number > 0", to_text(occlusion_radius_mm));
    require(supersampling >= 1 && supersampling <= 8, function, "supersampling", "1 to 8",
            std::to_string(supersampling));
}

namespace detail {

inline float to_power_28(float x)
{
    const float x4 = x * x * x * x;
    const float x8 = x4 * x4;
    return x8 * x8 * x8 * x4;
}

/// Light that reaches the eye from a matt, faintly glossy surface in a small studio, in camera space (x right, y down,
/// z forward): a warm key light from the upper left, a cool fill from the right, a rim light from behind, and a sky
/// brighter than the floor. The diffuse terms are wrapped around the terminator, as large lamps do.
class StudioLights
{
public:
    /// @param albedo    linear RGB.
    /// @param normal    unit, towards the eye.
    /// @param to_eye    unit.
    /// @param openness  1: nothing near hides the sky; 0: all hidden.
    [[nodiscard]] Eigen::Vector3f shade(const Eigen::Vector3f& albedo, const Eigen::Vector3f& normal,
                                        const Eigen::Vector3f& to_eye, float openness) const
    {
        const float up = 0.5f - 0.5f * normal.y();
        Eigen::Vector3f diffuse = openness * (up * sky_ + (1.0f - up) * floor_);
        Eigen::Vector3f gloss = Eigen::Vector3f::Zero();
        const float hidden = 0.45f + 0.55f * openness; // lamps are hidden less than the sky
        for (const Lamp& lamp : lamps_) {
            const float cosine = (normal.dot(lamp.direction) + lamp.wrap) / (1.0f + lamp.wrap);
            if (cosine <= 0) {
                continue;
            }
            diffuse += hidden * cosine * lamp.light;
            const float half = normal.dot((lamp.direction + to_eye).normalized());
            if (half > 0) {
                gloss += hidden * lamp.gloss * to_power_28(half) * lamp.light;
            }
        }
        const float facing = std::clamp(normal.dot(to_eye), 0.0f, 1.0f);
        const float edge = (1.0f - facing) * (1.0f - facing) * (1.0f - facing);
        return albedo.cwiseProduct(diffuse) + 0.07f * gloss + (0.10f * edge * openness * up) * sky_;
    }

private:
    struct Lamp
    {
        Eigen::Vector3f direction; // towards the lamp, unit
        Eigen::Vector3f light;
        float wrap;
        float gloss;
    };
    std::array<Lamp, 3> lamps_ = {
        Lamp{Eigen::Vector3f(-0.55f, -0.60f, -0.75f).normalized(), {0.88f, 0.83f, 0.76f}, 0.12f, 1.0f},
        Lamp{Eigen::Vector3f(0.85f, -0.05f, -0.50f).normalized(), {0.11f, 0.135f, 0.17f}, 0.30f, 0.6f},
        Lamp{Eigen::Vector3f(0.60f, -0.45f, 0.65f).normalized(), {0.34f, 0.36f, 0.40f}, 0.0f, 0.5f}};
    Eigen::Vector3f sky_ = {0.19f, 0.20f, 0.215f};
    Eigen::Vector3f floor_ = {0.085f, 0.075f, 0.066f};
};

/// 1 where the sky over a surface point is open, less in creases: the mean over a ring of pixels of how far their
/// depth stands above the tangent plane, fading with distance.
/// @par Reference  After McGuire et al., The Alchemy Screen-Space Ambient Obscurance Algorithm, HPG 2011.
inline float screen_space_openness(const ImageF& depth, int column, int row, const Eigen::Vector3f& normal,
                                   float mm_per_px, float radius_mm)
{
    constexpr int num_directions = 10;
    constexpr int num_rings = 2;
    static const std::array<Eigen::Vector2f, num_directions* num_rings> directions = [] {
        std::array<Eigen::Vector2f, num_directions * num_rings> values;
        for (int i = 0; i < num_directions * num_rings; ++i) { // the second ring is turned by half a step
            const float step = static_cast<float>(i) + (i < num_directions ? 0.5f : 1.0f);
            const float angle = 2.0f * std::numbers::pi_v<float> * step / num_directions;
            values[i] = Eigen::Vector2f(std::cos(angle), std::sin(angle));
        }
        return values;
    }();
    const float center = depth.at(column, row);
    float hidden = 0.0f;
    for (int ring = 1; ring <= num_rings; ++ring) {
        const float reach_px = std::clamp(radius_mm * static_cast<float>(ring) / (num_rings * mm_per_px), 1.0f, 400.0f);
        for (int i = 0; i < num_directions; ++i) {
            const Eigen::Vector2f& direction = directions[num_directions * (ring - 1) + i];
            const int other_column = static_cast<int>(static_cast<float>(column) + 0.5f + reach_px * direction.x());
            const int other_row = static_cast<int>(static_cast<float>(row) + 0.5f + reach_px * direction.y());
            if (!depth.contains(other_column, other_row) || depth.at(other_column, other_row) == empty_depth) {
                continue;
            }
            const Eigen::Vector3f offset(static_cast<float>(other_column - column) * mm_per_px,
                                         static_cast<float>(other_row - row) * mm_per_px,
                                         depth.at(other_column, other_row) - center);
            const float height = offset.dot(normal) - 0.02f * radius_mm;
            if (height > 0) {
                hidden += height * radius_mm / (offset.squaredNorm() + 0.1f * radius_mm * radius_mm);
            }
        }
    }
    return std::clamp(1.0f - 2.2f * hidden / (num_directions * num_rings), 0.0f, 1.0f);
}

/// How much of a pixel the nearest edge of its triangle covers, for lines of a given width.
inline float wire_coverage(const std::array<Eigen::Vector2f, 3>& corners, const Eigen::Vector2f& center, float width)
{
    float nearest = std::numeric_limits<float>::infinity();
    for (int i = 0; i < 3; ++i) {
        const Eigen::Vector2f along = corners[(i + 1) % 3] - corners[i];
        const Eigen::Vector2f offset = center - corners[i];
        const float length = along.norm();
        if (length > 0) {
            nearest = std::min(nearest, std::abs(along.x() * offset.y() - along.y() * offset.x()) / length);
        }
    }
    return std::clamp(0.5f * width + 0.5f - nearest, 0.0f, 1.0f); // each side of an edge draws half of its line
}

inline Eigen::Vector4f premultiplied(const Eigen::Vector3f& light, float alpha)
{
    return {alpha * light.x(), alpha * light.y(), alpha * light.z(), alpha};
}

/// Linear, premultiplied RGBA of a texture (RGB or RGBA) at a point in texels, bilinear with the border repeated.
inline Eigen::Vector4f sample_texture(const ImageU8& texture, float x, float y)
{
    const float u = std::clamp(x - 0.5f, 0.0f, static_cast<float>(texture.width - 1));
    const float v = std::clamp(y - 0.5f, 0.0f, static_cast<float>(texture.height - 1));
    const int column = static_cast<int>(u);
    const int row = static_cast<int>(v);
    const float right = u - static_cast<float>(column);
    const float below = v - static_cast<float>(row);
    const std::array<float, 256>& linear = linear_from_srgb_table();
    const std::uint8_t* const corner = texture.pixel(column, row);
    const std::ptrdiff_t to_right = column + 1 < texture.width ? texture.channels : 0;
    const std::ptrdiff_t to_below = row + 1 < texture.height ? std::ptrdiff_t{texture.width} * texture.channels : 0;
    Eigen::Vector4f sum = Eigen::Vector4f::Zero();
    for (int j = 0; j < 2; ++j) {
        for (int i = 0; i < 2; ++i) {
            const std::uint8_t* const texel = corner + (i == 0 ? 0 : to_right) + (j == 0 ? 0 : to_below);
            const float share = (i == 0 ? 1.0f - right : right) * (j == 0 ? 1.0f - below : below);
            const float alpha = texture.channels == 4 ? static_cast<float>(texel[3]) / 255.0f : 1.0f;
            sum += share * premultiplied({linear[texel[0]], linear[texel[1]], linear[texel[2]]}, alpha);
        }
    }
    return sum;
}

/// Linear, premultiplied RGBA of a mesh at output resolution (4 channels).
class MeshPainter
{
public:
    MeshPainter(const Mesh& mesh, const ImageU8* texture, const Camera& camera, int width, int height,
                const ShadingOptions& options, const char* function)
        : mesh_(mesh), texture_(options.surface == SurfaceColor::clay ? nullptr : texture), options_(options),
          camera_(camera), width_(width), height_(height), clay_(linear_rgb(options.clay))
    {
        options.check();
        require_scene(mesh.vertices, mesh.triangles, camera, width, height, function);
        require_image_size(width * options.supersampling, height * options.supersampling, function);
        has_colors_ = mesh.colors.cols() > 0 && options.surface == SurfaceColor::automatic && texture_ == nullptr;
        if (has_colors_) {
            require_size(mesh.colors.cols(), mesh.vertices.cols(), function, "mesh.colors");
            require_finite(mesh.colors, function, "mesh.colors");
            linear_colors_ =
                mesh.colors.unaryExpr([](float value) { return linear_from_srgb(std::clamp(value, 0.0f, 1.0f)); });
        }
        if (texture_ != nullptr) {
            require(!texture_->empty() && (texture_->channels == 3 || texture_->channels == 4), function, "texture",
                    "an RGB or RGBA image",
                    std::to_string(texture_->channels) + " channels, " + std::to_string(texture_->width) + " x " +
                        std::to_string(texture_->height));
            require_size(mesh.uv_triangles.cols(), mesh.triangles.cols(), function, "mesh.uv_triangles");
            require_finite(mesh.uv_coordinates, function, "mesh.uv_coordinates");
            require_triangles(mesh.uv_triangles, mesh.uv_coordinates.cols(), function, "mesh.uv_triangles");
        }
        is_lit_ =
            options.lighting == Lighting::studio || (options.lighting == Lighting::automatic && texture_ == nullptr);
        normals_ = camera.camera_from_model.cast<float>() * compute_vertex_normals(mesh.vertices, mesh.triangles);
    }

    [[nodiscard]] ImageF paint() const
    {
        ImageF result(width_, height_, 4);
        // In bands that fit into the cache; creases are looked for in the depth all around.
        const bool looks_around = is_lit_ && options_.ambient_occlusion > 0;
        const int band_height = looks_around ? height_ : std::max(1, 128 / options_.supersampling);
        for (int top = 0; top < height_; top += band_height) {
            paint_rows(top, std::min(top + band_height, height_), result);
        }
        return result;
    }

private:
    void paint_rows(int top, int bottom, ImageF& result) const
    {
        const int samples = options_.supersampling;
        Camera fine = camera_;
        fine.scale_px_per_mm *= samples;
        fine.principal_point_px = samples * (camera_.principal_point_px - Eigen::Vector2d(0, top));
        const Raster raster = rasterize(mesh_.vertices, mesh_.triangles, fine, width_ * samples,
                                        (bottom - top) * samples, {.culling = options_.culling});
        const std::vector<Eigen::Vector2f> corners =
            options_.mode == DrawMode::surface ? std::vector<Eigen::Vector2f>{} : project_corners(fine);

        const float share = 1.0f / static_cast<float>(samples * samples);
        for (int row = 0; row < bottom - top; ++row) {
            for (int column = 0; column < width_; ++column) {
                Eigen::Map<Eigen::Vector4f> sum(result.pixel(column, top + row));
                float openness = -1.0f; // once a pixel
                for (int j = row * samples; j < (row + 1) * samples; ++j) {
                    for (int i = column * samples; i < (column + 1) * samples; ++i) {
                        if (raster.triangle.at(i, j) >= 0) {
                            sum += share * paint_sample(raster, fine, i, j, corners, openness);
                        }
                    }
                }
            }
        }
    }

    [[nodiscard]] std::vector<Eigen::Vector2f> project_corners(const Camera& fine) const
    {
        std::vector<Eigen::Vector2f> corners(static_cast<std::size_t>(mesh_.vertices.cols()));
        for (Eigen::Index v = 0; v < mesh_.vertices.cols(); ++v) {
            corners[v] = fine.project(Eigen::Vector3d(mesh_.vertices.col(v).cast<double>())).cast<float>();
        }
        return corners;
    }

    [[nodiscard]] Eigen::Vector4f paint_sample(const Raster& raster, const Camera& fine, int column, int row,
                                               const std::vector<Eigen::Vector2f>& corners, float& openness) const
    {
        const int triangle = raster.triangle.at(column, row);
        const Eigen::Vector3f weights = Eigen::Map<const Eigen::Vector3f>(raster.barycentric.pixel(column, row));
        Eigen::Vector4f sample = Eigen::Vector4f::Zero();
        if (options_.mode != DrawMode::wireframe) {
            Eigen::Vector3f light = surface_color(triangle, weights);
            if (is_lit_) {
                light = lit(light, triangle, weights, raster.depth, fine, column, row, openness);
            }
            sample = premultiplied(light, static_cast<float>(options_.opacity));
        }
        if (options_.mode != DrawMode::surface) {
            const std::array<Eigen::Vector2f, 3> ends = {corners[mesh_.triangles(0, triangle)],
                                                         corners[mesh_.triangles(1, triangle)],
                                                         corners[mesh_.triangles(2, triangle)]};
            const Eigen::Vector2f center(static_cast<float>(column) + 0.5f, static_cast<float>(row) + 0.5f);
            const float alpha =
                wire_coverage(ends, center, static_cast<float>(options_.wire_width_px * options_.supersampling)) *
                static_cast<float>(options_.wire.alpha) / 255.0f;
            sample = premultiplied(linear_rgb(options_.wire), alpha) + (1.0f - alpha) * sample;
        }
        return sample;
    }

    [[nodiscard]] Eigen::Vector3f surface_color(int triangle, const Eigen::Vector3f& weights) const
    {
        if (texture_ != nullptr) {
            const auto uv = [&](int corner) { return mesh_.uv_coordinates.col(mesh_.uv_triangles(corner, triangle)); };
            const Eigen::Vector2f at = weights[0] * uv(0) + weights[1] * uv(1) + weights[2] * uv(2);
            const float x = at.x() * static_cast<float>(texture_->width);
            const float y = at.y() * static_cast<float>(texture_->height);
            const Eigen::Vector4f seen = sample_texture(*texture_, x, y);
            return seen.head<3>() + (1.0f - seen[3]) * clay_;
        }
        if (has_colors_) {
            return weights[0] * linear_colors_.col(mesh_.triangles(0, triangle)) +
                   weights[1] * linear_colors_.col(mesh_.triangles(1, triangle)) +
                   weights[2] * linear_colors_.col(mesh_.triangles(2, triangle));
        }
        return clay_;
    }

    [[nodiscard]] Eigen::Vector3f lit(const Eigen::Vector3f& albedo, int triangle, const Eigen::Vector3f& weights,
                                      const ImageF& depth, const Camera& fine, int column, int row,
                                      float& openness) const
    {
        Eigen::Vector3f normal = (weights[0] * normals_.col(mesh_.triangles(0, triangle)) +
                                  weights[1] * normals_.col(mesh_.triangles(1, triangle)) +
                                  weights[2] * normals_.col(mesh_.triangles(2, triangle)));
        const float length = normal.norm();
        const float z = depth.at(column, row);
        const auto range = static_cast<float>(1.0 + fine.phi_per_mm * z);
        const float mm_per_px = range / static_cast<float>(fine.scale_px_per_mm);
        const Eigen::Vector3d point((column + 0.5 - fine.principal_point_px.x()) * mm_per_px,
                                    (row + 0.5 - fine.principal_point_px.y()) * mm_per_px, z);
        const Eigen::Vector3f to_eye = -view_ray(fine, point).normalized().cast<float>();
        normal = length > 0 ? Eigen::Vector3f(normal / length) : to_eye;
        const bool is_back = normal.dot(to_eye) < 0 && is_back_facing(triangle, fine);
        if (is_back) {
            normal = -normal;
        }
        if (openness < 0) {
            openness = 1.0f;
            if (options_.ambient_occlusion > 0) {
                const float strength = static_cast<float>(options_.ambient_occlusion);
                openness = 1.0f - strength +
                           strength * screen_space_openness(depth, column, row, normal, mm_per_px,
                                                            static_cast<float>(options_.occlusion_radius_mm));
            }
        }
        return (is_back ? 0.5f : 1.0f) * lights_.shade(albedo, normal, to_eye, openness);
    }

    [[nodiscard]] bool is_back_facing(int triangle, const Camera& camera) const
    {
        const auto corner = [&](int i) {
            return camera.in_camera(mesh_.vertices.col(mesh_.triangles(i, triangle)).cast<double>());
        };
        const Eigen::Vector3d a = corner(0);
        return (corner(1) - a).cross(corner(2) - a).dot(view_ray(camera, a)) > 0;
    }

    const Mesh& mesh_;
    const ImageU8* texture_;
    const ShadingOptions& options_;
    Camera camera_;
    int width_;
    int height_;
    bool has_colors_ = false;
    bool is_lit_ = true;
    Eigen::Vector3f clay_; // linear
    Eigen::Matrix3Xf linear_colors_ = {};
    Eigen::Matrix3Xf normals_ = {}; // in camera space
    StudioLights lights_ = {};
};

/// Linear premultiplied RGBA over a background given per pixel, as 8-bit sRGB.
template <typename BackgroundAt>
ImageU8 compose(const ImageF& painted, BackgroundAt&& background_at)
{
    ImageU8 result(painted.width, painted.height, 3);
    for (int row = 0; row < painted.height; ++row) {
        for (int column = 0; column < painted.width; ++column) {
            const Eigen::Map<const Eigen::Vector4f> above(painted.pixel(column, row));
            const Eigen::Vector3f sum = above.head<3>() + (1.0f - above[3]) * background_at(column, row);
            for (int channel = 0; channel < 3; ++channel) {
                result.at(column, row, channel) = srgb_u8_from_linear(sum[channel]);
            }
        }
    }
    return result;
}

inline ImageU8 transparent(const ImageF& painted)
{
    ImageU8 result(painted.width, painted.height, 4);
    for (std::size_t i = 0; i < painted.data.size(); i += 4) {
        const float alpha = painted.data[i + 3];
        for (std::size_t channel = 0; channel < 3 && alpha > 0; ++channel) {
            result.data[i + channel] = srgb_u8_from_linear(painted.data[i + channel] / alpha);
        }
        result.data[i + 3] = to_u8(alpha);
    }
    return result;
}

inline ImageU8 render_mesh(const Mesh& mesh, const ImageU8* texture, const Camera& camera, int width, int height,
                           const ShadingOptions& options)
{
    const ImageF painted = MeshPainter(mesh, texture, camera, width, height, options, "render_mesh").paint();
    if (options.background_mode == BackgroundMode::transparent) {
        return transparent(painted);
    }
    const Eigen::Vector3f background = linear_rgb(options.background);
    return compose(painted, [&](int, int) -> const Eigen::Vector3f& { return background; });
}

inline ImageU8 render_mesh_over(const ImageU8& picture, const Mesh& mesh, const ImageU8* texture, const Camera& camera,
                                const ShadingOptions& options)
{
    require(picture.channels == 1 || picture.channels == 3 || picture.channels == 4, "render_mesh_over", "picture",
            "1, 3 or 4 channels", std::to_string(picture.channels));
    const ImageF painted =
        MeshPainter(mesh, texture, camera, picture.width, picture.height, options, "render_mesh_over").paint();
    const int green = picture.channels == 1 ? 0 : 1;
    const int blue = picture.channels == 1 ? 0 : 2;
    return compose(painted, [&](int column, int row) {
        const std::uint8_t* const pixel = picture.pixel(column, row);
        return Eigen::Vector3f(linear_from_srgb_u8(pixel[0]), linear_from_srgb_u8(pixel[green]),
                               linear_from_srgb_u8(pixel[blue]));
    });
}

} // namespace detail

LINEAMENT_RENDER_INLINE ImageU8 render_mesh(const Mesh& mesh, const Camera& camera, int width, int height,
                                            const ShadingOptions& options)
{
    return detail::render_mesh(mesh, nullptr, camera, width, height, options);
}

LINEAMENT_RENDER_INLINE ImageU8 render_mesh(const Mesh& mesh, const ImageU8& texture, const Camera& camera, int width,
                                            int height, const ShadingOptions& options)
{
    return detail::render_mesh(mesh, &texture, camera, width, height, options);
}

LINEAMENT_RENDER_INLINE ImageU8 render_mesh_over(const ImageU8& picture, const Mesh& mesh, const Camera& camera,
                                                 const ShadingOptions& options)
{
    return detail::render_mesh_over(picture, mesh, nullptr, camera, options);
}

LINEAMENT_RENDER_INLINE ImageU8 render_mesh_over(const ImageU8& picture, const Mesh& mesh, const ImageU8& texture,
                                                 const Camera& camera, const ShadingOptions& options)
{
    return detail::render_mesh_over(picture, mesh, &texture, camera, options);
}

LINEAMENT_RENDER_INLINE Camera frame_camera(const Mesh& mesh, const HeadAngles& angles, int width, int height,
                                            double margin)
{
    const char* const function = "frame_camera";
    require(width >= 1 && height >= 1, function, "width, height", "at least 1 px each",
            std::to_string(width) + " x " + std::to_string(height));
    require(margin >= 0 && margin < 0.5, function, "margin", "a number >= 0 and < 0.5", to_text(margin));
    require(mesh.vertices.cols() > 0, function, "mesh", "a vertex at least", "none");
    require_finite(mesh.vertices, function, "mesh.vertices");
    Camera camera;
    camera.camera_from_model = rotation_from_angles(angles);
    require_finite(camera.camera_from_model, function, "angles");
    const Eigen::Matrix3Xd points = camera.camera_from_model * mesh.vertices.cast<double>();
    const Eigen::Vector2d low = points.topRows<2>().rowwise().minCoeff();
    const Eigen::Vector2d high = points.topRows<2>().rowwise().maxCoeff();
    const Eigen::Vector2d extent = high - low;
    require(extent.maxCoeff() > 0, function, "mesh", "vertices that differ as seen from the angle", "one point");
    const double free_width = width * (1.0 - 2.0 * margin);
    const double free_height = height * (1.0 - 2.0 * margin);
    constexpr double tiny_mm = 1e-12;
    camera.scale_px_per_mm =
        std::min(free_width / std::max(extent.x(), tiny_mm), free_height / std::max(extent.y(), tiny_mm));
    camera.translation_mm = -0.5 * (low + high);
    camera.principal_point_px = Eigen::Vector2d(0.5 * width, 0.5 * height);
    return camera;
}

} // namespace lineament
