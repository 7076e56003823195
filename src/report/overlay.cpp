// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/report/overlay.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/fit/fitted_shape.hpp"
#include "lineament/render/draw.hpp"
#include "lineament/render/visibility.hpp"
#include "report/html.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace lineament {

void OverlayOptions::check() const
{
    require(mesh_opacity >= 0 && mesh_opacity <= 1, "OverlayOptions", "mesh_opacity", "a number in [0, 1]",
            to_text(mesh_opacity));
    require(axis_length_mm >= 0 && std::isfinite(axis_length_mm), "OverlayOptions", "axis_length_mm", "a number >= 0",
            to_text(axis_length_mm));
}

namespace {

constexpr double smallest_edge_px = 6.0; // Mean edge length from which a wireframe reads as lines.

bool has_face(const FitResult& fit)
{
    return fit.status != FitStatus::degenerate && fit.status != FitStatus::too_few_correspondences;
}

// The picture as RGB; alpha is laid over white.
ImageU8 rgb_of(const ImageU8& picture)
{
    if (picture.channels == 3) {
        return picture;
    }
    ImageU8 result(picture.width, picture.height, 3);
    const std::size_t count = static_cast<std::size_t>(picture.width) * picture.height;
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint8_t* pixel = picture.data.data() + i * picture.channels;
        for (std::size_t c = 0; c < 3; ++c) {
            const int value = pixel[picture.channels == 1 ? 0 : c];
            const int alpha = picture.channels == 4 ? pixel[3] : 255;
            result.data[3 * i + c] = static_cast<std::uint8_t>((value * alpha + 255 * (255 - alpha) + 127) / 255);
        }
    }
    return result;
}

// Where the face lies in the picture.
struct FaceBox
{
    Eigen::AlignedBox2d box_px = {};

    [[nodiscard]] double size_px() const { return box_px.isEmpty() ? 0.0 : box_px.sizes().maxCoeff(); }
    // Drawing sizes are given for a face of 300 px.
    [[nodiscard]] double unit_px() const { return std::clamp(size_px() / 300.0, 0.7, 8.0); }
};

double mean_edge_px(const Level& level, const Eigen::Matrix2Xd& points)
{
    double sum = 0.0;
    for (Eigen::Index t = 0; t < level.triangles.cols(); ++t) {
        sum += (points.col(level.triangles(0, t)) - points.col(level.triangles(1, t))).norm();
    }
    return level.triangles.cols() > 0 ? sum / static_cast<double>(level.triangles.cols()) : 0.0;
}

const Level& readable_level(const MorphableModel& model, const Eigen::Matrix2Xd& points)
{
    for (std::size_t i = model.levels.size(); i-- > 1;) {
        if (mean_edge_px(model.levels[i], points) >= smallest_edge_px) {
            return model.levels[i];
        }
    }
    return model.levels.front();
}

using Edge = std::pair<int, int>; // the smaller vertex number first

// The edges of triangles that are seen, each once, with how squarely it is seen: 0 at the silhouette to 1.
std::vector<std::pair<Edge, double>> seen_edges(const Level& level, const Eigen::Matrix3Xf& vertices,
                                                const Camera& camera, const DepthTest& depth_test)
{
    std::vector<std::pair<Edge, double>> edges; // those of two seen triangles twice at first
    edges.reserve(3 * static_cast<std::size_t>(level.triangles.cols()));
    for (Eigen::Index t = 0; t < level.triangles.cols(); ++t) {
        const Eigen::Vector3i corners = level.triangles.col(t);
        Eigen::Matrix3d points;
        for (int i = 0; i < 3; ++i) {
            points.col(i) = camera.in_camera(vertices.col(corners[i]).cast<double>());
        }
        const Eigen::Vector3d normal =
            (points.col(1) - points.col(0)).cross(points.col(2) - points.col(0)).normalized();
        const Eigen::Vector3d middle = points.rowwise().mean();
        if (depth_test(middle, normal) != Visibility::visible) {
            continue;
        }
        const double facing = std::clamp(-normal.dot(view_ray(camera, middle).normalized()), 0.0, 1.0);
        for (int i = 0; i < 3; ++i) {
            edges.emplace_back(std::minmax(corners[i], corners[(i + 1) % 3]), facing);
        }
    }
    std::sort(edges.begin(), edges.end(), [](const auto& a, const auto& b) {
        return a.first != b.first ? a.first < b.first : a.second > b.second;
    });
    edges.erase(
        std::unique(edges.begin(), edges.end(), [](const auto& a, const auto& b) { return a.first == b.first; }),
        edges.end());
    return edges;
}

