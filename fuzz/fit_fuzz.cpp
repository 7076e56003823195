// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Hostile fit.json files: what is accepted is written, and read again to the same text.
#include "lineament/core/error.hpp"
#include "lineament/io/fit_file.hpp"

#include <cstdint>
#include <cstdlib>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    using namespace lineament;
    const std::vector<char> bytes(data, data + size); // a block of exact size
    FitFile file;
    try {
        file = parse_fit_json({bytes.data(), bytes.size()}, "fuzz");
    } catch (const IoError&) {
        return 0;
    }
    const std::string text = format_fit_json(file);
    if (format_fit_json(parse_fit_json(text, "again")) != text) {
        std::abort();
    }
    return 0;
}
