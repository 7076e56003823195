// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/core/mesh.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <optional>
#include <string>
#include <vector>

namespace lineament {

/// An expression as a morph target: the shape is mesh + sum of weight times offsets.
struct GlbMorphTarget
{
    std::string name = {};
    Eigen::Matrix3Xf offsets = {}; ///< 3 x V, mm.
    double weight = 0.0;           ///< The default weight: the fitted expression.
};

/// One moment of an animation.
struct GlbKeyframe
{
    double time_s = 0.0;          ///< >= 0, rising from keyframe to keyframe (as 32-bit floats too).
    Camera camera = {};           ///< The pose of the head.
    Eigen::VectorXd weights = {}; ///< One per morph target.
};

enum class GlbShading
{
    automatic, ///< Unlit with a texture (which already holds the light of the photo), else lit.
    lit,       ///< Dielectric, fully rough.
    unlit,     ///< KHR_materials_unlit; viewers without it show the lit material.
};

enum class GlbNormals
{
    included,
    omitted, ///< Viewers then shade flat.
};

/// A face to store as binary glTF 2.0.
struct GlbScene
{
    std::string name = "face";
    Mesh mesh = {};           ///< Neutral, mm; colours are used only without a texture.
    std::string texture = {}; ///< Bytes of a PNG or JPEG file; needs uv coordinates.
    std::vector<GlbMorphTarget> morph_targets = {};
    std::optional<Camera> pose = std::nullopt; ///< Of the node, if no animation sets it; empty: model space.
    std::vector<GlbKeyframe> animation = {};
    GlbShading shading = GlbShading::automatic;
    GlbNormals normals = GlbNormals::included;
};

/// The unit quaternion of H = F R, F = diag(1, -1, -1): the head's turn in x right, y up, z towards the camera.
[[nodiscard]] Eigen::Quaterniond glb_rotation(const Camera& camera);

/// The head's place [m] in x right, y up, z towards the camera: 0.001 (tau_x, -tau_y, reference_depth_mm - 1/phi), the
/// last one 0 under scaled orthographic projection.
/// @param reference_depth_mm  1/phi of the pose that gets z = 0.
[[nodiscard]] Eigen::Vector3d glb_translation_m(const Camera& camera, double reference_depth_mm);

/// The scene as a GLB file: metres (mm times 0.001); vertices split where uv indices differ; morph targets stored
/// sparse where that is smaller, their names in `mesh.extras.targetNames`; keyframes at their own times, linear in
/// between; the first keyframe's depth is z = 0. docs/formats.md, "GLB"
/// @throws InvalidArgument on sizes that disagree, an index out of range, a number that is not finite, times that do
/// not
///   rise, a texture that is neither PNG nor JPEG or has no uv coordinates.
[[nodiscard]] std::string format_glb(const GlbScene& scene);

/// format_glb into a file, which is replaced only when all of it is written.
void save_glb(const std::string& path, const GlbScene& scene);

} // namespace lineament
