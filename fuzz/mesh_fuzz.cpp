// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Hostile OBJ and PLY files: a mesh that is accepted is sane, and comes back from our own files as it was.
#include "lineament/core/error.hpp"
#include "lineament/io/mesh_file.hpp"

#include <cstdlib>
#include <string_view>
#include <vector>

namespace {

using namespace lineament;

void expect_same(const Mesh& mesh, const Mesh& again)
{
    if (mesh.vertices != again.vertices || mesh.triangles != again.triangles) {
        std::abort();
    }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    const std::vector<char> bytes(data, data + size); // a block of exact size
    const std::string_view file(bytes.data(), bytes.size());
    MeshFile read;
    try {
        read = file.starts_with("ply") ? parse_ply(file, "fuzz") : parse_obj(file, "fuzz");
    } catch (const IoError&) {
        return 0;
    }
    // The writers throw InvalidArgument, which nothing catches here, unless the mesh is sane.
    expect_same(read.mesh, parse_obj(format_obj(read.mesh), "again").mesh);
    expect_same(read.mesh, parse_ply(format_ply(read.mesh), "again").mesh);
    expect_same(read.mesh, parse_ply(format_ply(read.mesh, PlyEncoding::ascii), "again").mesh);
    return 0;
}
