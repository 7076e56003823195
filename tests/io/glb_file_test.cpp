// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/glb_file.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/core/error.hpp"
#include "lineament/core/random.hpp"
#include "lineament/io/file.hpp"

#include "support/gltf_validator.hpp"
#include "support/matchers.hpp"
#include "support/parsed_glb.hpp"
#include "support/synthetic_face.hpp"

#include <Eigen/Dense>
#include <nlohmann/json.hpp>

#include <array>
#include <cmath>
#include <set>

namespace lineament {
namespace {

using nlohmann::json;
using test::ParsedGlb;
using test::throws;

// A grey PNG picture of one pixel.
std::string png()
{
    const std::array<unsigned char, 67> bytes = {
        0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00,
        0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x00, 0x00, 0x00, 0x00, 0x3a, 0x7e, 0x9b, 0x55, 0x00,
        0x00, 0x00, 0x0a, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x68, 0x00, 0x00, 0x00, 0x82, 0x00, 0x81,
        0x77, 0xcd, 0x72, 0xb6, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
    return {bytes.begin(), bytes.end()};
}

Camera camera_at(double yaw_deg, double x_mm, double y_mm, double phi_per_mm = 0.0)
{
    Camera camera;
    camera.camera_from_model = rotation_from_angles({radians(yaw_deg), radians(5.0), radians(-10.0)});
    camera.translation_mm = {x_mm, y_mm};
    camera.phi_per_mm = phi_per_mm;
    return camera;
}

// A face with a seam, a sparse, a full and an empty morph target.
GlbScene make_scene()
{
    const MorphableModel model = test::make_synthetic_face();
    GlbScene scene;
    scene.name = "person";
    scene.mesh = model.mesh_of(model.shape.mean);
    // A seam: one triangle gets uv points of its own.
    const Eigen::Index num_uv = scene.mesh.uv_coordinates.cols();
    scene.mesh.uv_coordinates.conservativeResize(2, num_uv + 3);
    for (int corner = 0; corner < 3; ++corner) {
        scene.mesh.uv_coordinates.col(num_uv + corner) = Eigen::Vector2f(0.25f * static_cast<float>(corner), 0.5f);
        scene.mesh.uv_triangles(corner, 7) = static_cast<int>(num_uv) + corner;
    }
    Eigen::Matrix3Xf offsets = Eigen::Matrix3Xf::Zero(3, scene.mesh.num_vertices());
    offsets.col(5) << 1.0f, -2.0f, 3.0f;
    offsets.col(9) << 0.0f, 0.0f, -4.0f;
    scene.morph_targets.push_back({"sparse", offsets, 0.25});
    scene.morph_targets.push_back({"full", Eigen::Matrix3Xf::Constant(3, scene.mesh.num_vertices(), 2.0f), 0.0});
    scene.morph_targets.push_back({"empty", Eigen::Matrix3Xf::Zero(3, scene.mesh.num_vertices()), 1.0});
    scene.texture = png();
    return scene;
}

GlbScene make_animated_scene()
{
    GlbScene scene = make_scene();
    for (int f = 0; f < 4; ++f) {
        scene.animation.push_back({0.5 + 0.04 * f * f, camera_at(100.0 * f, 10.0 + f, -20.0, 0.001 * (1 + f)),
                                   Eigen::Vector3d(0.1 * f, 0.5, 0.0)});
    }
    return scene;
}

TEST(GlbFile, EachCornerKeepsItsPointAndItsUv)
{
    const GlbScene scene = make_scene();
    const ParsedGlb glb(format_glb(scene));
    const json& primitive = glb.gltf["meshes"][0]["primitives"][0];
    const Eigen::MatrixXd positions = glb.accessor(primitive["attributes"]["POSITION"]);
    const Eigen::MatrixXd uv = glb.accessor(primitive["attributes"]["TEXCOORD_0"]);
    const Eigen::MatrixXd indices = glb.accessor(primitive["indices"]);
    ASSERT_EQ(indices.cols(), 3 * scene.mesh.num_triangles());
    ASSERT_EQ(uv.cols(), positions.cols());
    std::set<std::pair<int, int>> pairs;
    for (Eigen::Index i = 0; i < indices.cols(); ++i) {
        const auto at = static_cast<Eigen::Index>(indices(0, i));
        const int vertex = scene.mesh.triangles(i % 3, i / 3);
        const int uv_point = scene.mesh.uv_triangles(i % 3, i / 3);
        pairs.emplace(vertex, uv_point);
        ASSERT_THAT(positions.col(at), test::IsNear(0.001 * scene.mesh.vertices.col(vertex).cast<double>(), 1e-8));
        ASSERT_EQ(uv.col(at), scene.mesh.uv_coordinates.col(uv_point).cast<double>());
    }
    EXPECT_EQ(positions.cols(), static_cast<Eigen::Index>(pairs.size())) << "split at the seam and nowhere else";
    EXPECT_TRUE(glb.gltf["accessors"][primitive["attributes"]["POSITION"].get<int>()].contains("min"));
    const Eigen::MatrixXd normals = glb.accessor(primitive["attributes"]["NORMAL"]);
    EXPECT_THAT(normals.colwise().norm(), test::IsNear(Eigen::RowVectorXd::Ones(normals.cols()), 1e-5));
    EXPECT_EQ(glb.view_bytes(glb.gltf["images"][0]["bufferView"]), scene.texture);
    EXPECT_EQ(glb.gltf["images"][0]["mimeType"], "image/png");
}

TEST(GlbFile, MorphTargetsKeepNamesWeightsAndOffsets)
{
    const GlbScene scene = make_scene();
    const ParsedGlb glb(format_glb(scene));
    const json& mesh = glb.gltf["meshes"][0];
    EXPECT_EQ(mesh["extras"]["targetNames"], json::array({"sparse", "full", "empty"}));
    EXPECT_EQ(mesh["weights"], json::array({0.25, 0.0, 1.0}));
    const json& primitive = mesh["primitives"][0];
    ASSERT_EQ(primitive["targets"].size(), 3u);
    const Eigen::MatrixXd indices = glb.accessor(primitive["indices"]);
    for (std::size_t k = 0; k < 3; ++k) {
        const json& accessor = glb.gltf["accessors"][primitive["targets"][k]["POSITION"].get<int>()];
        EXPECT_EQ(accessor.contains("bufferView"), k == 1) << "only the full one is stored whole";
        EXPECT_EQ(accessor.contains("sparse"), k == 0);
        const Eigen::MatrixXd offsets = glb.accessor(primitive["targets"][k]["POSITION"]);
        for (Eigen::Index i = 0; i < indices.cols(); ++i) {
            const int vertex = scene.mesh.triangles(i % 3, i / 3);
            ASSERT_THAT(offsets.col(static_cast<Eigen::Index>(indices(0, i))),
                        test::IsNear(0.001 * scene.morph_targets[k].offsets.col(vertex).cast<double>(), 1e-9));
        }
    }
}

TEST(GlbFile, NodeTurnsAndMovesTheHeadAsTheCameraSeesIt)
{
    const Camera camera = camera_at(30.0, 12.0, -7.0);
    const Eigen::Vector3d point(20.0, -30.0, 50.0);
    const Eigen::Vector3d seen = camera.in_camera(point);
    // Camera space with y and z reversed, in metres, is glTF's space.
    const Eigen::Vector3d moved = glb_rotation(camera) * (0.001 * point) + glb_translation_m(camera, 0.0);
    EXPECT_THAT(moved, test::IsNear(0.001 * Eigen::Vector3d(seen.x(), -seen.y(), -seen.z()), 1e-12));

    GlbScene scene = make_scene();
    EXPECT_FALSE(ParsedGlb(format_glb(scene)).gltf["nodes"][0].contains("rotation"));
    scene.pose = camera;
    const json node = ParsedGlb(format_glb(scene)).gltf["nodes"][0];
    const Eigen::Quaterniond expected = glb_rotation(camera);
    for (int i = 0; i < 4; ++i) {
        EXPECT_NEAR(node["rotation"][i].get<double>(), expected.coeffs()[i], 1e-7);
    }
    EXPECT_NEAR(node["translation"][0].get<double>(), 0.012, 1e-8);
    EXPECT_NEAR(node["translation"][1].get<double>(), 0.007, 1e-8);
    EXPECT_EQ(node["translation"][2].get<double>(), 0.0);
}

TEST(GlbFile, AnimationHasTheTrueTimesPosesAndWeights)
{
    const GlbScene scene = make_animated_scene();
    const ParsedGlb glb(format_glb(scene));
    const json& animation = glb.gltf["animations"][0];
    ASSERT_EQ(animation["channels"].size(), 3u);
    for (const json& channel : animation["channels"]) {
        const json& sampler = animation["samplers"][channel["sampler"].get<int>()];
        const Eigen::MatrixXd times = glb.accessor(sampler["input"]);
        const Eigen::MatrixXd values = glb.accessor(sampler["output"]);
        const std::string path = channel["target"]["path"];
        ASSERT_EQ(times.cols(), 4);
        for (Eigen::Index f = 0; f < 4; ++f) {
            const GlbKeyframe& keyframe = scene.animation[static_cast<std::size_t>(f)];
            EXPECT_NEAR(times(0, f), keyframe.time_s, 1e-7);
            if (path == "rotation") {
                const Eigen::Quaterniond expected = glb_rotation(keyframe.camera);
                EXPECT_NEAR(std::abs(values.col(f).dot(expected.coeffs())), 1.0, 1e-6);
                EXPECT_TRUE(f == 0 || values.col(f).dot(values.col(f - 1)) > 0.0) << "the short way";
            } else if (path == "translation") {
                const double depth_mm = 1000.0 / static_cast<double>(f + 1);
                EXPECT_THAT(values.col(f), test::IsNear(Eigen::Vector3d(0.001 * (10.0 + static_cast<double>(f)), 0.020,
                                                                        0.001 * (1000.0 - depth_mm)),
                                                        1e-6))
                    << "a nearer face has a larger z";
            } else {
                EXPECT_EQ(path, "weights");
                ASSERT_EQ(values.cols(), 12);
                EXPECT_NEAR(values(0, 3 * f), 0.1 * static_cast<double>(f), 1e-7);
                EXPECT_NEAR(values(0, 3 * f + 1), 0.5, 1e-7);
            }
        }
    }
}

TEST(GlbFile, ColoursAreLinearAndOnlyThereWithoutTexture)
{
    GlbScene scene = make_scene();
    scene.mesh.colors = Eigen::Matrix3Xf::Constant(3, scene.mesh.num_vertices(), 0.5f);
    EXPECT_FALSE(ParsedGlb(format_glb(scene)).gltf["meshes"][0]["primitives"][0]["attributes"].contains("COLOR_0"));
    EXPECT_TRUE(ParsedGlb(format_glb(scene)).gltf["materials"][0]["extensions"].contains("KHR_materials_unlit"));
    scene.texture.clear();
    const ParsedGlb glb(format_glb(scene));
    EXPECT_NEAR(glb.accessor(glb.gltf["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"])(0, 0), 0.2140411, 1e-6);
    EXPECT_FALSE(glb.gltf.contains("extensionsUsed")) << "a face without texture is lit";
}

TEST(GlbFile, ManyVerticesGet32BitIndices)
{
    for (const int count : {65535, 65536}) {
        GlbScene scene;
        scene.mesh.vertices = Eigen::Matrix3Xf::Random(3, count);
        scene.mesh.triangles = Eigen::Matrix3Xi{{0}, {1}, {count - 1}};
        const ParsedGlb glb(format_glb(scene));
        const json& index = glb.gltf["meshes"][0]["primitives"][0]["indices"];
        EXPECT_EQ(glb.gltf["accessors"][index.get<int>()]["componentType"], count == 65535 ? 5123 : 5125);
        EXPECT_EQ(glb.accessor(index)(0, 2), count - 1);
    }
}

TEST(GlbFile, BrokenScenesAreRefused)
{
    const auto refused = [](const auto& change, const char* what) {
        GlbScene scene = make_animated_scene();
        change(scene);
        EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_glb(scene); }, what));
    };
    refused([](GlbScene& s) { s.mesh.triangles(0, 0) = -1; }, "mesh.triangles");
    refused([](GlbScene& s) { s.mesh.vertices(0, 0) = std::nanf(""); }, "mesh.vertices");
    refused(
        [](GlbScene& s) {
            s.mesh = Mesh{};
            s.texture.clear();
            s.morph_targets.clear();
            s.animation.clear();
        },
        "at least one triangle");
    refused([](GlbScene& s) { s.morph_targets[1].offsets.conservativeResize(3, 2); }, "morph_targets.offsets");
    refused([](GlbScene& s) { s.morph_targets[0].offsets(1, 1) = INFINITY; }, "morph_targets.offsets");
    refused([](GlbScene& s) { s.morph_targets[0].weight = NAN; }, "morph_targets.weight");
    refused([](GlbScene& s) { s.texture = "GIF89a"; }, "PNG or JPEG");
    refused([](GlbScene& s) { s.mesh.uv_triangles.resize(3, 0); }, "uv for the texture");
    refused([](GlbScene& s) { s.animation[1].time_s = s.animation[0].time_s; }, "rising times");
    refused([](GlbScene& s) { s.animation[1].time_s = s.animation[0].time_s + 1e-12; }, "rising times");
    refused([](GlbScene& s) { s.animation[0].time_s = -1.0; }, "rising times");
    refused([](GlbScene& s) { s.animation[2].weights.conservativeResize(2); }, "animation.weights");
    refused([](GlbScene& s) { s.animation[2].weights[0] = NAN; }, "animation.weights");
    refused([](GlbScene& s) { s.animation[2].camera.camera_from_model *= 2.0; }, "a rotation");
    refused([](GlbScene& s) { s.animation[2].camera.camera_from_model(0, 0) = NAN; }, "camera_from_model");
    refused([](GlbScene& s) { s.animation[2].camera.phi_per_mm = -1.0; }, "phi_per_mm");
}

