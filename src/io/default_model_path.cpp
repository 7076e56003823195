// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/core/error.hpp"
#include "lineament/io/model_file.hpp"

#include <cstdlib>

namespace lineament {

std::filesystem::path default_model_path()
{
    const auto exists = [](const std::filesystem::path& path) {
        std::error_code ignored;
        return std::filesystem::is_regular_file(path, ignored);
    };
    const std::string advice = "; set LINEAMENT_MODEL or give the model's path";
    if (const char* variable = std::getenv("LINEAMENT_MODEL"); variable != nullptr && *variable != '\0') {
        if (!exists(variable)) {
            throw IoError(IoErrorKind::system, variable, "",
                          "no such file; the environment variable LINEAMENT_MODEL names it");
        }
        return variable;
    }
    const char* const name = "lineament-face-1.safetensors";
    std::string places;
    for (const char* folder : {LINEAMENT_SOURCE_MODELS, LINEAMENT_INSTALLED_MODELS}) {
        const std::filesystem::path path = std::filesystem::path(folder) / name;
        if (exists(path)) {
            return path;
        }
        places += (places.empty() ? "" : ", ") + path.string();
    }
    throw IoError(IoErrorKind::system, name, "",
                  "the default model is not there; looked at LINEAMENT_MODEL (not set), " + places + advice);
}

} // namespace lineament
