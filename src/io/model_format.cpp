// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "model_format.hpp"

#include <algorithm>
#include <cstdio>

namespace lineament::model_format {

std::optional<std::size_t> find_checksum(std::span<const std::byte> file)
{
    std::uint64_t header_size = 0;
    for (std::size_t i = 0; i < 8 && i < file.size(); ++i) {
        header_size |= static_cast<std::uint64_t>(file[i]) << (8 * i);
    }
    const std::string_view text(reinterpret_cast<const char*>(file.data()),
                                std::min<std::uint64_t>(file.size(), 8 + header_size));
    // A quotation mark inside a JSON text is escaped, so this can only be the key itself.
    const std::size_t found = text.find(checksum_key);
    if (found == std::string_view::npos || found + checksum_key.size() + checksum_digits > text.size()) {
        return std::nullopt;
    }
    return found + checksum_key.size();
}

std::string compute_checksum(std::span<const std::byte> file, std::size_t position)
{
    constexpr std::string_view zeros = "00000000";
    std::uint32_t crc = compute_crc32c(file.first(position));
    crc = compute_crc32c(std::as_bytes(std::span(zeros)), crc);
    crc = compute_crc32c(file.subspan(position + checksum_digits), crc);
    char text[checksum_digits + 1];
    std::snprintf(text, sizeof text, "%08x", static_cast<unsigned>(crc));
    return text;
}

} // namespace lineament::model_format
