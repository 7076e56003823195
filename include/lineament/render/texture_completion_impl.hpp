// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/texture_completion.hpp" // IWYU pragma: keep

#include "lineament/render/inline.hpp"
#include "lineament/render/texture.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <vector>

namespace lineament {

LINEAMENT_RENDER_INLINE void CompletionOptions::check() const
{
    require(min_relative_weight >= 0 && min_relative_weight <= 1, "CompletionOptions", "min_relative_weight",
            "a number in [0, 1]", to_text(min_relative_weight));
}

LINEAMENT_RENDER_INLINE ImageF diffuse(const ImageF& values, const ImageF& weights)
{
    require(values.width == weights.width && values.height == weights.height && weights.channels == 1, "diffuse",
            "weights", "one channel of the size of values",
            std::to_string(weights.width) + " x " + std::to_string(weights.height));
    ImageF filled = values;
    const bool is_coarsest = values.width <= 1 && values.height <= 1;
    ImageF coarse;
    if (!is_coarsest) {
        ImageF coarse_values((values.width + 1) / 2, (values.height + 1) / 2, values.channels);
        ImageF coarse_weights(coarse_values.width, coarse_values.height, 1);
        for (int row = 0; row < values.height; ++row) {
            for (int column = 0; column < values.width; ++column) {
                const float weight = std::clamp(weights.at(column, row), 0.0f, 1.0f);
                if (!(weight > 0)) {
                    continue;
                }
                coarse_weights.at(column / 2, row / 2) += weight;
                const float* const value = values.pixel(column, row);
                float* const sum = coarse_values.pixel(column / 2, row / 2);
                for (int channel = 0; channel < values.channels; ++channel) {
                    sum[channel] += weight * value[channel];
                }
            }
        }
        for (int row = 0; row < coarse_values.height; ++row) {
            for (int column = 0; column < coarse_values.width; ++column) {
                float& weight = coarse_weights.at(column, row);
                for (int channel = 0; channel < values.channels && weight > 0; ++channel) {
                    coarse_values.at(column, row, channel) /= weight;
                }
                weight = std::min(weight, 1.0f);
            }
        }
        coarse = diffuse(coarse_values, coarse_weights);
    }
    for (int row = 0; row < values.height; ++row) {
        for (int column = 0; column < values.width; ++column) {
            const float weight = std::clamp(weights.at(column, row), 0.0f, 1.0f);
            if (weight >= 1) {
                continue;
            }
            const BilinearSample around(is_coarsest ? values : coarse, 0.5f * (static_cast<float>(column) + 0.5f),
                                        0.5f * (static_cast<float>(row) + 0.5f));
            const float* const value = values.pixel(column, row);
            float* const target = filled.pixel(column, row);
            for (int channel = 0; channel < values.channels; ++channel) {
                const float own = weight > 0 ? weight * value[channel] : 0.0f;
                const float spread = is_coarsest ? (weight > 0 ? value[channel] : 0.0f) : around(channel);
                target[channel] = own + (1.0f - weight) * spread;
            }
        }
    }
    return filled;
}

namespace detail {

/// The median of the values > 0, or 0 without any.
inline float median_positive(const ImageF& image)
{
    std::vector<float> values;
    std::copy_if(image.data.begin(), image.data.end(), std::back_inserter(values), [](float v) { return v > 0; });
    if (values.empty()) {
        return 0.0f;
    }
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

} // namespace detail

LINEAMENT_RENDER_INLINE CompletedTexture complete_texture(const TextureMap& map, const CompletionOptions& options)
{
    const char* const function = "complete_texture";
    options.check();
    const int width = map.color.width;
    const int height = map.color.height;
    require(map.color.channels == 3 || map.color.empty(), function, "map.color", "3 channels",
            std::to_string(map.color.channels));
    require(map.weight.width == width && map.weight.height == height, function, "map.weight",
            std::to_string(width) + " x " + std::to_string(height),
            std::to_string(map.weight.width) + " x " + std::to_string(map.weight.height));
    CompletedTexture completed{map.color, Image<std::uint8_t>(width, height, 1)};
    const float min_weight = static_cast<float>(options.min_relative_weight) * detail::median_positive(map.weight);
    const auto is_seen = [&](int column, int row) {
        const float weight = map.weight.at(column, row);
        return weight > 0 && weight >= min_weight;
    };

    ImageF colors(width, height, 3);     // what is known so far
    ImageF known(width, height, 1);      // 1 where it is
    ImageF difference(width, height, 3); // seen minus its mirrored partner, where both are seen
    ImageF comparable(width, height, 1);
    for (int row = 0; row < height; ++row) {
        for (int column = 0; column < width; ++column) {
            if (!is_seen(column, row)) {
                continue;
            }
            known.at(column, row) = 1.0f;
            const bool has_partner = is_seen(width - 1 - column, row);
            comparable.at(column, row) = has_partner ? 1.0f : 0.0f;
            for (int channel = 0; channel < 3; ++channel) {
                const auto value = static_cast<float>(map.color.at(column, row, channel));
                colors.at(column, row, channel) = value;
                if (has_partner) {
                    difference.at(column, row, channel) =
                        value - static_cast<float>(map.color.at(width - 1 - column, row, channel));
                }
            }
        }
    }
    if (options.mirroring == Mirroring::flip_u) {
        const ImageF shift = diffuse(difference, comparable);
        for (int row = 0; row < height; ++row) {
            for (int column = 0; column < width; ++column) {
                if (is_seen(column, row) || !is_seen(width - 1 - column, row)) {
                    continue;
                }
                known.at(column, row) = 1.0f;
                completed.origin.at(column, row) = static_cast<std::uint8_t>(TexelOrigin::mirrored);
                for (int channel = 0; channel < 3; ++channel) {
                    colors.at(column, row, channel) =
                        std::clamp(static_cast<float>(map.color.at(width - 1 - column, row, channel)) +
                                       shift.at(column, row, channel),
                                   0.0f, 255.0f);
                }
            }
        }
    }
    const bool is_anything_known = std::any_of(known.data.begin(), known.data.end(), [](float k) { return k > 0; });
    const ImageF filled = is_anything_known ? diffuse(colors, known) : ImageF(width, height, 3, 128.0f);
    for (int row = 0; row < height; ++row) {
        for (int column = 0; column < width; ++column) {
            if (!(known.at(column, row) > 0)) {
                completed.origin.at(column, row) = static_cast<std::uint8_t>(TexelOrigin::diffused);
            }
            for (int channel = 0; channel < 3 && !is_seen(column, row); ++channel) {
                completed.color.at(column, row, channel) =
                    static_cast<std::uint8_t>(rounded(filled.at(column, row, channel)));
            }
        }
    }
    return completed;
}

} // namespace lineament
