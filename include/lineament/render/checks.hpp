// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/core/checks.hpp"

#include <Eigen/Core>

#include <cmath>
#include <string>

namespace lineament {

/// Longest side of a picture the renderer makes or reads [px].
inline constexpr int max_image_side_px = 32768;

/// @throws InvalidArgument unless 0 <= width, height <= max_image_side_px.
inline void require_image_size(int width, int height, const char* function)
{
    require(width >= 0 && height >= 0 && width <= max_image_side_px && height <= max_image_side_px, function,
            "width, height", "0 to " + std::to_string(max_image_side_px) + " px each",
            std::to_string(width) + " x " + std::to_string(height));
}

/// @throws InvalidArgument naming the first index outside 0 <= index < num_points.
inline void require_triangles(const Eigen::Matrix3Xi& triangles, Eigen::Index num_points, const char* function,
                              const char* parameter)
{
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            const int index = triangles(corner, t);
            if (index < 0 || index >= num_points) {
                throw InvalidArgument(
                    function, std::string(parameter) + "(" + std::to_string(corner) + ", " + std::to_string(t) + ")",
                    "an index >= 0 and < " + std::to_string(num_points), std::to_string(index));
            }
        }
    }
}

/// @throws InvalidArgument unless every number of the camera is finite, scale > 0 and phi >= 0.
inline void require_camera(const Camera& camera, const char* function)
{
    require_finite(camera.camera_from_model, function, "camera.camera_from_model");
    require_finite(camera.translation_mm, function, "camera.translation_mm");
    require_finite(camera.principal_point_px, function, "camera.principal_point_px");
    require(std::isfinite(camera.scale_px_per_mm) && camera.scale_px_per_mm > 0, function, "camera.scale_px_per_mm",
            "a finite number > 0", to_text(camera.scale_px_per_mm));
    require(std::isfinite(camera.phi_per_mm) && camera.phi_per_mm >= 0, function, "camera.phi_per_mm",
            "a finite number >= 0", to_text(camera.phi_per_mm));
}

} // namespace lineament
