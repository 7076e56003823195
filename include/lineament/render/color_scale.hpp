// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/core/image.hpp"
#include "lineament/core/mesh.hpp"
#include "lineament/render/color.hpp"

#include <Eigen/Core>

#include <string>

namespace lineament {

/// The colour of a number on a scale from 0 to 1: dark blue over green to yellow, always brighter. Numbers outside get
/// the colour of the nearer end.
/// @throws InvalidArgument unless the number is finite.
[[nodiscard]] Color scale_color(double value);

/// The colours (3 x N, as Mesh::colors) of numbers on a scale from 0 to `largest`.
/// @throws InvalidArgument unless the values are finite and `largest` is finite and > 0.
[[nodiscard]] Eigen::Matrix3Xf scale_colors(const Eigen::VectorXf& values, double largest);

/// The scale from 0 to `largest` with five numbers and their unit, in the middle half of a white picture of that width
/// and 42 px; RGB.
/// @throws InvalidArgument unless `largest` is finite and > 0 and the width at least 16.
[[nodiscard]] ImageU8 draw_color_bar(double largest, const std::string& unit, int width);

/// An RGB picture with `draw_color_bar` of its width below it.
/// @throws InvalidArgument as draw_color_bar, or on a picture that is not RGB.
[[nodiscard]] ImageU8 add_color_bar(const ImageU8& picture, double largest, const std::string& unit);

/// A picture of the mesh over white with a number for each vertex as colour, shaded a little so that the form is seen.
/// @throws InvalidArgument as render_mesh and scale_colors, or unless there is one value a vertex.
[[nodiscard]] ImageU8 render_values(Mesh mesh, const Eigen::VectorXf& values, double largest, const Camera& camera,
                                    int width, int height);

} // namespace lineament

#ifndef LINEAMENT_COMPILED_RENDER
#include "lineament/render/color_scale_impl.hpp"
#endif
