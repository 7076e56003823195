// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>

namespace lineament::test {

/// The folder of node modules with the Khronos glTF validator ($LINEAMENT_GLTF_VALIDATOR), or an empty text; empty too
/// without node.
inline std::string gltf_validator_modules()
{
    const char* const modules = std::getenv("LINEAMENT_GLTF_VALIDATOR");
    return modules != nullptr && std::system("node --version > /dev/null 2>&1") == 0 ? modules : "";
}

/// What the validator prints for a GLB file; the last line is "errors 0 warnings 0" if it finds nothing.
inline std::string validate_glb(const std::string& path)
{
    const std::string command = "node '" LINEAMENT_SOURCE_DIR "/tests/support/gltf_validate.js' '" +
                                gltf_validator_modules() + "' '" + path + "' 2>&1";
    FILE* pipe = popen(command.c_str(), "r");
    std::string output;
    for (int c = pipe == nullptr ? EOF : std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) {
        output += static_cast<char>(c);
    }
    if (pipe != nullptr) {
        pclose(pipe);
    }
    return output;
}

} // namespace lineament::test

/// Ends the test as skipped, naming what is missing, unless the validator can run.
#define LINEAMENT_REQUIRE_GLTF_VALIDATOR()                                                                             \
    if (::lineament::test::gltf_validator_modules().empty()) {                                                         \
        GTEST_SKIP() << "node or the package gltf-validator not found (set LINEAMENT_GLTF_VALIDATOR to node_modules)"; \
    }
