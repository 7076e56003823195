// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/mesh.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace lineament {

/// What was read from a mesh file. The mesh is sane: every number finite, every index in range.
struct MeshFile
{
    Mesh mesh = {};                         ///< In the file's own unit and axes; polygons split into triangle fans.
    std::string material_file = {};         ///< OBJ: the name after `mtllib`; never opened.
    std::vector<std::string> warnings = {}; ///< What was odd but could be read, one sentence each.
};

/// The mesh in the text of a Wavefront OBJ file: v (with optional colour), vt, f, g, o, usemtl; other lines are
/// skipped. uv coordinates are flipped to v down. Groups are those of `g` or `o` if there are any, else of `usemtl`.
/// @throws IoError with line:column for a bad number, a bad or out-of-range index, a face of fewer than three corners.
[[nodiscard]] MeshFile parse_obj(std::string_view text, const std::string& path);

/// The mesh in the bytes of a PLY file, ascii or binary of either byte order: vertices x y z, optional red green blue,
/// and faces with vertex_indices (or vertex_index). Other elements and properties are skipped.
/// @throws IoError with the header line or byte offset for a header or data that break the format.
[[nodiscard]] MeshFile parse_ply(std::string_view bytes, const std::string& path);

/// parse_ply if the content starts with "ply", else parse_obj.
[[nodiscard]] MeshFile load_mesh(const std::string& path);

struct ObjOptions
{
    std::string material_file = {}; ///< Written as `mtllib`, if not empty; a plain file name.
};

/// The mesh as OBJ text: mm, vt with v up, one `g` per triangle group, vertex colours after the coordinates.
/// Numbers are the shortest that read back to the same float. Uses "face" as material if there is a material file.
/// @throws InvalidArgument on an index out of range, sizes that disagree or a number that is not finite.
[[nodiscard]] std::string format_obj(const Mesh& mesh, const ObjOptions& options = {});

/// The text of a material file with the material "face", textured with the picture of that name if it is not empty.
[[nodiscard]] std::string format_mtl(const std::string& texture_file);

/// Writes the mesh; with a texture file name also `<stem>.mtl` beside it, which refers to that picture.
/// @param texture_file  A plain file name in the folder of `path`, or empty.
void save_obj(const std::string& path, const Mesh& mesh, const std::string& texture_file = {});

enum class PlyEncoding
{
    binary, ///< Little-endian.
    ascii,
};

/// The mesh as PLY: mm, float coordinates, colours as 8-bit sRGB. PLY has no seams, so uv coordinates are left out.
/// @throws InvalidArgument as format_obj.
[[nodiscard]] std::string format_ply(const Mesh& mesh, PlyEncoding encoding = PlyEncoding::binary);

void save_ply(const std::string& path, const Mesh& mesh, PlyEncoding encoding = PlyEncoding::binary);

} // namespace lineament
