// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "support/matchers.hpp"

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

namespace lineament::test {

/// $LINEAMENT_CHROMIUM, or `chromium` if it is on the path, or an empty text.
inline std::string find_chromium()
{
    if (const char* path = std::getenv("LINEAMENT_CHROMIUM")) {
        return path;
    }
    return std::system("command -v chromium > /dev/null 2>&1") == 0 ? "chromium" : "";
}

/// The document of a page in the folder after its scripts have run; empty if Chromium failed.
inline std::string document_of_page(const TemporaryFolder& folder, const std::string& page,
                                    const std::string& more_options = "")
{
    const std::string command = find_chromium() +
                                " --headless=new --no-sandbox --disable-gpu --disable-background-networking"
                                " --no-first-run --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader"
                                " --window-size=1200,1600 --virtual-time-budget=4000 --user-data-dir=" +
                                (folder / "profile") + " " + more_options + " --dump-dom file://" + (folder / page) +
                                " > " + (folder / "document") + " 2> /dev/null";
    if (std::system(command.c_str()) != 0) {
        return "";
    }
    std::ifstream file(folder / "document");
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
}

} // namespace lineament::test

/// Ends the test as skipped, naming what is missing, unless there is a Chromium.
#define LINEAMENT_REQUIRE_CHROMIUM()                                                                                   \
    if (::lineament::test::find_chromium().empty()) {                                                                  \
        GTEST_SKIP() << "chromium not found (set LINEAMENT_CHROMIUM)";                                                 \
    }
