// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"

#include <Eigen/Core>

#include <span>

namespace lineament {

/// A rotated square in a picture that a network looks at.
struct SquareWindow
{
    Eigen::Vector2d center = Eigen::Vector2d::Zero(); ///< [px]
    double side = 0.0;                                ///< [px]
    double angle = 0.0;                               ///< From the picture's x axis to the window's, towards y [rad].

    /// linear * p + offset: from points in the window, side `size` [network px], to the picture.
    struct Affine
    {
        Eigen::Matrix2d linear;
        Eigen::Vector2d offset;

        [[nodiscard]] Eigen::Vector2d operator()(const Eigen::Vector2d& point) const { return linear * point + offset; }
    };
    [[nodiscard]] Affine picture_from_window(double size) const;
};

/// The smallest upright square around the whole picture.
[[nodiscard]] SquareWindow window_around(const ImageU8& picture);

enum class Border
{
    black,
    repeated, ///< The picture's outermost pixels go on.
};

/// The window resampled to size x size x 3 by bilinear interpolation, 0 ... 255 mapped to low ... high.
void sample_window(const ImageU8& picture, const SquareWindow& window, int size, Border border, float low, float high,
                   std::span<float> values);

} // namespace lineament
