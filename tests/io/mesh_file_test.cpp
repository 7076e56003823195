// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/mesh_file.hpp"

#include "lineament/core/error.hpp"
#include "lineament/core/random.hpp"
#include "lineament/io/file.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <clocale>
#include <cmath>
#include <cstring>

namespace lineament {
namespace {

using test::throws;

Mesh colored_face()
{
    const MorphableModel model = test::make_synthetic_face();
    Mesh mesh = model.mesh_of(model.shape.mean);
    Random random(5);
    mesh.colors.resize(3, mesh.num_vertices());
    for (float& value : mesh.colors.reshaped()) {
        value = static_cast<float>(random.index(256)) / 255.0f;
    }
    return mesh;
}

const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";

void expect_same(const std::string& text)
{
    const MeshFile expected = parse_obj(square, "a.obj");
    const MeshFile got = parse_obj(text, "a.obj");
    EXPECT_EQ(got.mesh.vertices, expected.mesh.vertices) << text;
    EXPECT_EQ(got.mesh.triangles, expected.mesh.triangles) << text;
    EXPECT_TRUE(got.warnings.empty()) << text;
}

void expect_refused(const std::string& text, const std::string& place, const std::string& what)
{
    EXPECT_TRUE(throws<IoError>([&] { (void)parse_obj(text, "a.obj"); }, "a.obj:" + place, what)) << text.substr(0, 99);
}

void expect_ply_refused(const std::string& bytes, const std::string& place, const std::string& what)
{
    EXPECT_TRUE(throws<IoError>([&] { (void)parse_ply(bytes, "a.ply"); }, "a.ply:" + place, what))
        << bytes.substr(0, 250);
}

TEST(MeshFile, ObjComesBackBitForBit)
{
    const Mesh mesh = colored_face();
    const MeshFile file = parse_obj(format_obj(mesh, {.material_file = "a.mtl"}), "a.obj");
    EXPECT_EQ(file.mesh.vertices, mesh.vertices);
    EXPECT_EQ(file.mesh.triangles, mesh.triangles);
    EXPECT_EQ(file.mesh.uv_triangles, mesh.uv_triangles);
    EXPECT_THAT(file.mesh.uv_coordinates, test::IsNear(mesh.uv_coordinates, 1e-7)) << "1 - (1 - v) rounds";
    EXPECT_EQ(file.mesh.colors, mesh.colors);
    EXPECT_EQ(file.material_file, "a.mtl");
    EXPECT_TRUE(file.warnings.empty());
    for (Eigen::Index t = 0; t < mesh.num_triangles(); ++t) {
        EXPECT_EQ(file.mesh.group_names.at(file.mesh.triangle_groups[t]), mesh.group_names.at(mesh.triangle_groups[t]));
    }
}

TEST(MeshFile, PlyComesBackBitForBitInBothEncodings)
{
    const Mesh mesh = colored_face();
    for (const PlyEncoding encoding : {PlyEncoding::binary, PlyEncoding::ascii}) {
        const MeshFile file = parse_ply(format_ply(mesh, encoding), "a.ply");
        EXPECT_EQ(file.mesh.vertices, mesh.vertices);
        EXPECT_EQ(file.mesh.triangles, mesh.triangles);
        EXPECT_THAT(file.mesh.colors, test::IsNear(mesh.colors, 1e-7));
        EXPECT_TRUE(file.warnings.empty());
    }
}

TEST(MeshFile, SavedFilesAreReadByContent)
{
    test::TemporaryFolder folder;
    const Mesh mesh = colored_face();
    save_obj(folder / "a.obj", mesh, "texture.png");
    save_ply(folder / "b.obj", mesh);
    EXPECT_EQ(load_mesh(folder / "a.obj").mesh.vertices, mesh.vertices);
    EXPECT_EQ(load_mesh(folder / "a.obj").material_file, "a.mtl");
    EXPECT_EQ(load_mesh(folder / "b.obj").mesh.triangles, mesh.triangles);
    EXPECT_THAT(read_text_file(folder / "a.mtl"), testing::HasSubstr("map_Kd texture.png"));
    save_obj(folder / "c.obj", mesh);
    EXPECT_FALSE(std::filesystem::exists(folder / "c.mtl"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { save_obj(folder / "d.obj", mesh, "../t.png"); }, "plain file name"));
    EXPECT_TRUE(throws<IoError>([&] { (void)load_mesh(folder.path().string()); }, folder.path().string()));
}

TEST(MeshFile, ObjFlipsVOfUv)
{
    Mesh mesh = parse_obj(square, "a.obj").mesh;
    mesh.uv_coordinates = Eigen::Matrix2Xf{{0.25f}, {0.125f}};
    mesh.uv_triangles = Eigen::Matrix3Xi::Zero(3, 2);
    EXPECT_THAT(format_obj(mesh), testing::HasSubstr("vt 0.25 0.875\n"));
}

TEST(MeshFile, LegalVariantsOfObjReadTheSame)
{
    expect_same("\xef\xbb\xbf" + square);
    expect_same("v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\nf 1 2 3\r\nf 1 3 4");
    expect_same("v 0 0 0\rv 1 0 0\rv 1 1 0\rv 0 1 0\rf 1 2 3\rf 1 3 4\r");
    expect_same("v\t0 \t 0 0\n v 1 0 0 \n\n\nv +1 1e0 0.\nv -0 1.0 0 # end\n#f 9 9 9\nf 1 2 3\nf 1 3 4\n");
    expect_same("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2\nf -4 -2 -1\n");
    expect_same("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
    expect_same("v 0 \\\n0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 \\\r\n3 \\\n 4\n");
    expect_same("v 0 0 0 1\nv 1 0 0 1.0\nv 1 1 0 1\nv 0 1 0 1\nvn 0 0 1\nf 1//1 2//1 3//-1\ns off\nf 1//1 3//1 4//1\n");
    EXPECT_EQ(parse_obj("v 1e-42 1e-60 -3.4028235e38\n", "a.obj").mesh.vertices(0, 0), 1e-42f);
}

TEST(MeshFile, BrokenObjIsRefusedWithLineAndColumn)
{
    const std::string head = "v 0 0 0\nv 1 0 0\nv 1 1 0\n";
    expect_refused("", "", "empty");
    expect_refused("# only a comment\n", "", "no vertices");
    expect_refused(head + "f 0 1 2\n", "4:3", "allowed 1..3, -3..-1");
    expect_refused(head + "f 1 2 9999\n", "4:7", "\"9999\" is out of range");
    expect_refused(head + "f 1 -9999 2\n", "4:5", "out of range");
    expect_refused(head + "f 1 2 2147483647\n", "4:7", "out of range");
    expect_refused(head + "f 1 2 99999999999999999999\n", "4:7", "out of range");
    expect_refused(head + "f 1 2 x\n", "4:7", "\"x\"");
    expect_refused(head + "f 1/2/3/4 2 3\n", "4:3", "vertex/uv/normal");
    expect_refused(head + "f 1/1 2/1 3/1\n", "4:5", "uv index");
    expect_refused(head + "f 1//1 2//1 3//1\n", "4:6", "normal index");
    expect_refused(head + "f 1/ 2/ 3/\n", "4:5", "uv index");
    expect_refused(head + "f 1 2\n", "4:1", "at least 3 corners, found 2");
    expect_refused(head + "f\n", "4:1", "found 0");
    expect_refused(head + "f 1 \\\n 2 \\\n 99\n", "6:2", "\"99\"");
    expect_refused("v nan 0 0\n", "1:3", "\"nan\"");
    expect_refused("v 0 inf 0\n", "1:5", "\"inf\"");
    expect_refused("v 0 0 1e999\n", "1:7", "\"1e999\"");
    expect_refused("v 0 0 1e39\n", "1:7", "\"1e39\"");
    expect_refused("v " + std::string(1000, '9') + " 0 0\n", "1:3", "...\"");
    expect_refused("v " + std::string(2000000, '9') + " 0 0\n", "1:1", "1 MB");
    expect_refused("v 1,5 0,5 0,5\n", "1:3", "decimal comma");
    expect_refused("v 1 2\n", "1:1", "found 2 numbers");
    expect_refused("v 1 2 3 4 5\n", "1:1", "found 5 numbers");
    expect_refused("v 1 2 3 4 5 6 7 8\n", "1:17", "more than 7");
    expect_refused("v a b c\n", "1:3", "\"a\"");
    expect_refused("v 1abc 0 0\n", "1:3", "\"1abc\"");
    expect_refused("v 0x10 0 0\n", "1:3", "\"0x10\"");
    expect_refused(std::string("v 0\0 0 0\n", 9), "1:4", "zero byte");
    expect_refused(std::string("\xff\xfev\0", 4), "byte 0x0", "UTF-16");
    expect_refused("vt x\nv 0 0 0\n", "1:4", "u coordinate");
    expect_refused("<!DOCTYPE html><html></html>", "", "web page");
    expect_refused("version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 9\n", "", "git lfs pull");
}

TEST(MeshFile, OddButReadableObjWarns)
{
    const auto warnings_of = [](const std::string& text) {
        std::string all;
        for (const std::string& warning : parse_obj(text, "a.obj").warnings) {
            all += warning + "\n";
        }
        return all;
    };
    EXPECT_THAT(warnings_of("v 0 0 0\n"), testing::HasSubstr("no faces"));
    EXPECT_THAT(warnings_of("v 0 0 0\nf 1 1 1\n"), testing::HasSubstr("1 triangles use a vertex twice"));
    EXPECT_THAT(warnings_of("v 0 0 0 1 0 0\nv 0 0 0\nv 0 1 0\nf 1 2 3\n"), testing::HasSubstr("colours ignored"));
    EXPECT_THAT(warnings_of("v 0 0 0\nv 0 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2 3/1\n"), testing::HasSubstr("uv (0, 0)"));
    for (const char* name : {"../../../etc/passwd", "/etc/passwd", "a\\b.mtl", "..", "file:x", ""}) {
        const MeshFile file = parse_obj(std::string("mtllib ") + name + "\nv 0 0 0\n", "a.obj");
        EXPECT_EQ(file.material_file, "");
        EXPECT_THAT(file.warnings.at(0), testing::HasSubstr("not in the folder"));
    }
}

TEST(MeshFile, EveryCutOfAPlyFileIsRefused)
{
    Mesh mesh = parse_obj(square, "a.obj").mesh;
    for (const PlyEncoding encoding : {PlyEncoding::binary, PlyEncoding::ascii}) {
        const std::string whole = format_ply(mesh, encoding);
        const std::size_t ends = encoding == PlyEncoding::ascii ? 2 : 0; // the last digit, the last line end
        for (std::size_t size = 0; size + ends < whole.size(); ++size) {
            const std::vector<char> exact(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
            EXPECT_TRUE(throws<IoError>(
                [&] {
                    (void)parse_ply({exact.data(), exact.size()}, "a.ply");
                },
                "a.ply"))
                << size;
        }
    }
}

TEST(MeshFile, BrokenPlyIsRefusedWithItsPlace)
{
    const std::string start = "ply\nformat ascii 1.0\n";
    const std::string vertices = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    const std::string faces = "element face 1\nproperty list uchar int vertex_indices\n";
    const std::string head = start + vertices + faces + "end_header\n0 0 0\n1 0 0\n0 1 0\n";
    EXPECT_EQ(parse_ply(head + "3 0 1 2\n", "a.ply").mesh.num_triangles(), 1);
    EXPECT_EQ(parse_ply(head + "4 0 1 2 0\n", "a.ply").mesh.num_triangles(), 2);
    expect_ply_refused(start + vertices + faces, "8", "end_header");
    expect_ply_refused("ply\n" + vertices + "end_header\n", "6", "format");
    expect_ply_refused("ply\nformat ascii 1.1\n", "2", "1.0");
    expect_ply_refused("ply\nformat text 1.0\n", "2", "\"text\"");
    expect_ply_refused(start + "element vertex 4294967295\nproperty float x\nend_header\n", "3", "COUNT");
    expect_ply_refused(start + "element vertex 429496729\nproperty float x\nproperty float y\nproperty float z\n"
                               "end_header\n0 0 0\n",
                       "3", "announces 429496729");
    expect_ply_refused(start + "element vertex 3\nend_header\n", "3", "announces");
    expect_ply_refused(start + "element vertex -1\n", "3", "COUNT");
    expect_ply_refused(start + "element vertex 1\nproperty real x\n", "4", "\"real\"");
    expect_ply_refused(start + "element vertex 1\nproperty float x\nproperty float x\n", "5", "twice");
    expect_ply_refused(start + vertices + vertices, "7", "twice");
    expect_ply_refused(start + "property float x\n", "3", "before its properties");
    expect_ply_refused(start + "element vertex 1\nproperty list float int x\n", "4", "integer type");
    expect_ply_refused(start + "element vertex 1\nproperty float x\nproperty float y\nend_header\n0 0\n", "3",
                       "x, y and z");
    expect_ply_refused(start + vertices +
                           "element face 1\nproperty list uchar float vertex_indices\nend_header\n0 0 0\n"
                           "1 0 0\n0 1 0\n3 0 1 2\n",
                       "8", "integers vertex_indices");
    expect_ply_refused(head + "255 0 1 2\n", "13:", "end of the line");
    expect_ply_refused(head + "3 0 1 2 7\n", "13:9", "no more values");
    expect_ply_refused(head + "3 0 1 -1\n", "13:7", "allowed 0..2");
    expect_ply_refused(head + "3 0 1 3\n", "13:7", "out of range");
    expect_ply_refused(head + "2 0 1\n", "13:", "at least 3");
    expect_ply_refused(head + "-1 0 1\n", "13:1", ">= 0");
    expect_ply_refused(head + "3 0 1 1.5\n", "13:7", "integer");
    expect_ply_refused(start + vertices + "end_header\n0 0 0\n1 nan 0\n0 1 0\n", "9:3", "\"nan\"");
    expect_ply_refused(start + vertices + "end_header\n0 0 0\n1 1,5 0\n0 1 0\n", "9:3", "decimal comma");
    expect_ply_refused(start + vertices + std::string("end_header\n\1\2\3\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0", 29),
                       "8:", "finite");
    expect_ply_refused(start + "element vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
                       "", "no vertices");
    expect_ply_refused("plyx\n", "1", "\"ply\"");
}

TEST(MeshFile, BinaryPlyOfEitherByteOrderReadsTheSame)
{
    const std::string elements = " 1.0\nelement vertex 1\nproperty double x\nproperty short y\nproperty uint z\n"
                                 "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                                 "element edge 1\nproperty list uchar ushort skipped\nend_header\r\n";
    const std::string little = std::string("\0\0\0\0\0\0\xf8\x3f\xfe\xff\1\1\0\0\xff\0\x33\1\7\7", 20);
    const std::string big = std::string("\x3f\xf8\0\0\0\0\0\0\xff\xfe\0\0\1\1\xff\0\x33\1\7\7", 20);
    const Mesh a = parse_ply("ply\r\nformat binary_little_endian" + elements + little, "a.ply").mesh;
    const Mesh b = parse_ply("ply\nformat binary_big_endian" + elements + big, "a.ply").mesh;
    EXPECT_EQ(a.vertices, (Eigen::Matrix3Xf{{1.5f}, {-2.0f}, {257.0f}}));
    EXPECT_EQ(b.vertices, a.vertices);
    EXPECT_THAT(a.colors, test::IsNear(Eigen::Matrix3Xf{{1.0f}, {0.0f}, {0.2f}}, 1e-6));
    EXPECT_EQ(b.colors, a.colors);
}

TEST(MeshFile, BinaryPlyWithNotANumberIsRefused)
{
    Mesh mesh = parse_obj(square, "a.obj").mesh;
    std::string bytes = format_ply(mesh);
    const std::size_t body = bytes.find("end_header\n") + 11;
    const float bad = std::nanf("");
    std::memcpy(bytes.data() + body + 16, &bad, 4);
    expect_ply_refused(bytes, "byte 0x", "finite");
}

TEST(MeshFile, WritersRefuseMeshesThatAreNotSane)
{
    const auto refused = [](const Mesh& mesh, const char* parameter) {
        EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_obj(mesh); }, parameter));
        EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_ply(mesh); }, parameter));
    };
    const Mesh good = colored_face();
    Mesh mesh = good;
    mesh.vertices(1, 2) = std::nanf("");
    refused(mesh, "mesh.vertices(1, 2)");
    mesh = good;
    mesh.triangles(0, 0) = static_cast<int>(mesh.num_vertices());
    refused(mesh, "mesh.triangles");
    mesh = good;
    mesh.uv_triangles(0, 0) = -1;
    refused(mesh, "mesh.uv_triangles");
    mesh = good;
    mesh.triangle_groups[0] = 99;
    refused(mesh, "mesh.triangle_groups");
    mesh = good;
    mesh.colors = mesh.colors.leftCols(2).eval();
    refused(mesh, "mesh.colors");
}

