// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/io/safetensors.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

// What reader and writer of the model file share; the layout is described in docs/formats.md.
namespace lineament::model_format {

inline constexpr const char* format_name = "lineament-model";
inline constexpr int version = 1;
inline constexpr std::string_view checksum_key = "\"crc32c\":\"";
inline constexpr std::size_t checksum_digits = 8;

/// Position in the file of the checksum's first digit, or nothing.
[[nodiscard]] std::optional<std::size_t> find_checksum(std::span<const std::byte> file);

/// Checksum of the file whose own digits, at `position`, are taken as zeros: 8 lower-case hexadecimal digits.
[[nodiscard]] std::string compute_checksum(std::span<const std::byte> file, std::size_t position);

} // namespace lineament::model_format
