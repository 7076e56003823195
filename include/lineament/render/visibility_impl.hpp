// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/visibility.hpp" // IWYU pragma: keep

#include "lineament/core/mesh.hpp"
#include "lineament/render/inline.hpp"
#include "lineament/render/rasterizer.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace lineament {

LINEAMENT_RENDER_INLINE DepthTest::DepthTest(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& triangles,
                                             const Camera& camera, int width, int height,
                                             const VisibilityOptions& options)
    : camera_(camera), tolerance_mm_(options.depth_tolerance_mm)
{
    require(options.depth_tolerance_mm >= 0, "DepthTest", "depth_tolerance_mm", "a number >= 0",
            to_text(options.depth_tolerance_mm));
    depth_ = render_depth(vertices, triangles, camera, width, height);
}

LINEAMENT_RENDER_INLINE std::vector<Visibility> compute_visibility(const Eigen::Matrix3Xf& vertices,
                                                                   const Eigen::Matrix3Xi& triangles,
                                                                   const Camera& camera, int width, int height,
                                                                   const VisibilityOptions& options)
{
    const DepthTest test(vertices, triangles, camera, width, height, options);
    const Eigen::Matrix3Xf normals = compute_vertex_normals(vertices, triangles);
    std::vector<Visibility> visibility(static_cast<std::size_t>(vertices.cols()));
    for (Eigen::Index v = 0; v < vertices.cols(); ++v) {
        visibility[v] = test(camera.in_camera(vertices.col(v).cast<double>()),
                             camera.camera_from_model * normals.col(v).cast<double>());
    }
    return visibility;
}

} // namespace lineament
