// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "ibug_points.hpp"

#include "coarse_surface.hpp"

#include "lineament/core/checks.hpp"

#include <algorithm>
#include <array>
#include <string>

namespace lineament::build {

namespace {

struct Offset
{
    int number;
    double x; ///< To the subject's left [mm].
    double y; ///< Up.
};

/// Of the subject's right and of the symmetry plane.
constexpr std::array<Offset, 30> offsets = {{
    {18, 0.5, -0.6}, {19, 0.5, -0.6},  {20, -3.0, -2.0}, {21, 0.7, 1.7},   {22, 2.9, -1.9}, {28, 0.0, -0.7},
    {29, 0.0, 0.2},  {30, 0.0, 0.9},   {31, 0.0, -0.7},  {32, 2.1, -0.5},  {33, 2.1, 0.6},  {34, 0.0, 1.2},
    {37, 0.1, -0.4}, {38, -1.3, 0.6},  {39, 0.1, 1.0},   {40, -1.0, -0.3}, {41, 0.3, -0.2}, {42, -1.1, -0.4},
    {49, 0.0, 1.7},  {50, -2.3, -2.0}, {51, -1.8, 0.0},  {52, 0.0, -1.2},  {58, 0.0, 0.2},  {59, -1.1, 0.4},
    {60, -2.9, 0.6}, {61, 3.1, 1.3},   {62, 1.0, 0.0},   {63, 0.0, -0.4},  {67, 0.0, -0.6}, {68, -1.6, -0.1},
}};

} // namespace

Eigen::Matrix2Xd annotator_offsets_mm()
{
    Eigen::Matrix2Xd result = Eigen::Matrix2Xd::Zero(2, 68);
    for (const Offset& offset : offsets) {
        result.col(offset.number - 1) << offset.x, offset.y;
    }
    return result;
}

LandmarkMap make_ibug_map(const MorphableModel& model, const std::vector<int>& vertices,
                          const Eigen::Matrix2Xd& offsets_mm)
{
    const CoarseSurface surface(model);
    LandmarkMap map;
    map.scheme = "ibug68";
    const auto count = static_cast<Eigen::Index>(vertices.size());
    map.vertices.resize(3, count);
    map.weights = Eigen::Vector3f::UnitX().replicate(1, count);
    for (Eigen::Index l = 0; l < count; ++l) {
        map.names.push_back(std::to_string(l + 1));
        map.vertices.col(l).setConstant(vertices[static_cast<std::size_t>(l)]);
    }
    for (Eigen::Index l = 0; l < count; ++l) {
        const int vertex = vertices[static_cast<std::size_t>(l)];
        const int partner_vertex = model.mirror[vertex];
        const Eigen::Vector3d point = surface.vertex(vertex);
        const bool is_central = partner_vertex == vertex;
        if (offsets_mm.col(l).isZero() || (!is_central && point.x() > 0.0)) {
            continue;
        }
        const Eigen::Vector3d target = point + Eigen::Vector3d(offsets_mm(0, l), offsets_mm(1, l), 0.0);
        const SurfacePoint place =
            is_central ? surface.closest_in_symmetry_plane(target) : surface.closest(target, "skin");
        map.vertices.col(l) = place.vertices;
        map.weights.col(l) = place.rounded_weights();
        if (!is_central) {
            const auto partner = std::find(vertices.begin(), vertices.end(), partner_vertex);
            LINEAMENT_ASSERT(partner != vertices.end());
            const Eigen::Index p = partner - vertices.begin();
            map.vertices.col(p) = surface.mirrored(place).vertices;
            map.weights.col(p) = map.weights.col(l);
        }
    }
    return map;
}

} // namespace lineament::build