void draw_mesh(ImageU8& picture, const MorphableModel& model, const Eigen::Matrix3Xf& vertices, const Camera& camera,
               const Eigen::Matrix2Xd& points, const FaceBox& face, double opacity)
{
    // The depth test looks at the part of the picture that holds the face.
    const Eigen::AlignedBox2d view(Eigen::Vector2d::Zero(), Eigen::Vector2d(picture.width, picture.height));
    const Eigen::AlignedBox2d part = face.box_px.intersection(view);
    if (part.isEmpty()) {
        return;
    }
    const Eigen::Vector2d corner(std::floor(part.min().x()), std::floor(part.min().y()));
    const Eigen::Vector2i size = (part.max() - corner).array().ceil().matrix().cast<int>();
    Camera shifted = camera;
    shifted.principal_point_px -= corner;
    const DepthTest depth_test(vertices, model.levels.back().triangles, shifted, size.x(), size.y(),
                               {.depth_tolerance_mm = 2.5}); // a coarser level lies that far from the finest
    const double width = 0.65 * std::sqrt(face.unit_px());
    for (const auto& [edge, facing] : seen_edges(readable_level(model, points), vertices, shifted, depth_test)) {
        const double alpha = 255.0 * opacity * (0.15 + 0.85 * std::sqrt(facing));
        draw_line(picture, points.col(edge.first), points.col(edge.second),
                  {215, 240, 255, static_cast<std::uint8_t>(std::lround(std::min(alpha, 255.0)))}, width);
    }
}

void draw_landmarks(ImageU8& picture, const FitResult& fit, double unit_px)
{
    constexpr Color seen{255, 205, 40};
    constexpr Color unused{200, 200, 200, 150};
    constexpr Color fitted{20, 200, 220};
    constexpr Color residual{255, 60, 120};
    constexpr Color rim{20, 24, 30, 200};
    const auto is_used = [&](const FittedLandmark& landmark) { return has_face(fit) && landmark.weight > 0; };
    for (const FittedLandmark& landmark : fit.landmarks) {
        if (is_used(landmark)) {
            draw_line(picture, landmark.point_px, landmark.fitted_px, residual, 1.1 * unit_px);
        }
    }
    for (const FittedLandmark& landmark : fit.landmarks) {
        if (!landmark.point_px.allFinite()) {
            continue;
        }
        draw_disc(picture, landmark.point_px, 2.3 * unit_px, rim);
        draw_disc(picture, landmark.point_px, 1.7 * unit_px, is_used(landmark) || !has_face(fit) ? seen : unused);
        if (is_used(landmark)) {
            draw_disc(picture, landmark.fitted_px, 1.1 * unit_px, fitted);
        }
    }
}

// The tip of the nose, if a landmark scheme names it; else the foremost point near the symmetry plane.
Eigen::Vector3d nose_of(const MorphableModel& model, const Eigen::Matrix3Xf& vertices)
{
    if (const LandmarkMap* map = model.find_landmark_map("ibug68")) {
        const int tip = map->index_of("31");
        if (tip >= 0) {
            return map->points_on(vertices).col(tip).cast<double>();
        }
    }
    Eigen::Index foremost = 0;
    vertices.row(2).maxCoeff(&foremost);
    return vertices.col(foremost).cast<double>();
}

