// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/error.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace lineament {

/// The largest file a reader takes in one piece.
struct FileLimit
{
    std::uint64_t max_bytes = std::uint64_t{2} << 30;
};

/// All bytes of a regular file.
///
/// @throws IoError (system) if the file is missing, not permitted, not a regular file (a folder, a pipe, a device: it
///         is never opened for waiting) or changes its size while it is read; (limit) if it is larger than the limit,
///         before anything is allocated.
[[nodiscard]] std::vector<std::byte> read_file(const std::filesystem::path& path, FileLimit limit = {});

/// As read_file, as text. The bytes are not checked to be UTF-8.
[[nodiscard]] std::string read_text_file(const std::filesystem::path& path, FileLimit limit = {});

/// Replaces the file by the bytes, or leaves it as it was: writes a temporary file in the same folder, flushes it to
/// the device, renames it over the old one and flushes the folder. A symbolic link is followed.
///
/// @throws IoError (system) naming path, reason and number of bytes; the temporary file is removed, the old file whole.
void write_file(const std::filesystem::path& path, std::span<const std::byte> bytes);
void write_file(const std::filesystem::path& path, std::string_view text);

/// A file in the making, for writers that need a name to write to. Whatever is written to temporary_path() becomes the
/// file at path() by commit(); without commit() it is removed.
class AtomicFile
{
public:
    /// Creates the empty temporary file in the folder of `path`, with the same extension.
    /// @throws IoError (system) if that fails, or if `path` exists and is not a regular file.
    explicit AtomicFile(const std::filesystem::path& path);
    ~AtomicFile();
    AtomicFile(const AtomicFile&) = delete;
    AtomicFile& operator=(const AtomicFile&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
    [[nodiscard]] const std::filesystem::path& temporary_path() const noexcept { return temporary_path_; }

    /// Writes at the end of the temporary file.
    /// @throws IoError (system) naming path, reason and number of bytes.
    void write(std::span<const std::byte> bytes);

    /// Flushes the temporary file to the device and renames it to path(). To be called once, with the file closed by
    /// whoever wrote to it.
    /// @throws IoError (system); the temporary file is then removed at the end of this object's life.
    void commit();

private:
    friend class FileBatch;
    void close();
    void start_flush(); ///< Closes the file, of which the device may take its time.
    void flush_file();
    void replace();
    void flush_folder() const;

    std::filesystem::path path_;
    std::filesystem::path target_; ///< path_ with symbolic links followed.
    std::filesystem::path temporary_path_;
    int descriptor_ = -1;
};

/// Files that belong together and appear together. The device writes each while the next is made, so that commit()
/// waits once for all of them, and not as often as write_file would.
class FileBatch
{
public:
    /// Writes a temporary file beside `path`. @throws IoError as write_file.
    void write(const std::filesystem::path& path, std::span<const std::byte> bytes);
    void write(const std::filesystem::path& path, std::string_view text);

    /// Flushes what was written since the last call to the device, renames it in the order it was written, and flushes
    /// the folders. What is not committed is removed at the end of this object's life.
    /// @throws IoError (system) as write_file; no file is replaced unless all could be flushed.
    void commit();

private:
    std::vector<std::unique_ptr<AtomicFile>> files_;
};

/// What a file that could not be read as expected seems to be.
struct ContentGuess
{
    std::string kind = {};   ///< "a git-LFS pointer".
    std::string advice = {}; ///< "run git lfs pull"; may be empty.
};

/// Recognises, from the leading bytes, what people confuse with models, meshes and images: web pages, git-LFS pointers,
/// archives, pickles, MATLAB, HDF5 and cereal files, safetensors files, pictures, UTF-16 text. Empty if nothing is
/// recognised.
[[nodiscard]] std::optional<ContentGuess> guess_content(std::span<const std::byte> bytes);

/// "; it seems to be a git-LFS pointer: run git lfs pull", or an empty text; to end a message with.
[[nodiscard]] std::string content_hint(std::span<const std::byte> bytes);

} // namespace lineament
