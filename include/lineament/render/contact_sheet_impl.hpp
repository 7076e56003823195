// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/contact_sheet.hpp" // IWYU pragma: keep

#include "lineament/core/image.hpp"
#include "lineament/render/checks.hpp"
#include "lineament/render/draw.hpp"
#include "lineament/render/inline.hpp"

#include <algorithm>
#include <string>
#include <vector>

namespace lineament {

LINEAMENT_RENDER_INLINE void ContactSheetOptions::check() const
{
    const auto in_range = [](int value, int low, int high, const char* name) {
        require(value >= low && value <= high, "ContactSheetOptions", name,
                std::to_string(low) + " to " + std::to_string(high), std::to_string(value));
    };
    in_range(tile_width_px, 1, 4096, "tile_width_px");
    in_range(tile_height_px, 1, 4096, "tile_height_px");
    in_range(gap_px, 0, 256, "gap_px");
    in_range(text_scale, 1, 16, "text_scale");
}

LINEAMENT_RENDER_INLINE ImageU8 contact_sheet(const std::vector<Tile>& tiles, int columns,
                                              const ContactSheetOptions& options)
{
    const char* const function = "contact_sheet";
    options.check();
    require(columns >= 1, function, "columns", "at least 1", std::to_string(columns));
    if (tiles.empty()) {
        return {};
    }
    const int num_tiles = static_cast<int>(std::min<std::size_t>(tiles.size(), max_image_side_px));
    const int num_columns = std::min(columns, num_tiles);
    const int num_rows = (num_tiles + num_columns - 1) / num_columns;
    int caption_height = 0;
    for (const Tile& tile : tiles) {
        caption_height = std::max(caption_height, text_height_px(tile.caption, options.text_scale));
    }
    if (caption_height > 0) {
        caption_height += 2 * options.text_scale; // between picture and caption
    }
    const std::int64_t stride_x = options.tile_width_px + options.gap_px;
    const std::int64_t stride_y = options.tile_height_px + caption_height + options.gap_px;
    const std::int64_t width = options.gap_px + num_columns * stride_x;
    const std::int64_t height = options.gap_px + num_rows * stride_y;
    require(width <= max_image_side_px && height <= max_image_side_px, function, "tiles",
            "a sheet of at most " + std::to_string(max_image_side_px) + " px a side",
            std::to_string(width) + " x " + std::to_string(height));

    ImageU8 sheet(static_cast<int>(width), static_cast<int>(height), 3);
    fill_rectangle(sheet, 0, 0, sheet.width, sheet.height, options.background);
    for (int i = 0; i < num_tiles; ++i) {
        const Tile& tile = tiles[i];
        const int left = options.gap_px + (i % num_columns) * static_cast<int>(stride_x);
        const int top = options.gap_px + (i / num_columns) * static_cast<int>(stride_y);
        if (!tile.picture.empty()) {
            const double zoom = std::min(static_cast<double>(options.tile_width_px) / tile.picture.width,
                                         static_cast<double>(options.tile_height_px) / tile.picture.height);
            const int fitted_width = std::max(1, static_cast<int>(zoom * tile.picture.width + 0.5));
            const int fitted_height = std::max(1, static_cast<int>(zoom * tile.picture.height + 0.5));
            paste(sheet, resize(tile.picture, fitted_width, fitted_height),
                  left + (options.tile_width_px - fitted_width) / 2,
                  top + (options.tile_height_px - fitted_height) / 2);
        }
        ImageU8 caption(options.tile_width_px, caption_height, 3); // a strip of its own cuts long captions
        fill_rectangle(caption, 0, 0, caption.width, caption.height, options.background);
        const int indent = std::max(0, (options.tile_width_px - text_width_px(tile.caption, options.text_scale)) / 2);
        draw_text(caption, indent, 2 * options.text_scale, tile.caption, options.text, options.text_scale);
        paste(sheet, caption, left, top + options.tile_height_px);
    }
    return sheet;
}

} // namespace lineament
