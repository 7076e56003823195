// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/rasterizer.hpp" // IWYU pragma: keep

#include "lineament/camera/camera.hpp"
#include "lineament/core/image.hpp"
#include "lineament/render/inline.hpp"
#include "lineament/render/rasterizer_support_impl.hpp"

#include <Eigen/Core>

#include <cstddef>

namespace lineament {

LINEAMENT_RENDER_INLINE Raster rasterize(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& triangles,
                                         const Camera& camera, int width, int height, const RasterOptions& options)
{
    detail::require_scene(vertices, triangles, camera, width, height, "rasterize");
    Raster raster{ImageF(width, height, 1, empty_depth), Image<int>(width, height, 1, -1), ImageF(width, height, 3)};
    detail::draw_triangles(vertices, triangles, camera, options, raster.depth,
                           [&](int triangle, std::size_t pixel, double weight_b, double weight_c) {
                               raster.triangle.data[pixel] = triangle;
                               float* const weights = raster.barycentric.data.data() + 3 * pixel;
                               weights[0] = static_cast<float>(1.0 - weight_b - weight_c);
                               weights[1] = static_cast<float>(weight_b);
                               weights[2] = static_cast<float>(weight_c);
                           });
    return raster;
}

LINEAMENT_RENDER_INLINE ImageF render_depth(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& triangles,
                                            const Camera& camera, int width, int height, const RasterOptions& options)
{
    detail::require_scene(vertices, triangles, camera, width, height, "render_depth");
    ImageF depth(width, height, 1, empty_depth);
    detail::draw_triangles(vertices, triangles, camera, options, depth, [](int, std::size_t, double, double) {});
    return depth;
}

} // namespace lineament
