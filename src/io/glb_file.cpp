// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Binary glTF 2.0 (The Khronos Group, glTF 2.0 Specification, version 2.0.1, 2021).
#include "lineament/io/glb_file.hpp"

#include "glb_buffer.hpp"
#include "mesh_checks.hpp"

#include "lineament/core/checks.hpp"
#include "lineament/io/file.hpp"

#include <cmath>
#include <map>
#include <utility>

namespace lineament {

namespace {

using detail::GlbBuffer;
using detail::Json;

constexpr float metres_per_mm = 0.001f;

// glTF has one uv point a vertex, so a vertex with several becomes several.
struct SplitMesh
{
    Eigen::Matrix3Xi triangles = {};
    std::vector<int> vertices = {}; ///< Of the mesh, for each split vertex.
    std::vector<int> uv = {};       ///< Of the mesh; empty without uv.
};

SplitMesh split_at_seams(const Mesh& mesh)
{
    SplitMesh split;
    split.triangles = mesh.triangles;
    if (mesh.uv_triangles.cols() == 0) {
        split.vertices.resize(static_cast<std::size_t>(mesh.num_vertices()));
        for (std::size_t v = 0; v < split.vertices.size(); ++v) {
            split.vertices[v] = static_cast<int>(v);
        }
        return split;
    }
    std::map<std::pair<int, int>, int> indices;
    for (Eigen::Index t = 0; t < mesh.num_triangles(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            const std::pair<int, int> key(mesh.triangles(corner, t), mesh.uv_triangles(corner, t));
            const auto [entry, is_new] = indices.emplace(key, static_cast<int>(split.vertices.size()));
            if (is_new) {
                split.vertices.push_back(key.first);
                split.uv.push_back(key.second);
            }
            split.triangles(corner, t) = entry->second;
        }
    }
    return split;
}

template <typename Matrix>
Matrix pick_columns(const Matrix& matrix, const std::vector<int>& columns)
{
    Matrix picked(matrix.rows(), static_cast<Eigen::Index>(columns.size()));
    for (std::size_t i = 0; i < columns.size(); ++i) {
        picked.col(static_cast<Eigen::Index>(i)) = matrix.col(columns[i]);
    }
    return picked;
}

float linear_from_srgb(float value)
{
    return value <= 0.04045f ? value / 12.92f : std::pow((value + 0.055f) / 1.055f, 2.4f);
}

const char* mime_type_of(const std::string& texture)
{
    if (texture.starts_with("\x89PNG\r\n\x1a\n")) {
        return "image/png";
    }
    return texture.starts_with("\xff\xd8\xff") ? "image/jpeg" : nullptr;
}

void check_camera(const Camera& camera)
{
    require_finite(camera.camera_from_model, "format_glb", "camera_from_model");
    require_finite(camera.translation_mm, "format_glb", "translation_mm");
    require(camera.phi_per_mm >= 0.0 && std::isfinite(camera.phi_per_mm), "format_glb", "phi_per_mm", "a number >= 0",
            to_text(camera.phi_per_mm));
    const double error =
        (camera.camera_from_model * camera.camera_from_model.transpose() - Eigen::Matrix3d::Identity()).norm();
    require(error <= 1e-6 && camera.camera_from_model.determinant() > 0.0, "format_glb", "camera_from_model",
            "a rotation", "a matrix that is " + to_text(error) + " away from one");
}

void check_scene(const GlbScene& scene)
{
    detail::check_mesh(scene.mesh, "format_glb");
    require(scene.mesh.num_triangles() > 0, "format_glb", "scene.mesh", "at least one triangle", "none");
    for (const GlbMorphTarget& target : scene.morph_targets) {
        require_size(target.offsets.cols(), scene.mesh.num_vertices(), "format_glb", "morph_targets.offsets");
        require_finite(target.offsets, "format_glb", "morph_targets.offsets");
        require(std::isfinite(target.weight), "format_glb", "morph_targets.weight", "a finite number",
                to_text(target.weight));
    }
    if (!scene.texture.empty()) {
        require(mime_type_of(scene.texture) != nullptr, "format_glb", "scene.texture",
                "the bytes of a PNG or JPEG file", std::to_string(scene.texture.size()) + " other bytes");
        require(scene.mesh.uv_triangles.cols() > 0, "format_glb", "scene.mesh.uv_triangles", "uv for the texture",
                "none");
    }
    if (scene.pose) {
        check_camera(*scene.pose);
    }
    float last = -1.0f;
    for (const GlbKeyframe& keyframe : scene.animation) {
        const auto time = static_cast<float>(keyframe.time_s);
        require(keyframe.time_s >= 0.0 && std::isfinite(time) && time > last, "format_glb", "animation.time_s",
                "rising times >= 0", to_text(keyframe.time_s) + " after " + to_text(last));
        last = time;
        check_camera(keyframe.camera);
        require_size(keyframe.weights.size(), static_cast<Eigen::Index>(scene.morph_targets.size()), "format_glb",
                     "animation.weights");
        require_finite(keyframe.weights, "format_glb", "animation.weights");
    }
}

Json json_material(const GlbScene& scene)
{
    Json material = {{"name", scene.name}, {"doubleSided", true}};
    material["pbrMetallicRoughness"] = {{"metallicFactor", 0.0}, {"roughnessFactor", 1.0}};
    if (!scene.texture.empty()) {
        material["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
    }
    return material;
}

bool is_unlit(const GlbScene& scene)
{
    return scene.shading == GlbShading::unlit || (scene.shading == GlbShading::automatic && !scene.texture.empty());
}

Json json_mesh(const GlbScene& scene, GlbBuffer& buffer)
{
    const SplitMesh split = split_at_seams(scene.mesh);
    Json primitive = {{"attributes", Json::object()}, {"material", 0}};
    const Eigen::Matrix3Xf positions = pick_columns(scene.mesh.vertices, split.vertices) * metres_per_mm;
    primitive["attributes"]["POSITION"] = buffer.add_attribute(positions, detail::GlbBounds::written);
    if (scene.normals == GlbNormals::included) {
        // A vertex without area has no normal; any unit vector is valid there.
        Eigen::Matrix3Xf normals = compute_vertex_normals(scene.mesh.vertices, scene.mesh.triangles);
        for (Eigen::Index v = 0; v < normals.cols(); ++v) {
            if (!(normals.col(v).squaredNorm() > 0.5f)) {
                normals.col(v) = Eigen::Vector3f::UnitZ();
            }
        }
        primitive["attributes"]["NORMAL"] =
            buffer.add_attribute(pick_columns(normals, split.vertices), detail::GlbBounds::omitted);
    }
    if (!split.uv.empty()) {
        primitive["attributes"]["TEXCOORD_0"] =
            buffer.add_attribute(pick_columns(scene.mesh.uv_coordinates, split.uv), detail::GlbBounds::omitted);
    }
    if (scene.mesh.colors.cols() > 0 && scene.texture.empty()) {
        const Eigen::Matrix3Xf linear = scene.mesh.colors.cwiseMax(0.0f).cwiseMin(1.0f).unaryExpr(&linear_from_srgb);
        primitive["attributes"]["COLOR_0"] =
            buffer.add_attribute(pick_columns(linear, split.vertices), detail::GlbBounds::omitted);
    }
    primitive["indices"] = buffer.add_indices(split.triangles, static_cast<Eigen::Index>(split.vertices.size()));
    Json mesh = {{"name", scene.name}, {"primitives", Json::array()}};
    if (!scene.morph_targets.empty()) {
        primitive["targets"] = Json::array();
        Json names = Json::array();
        mesh["weights"] = Json::array();
        for (const GlbMorphTarget& target : scene.morph_targets) {
            const Eigen::Matrix3Xf offsets = pick_columns(target.offsets, split.vertices) * metres_per_mm;
            primitive["targets"].push_back({{"POSITION", buffer.add_offsets(offsets)}});
            names.push_back(target.name);
            mesh["weights"].push_back(static_cast<float>(target.weight));
        }
        mesh["extras"] = {{"targetNames", std::move(names)}};
    }
    mesh["primitives"].push_back(std::move(primitive));
    return mesh;
}

Json json_animation(const GlbScene& scene, GlbBuffer& buffer)
{
    const auto count = static_cast<Eigen::Index>(scene.animation.size());
    const auto num_targets = static_cast<Eigen::Index>(scene.morph_targets.size());
    const double first_phi = scene.animation.front().camera.phi_per_mm;
    const double reference_depth_mm = first_phi > 0.0 ? 1.0 / first_phi : 0.0;
    Eigen::RowVectorXf times(count);
    Eigen::Matrix4Xf rotations(4, count);
    Eigen::Matrix3Xf translations(3, count);
    Eigen::MatrixXf weights(num_targets, count);
    Eigen::Quaterniond last = Eigen::Quaterniond::Identity();
    for (Eigen::Index f = 0; f < count; ++f) {
        const GlbKeyframe& keyframe = scene.animation[static_cast<std::size_t>(f)];
        Eigen::Quaterniond rotation = glb_rotation(keyframe.camera);
        if (rotation.dot(last) < 0.0) { // the nearer of two equal turns, so that interpolation takes the short way
            rotation.coeffs() = -rotation.coeffs();
        }
        last = rotation;
        times[f] = static_cast<float>(keyframe.time_s);
        rotations.col(f) = rotation.coeffs().cast<float>(); // x y z w
        translations.col(f) = glb_translation_m(keyframe.camera, reference_depth_mm).cast<float>();
        weights.col(f) = keyframe.weights.cast<float>();
    }
    const int input = buffer.add_track(times, "SCALAR", detail::GlbBounds::written);
    Json animation = {{"name", scene.name}, {"channels", Json::array()}, {"samplers", Json::array()}};
    const auto add = [&](const char* path, int output) {
        animation["channels"].push_back(
            {{"sampler", animation["samplers"].size()}, {"target", {{"node", 0}, {"path", path}}}});
        animation["samplers"].push_back({{"input", input}, {"output", output}, {"interpolation", "LINEAR"}});
    };
    add("rotation", buffer.add_track(rotations, "VEC4", detail::GlbBounds::omitted));
    add("translation", buffer.add_track(translations, "VEC3", detail::GlbBounds::omitted));
    if (num_targets > 0) {
        add("weights", buffer.add_track(weights, "SCALAR", detail::GlbBounds::omitted));
    }
    return animation;
}

} // namespace

Eigen::Quaterniond glb_rotation(const Camera& camera)
{
    return Eigen::Quaterniond(Eigen::Matrix3d(frontal_rotation() * camera.camera_from_model)).normalized();
}

Eigen::Vector3d glb_translation_m(const Camera& camera, double reference_depth_mm)
{
    const double nearer_mm = camera.phi_per_mm > 0.0 ? reference_depth_mm - 1.0 / camera.phi_per_mm : 0.0;
    return 0.001 * Eigen::Vector3d(camera.translation_mm.x(), -camera.translation_mm.y(), nearer_mm);
}

std::string format_glb(const GlbScene& scene)
{
    check_scene(scene);
    GlbBuffer buffer;
    Json json = {{"asset", {{"version", "2.0"}, {"generator", "Lineament"}}}};
    json["scene"] = 0;
    json["scenes"] = Json::array({{{"nodes", {0}}}});
    Json node = {{"name", scene.name}, {"mesh", 0}};
    const Camera* pose = !scene.animation.empty() ? &scene.animation.front().camera
                         : scene.pose             ? &*scene.pose
                                                  : nullptr;
    if (pose != nullptr) {
        const Eigen::Vector4f rotation = glb_rotation(*pose).coeffs().cast<float>();
        const double depth_mm = pose->phi_per_mm > 0.0 ? 1.0 / pose->phi_per_mm : 0.0;
        const Eigen::Vector3f translation = glb_translation_m(*pose, depth_mm).cast<float>();
        node["rotation"] = {rotation.x(), rotation.y(), rotation.z(), rotation.w()};
        node["translation"] = {translation.x(), translation.y(), translation.z()};
    }
    json["nodes"] = Json::array({std::move(node)});
    json["materials"] = Json::array({json_material(scene)});
    if (is_unlit(scene)) {
        json["materials"][0]["extensions"] = {{"KHR_materials_unlit", Json::object()}};
        json["extensionsUsed"] = {"KHR_materials_unlit"};
    }
    json["meshes"] = Json::array({json_mesh(scene, buffer)});
    if (!scene.animation.empty()) {
        json["animations"] = Json::array({json_animation(scene, buffer)});
    }
    if (!scene.texture.empty()) {
        json["images"] =
            Json::array({{{"mimeType", mime_type_of(scene.texture)}, {"bufferView", buffer.add_bytes(scene.texture)}}});
        json["samplers"] =
            Json::array({{{"magFilter", 9729}, {"minFilter", 9987}, {"wrapS", 33071}, {"wrapT", 33071}}});
        json["textures"] = Json::array({{{"sampler", 0}, {"source", 0}}});
    }
    return std::move(buffer).to_glb(std::move(json));
}

void save_glb(const std::string& path, const GlbScene& scene)
{
    write_file(path, format_glb(scene));
}

} // namespace lineament