// Pixels of the built-in letters, whose capitals are 7 high, in pixels of the picture.
double text_scale(double unit_px)
{
    return std::clamp(1.25 * unit_px, 1.0, 12.0);
}

// Text in the built-in letters at any size >= 1: their pixels are interpolated and drawn where that exceeds `cut`,
// which rounds them; a lower cut makes them bolder. `middle` is the middle of the capitals.
void draw_smooth_text(ImageU8& picture, const Eigen::Vector2d& middle, const std::string& text, const Color& color,
                      double scale, double cut)
{
    constexpr int border = 2;
    constexpr double capital_height = 7.0;
    ImageU8 letters(text_width_px(text) + 2 * border, text_height_px(text) + 2 * border, 1, 0);
    draw_text(letters, border, border, text, {255, 255, 255});
    const double width = scale * letters.width;
    const Eigen::Vector2d corner = middle - Eigen::Vector2d(0.5 * width, scale * (border + 0.5 * capital_height));
    const int left = std::max(0, static_cast<int>(std::floor(corner.x())));
    const int top = std::max(0, static_cast<int>(std::floor(corner.y())));
    const int right = std::min(picture.width, static_cast<int>(std::ceil(corner.x() + width)));
    const int bottom = std::min(picture.height, static_cast<int>(std::ceil(corner.y() + scale * letters.height)));
    for (int row = top; row < bottom; ++row) {
        for (int column = left; column < right; ++column) {
            const double u = (column + 0.5 - corner.x()) / scale;
            const double v = (row + 0.5 - corner.y()) / scale;
            const double height = sample_bilinear(letters, static_cast<float>(u), static_cast<float>(v), 0) / 255.0;
            const double coverage = std::clamp(2.0 * scale * (height - cut) + 0.5, 0.0, 1.0);
            blend_pixel(picture, column, row, color, static_cast<float>(coverage));
        }
    }
}

void draw_axes(ImageU8& picture, const Camera& camera, const Eigen::Vector3d& nose, double length_mm, double unit_px)
{
    struct Axis
    {
        Eigen::Vector3d direction;
        Color color;
        const char* name;
    };
    std::array<Axis, 3> axes{{{Eigen::Vector3d::UnitX(), {235, 64, 52}, "x"},
                              {Eigen::Vector3d::UnitY(), {52, 199, 89}, "y"},
                              {Eigen::Vector3d::UnitZ(), {64, 132, 255}, "z"}}};
    const auto depth = [&](const Axis& axis) { return (camera.camera_from_model * axis.direction).z(); };
    std::sort(axes.begin(), axes.end(), [&](const Axis& a, const Axis& b) { return depth(a) > depth(b); });
    const Eigen::Vector2d origin = camera.project(nose);
    constexpr Color shadow{20, 24, 30, 150};
    for (const Axis& axis : axes) { // the farthest first
        const Eigen::Vector2d end = camera.project(Eigen::Vector3d(nose + length_mm * axis.direction));
        const double length_px = (end - origin).norm();
        if (!(length_px > 4.0 * unit_px) || !(end.cwiseAbs().maxCoeff() < 1e6)) {
            continue; // seen along its length, or far outside
        }
        const Eigen::Vector2d along = (end - origin) / length_px;
        const Eigen::Vector2d across(-along.y(), along.x());
        const double head = std::min(7.0 * unit_px, 0.4 * length_px);
        for (const auto& [color, width] : {std::pair(shadow, 4.2 * unit_px), std::pair(axis.color, 2.4 * unit_px)}) {
            draw_line(picture, origin, end, color, width);
            draw_line(picture, end, end - head * along + 0.55 * head * across, color, width);
            draw_line(picture, end, end - head * along - 0.55 * head * across, color, width);
        }
        const double scale = text_scale(unit_px);
        const Eigen::Vector2d middle = end + (3.0 * unit_px + 5.0 * scale) * along;
        draw_smooth_text(picture, middle, axis.name, shadow, scale, 0.25);
        draw_smooth_text(picture, middle, axis.name, axis.color, scale, 0.45);
    }
    draw_disc(picture, origin, 2.4 * unit_px, {255, 255, 255});
}

