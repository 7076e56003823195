// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/core/image.hpp"

#include <Eigen/Core>

#include <limits>

namespace lineament {

/// Which triangles are left out. A face turned towards the camera has its corners counter-clockwise as seen.
enum class Culling
{
    none,
    back_faces,
};

struct RasterOptions
{
    Culling culling = Culling::none;
};

/// What a camera sees of a triangle mesh, for each pixel at its centre.
struct Raster
{
    ImageF depth = {};        ///< Camera-space z relative to the model's origin [mm], smaller is nearer; empty: inf.
    Image<int> triangle = {}; ///< The nearest triangle; empty: -1.
    ImageF barycentric = {};  ///< 3 channels: weights of its corners on the surface (perspective-correct); empty: 0.
};

/// Depth of a pixel in which nothing is seen.
inline constexpr float empty_depth = std::numeric_limits<float>::infinity();

/// The nearest triangle at each pixel centre, its depth and barycentric weights, by a z-buffer.
///
/// Corners are rounded to 1/256 px; a shared edge is drawn exactly once; of two surfaces at the same depth the first
/// triangle is kept. Left out: triangles with a corner behind the camera (1 + phi P_z < 1e-3) or more than 2^20 px
/// off the image's origin.
///
/// @param vertices   3 x V, mm, model space.
/// @param triangles  3 x T, 0 <= index < V.
/// @return Three images of width x height; empty ones if a side is 0.
/// @throws InvalidArgument on an index out of range, a number that is not finite, or a bad camera or size.
/// @par Cost  O(V + T + covered pixels); see bench/render_bench.cpp. Thread-safe.
[[nodiscard]] Raster rasterize(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& triangles,
                               const Camera& camera, int width, int height, const RasterOptions& options = {});

/// The depth image of `rasterize` alone, faster.
[[nodiscard]] ImageF render_depth(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& triangles,
                                  const Camera& camera, int width, int height, const RasterOptions& options = {});

} // namespace lineament

#ifndef LINEAMENT_COMPILED_RENDER
#include "lineament/render/rasterizer_impl.hpp"
#endif
