// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/angles.hpp"
#include "lineament/camera/camera.hpp"
#include "lineament/core/image.hpp"
#include "lineament/core/mesh.hpp"
#include "lineament/render/color.hpp"
#include "lineament/render/rasterizer.hpp"

#include <Eigen/Core>

namespace lineament {

enum class DrawMode
{
    surface,
    wireframe,             ///< Edges of the nearest surface only; what lies behind is hidden.
    surface_and_wireframe, ///< Edges over the shaded surface.
};

enum class Lighting
{
    automatic, ///< `unlit` for a texture, which carries its own light; else `studio`.
    studio,    ///< Three soft lights that move with the camera.
    unlit,     ///< The surface's own colour.
};

enum class SurfaceColor
{
    automatic, ///< The texture if one is given, else the mesh's colours, else clay.
    clay,      ///< One colour, ShadingOptions::clay.
};

enum class BackgroundMode
{
    color,       ///< The result is RGB over ShadingOptions::background.
    transparent, ///< The result is RGBA, not premultiplied.
};

struct ShadingOptions
{
    DrawMode mode = DrawMode::surface;
    Lighting lighting = Lighting::automatic;
    SurfaceColor surface = SurfaceColor::automatic;
    BackgroundMode background_mode = BackgroundMode::color;
    Culling culling = Culling::none; ///< Back faces, where drawn, are darker.
    Color clay = {218, 196, 178};    ///< Also under the transparent texels of an RGBA texture.
    Color background = {246, 246, 244};
    Color wire = {38, 50, 66, 200};
    double wire_width_px = 1.0;        ///< > 0.
    double opacity = 1.0;              ///< Of the surface, [0, 1].
    double ambient_occlusion = 0.7;    ///< Darkening of creases by screen-space occlusion, [0, 1]; 0 is faster.
    double occlusion_radius_mm = 14.0; ///< How far a crease sees, > 0.
    int supersampling = 2;             ///< Samples per pixel and axis, 1 to 8.

    void check() const; ///< @throws InvalidArgument naming the member and the value.
};

/// A picture of the mesh, in linear light, with smooth vertex normals and antialiased by supersampling.
///
/// @param mesh   vertices and triangles; its colours are used if there are any.
/// @return RGB, or RGBA with BackgroundMode::transparent; empty if a side is 0.
/// @throws InvalidArgument as `rasterize`, on colours or uv that do not fit the mesh, or on bad options.
[[nodiscard]] ImageU8 render_mesh(const Mesh& mesh, const Camera& camera, int width, int height,
                                  const ShadingOptions& options = {});

/// The same with the surface's colour from a texture (RGB, or RGBA with holes) at the mesh's uv coordinates.
[[nodiscard]] ImageU8 render_mesh(const Mesh& mesh, const ImageU8& texture, const Camera& camera, int width, int height,
                                  const ShadingOptions& options = {});

/// The mesh drawn over a picture (grey, RGB or RGBA) that the camera refers to. The result is RGB.
[[nodiscard]] ImageU8 render_mesh_over(const ImageU8& picture, const Mesh& mesh, const Camera& camera,
                                       const ShadingOptions& options = {});

/// The same with a texture.
[[nodiscard]] ImageU8 render_mesh_over(const ImageU8& picture, const Mesh& mesh, const ImageU8& texture,
                                       const Camera& camera, const ShadingOptions& options = {});

/// A scaled orthographic camera that sees the mesh from an angle, its bounding box centred in a width x height picture
/// with `margin` of each side left free.
/// @throws InvalidArgument unless the mesh has a finite vertex extent, the sides are >= 1 and 0 <= margin < 0.5.
[[nodiscard]] Camera frame_camera(const Mesh& mesh, const HeadAngles& angles, int width, int height,
                                  double margin = 0.06);

} // namespace lineament

#ifndef LINEAMENT_COMPILED_RENDER
#include "lineament/render/shading_impl.hpp"
#endif
