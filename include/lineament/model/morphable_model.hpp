// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/mesh.hpp"
#include "lineament/model/blendshapes.hpp"
#include "lineament/model/landmark_map.hpp"
#include "lineament/model/pca_model.hpp"

#include <Eigen/Core>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace lineament {

/// One resolution of a model. Its vertices are the leading `num_vertices` of the model's, its triangles are its own.
struct Level
{
    int num_vertices = 0;
    Eigen::Matrix3Xi triangles = {};      ///< 3 x T.
    Eigen::VectorXi triangle_groups = {}; ///< T, index into MorphableModel::triangle_group_names.
    Eigen::Matrix3Xi uv_triangles = {};   ///< 3 x T, index into MorphableModel::uv_coordinates.
};

/// A 3D morphable face model, with everything a fit needs.
///
///   S(a, psi) = mean + B a + D psi                                                        docs/maths.md, Eq. (1)
///
/// Model space: right-handed, mm, y up, z out of the face, x to the subject's left, origin at the centroid of the
/// mean's vertices.
struct MorphableModel
{
    std::string name = {};
    std::string license = {};
    std::string provenance = {};
    PcaModel shape = {};
    std::optional<PcaModel> color = std::nullopt; ///< Per-vertex sRGB colour, entries in [0, 1].
    std::vector<Blendshapes> expression_sets = {};
    std::vector<Level> levels = {};                     ///< Coarse to fine; the last holds all vertices.
    std::vector<std::string> triangle_group_names = {}; ///< "skin", "eyes", "mouth_interior".
    Eigen::Matrix2Xf uv_coordinates = {};               ///< 2 x U, [0, 1]^2, v down.
    std::vector<LandmarkMap> landmark_maps = {};
    std::vector<int> contour_left = {};                ///< Candidate vertices, subject's left, ear to chin.
    std::vector<int> contour_right = {};               ///< Candidate vertices, subject's right, ear to chin.
    Eigen::VectorXi mirror = {};                       ///< V: vertex i's left-right partner.
    std::map<std::string, Eigen::VectorXf> masks = {}; ///< Region -> V weights in [0, 1].

    [[nodiscard]] Eigen::Index num_vertices() const { return shape.num_vertices(); }

    /// The expression set of that name, or nullptr.
    [[nodiscard]] const Blendshapes* find_expression_set(const std::string& set_name) const
    {
        for (const Blendshapes& set : expression_sets) {
            if (set.name == set_name) {
                return &set;
            }
        }
        return nullptr;
    }

    /// The landmark map of that scheme, or nullptr.
    [[nodiscard]] const LandmarkMap* find_landmark_map(const std::string& scheme) const
    {
        for (const LandmarkMap& map : landmark_maps) {
            if (map.scheme == scheme) {
                return &map;
            }
        }
        return nullptr;
    }

    /// The model at one level (0: coarsest): leading rows of every tensor, that level's triangles, levels 0..level.
    /// @throws InvalidArgument unless 0 <= level < levels.size().
    [[nodiscard]] MorphableModel at_level(int level) const;

    /// The mesh of a shape vector (3V) with the finest level's topology, uv, and no colours.
    /// @throws InvalidArgument if the size is not 3V.
    [[nodiscard]] Mesh mesh_of(const Eigen::Ref<const Eigen::VectorXf>& shape_vector) const;
};

inline MorphableModel MorphableModel::at_level(int level) const
{
    require(level >= 0 && level < static_cast<int>(levels.size()), "MorphableModel::at_level", "level",
            "0 to " + std::to_string(static_cast<int>(levels.size()) - 1), std::to_string(level));
    const int count = levels[level].num_vertices;
    MorphableModel result = *this;
    result.shape = shape.first_vertices(count);
    if (color) {
        result.color = color->first_vertices(count);
    }
    for (Blendshapes& set : result.expression_sets) {
        set = set.first_vertices(count);
    }
    result.levels.resize(level + 1);
    if (mirror.size() > 0) {
        result.mirror = mirror.head(count);
    }
    for (auto& [region, weights] : result.masks) {
        const Eigen::VectorXf leading = weights.head(count);
        weights = leading;
    }
    return result;
}

inline Mesh MorphableModel::mesh_of(const Eigen::Ref<const Eigen::VectorXf>& shape_vector) const
{
    require_size(shape_vector.size(), shape.mean.size(), "MorphableModel::mesh_of", "shape_vector");
    Mesh mesh;
    mesh.vertices = Eigen::Map<const Eigen::Matrix3Xf>(shape_vector.data(), 3, num_vertices());
    if (!levels.empty()) {
        mesh.triangles = levels.back().triangles;
        mesh.triangle_groups = levels.back().triangle_groups;
        mesh.uv_triangles = levels.back().uv_triangles;
    }
    mesh.group_names = triangle_group_names;
    mesh.uv_coordinates = uv_coordinates;
    return mesh;
}

} // namespace lineament
