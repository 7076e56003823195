// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "model_sheets.hpp"

#include "console.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/core/random.hpp"
#include "lineament/render/contact_sheet.hpp"
#include "lineament/render/draw.hpp"
#include "lineament/render/shading.hpp"
#include "lineament/render/texture_layout.hpp"

#include <cstdio>

namespace lineament::cli {

namespace {

/// Draws tiles of one model with one camera scale, so that sizes can be compared.
class Studio
{
public:
    Studio(const MorphableModel& model, int tile_px) : model_(model), tile_px_(tile_px) {}

    [[nodiscard]] Mesh mesh(const Eigen::VectorXf& shape, const Eigen::VectorXf* color = nullptr) const
    {
        Mesh mesh = model_.mesh_of(shape);
        if (color != nullptr) {
            mesh.colors = Eigen::Map<const Eigen::Matrix3Xf>(color->data(), 3, model_.num_vertices())
                              .cwiseMax(0.0f)
                              .cwiseMin(1.0f);
        }
        return mesh;
    }

    [[nodiscard]] Tile tile(const Mesh& mesh, double yaw_deg, const std::string& caption,
                            const ShadingOptions& options = {}) const
    {
        Camera camera =
            frame_camera(model_.mesh_of(model_.shape.mean), {radians(yaw_deg), 0.0, 0.0}, tile_px_, tile_px_, 0.1);
        return {render_mesh(mesh, camera, tile_px_, tile_px_, options), caption};
    }

private:
    const MorphableModel& model_;
    int tile_px_;
};

Eigen::VectorXd unit_vector(Eigen::Index size, Eigen::Index index, double value)
{
    Eigen::VectorXd vector = Eigen::VectorXd::Zero(size);
    vector[index] = value;
    return vector;
}

std::string signed_text(double value)
{
    char text[32];
    std::snprintf(text, sizeof text, "%+g sd", value);
    return text;
}

std::vector<Tile> random_faces(const MorphableModel& model, const Studio& studio, const SheetOptions& options)
{
    Random random(options.seed);
    std::vector<Tile> tiles;
    for (int i = 0; i < options.count; ++i) {
        Eigen::VectorXd shape(model.shape.num_coefficients());
        for (double& coefficient : shape) {
            coefficient = random.normal();
        }
        const double yaw_deg = random.uniform(-40.0, 40.0);
        Eigen::VectorXf color;
        if (model.color) {
            Eigen::VectorXd coefficients(model.color->num_coefficients());
            for (double& coefficient : coefficients) {
                coefficient = random.normal();
            }
            color = model.color->instance(coefficients);
        }
        tiles.push_back(
            studio.tile(studio.mesh(model.shape.instance(shape), model.color ? &color : nullptr), yaw_deg, ""));
    }
    return tiles;
}

std::vector<Tile> shape_modes(const MorphableModel& model, const Studio& studio, const SheetOptions& options)
{
    std::vector<Tile> tiles;
    for (int mode = 0; mode < std::min<Eigen::Index>(options.count, model.shape.num_coefficients()); ++mode) {
        for (const double sign : {-1.0, 1.0}) {
            const double value = sign * options.standard_deviations;
            const Mesh mesh = studio.mesh(model.shape.instance(unit_vector(mode + 1, mode, value)));
            tiles.push_back(studio.tile(mesh, 25.0, "mode " + std::to_string(mode + 1) + "  " + signed_text(value)));
        }
    }
    return tiles;
}

std::vector<Tile> color_modes(const MorphableModel& model, const Studio& studio, const SheetOptions& options)
{
    if (!model.color) {
        throw Failure(wrong_use, "--what color-modes: the model has no colours");
    }
    std::vector<Tile> tiles;
    for (int mode = 0; mode < std::min<Eigen::Index>(options.count, model.color->num_coefficients()); ++mode) {
        for (const double sign : {-1.0, 1.0}) {
            const double value = sign * options.standard_deviations;
            const Eigen::VectorXf color = model.color->instance(unit_vector(mode + 1, mode, value));
            tiles.push_back(studio.tile(studio.mesh(model.shape.mean, &color), 20.0,
                                        "colour " + std::to_string(mode + 1) + "  " + signed_text(value)));
        }
    }
    return tiles;
}

std::vector<Tile> expressions(const MorphableModel& model, const Studio& studio, const SheetOptions& options)
{
    const Blendshapes* set = model.find_expression_set(options.expression_set);
    if (set == nullptr) {
        throw Failure(wrong_use, "--expressions: the model has no set " + options.expression_set);
    }
    const Eigen::VectorXf* color = model.color ? &model.color->mean : nullptr;
    std::vector<Tile> tiles;
    for (Eigen::Index k = 0; k < set->num_coefficients(); ++k) {
        const Eigen::VectorXf shape =
            model.shape.mean + set->displacement(unit_vector(set->num_coefficients(), k, 1.0));
        tiles.push_back(studio.tile(studio.mesh(shape, color), 15.0, set->names[static_cast<std::size_t>(k)]));
    }
    return tiles;
}

std::vector<Tile> levels(const MorphableModel& model, const SheetOptions& options)
{
    std::vector<Tile> tiles;
    for (int level = 0; level < static_cast<int>(model.levels.size()); ++level) {
        const MorphableModel coarse = model.at_level(level);
        const Studio studio(coarse, options.tile_px);
        for (const DrawMode mode : {DrawMode::surface, DrawMode::surface_and_wireframe}) {
            ShadingOptions shading;
            shading.mode = mode;
            tiles.push_back(studio.tile(studio.mesh(coarse.shape.mean), 25.0,
                                        std::to_string(coarse.num_vertices()) + " vertices, " +
                                            std::to_string(coarse.levels.back().triangles.cols()) + " triangles",
                                        shading));
        }
    }
    return tiles;
}

ImageU8 isomap(const MorphableModel& model, const SheetOptions& options)
{
    const Eigen::Matrix3Xi& triangles = model.levels.back().uv_triangles;
    if (triangles.cols() == 0) {
        throw Failure(wrong_use, "--what isomap: the model has no uv layout");
    }
    return draw_uv_layout(model.uv_coordinates, triangles, 3 * options.tile_px);
}

std::vector<Tile> landmarks(const MorphableModel& model, const SheetOptions& options)
{
    const Studio studio(model, options.tile_px);
    const Eigen::Map<const Eigen::Matrix3Xf> vertices(model.shape.mean.data(), 3, model.num_vertices());
    std::vector<Tile> tiles;
    for (const double yaw_deg : {0.0, 45.0}) {
        const Mesh mean = studio.mesh(model.shape.mean);
        Tile tile = studio.tile(mean, yaw_deg, "");
        const Camera camera = frame_camera(mean, {radians(yaw_deg), 0.0, 0.0}, options.tile_px, options.tile_px, 0.1);
        for (const std::vector<int>* contour : {&model.contour_left, &model.contour_right}) {
            for (const int vertex : *contour) {
                draw_disc(tile.picture, camera.project(Eigen::Vector3d(vertices.col(vertex).cast<double>())), 1.5,
                          {40, 90, 200});
            }
        }
        for (const LandmarkMap& map : model.landmark_maps) {
            const Eigen::Matrix3Xf points = map.points_on(vertices);
            for (Eigen::Index l = 0; l < points.cols(); ++l) {
                draw_disc(tile.picture, camera.project(Eigen::Vector3d(points.col(l).cast<double>())), 2.5,
                          {200, 40, 40});
            }
        }
        tiles.push_back(std::move(tile));
    }
    return tiles;
}

} // namespace

ImageU8 make_sheet(const MorphableModel& model, const SheetOptions& options)
{
    const Studio studio(model, options.tile_px);
    if (options.what == "isomap") {
        return isomap(model, options);
    }
    std::vector<Tile> tiles;
    int columns = 6;
    if (options.what == "random") {
        tiles = random_faces(model, studio, options);
    } else if (options.what == "shape-modes") {
        tiles = shape_modes(model, studio, options);
    } else if (options.what == "color-modes") {
        tiles = color_modes(model, studio, options);
    } else if (options.what == "expressions") {
        tiles = expressions(model, studio, options);
        columns = tiles.size() <= 6 ? 3 : 8;
    } else if (options.what == "levels") {
        tiles = levels(model, options);
        columns = 2;
    } else {
        tiles = landmarks(model, options);
        columns = 2;
    }
    ContactSheetOptions sheet;
    sheet.tile_width_px = options.tile_px;
    sheet.tile_height_px = options.tile_px;
    return contact_sheet(tiles, std::min(columns, static_cast<int>(tiles.size())), sheet);
}

} // namespace lineament::cli
