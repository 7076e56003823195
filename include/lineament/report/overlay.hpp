// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/fit/fit_result.hpp"
#include "lineament/model/morphable_model.hpp"

namespace lineament {

enum class OverlayLandmarks
{
    none,
    residuals, ///< Landmarks as seen (discs), the fitted points, and a line between each pair.
};

enum class OverlayCaption
{
    none,
    pose_and_status, ///< Below the face: the angles [deg], and the status where it is not success.
};

/// What is drawn over a picture. All sizes follow the size of the face in the picture.
struct OverlayOptions
{
    double mesh_opacity = 0.4;    ///< Of the wireframe, [0, 1]; 0: none.
    double axis_length_mm = 55.0; ///< Of the head's axes, >= 0; 0: none.
    OverlayLandmarks landmarks = OverlayLandmarks::residuals;
    OverlayCaption caption = OverlayCaption::pose_and_status;

    void check() const; ///< @throws InvalidArgument naming the member and the value.
};

/// The picture (grey, RGB or RGBA; the result is RGB) with a fitted face drawn over it: the edges of the triangles that
/// are seen, fading towards the silhouette and at the finest level of the model whose edges stay apart; landmarks and
/// residuals; the head's axes at the nose (x red, y green, z blue); a caption.
///
/// A fit that is degenerate or had too few points has no face to draw: its landmarks and caption alone are drawn.
/// @throws InvalidArgument on a picture of another number of channels, coefficients that do not fit the model, an
///   expression set the model lacks, a camera under which a vertex is at no finite place, or bad options.
[[nodiscard]] ImageU8 draw_overlay(const ImageU8& picture, const MorphableModel& model, const FitResult& fit,
                                   const OverlayOptions& options = {});

} // namespace lineament
