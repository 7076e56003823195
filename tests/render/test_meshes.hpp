// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/angles.hpp"
#include "lineament/camera/camera.hpp"
#include "lineament/core/mesh.hpp"

#include <optional>
#include <utility>

namespace lineament::test {

/// The rectangle [-w/2, w/2] x [-h/2, h/2] at a given z, facing +z, as columns x rows cells of two triangles, with uv.
[[nodiscard]] Mesh make_plane(double width_mm, double height_mm, double z_mm, int columns = 1, int rows = 1);

/// A sphere about a centre; uv is longitude and latitude, with a seam at the back.
[[nodiscard]] Mesh make_sphere(double radius_mm, const Eigen::Vector3d& center = Eigen::Vector3d::Zero(),
                               int columns = 96, int rows = 48);

/// Both meshes as one; uv of the first alone (the second's triangles share its first uv point).
[[nodiscard]] Mesh join(const Mesh& a, const Mesh& b);

/// Where the ray through an image point first meets the mesh: triangle and depth [mm], by intersecting every triangle.
[[nodiscard]] std::optional<std::pair<int, double>> cast_ray(const Mesh& mesh, const Camera& camera,
                                                             const Eigen::Vector2d& point_px);

/// A camera looking at the origin in the middle of a picture.
[[nodiscard]] Camera centered_camera(int width, int height, double scale_px_per_mm, const HeadAngles& angles = {},
                                     double phi_per_mm = 0.0);

} // namespace lineament::test
