// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/mesh_file.hpp"

#include "mesh_checks.hpp"
#include "text.hpp"

#include "lineament/core/checks.hpp"
#include "lineament/io/file.hpp"

#include <filesystem>

namespace lineament {

namespace detail {

namespace {

void check_indices(const Eigen::Matrix3Xi& triangles, Eigen::Index count, const char* function, const char* parameter)
{
    if (triangles.cols() > 0) {
        require(triangles.minCoeff() >= 0 && triangles.maxCoeff() < count, function, parameter,
                "indices in 0 to " + std::to_string(count - 1),
                std::to_string(triangles.minCoeff()) + " to " + std::to_string(triangles.maxCoeff()));
    }
}

} // namespace

void check_mesh(const Mesh& mesh, const char* function)
{
    require_finite(mesh.vertices, function, "mesh.vertices");
    require_finite(mesh.uv_coordinates, function, "mesh.uv_coordinates");
    require_finite(mesh.colors, function, "mesh.colors");
    check_indices(mesh.triangles, mesh.vertices.cols(), function, "mesh.triangles");
    check_indices(mesh.uv_triangles, mesh.uv_coordinates.cols(), function, "mesh.uv_triangles");
    if (mesh.uv_triangles.cols() > 0) {
        require_size(mesh.uv_triangles.cols(), mesh.triangles.cols(), function, "mesh.uv_triangles");
    }
    if (mesh.colors.cols() > 0) {
        require_size(mesh.colors.cols(), mesh.vertices.cols(), function, "mesh.colors");
    }
    if (mesh.triangle_groups.size() > 0) {
        require_size(mesh.triangle_groups.size(), mesh.triangles.cols(), function, "mesh.triangle_groups");
        const auto num_names = static_cast<Eigen::Index>(mesh.group_names.size());
        require(mesh.triangle_groups.minCoeff() >= 0 && mesh.triangle_groups.maxCoeff() < num_names, function,
                "mesh.triangle_groups", "indices in 0 to " + std::to_string(num_names - 1),
                std::to_string(mesh.triangle_groups.minCoeff()) + " to " +
                    std::to_string(mesh.triangle_groups.maxCoeff()));
    }
}

Eigen::Index count_degenerate(const Eigen::Matrix3Xi& triangles)
{
    Eigen::Index count = 0;
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        const int a = triangles(0, t), b = triangles(1, t), c = triangles(2, t);
        count += a == b || b == c || c == a ? 1 : 0;
    }
    return count;
}

} // namespace detail

MeshFile load_mesh(const std::string& path)
{
    const std::string bytes = read_text_file(path);
    const bool is_ply = bytes.starts_with("ply\n") || bytes.starts_with("ply\r");
    return is_ply ? parse_ply(bytes, path) : parse_obj(bytes, path);
}

void save_obj(const std::string& path, const Mesh& mesh, const std::string& texture_file)
{
    require(texture_file.find_first_of("/\\\r\n") == std::string::npos, "save_obj", "texture_file", "a plain file name",
            detail::in_quotes(texture_file));
    ObjOptions options;
    if (!texture_file.empty()) {
        const std::filesystem::path material = std::filesystem::path(path).replace_extension(".mtl");
        options.material_file = material.filename().string();
        const std::string text = format_obj(mesh, options);
        write_file(material, format_mtl(texture_file));
        write_file(path, text);
        return;
    }
    write_file(path, format_obj(mesh, options));
}

void save_ply(const std::string& path, const Mesh& mesh, PlyEncoding encoding)
{
    write_file(path, format_ply(mesh, encoding));
}

} // namespace lineament
