// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/render/color.hpp"

#include <string>
#include <vector>

namespace lineament {

/// A picture of a contact sheet and what stands below it.
struct Tile
{
    ImageU8 picture = {};
    std::string caption = {}; ///< ASCII; may hold line feeds. Cut where it is longer than the tile is wide.
};

struct ContactSheetOptions
{
    int tile_width_px = 256;  ///< 1 to 4096. A picture is fitted into its tile without changing its shape.
    int tile_height_px = 256; ///< 1 to 4096.
    int gap_px = 12;          ///< Between tiles and around the sheet, 0 to 256.
    int text_scale = 2;       ///< 1 to 16.
    Color background = {255, 255, 255};
    Color text = {40, 40, 44};

    void check() const; ///< @throws InvalidArgument naming the member and the value.
};

/// Pictures in rows of equal tiles with captions below them; RGB. Without tiles it is empty.
/// @throws InvalidArgument unless columns >= 1, on bad options, or a sheet longer than max_image_side_px.
[[nodiscard]] ImageU8 contact_sheet(const std::vector<Tile>& tiles, int columns,
                                    const ContactSheetOptions& options = {});

} // namespace lineament

#ifndef LINEAMENT_COMPILED_RENDER
#include "lineament/render/contact_sheet_impl.hpp"
#endif
