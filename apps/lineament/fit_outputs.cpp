// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "fit_outputs.hpp"

#include "lineament/fit/fitted_shape.hpp"
#include "lineament/io/glb_file.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/io/mesh_file.hpp"
#include "lineament/render/color_scale.hpp"
#include "lineament/render/contact_sheet.hpp"
#include "lineament/render/shading.hpp"
#include "lineament/render/texture_completion.hpp"

#include <algorithm>

namespace lineament::cli {

namespace fs = std::filesystem;

namespace {

constexpr double largest_deviation_mm = 8.0; ///< Of the colour scale: about what the default model's prior leaves.

/// The neutral face with its expressions, without texture.
GlbScene make_scene(const MorphableModel& model, const FitResult& fit)
{
    GlbScene scene;
    scene.mesh = neutral_mesh(model, fit.shape_coefficients);
    scene.morph_targets = make_morph_targets(model, fit.expression_set, fit.expression_coefficients);
    return scene;
}

/// The mesh with texture_filled.png on it, and the material that says so.
void write_obj(FileBatch& files, const fs::path& folder, const std::string& name, const Mesh& mesh)
{
    files.write(folder / (name + ".mtl"), format_mtl("texture_filled.png"));
    files.write(folder / (name + ".obj"), format_obj(mesh, {.material_file = name + ".mtl"}));
}

} // namespace

std::vector<std::string> fit_file_names()
{
    return {"fit.json",    "frontal.png",        "mesh.glb",        "mesh.mtl",       "mesh.obj",
            "mesh.ply",    "neutral.mtl",        "neutral.obj",     "overlay.png",    "report.html",
            "texture.png", "texture_filled.png", "uncertainty.glb", "uncertainty.png"};
}

std::string png_text(const ImageU8& image)
{
    const std::vector<std::byte> bytes = format_png(image);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Mesh neutral_mesh(const MorphableModel& model, const Eigen::VectorXd& shape_coefficients)
{
    return model.mesh_of(model.shape.instance(shape_coefficients));
}

std::vector<GlbMorphTarget> make_morph_targets(const MorphableModel& model, const std::string& expression_set,
                                               const Eigen::VectorXd& weights)
{
    std::vector<GlbMorphTarget> targets;
    if (const Blendshapes* set = model.find_expression_set(expression_set)) {
        for (Eigen::Index k = 0; k < set->num_coefficients(); ++k) {
            GlbMorphTarget target;
            target.name = set->names[static_cast<std::size_t>(k)];
            target.offsets = Eigen::Map<const Eigen::Matrix3Xf>(set->offsets.col(k).data(), 3, model.num_vertices());
            target.weight = k < weights.size() ? weights[k] : 0.0;
            targets.push_back(std::move(target));
        }
    }
    return targets;
}

ImageU8 render_frontal(const Mesh& mesh, const ImageU8& texture)
{
    constexpr int width = 480;
    constexpr int height = 600;
    return render_mesh(mesh, texture, frame_camera(mesh, {}, width, height), width, height);
}

TextureMap extract_face_texture(const MorphableModel& model, const TextureLayout& layout, const Mesh& mesh,
                                const Camera& camera, const ImageU8& picture)
{
    TextureOptions options;
    const auto ears = model.masks.find("ears");
    if (ears != model.masks.end()) {
        // The sine of the angle by which the head shows its left side; an ear counts in full from 30 degrees on.
        const double to_left = -camera.camera_from_model(2, 0);
        options.vertex_trust.resize(mesh.vertices.cols());
        for (Eigen::Index v = 0; v < mesh.vertices.cols(); ++v) {
            const double shown = mesh.vertices(0, v) > 0 ? to_left : -to_left;
            const double ear_trust = std::clamp((shown - 0.25) / 0.25, 0.0, 1.0);
            options.vertex_trust[v] = static_cast<float>(1.0 - ears->second[v] * (1.0 - ear_trust));
        }
    }
    options.vertex_skin = Eigen::VectorXf::Zero(mesh.vertices.cols());
    for (const char* const name : {"face", "neck", "ears"}) {
        const auto mask = model.masks.find(name);
        if (mask != model.masks.end()) {
            options.vertex_skin = options.vertex_skin.cwiseMax(mask->second);
        }
    }
    return extract_texture(layout, mesh.vertices, mesh.triangles, camera, picture, options);
}

FittedFace make_fitted_face(int id, const FitResult& fit, const MorphableModel& model, const TextureLayout& layout,
                            const ImageU8& picture)
{
    FittedFace face;
    face.id = id;
    face.fit = fit;
    const Mesh mesh = model.mesh_of(shape_of(model, fit));
    const TextureMap texture = extract_face_texture(model, layout, mesh, fit.camera, picture);
    face.texture = mark_holes(texture, HoleMark::transparent);
    face.whole_texture = complete_texture(texture).color;
    face.frontal = render_frontal(neutral_mesh(model, fit.shape_coefficients), face.whole_texture);
    return face;
}

void write_face(FileBatch& files, const fs::path& folder, const MorphableModel& model, const FittedFace& face,
                const OutputOptions& options)
{
    files.write(folder / "texture.png", format_png(face.texture));
    GlbScene scene = make_scene(model, face.fit);
    scene.texture = png_text(face.whole_texture);
    if (options.obj || options.neutral) {
        files.write(folder / "texture_filled.png", scene.texture); // packed once for both files
    }
    files.write(folder / "mesh.glb", format_glb(scene));
    const Mesh mesh = model.mesh_of(shape_of(model, face.fit));
    if (options.obj) {
        write_obj(files, folder, "mesh", mesh);
    }
    if (options.neutral) {
        write_obj(files, folder, "neutral", neutral_mesh(model, face.fit.shape_coefficients));
    }
    if (options.ply) {
        files.write(folder / "mesh.ply", format_ply(mesh));
    }
    files.write(folder / "frontal.png", format_png(face.frontal));
}

ImageU8 write_uncertainty(FileBatch& files, const fs::path& folder, const MorphableModel& model, const FitResult& fit,
                          const Eigen::VectorXf& vertex_deviations_mm)
{
    constexpr int tile_px = 400;
    GlbScene scene = make_scene(model, fit);
    std::vector<Tile> tiles;
    for (const double yaw_deg : {0.0, 50.0}) {
        const Camera camera = frame_camera(scene.mesh, {radians(yaw_deg), 0.0, 0.0}, tile_px, tile_px);
        tiles.push_back(
            {render_values(scene.mesh, vertex_deviations_mm, largest_deviation_mm, camera, tile_px, tile_px), ""});
    }
    ContactSheetOptions options;
    options.tile_width_px = options.tile_height_px = tile_px;
    const ImageU8 picture = add_color_bar(contact_sheet(tiles, 2, options), largest_deviation_mm, "mm");
    files.write(folder / "uncertainty.png", format_png(picture));
    scene.mesh.colors = scale_colors(vertex_deviations_mm, largest_deviation_mm);
    files.write(folder / "uncertainty.glb", format_glb(scene));
    return picture;
}

} // namespace lineament::cli
