// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/core/mesh.hpp"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace lineament {

/// A texel whose centre lies in a triangle of the uv layout.
struct Texel
{
    int index = 0;         ///< row * size + column.
    int triangle = 0;      ///< Of the mesh.
    float weight_b = 0.0f; ///< Barycentric weight of the triangle's second corner,
    float weight_c = 0.0f; ///< and of its third; the first has the rest.
};

/// Which point of the surface each texel of a square map shows; fixed by the model's uv and made once.
///
/// Where uv triangles overlap, the first keeps the texel. Triangles of excluded groups are left unmapped, for example
/// "mouth_interior", which in a photo is rarely what the model says.
class TextureLayout
{
public:
    TextureLayout() = default;

    /// @param mesh             Its uv_coordinates, uv_triangles and triangle groups are read; nothing else.
    /// @param size             Texels per side, 1 to 8192.
    /// @param excluded_groups  Names of triangle groups; names the mesh does not have are ignored.
    /// @throws InvalidArgument on a bad size, uv that are not finite, an index out of range, or no uv triangles at all.
    TextureLayout(const Mesh& mesh, int size, const std::vector<std::string>& excluded_groups = {});

    [[nodiscard]] int size() const { return size_; }
    [[nodiscard]] int num_triangles() const { return static_cast<int>(texel_areas_.size()); }
    /// The mapped texels, triangle by triangle.
    [[nodiscard]] const std::vector<Texel>& texels() const { return texels_; }
    /// Area of each triangle in the map [texel^2].
    [[nodiscard]] const Eigen::VectorXf& texel_areas() const { return texel_areas_; }

private:
    int size_ = 0;
    std::vector<Texel> texels_ = {};
    Eigen::VectorXf texel_areas_ = {};
};

/// The edges of a uv layout on white, size x size, RGB.
/// @param uv_coordinates  2 x N, in [0, 1], v down.
/// @param uv_triangles    3 x T, columns of uv_coordinates.
/// @throws InvalidArgument for a size below 1 or an index out of range.
[[nodiscard]] ImageU8 draw_uv_layout(const Eigen::Ref<const Eigen::Matrix2Xf>& uv_coordinates,
                                     const Eigen::Ref<const Eigen::Matrix3Xi>& uv_triangles, int size);

} // namespace lineament

#ifndef LINEAMENT_COMPILED_RENDER
#include "lineament/render/texture_layout_impl.hpp"
#endif