TEST(MeshFile, LocaleWithDecimalCommaChangesNothing)
{
    const std::string before = std::setlocale(LC_ALL, nullptr);
    if (std::setlocale(LC_ALL, "de_DE.UTF-8") == nullptr && std::setlocale(LC_ALL, "de_DE.utf8") == nullptr) {
        GTEST_SKIP() << "the locale de_DE.UTF-8 is not installed";
    }
    const Mesh mesh = parse_obj("v 1.5 0.25 -0.125\n", "a.obj").mesh;
    const std::string text = format_obj(mesh);
    std::setlocale(LC_ALL, before.c_str());
    EXPECT_EQ(mesh.vertices, (Eigen::Matrix3Xf{{1.5f}, {0.25f}, {-0.125f}}));
    EXPECT_THAT(text, testing::HasSubstr("v 1.5 0.25 -0.125\n"));
}

TEST(MeshFile, RealMeshesAreRead)
{
    LINEAMENT_REQUIRE_REAL_DATA("scans/meshmonk_demo/DemoFace_10K.obj");
    struct Expected
    {
        const char* path;
        Eigen::Index num_vertices;
        Eigen::Index num_triangles;
        Eigen::Index num_uv;
    };
    for (const Expected& expected : {Expected{"scans/meshmonk_demo/DemoFace_10K.obj", 10000, 18324, 0},
                                     Expected{"scans/lee_perry_smith/lps.obj", 8844, 17684, 9223},
                                     Expected{"scans/flame_fitting/scan.obj", 47653, 94445, 0},
                                     Expected{"scans/nricp/faceTarget.obj", 2634, 5231, 0},
                                     Expected{"models/mediapipe/canonical_face_model.obj", 468, 898, 468}}) {
        const MeshFile file = load_mesh((test::real_data_folder() / expected.path).string());
        EXPECT_EQ(file.mesh.num_vertices(), expected.num_vertices) << expected.path;
        EXPECT_EQ(file.mesh.num_triangles(), expected.num_triangles) << expected.path;
        EXPECT_EQ(file.mesh.uv_coordinates.cols(), expected.num_uv) << expected.path;
        EXPECT_EQ(parse_obj(format_obj(file.mesh), "again").mesh.vertices, file.mesh.vertices) << expected.path;
    }
}

} // namespace
} // namespace lineament
