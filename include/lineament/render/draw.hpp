// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/render/color.hpp"

#include <Eigen/Core>

#include <string_view>

namespace lineament {

// Drawing on pictures with 8 bits: grey (the colour's brightness is used), RGB, or RGBA (alpha grows). Shapes are
// antialiased by their distance to the pixel centre and clipped to the picture; a shape whose numbers are not finite,
// or whose width is not positive, draws nothing. Points are in image space [px]. Colours blend as encoded.

/// Mixes a colour into one pixel: result = (1 - a) pixel + a colour with a = coverage x the colour's alpha / 255.
/// A pixel outside the picture is left alone.
void blend_pixel(ImageU8& image, int column, int row, const Color& color, float coverage = 1.0f);

/// A line segment with round ends.
void draw_line(ImageU8& image, const Eigen::Vector2d& from, const Eigen::Vector2d& to, const Color& color,
               double width_px = 1.0);

/// A filled disc.
void draw_disc(ImageU8& image, const Eigen::Vector2d& center, double radius_px, const Color& color);

/// The outline of a circle, half of its width on each side of the radius.
void draw_circle(ImageU8& image, const Eigen::Vector2d& center, double radius_px, const Color& color,
                 double width_px = 1.0);

/// The outline of the rectangle between two corners.
void draw_rectangle(ImageU8& image, const Eigen::Vector2d& corner, const Eigen::Vector2d& opposite_corner,
                    const Color& color, double width_px = 1.0);

/// All pixels of [left, left + width) x [top, top + height).
void fill_rectangle(ImageU8& image, int left, int top, int width, int height, const Color& color);

/// Text in the built-in letters (font.hpp), each of its pixels drawn as scale x scale; the given point is the top left
/// corner of the first cell. A line feed starts a new line.
void draw_text(ImageU8& image, int left, int top, std::string_view text, const Color& color, int scale = 1);

/// Width of the longest line of a text [px].
[[nodiscard]] int text_width_px(std::string_view text, int scale = 1);

/// Height of a text, 10 px x scale a line [px].
[[nodiscard]] int text_height_px(std::string_view text, int scale = 1);

/// Copies a picture into another at a position, clipped; with alpha, blended. Grey is copied into every channel.
void paste(ImageU8& image, const ImageU8& picture, int left, int top);

/// The picture at another size: pixels are averaged over the area that each new pixel covers where it shrinks, and
/// interpolated linearly where it grows, independently in x and y. Rounded; RGBA is weighted by alpha.
/// @throws InvalidArgument on a negative size, or a size > 0 asked of an empty picture.
[[nodiscard]] ImageU8 resize(const ImageU8& picture, int width, int height);

} // namespace lineament

#ifndef LINEAMENT_COMPILED_RENDER
#include "lineament/render/draw_impl.hpp"
#endif
