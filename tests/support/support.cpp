// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "support/matchers.hpp"

#include <cstdlib>

#include <unistd.h>

namespace lineament::test {

TemporaryFolder::TemporaryFolder()
{
    std::string pattern = (std::filesystem::temp_directory_path() / "lineament-test-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) {
        throw std::runtime_error("cannot make a temporary folder");
    }
    path_ = pattern;
}

TemporaryFolder::~TemporaryFolder()
{
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
}

std::filesystem::path real_data_folder()
{
    if (const char* folder = std::getenv("LINEAMENT_DATA")) {
        return folder;
    }
    const std::filesystem::path beside = std::filesystem::path(LINEAMENT_SOURCE_DIR).parent_path() / "shared" / "data";
    return std::filesystem::exists(beside) ? beside : std::filesystem::path();
}

} // namespace lineament::test
