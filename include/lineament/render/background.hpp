// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/core/image.hpp"

#include <Eigen/Core>

#include <cstdint>

namespace lineament {

/// Where a picture shows its background although a mesh's image covers the pixel: the mesh is wider than the head, or
/// badly aligned. In a strip along the inside of the outline each cell of a coarse grid is compared with what lies
/// near it outside and with what lies near it further inside, both as normal distributions of the colour with one
/// variance for all channels:
///
///   P(foreground) = 1 / (1 + exp(-e)),    e = ln N(c; mean_in, var_in) - ln N(c; mean_out, var_out) + prior,
///
/// the prior log odds rising from 0 at the outline to `prior_inside` at the inner end of the strip. Where there is
/// nothing near to compare with, P = 1.
struct BackgroundOptions
{
    double strip_mm = 25.0;    ///< Width of the strip that is questioned, in [5, 60].
    double prior_inside = 4.0; ///< In [0, 20].
    double color_noise = 12.0; ///< Standard deviation added to both, of 0..255: shading, compression. In [1, 100].

    void check() const; ///< @throws InvalidArgument naming the member and the value.
};

/// P(foreground) of each cell, 1 further inside than the strip and wherever nothing speaks against it.
/// @param covered     1 where the mesh's image covers the cell, else 0.
/// @param colors      RGB of each cell, 0..255; as large as `covered`.
/// @param in_picture  1 where the cell lies in the picture, else 0; as large as `covered`.
/// @param cell_mm     Length of a cell, > 0.
/// @throws InvalidArgument on images of different sizes or bad options.
/// @par Cost  O(cells). Thread-safe.
[[nodiscard]] ImageF foreground_probability(const Image<std::uint8_t>& covered, const ImageF& colors,
                                            const Image<std::uint8_t>& in_picture, double cell_mm,
                                            const BackgroundOptions& options = {});

/// P(foreground) at points of a picture in which a mesh is seen.
class ForegroundTest
{
public:
    /// @param picture  Grey, RGB or RGBA.
    /// @throws InvalidArgument as `rasterize`, or on bad options.
    ForegroundTest(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& triangles, const Camera& camera,
                   const ImageU8& picture, const BackgroundOptions& options = {});

    [[nodiscard]] float operator()(const Eigen::Vector2d& point_px) const
    {
        const Eigen::Vector2d cell = (point_px - origin_px_) / cell_px_;
        return probability_.empty()
                   ? 1.0F
                   : sample_bilinear(probability_, static_cast<float>(cell.x()), static_cast<float>(cell.y()), 0);
    }

private:
    Eigen::Vector2d origin_px_ = Eigen::Vector2d::Zero();
    double cell_px_ = 1.0;
    ImageF probability_ = {};
};

} // namespace lineament

#ifndef LINEAMENT_COMPILED_RENDER
#include "lineament/render/background_impl.hpp"
#endif
