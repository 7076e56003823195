// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/model/morphable_model.hpp"

#include <cstdint>
#include <string>

namespace lineament::cli {

/// What a contact sheet of a model shows.
struct SheetOptions
{
    std::string what = "random"; ///< random, shape-modes, color-modes, expressions, levels, isomap, landmarks.
    int count = 12;              ///< Faces or modes.
    double standard_deviations = 2.0;
    std::string expression_set = "ekman6";
    std::uint64_t seed = 1;
    int tile_px = 320;
};

/// A picture of faces of the model: random ones (shape and colour from their priors), each mode at plus and minus some
/// standard deviations, each expression, the levels as wireframes, the uv layout, or the landmarks.
/// @throws Failure(wrong_use) for an expression set, colours or uv that the model has not.
[[nodiscard]] ImageU8 make_sheet(const MorphableModel& model, const SheetOptions& options);

} // namespace lineament::cli
