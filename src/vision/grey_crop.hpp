// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"

namespace lineament {

/// Where a crop lies in its picture: crop point = scale * (picture point - (left, top)), both in image space.
struct CropPlace
{
    double left = 0.0; ///< [px of the picture]; may be negative.
    double top = 0.0;
    double scale = 1.0; ///< > 0; pixels of the crop for one pixel of the picture.
    int width = 0;      ///< [px of the crop]
    int height = 0;
};

/// The luma (BT.601 weights) of a part of an RGB picture, resampled by a triangle filter that is widened when it
/// shrinks, so that nothing aliases. Outside the picture its border is continued.
[[nodiscard]] ImageU8 crop_grey(const ImageU8& picture, const CropPlace& place);

} // namespace lineament
