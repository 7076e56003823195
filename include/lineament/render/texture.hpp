// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/core/image.hpp"
#include "lineament/render/texture_layout.hpp"
#include "lineament/render/visibility.hpp" // IWYU pragma: keep

#include <Eigen/Core>

#include <cstdint>

namespace lineament {

/// A picture pulled into uv space. Texels that are not seen are holes: weight 0, and a state that says why.
struct TextureMap
{
    ImageU8 color = {};                  ///< size x size, RGB; meaningless where the weight is 0.
    ImageF weight = {};                  ///< size x size, in [0, 1]: how well the texel is seen.
    Image<std::uint8_t> visibility = {}; ///< size x size, values of Visibility.
};

struct TextureOptions
{
    double depth_tolerance_mm = 1.5; ///< As VisibilityOptions; a fit's surface is coarser than its texture.
    /// Texels seen that near to the outline of the mesh, or to a step in its depth, get weight 0: a fit misses the true
    /// outline by some millimetres, and what lies beside the face would bleed in. Measured across the view, 0 to 20;
    /// at least the pixel that interpolation reads; 0: keep all.
    double outline_margin_mm = 4.0;
    /// V, in [0, 1]: multiplies the weights, for parts of the mesh whose place the fit does not know well. Empty:
    /// all 1.
    Eigen::VectorXf vertex_trust = {};
    /// V, in [0, 1]: above 0.5 where the surface is skin. Weights there are multiplied by max(0, 2 P - 1), P the
    /// probability of `ForegroundTest` that the picture shows the face and not what lies beside its outline. Hair is to
    /// be left out: it goes on beyond the outline. Empty: all 0.
    Eigen::VectorXf vertex_skin = {};

    void check() const; ///< @throws InvalidArgument naming the member and the value.
};

/// The texture of a posed mesh from one picture:
///
///   color(texel)  = picture at x, bilinear and rounded,    x the projection of the texel's surface point
///   weight(texel) = trust max(0, -n . v) min(1, density)   for texels that are seen clear of outlines, else 0
///
/// with n the unit normal interpolated from the vertices, v the unit ray from the camera to the point, and density the
/// picture's pixels per texel if the surface faced the camera: (s / (1 + phi P_z))^2 times the triangle's area in mm^2
/// over its area in texels^2. A picture much finer than the map is halved first, so that nothing aliases.
///
/// @param layout    Of the mesh's uv; the same number of triangles.
/// @param vertices  3 x V, mm, model space, with expression and identity applied.
/// @param picture   Grey, RGB or RGBA; may be empty (then every texel is outside).
/// @throws InvalidArgument as `rasterize`, on triangles that do not fit the layout, or bad options.
/// @par Cost  O(texels + T + pixels of the face). Thread-safe.
[[nodiscard]] TextureMap extract_texture(const TextureLayout& layout, const Eigen::Matrix3Xf& vertices,
                                         const Eigen::Matrix3Xi& triangles, const Camera& camera,
                                         const ImageU8& picture, const TextureOptions& options = {});

enum class HoleMark
{
    checkered,   ///< RGB, holes in a grey checker pattern.
    transparent, ///< RGBA, holes with alpha 0.
};

/// The map's colours with its holes (weight 0) marked, for people (checkered) or for rendering over clay (transparent).
[[nodiscard]] ImageU8 mark_holes(const TextureMap& map, HoleMark mark = HoleMark::checkered);

} // namespace lineament

#ifndef LINEAMENT_COMPILED_RENDER
#include "lineament/render/texture_impl.hpp"
#endif