// What the validator prints for the bytes.
std::string validate(const std::string& bytes)
{
    const test::TemporaryFolder folder;
    write_file(folder / "scene.glb", bytes);
    return test::validate_glb(folder / "scene.glb");
}

TEST(GlbFile, KhronosValidatorFindsNothing)
{
    LINEAMENT_REQUIRE_GLTF_VALIDATOR();
    GlbScene posed = make_scene();
    posed.pose = camera_at(40.0, 3.0, 4.0, 0.002);
    posed.shading = GlbShading::lit;
    GlbScene plain = make_scene();
    plain.texture.clear();
    plain.mesh.colors = Eigen::Matrix3Xf::Constant(3, plain.mesh.num_vertices(), 0.5f);
    plain.normals = GlbNormals::omitted;
    GlbScene bare = make_animated_scene();
    bare.mesh.uv_triangles.resize(3, 0);
    bare.texture.clear();
    bare.morph_targets.clear();
    for (GlbKeyframe& keyframe : bare.animation) {
        keyframe.weights.resize(0);
    }
    for (const GlbScene& scene : {make_scene(), make_animated_scene(), posed, plain, bare}) {
        EXPECT_THAT(validate(format_glb(scene)), testing::HasSubstr("errors 0 warnings 0\n"));
    }
    std::string broken = format_glb(make_scene());
    broken.replace(broken.find("\"VEC2\""), 6, "\"VEC3\"");
    EXPECT_THAT(validate(broken), testing::Not(testing::HasSubstr("errors 0")));
}

} // namespace
} // namespace lineament