std::string caption_of(const FitResult& fit)
{
    std::string text;
    if (has_face(fit)) {
        const HeadAngles angles = angles_from_rotation(fit.camera.camera_from_model);
        text = "yaw " + html::number(degrees(angles.yaw), 0) + "  pitch " + html::number(degrees(angles.pitch), 0) +
               "  roll " + html::number(degrees(angles.roll), 0) + " deg";
    }
    if (fit.status != FitStatus::success) {
        text += (text.empty() ? "" : "  ") + std::string(to_string(fit.status));
    }
    return text;
}

// A dark plate with the text below the face, or as near as the picture allows.
void draw_caption(ImageU8& picture, const std::string& text, const FaceBox& face)
{
    if (text.empty() || face.box_px.isEmpty() || !face.box_px.sizes().allFinite()) {
        return;
    }
    const double letters_width = text_width_px(text) + 8.0;
    const double scale = std::clamp(picture.width / letters_width, 1.0, text_scale(face.unit_px()));
    const Eigen::Vector2d size(scale * letters_width, scale * 14.0);
    const auto place = [](double wished, double length, double available) {
        return std::floor(std::clamp(wished, 0.0, std::max(0.0, available - length)));
    };
    const Eigen::Vector2d corner(place(face.box_px.center().x() - 0.5 * size.x(), size.x(), picture.width),
                                 place(face.box_px.max().y() + 6.0 * scale, size.y(), picture.height));
    const Eigen::Vector2i corner_px = corner.cast<int>();
    const Eigen::Vector2i size_px = size.array().ceil().matrix().cast<int>();
    fill_rectangle(picture, corner_px.x(), corner_px.y(), size_px.x(), size_px.y(), {16, 20, 26, 170});
    draw_smooth_text(picture, corner + 0.5 * size, text, {245, 247, 250}, scale, 0.45);
}

void draw_annotations(ImageU8& picture, const FitResult& fit, const FaceBox& face, const OverlayOptions& options)
{
    if (options.landmarks == OverlayLandmarks::residuals) {
        draw_landmarks(picture, fit, face.unit_px());
    }
    if (options.caption == OverlayCaption::pose_and_status) {
        draw_caption(picture, caption_of(fit), face);
    }
}

} // namespace

ImageU8 draw_overlay(const ImageU8& picture, const MorphableModel& model, const FitResult& fit,
                     const OverlayOptions& options)
{
    options.check();
    require(picture.channels == 1 || picture.channels == 3 || picture.channels == 4, "draw_overlay", "picture.channels",
            "1, 3 or 4", std::to_string(picture.channels));
    ImageU8 result = rgb_of(picture);
    if (!has_face(fit)) {
        FaceBox seen;
        for (const FittedLandmark& landmark : fit.landmarks) {
            if (landmark.point_px.allFinite()) {
                seen.box_px.extend(landmark.point_px);
            }
        }
        draw_annotations(result, fit, seen, options);
        return result;
    }
    const Eigen::VectorXf shape = shape_of(model, fit);
    const Eigen::Map<const Eigen::Matrix3Xf> vertices(shape.data(), 3, model.num_vertices());
    const Eigen::Matrix2Xd points = fit.camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(vertices.cast<double>()));
    require_finite(points, "draw_overlay", "fitted vertices in the picture");
    const FaceBox face{Eigen::AlignedBox2d(points.rowwise().minCoeff(), points.rowwise().maxCoeff())};
    if (options.mesh_opacity > 0 && !model.levels.empty()) {
        draw_mesh(result, model, vertices, fit.camera, points, face, options.mesh_opacity);
    }
    draw_annotations(result, fit, face, options);
    if (options.axis_length_mm > 0) {
        draw_axes(result, fit.camera, nose_of(model, vertices), options.axis_length_mm, face.unit_px());
    }
    return result;
}

} // namespace lineament
