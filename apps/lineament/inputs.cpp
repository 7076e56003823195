// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "inputs.hpp"

#include "console.hpp"
#include "lineament/core/error.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include <glob.h>
#include <sys/stat.h>

namespace lineament::cli {

namespace fs = std::filesystem;

namespace {

std::vector<fs::path> files_in_folder(const fs::path& folder, const std::vector<std::string>& extensions)
{
    std::vector<fs::path> files;
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
        std::error_code ignored;
        if (entry->is_regular_file(ignored) &&
            std::find(extensions.begin(), extensions.end(), lower_extension(entry->path())) != extensions.end()) {
            files.push_back(entry->path());
        }
    }
    if (error) {
        throw IoError(IoErrorKind::system, folder.string(), "", "the folder cannot be read: " + error.message());
    }
    std::sort(files.begin(), files.end());
    if (files.empty()) {
        std::string list;
        for (const std::string& extension : extensions) {
            list += " " + extension;
        }
        throw Failure(wrong_use, folder.string() + ": the folder holds no file of these kinds:" + list);
    }
    return files;
}

std::vector<fs::path> files_of_pattern(const std::string& pattern)
{
    glob_t matches = {};
    std::vector<fs::path> files;
    if (glob(pattern.c_str(), 0, nullptr, &matches) == 0) {
        files.assign(matches.gl_pathv, matches.gl_pathv + matches.gl_pathc);
    }
    globfree(&matches);
    if (files.empty()) {
        throw Failure(wrong_use, pattern + ": no file matches the pattern");
    }
    return files;
}

/// Device and number of a file's inode, which all its names share; empty if there is no such file.
std::optional<std::pair<dev_t, ino_t>> identity_of(const fs::path& path)
{
    struct stat status = {};
    if (stat(path.c_str(), &status) != 0) {
        return std::nullopt;
    }
    return std::pair(status.st_dev, status.st_ino);
}

} // namespace

std::string lower_extension(const fs::path& path)
{
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c); });
    return extension;
}

std::vector<Job> collect_jobs(const std::vector<std::string>& inputs, const fs::path& output,
                              const std::vector<std::string>& extensions)
{
    std::vector<fs::path> files;
    for (const std::string& input : inputs) {
        std::error_code ignored;
        if (fs::is_directory(input, ignored)) {
            const std::vector<fs::path> found = files_in_folder(input, extensions);
            files.insert(files.end(), found.begin(), found.end());
        } else if (!fs::exists(input, ignored) && input.find_first_of("*?") != std::string::npos) {
            const std::vector<fs::path> found = files_of_pattern(input);
            files.insert(files.end(), found.begin(), found.end());
        } else {
            files.emplace_back(input);
        }
    }
    std::vector<Job> jobs;
    std::map<fs::path, fs::path> taken;
    for (const fs::path& file : files) {
        const Job job{file, output / file.stem()};
        if (const auto [other, is_new] = taken.emplace(job.output, job.input); !is_new) {
            throw Failure(system_failed, file.string() + " and " + other->second.string() + " would both write to " +
                                             job.output.string() + "; run them with different -o folders");
        }
        if (std::error_code ignored; fs::exists(job.output, ignored) && !fs::is_directory(job.output, ignored)) {
            throw Failure(system_failed, job.output.string() + ": the results' folder exists as a file; choose another "
                                                               "-o folder");
        }
        jobs.push_back(job);
    }
    return jobs;
}

std::vector<fs::path> result_files(const Job& job, const std::vector<std::string>& names)
{
    std::vector<fs::path> folders = {job.output};
    std::error_code error;
    for (fs::directory_iterator entry(job.output, error), end; !error && entry != end; entry.increment(error)) {
        if (entry->path().filename().string().starts_with("face_")) {
            folders.push_back(entry->path());
        }
    }
    std::vector<fs::path> files;
    for (const fs::path& folder : folders) {
        for (const std::string& name : names) {
            files.push_back(folder / name);
        }
    }
    return files;
}

void refuse_to_overwrite(const std::vector<fs::path>& read, const std::vector<fs::path>& written)
{
    std::map<std::pair<dev_t, ino_t>, fs::path> inputs;
    for (const fs::path& path : read) {
        if (const auto identity = identity_of(path)) {
            inputs.emplace(*identity, path);
        }
    }
    for (const fs::path& path : written) {
        const auto identity = identity_of(path);
        const auto input = identity ? inputs.find(*identity) : inputs.end();
        if (input != inputs.end()) {
            throw Failure(system_failed, path.string() + ": would be written over the input " + input->second.string() +
                                             "; choose another place with -o, nothing is written");
        }
    }
}

void make_folder(const fs::path& folder)
{
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) {
        throw IoError(IoErrorKind::system, folder.string(), "", "the folder cannot be made: " + error.message());
    }
}

} // namespace lineament::cli
