// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// How RealtimeFitter keeps the columns of its mesh: without the blocks that are zero, in 16 bits.      docs/realtime.md
#pragma once

#include "lineament/fit/realtime_buffers.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace lineament::detail {

/// The columns of panels without the blocks that are zero; nothing where these are less than half,
/// which reading panels in order makes up for.
[[nodiscard]] inline ColumnBlocks make_blocks(const AlignedBuffer<float>& panels, int num_panels, int num_columns)
{
    constexpr int blocks_a_panel = kernels::panel_size / kernels::block_size;
    const auto block_of = [&](int block, int column) {
        const std::size_t panel = static_cast<std::size_t>(block / blocks_a_panel);
        return panels.data() + (panel * num_columns + column) * kernels::panel_size +
               static_cast<std::size_t>(block % blocks_a_panel) * kernels::block_size;
    };
    std::vector<std::vector<int>> columns_of_block(static_cast<std::size_t>(num_panels) * blocks_a_panel);
    std::vector<std::vector<int>> blocks_of_count(static_cast<std::size_t>(num_columns) + 1);
    std::size_t num_values = 0;
    for (int block = 0; block < static_cast<int>(columns_of_block.size()); ++block) {
        std::vector<int>& columns = columns_of_block[block];
        for (int column = 0; column < num_columns; ++column) {
            const float* values = block_of(block, column);
            if (std::any_of(values, values + kernels::block_size, [](float value) { return value != 0; })) {
                columns.push_back(column);
            }
        }
        blocks_of_count[columns.size()].push_back(block);
        num_values += columns.size() * kernels::block_size;
    }
    ColumnBlocks blocks;
    if (2 * num_values > panels.size()) {
        return blocks;
    }
    blocks.values = AlignedBuffer<float>(num_values);
    float* to = blocks.values.data();
    for (int count = 0; count <= num_columns; ++count) {
        for (const int block : blocks_of_count[count]) {
            blocks.offsets.push_back(block * kernels::block_size);
            for (const int column : columns_of_block[block]) {
                blocks.columns.push_back(static_cast<std::uint16_t>(column));
                to = std::copy_n(block_of(block, column), kernels::block_size, to);
            }
        }
        if (!blocks_of_count[count].empty()) {
            blocks.runs.push_back({count, static_cast<int>(blocks_of_count[count].size())});
        }
    }
    return blocks;
}

/// The numbers of a column of panels.
[[nodiscard]] inline std::vector<float> column_of(const AlignedBuffer<float>& panels, int num_columns, int column)
{
    std::vector<float> numbers;
    numbers.reserve(panels.size() / static_cast<std::size_t>(num_columns));
    for (std::size_t at = static_cast<std::size_t>(column) * kernels::panel_size; at < panels.size();
         at += static_cast<std::size_t>(num_columns) * kernels::panel_size) {
        numbers.insert(numbers.end(), panels.data() + at, panels.data() + at + kernels::panel_size);
    }
    return numbers;
}

[[nodiscard]] inline double largest_of(const std::vector<float>& numbers)
{
    float largest = 0;
    for (const float number : numbers) {
        largest = std::max(largest, std::abs(number));
    }
    return largest;
}

/// The scale, a power of two times `unit`, of which the numbers are 16-bit integers, as in a model that was saved in 16
/// bits; none: they are not.
[[nodiscard]] inline std::optional<double> find_scale(const std::vector<float>& numbers, double unit)
{
    int exponent = 0;
    (void)std::frexp(largest_of(numbers) / unit, &exponent);
    const double scale = std::ldexp(unit, exponent - 15);
    const bool is_exact = std::all_of(numbers.begin(), numbers.end(), [&](double number) {
        const double integer = std::nearbyint(number / scale);
        return std::abs(integer) <= 32767 && static_cast<float>(integer * scale) == static_cast<float>(number);
    });
    return is_exact ? std::optional(scale) : std::nullopt;
}

/// @param units  Of the columns, for find_scale.
/// @param must_be_exact  Nothing unless no column loses anything.
[[nodiscard]] inline std::optional<ShortPanels> shorten(const AlignedBuffer<float>& panels,
                                                        const Eigen::VectorXd& units, bool must_be_exact)
{
    const int num_columns = static_cast<int>(units.size());
    ShortPanels shortened;
    shortened.integers = AlignedBuffer<std::int16_t>(panels.size());
    for (int j = 0; j < num_columns; ++j) {
        const std::vector<float> numbers = column_of(panels, num_columns, j);
        std::optional<double> scale = find_scale(numbers, units[j]);
        if (!scale && must_be_exact) {
            return std::nullopt;
        }
        scale = scale.value_or(largest_of(numbers) / 32767.0); // a column of zeros has one
        shortened.scales.push_back(static_cast<float>(*scale));
        for (std::size_t i = 0; i < numbers.size(); ++i) {
            const std::size_t panel = i / kernels::panel_size;
            shortened.integers[(panel * num_columns + j) * kernels::panel_size + i % kernels::panel_size] =
                static_cast<std::int16_t>(std::lround(numbers[i] / *scale));
        }
    }
    return shortened;
}

} // namespace lineament::detail
