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
/// @throws Failure(wrong_use) if a folder or pattern holds no such file; Failure(system_failed) if two inputs would
/// write to one folder, or that folder exists as a file.
[[nodiscard]] std::vector<Job> collect_jobs(const std::vector<std::string>& inputs, const std::filesystem::path& output,
                                            const std::vector<std::string>& extensions);

/// The paths at which a job may write files of these names: in its folder and, where there are such, its face_1 ....
[[nodiscard]] std::vector<std::filesystem::path> result_files(const Job& job, const std::vector<std::string>& names);

/// To be called before any work.
/// @param read  The files the command reads; those that do not exist are passed over.
/// @throws Failure(system_failed) if a path to be written is one of these files, also under another name.
void refuse_to_overwrite(const std::vector<std::filesystem::path>& read,
                         const std::vector<std::filesystem::path>& written);

/// The extension in lower case, with the dot.
[[nodiscard]] std::string lower_extension(const std::filesystem::path& path);

/// Makes the folder and those above it. @throws IoError(system) naming the folder.
void make_folder(const std::filesystem::path& folder);

} // namespace lineament::cli
