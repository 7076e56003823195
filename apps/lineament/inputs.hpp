// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace lineament::cli {

/// One input file and the folder its results go to.
struct Job
{
    std::filesystem::path input;
    std::filesystem::path output;
};

/// Files named on the command line; a folder stands for the files in it (not below it) with one of the extensions, in
/// alphabetical order, a pattern with * or ? for the files it matches. Every result folder is `output / stem`.
/// @param extensions  Lower case with the dot, for example ".png".
/// @throws Failure(wrong_use) if two inputs would write to one folder, or a folder or pattern holds no such file.
[[nodiscard]] std::vector<Job> collect_jobs(const std::vector<std::string>& inputs, const std::filesystem::path& output,
                                            const std::vector<std::string>& extensions);

/// Makes the folder and those above it. @throws IoError(system) naming the folder.
void make_folder(const std::filesystem::path& folder);

} // namespace lineament::cli
