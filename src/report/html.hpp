// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

/// Text for HTML pages: everything that comes from outside passes through one of these functions.
namespace lineament::html {

/// The text with & < > " ' as character references, fit for element content and quoted attributes. Control characters
/// other than tab and line end, and bytes that are not UTF-8, become U+FFFD.
[[nodiscard]] std::string escape(std::string_view text);

/// The text as a JSON string with its quotes, in which no "<" stands, so that it may lie inside a script element.
[[nodiscard]] std::string json_string(std::string_view text);

/// The number with so many digits after the point; "–" if it is not finite. Independent of the locale.
[[nodiscard]] std::string number(double value, int digits);

/// The shortest decimal text that reads back as the same float; "null" if it is not finite. For JSON.
[[nodiscard]] std::string json_number(float value);

/// RFC 4648 base64 with padding.
[[nodiscard]] std::string base64(std::span<const std::byte> bytes);

/// Base64 of the values as little-endian float32, int16 or uint32.
[[nodiscard]] std::string base64_floats(std::span<const float> values);
[[nodiscard]] std::string base64_int16(std::span<const std::int16_t> values);
[[nodiscard]] std::string base64_uint32(std::span<const std::uint32_t> values);

/// The picture as a "data:" address, a JPEG of quality 90, or a PNG if it has an alpha channel; reduced to at most
/// `max_side_px` (> 0). The picture must not be empty.
[[nodiscard]] std::string image_address(const ImageU8& picture, int max_side_px);

} // namespace lineament::html
