// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/file.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <map>
#include <random>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace lineament {

namespace {

/// Closes a descriptor at the end of the scope.
class Descriptor
{
public:
    explicit Descriptor(int value) : value_(value) {}
    ~Descriptor()
    {
        if (value_ >= 0) {
            ::close(value_);
        }
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    [[nodiscard]] int value() const { return value_; }

private:
    int value_;
};

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what, int error_number)
{
    throw IoError(IoErrorKind::system, path.string(), "", what + ": " + std::generic_category().message(error_number));
}

int open_again(const char* path, int flags, mode_t mode = 0)
{
    int descriptor = -1;
    do {
        descriptor = ::open(path, flags | O_CLOEXEC, mode);
    } while (descriptor < 0 && errno == EINTR);
    return descriptor;
}

const char* describe_file_type(mode_t mode)
{
    if (S_ISDIR(mode)) {
        return "is a folder, not a file";
    }
    if (S_ISFIFO(mode)) {
        return "is a pipe, not a regular file";
    }
    if (S_ISSOCK(mode)) {
        return "is a socket, not a regular file";
    }
    return "is a device, not a regular file";
}

void flush(int descriptor, const std::filesystem::path& path)
{
    int result = 0;
    do {
        result = ::fsync(descriptor);
    } while (result != 0 && errno == EINTR);
    // A file system without fsync (some network and FUSE mounts) says EINVAL; there is nothing more to do there.
    if (result != 0 && errno != EINVAL) {
        fail(path, "cannot flush to the device", errno);
    }
}

template <typename Bytes>
Bytes read_all(const std::filesystem::path& path, FileLimit limit)
{
    const Descriptor file(open_again(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY));
    if (file.value() < 0) {
        fail(path, "cannot open", errno);
    }
    struct stat status = {};
    if (::fstat(file.value(), &status) != 0) {
        fail(path, "cannot read", errno);
    }
    if (!S_ISREG(status.st_mode)) {
        throw IoError(IoErrorKind::system, path.string(), "", describe_file_type(status.st_mode));
    }
    const auto size = static_cast<std::uint64_t>(status.st_size);
    if (size > limit.max_bytes) {
        throw IoError(IoErrorKind::limit, path.string(), "",
                      "has " + std::to_string(size) + " bytes; at most " + std::to_string(limit.max_bytes) +
                          " are read");
    }
    Bytes bytes;
    bytes.resize(size);
    std::uint64_t count = 0;
    for (;;) {
        char beyond = 0; // asked for once everything is read: the file may have grown
        const bool is_full = count == size;
        void* const target = is_full ? static_cast<void*>(&beyond) : bytes.data() + count;
        const ssize_t got = ::read(file.value(), target, is_full ? 1 : std::min<std::uint64_t>(size - count, 1u << 30));
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got < 0) {
            fail(path, "cannot read " + std::to_string(size) + " bytes", errno);
        }
        if (got == 0 && is_full) {
            return bytes;
        }
        if (got == 0 || is_full) {
            throw IoError(IoErrorKind::system, path.string(), "", "changed while being read; try again");
        }
        count += static_cast<std::uint64_t>(got);
    }
}

std::string random_text()
{
    std::random_device device;
    std::string text;
    for (int i = 0; i < 12; ++i) {
        text += "0123456789abcdefghijklmnopqrstuv"[device() % 32];
    }
    return text;
}

} // namespace

std::vector<std::byte> read_file(const std::filesystem::path& path, FileLimit limit)
{
    return read_all<std::vector<std::byte>>(path, limit);
}

std::string read_text_file(const std::filesystem::path& path, FileLimit limit)
{
    return read_all<std::string>(path, limit);
}

AtomicFile::AtomicFile(const std::filesystem::path& path) : path_(path), target_(path)
{
    std::error_code ignored;
    if (std::filesystem::is_symlink(path, ignored)) {
        const std::filesystem::path followed = std::filesystem::weakly_canonical(path, ignored);
        target_ = ignored ? path : followed;
    }
    struct stat status = {};
    if (::stat(target_.c_str(), &status) == 0 && !S_ISREG(status.st_mode)) {
        throw IoError(IoErrorKind::system, path.string(), "",
                      std::string("cannot be written: ") + describe_file_type(status.st_mode));
    }
    std::string extension = target_.extension().string();
    if (extension.size() > 16) {
        extension.clear();
    }
    const std::filesystem::path folder = target_.parent_path();
    for (int attempt = 0; attempt < 100 && descriptor_ < 0; ++attempt) {
        temporary_path_ = folder / (".lineament-" + random_text() + ".tmp" + extension);
        descriptor_ = open_again(temporary_path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND, 0666);
        if (descriptor_ < 0 && errno != EEXIST) {
            break;
        }
    }
    if (descriptor_ < 0) {
        fail(path, "cannot create a file in " + (folder.empty() ? "the current folder" : folder.string()), errno);
    }
}

AtomicFile::~AtomicFile()
{
    if (descriptor_ >= 0) {
        ::close(descriptor_);
    }
    if (!temporary_path_.empty()) {
        ::unlink(temporary_path_.c_str());
    }
}

void AtomicFile::write(std::span<const std::byte> bytes)
{
    std::size_t count = 0;
    while (count < bytes.size()) {
        const ssize_t written = ::write(descriptor_, bytes.data() + count, bytes.size() - count);
        if (written < 0 && errno == EINTR) {
            continue;
        }
        if (written < 0) {
            fail(path_, "cannot write " + std::to_string(bytes.size()) + " bytes", errno);
        }
        count += static_cast<std::size_t>(written);
    }
}

void AtomicFile::close()
{
    const int descriptor = descriptor_;
    descriptor_ = -1;
    if (descriptor >= 0 && ::close(descriptor) != 0 && errno != EINTR) {
        fail(path_, "cannot close the temporary file", errno);
    }
}

void AtomicFile::start_flush()
{
#ifdef SYNC_FILE_RANGE_WRITE
    ::sync_file_range(descriptor_, 0, 0, SYNC_FILE_RANGE_WRITE); // a hint: flush_file waits for it and tells of errors
#endif
    close();
}

void AtomicFile::flush_file()
{
    // The writer may have replaced the file under the temporary name, so the name is opened again.
    const Descriptor file(open_again(temporary_path_.c_str(), O_RDONLY));
    if (file.value() < 0) {
        fail(path_, "cannot open the temporary file " + temporary_path_.string(), errno);
    }
    struct stat old = {};
    if (::stat(target_.c_str(), &old) == 0) {
        ::fchmod(file.value(), old.st_mode & 07777); // keeps the permissions of the file it replaces
    }
    flush(file.value(), path_);
}

void AtomicFile::replace()
{
    close();
    if (::rename(temporary_path_.c_str(), target_.c_str()) != 0) {
        fail(path_, "cannot replace", errno);
    }
    temporary_path_.clear();
}

void AtomicFile::flush_folder() const
{
    const std::filesystem::path parent = target_.parent_path();
    const Descriptor folder(open_again(parent.empty() ? "." : parent.c_str(), O_RDONLY | O_DIRECTORY));
    if (folder.value() >= 0) { // a folder that may be written but not read cannot be flushed
        flush(folder.value(), path_);
    }
}

void AtomicFile::commit()
{
    flush_file();
    replace();
    flush_folder();
}

void FileBatch::write(const std::filesystem::path& path, std::span<const std::byte> bytes)
{
    AtomicFile& file = *files_.emplace_back(std::make_unique<AtomicFile>(path));
    file.write(bytes);
    file.start_flush();
}

void FileBatch::write(const std::filesystem::path& path, std::string_view text)
{
    write(path, std::as_bytes(std::span(text)));
}

void FileBatch::commit()
{
    const std::vector<std::unique_ptr<AtomicFile>> files = std::move(files_); // removed at the end if something fails
    files_.clear();
    for (const auto& file : files) {
        file->flush_file();
    }
    std::map<std::filesystem::path, const AtomicFile*> folders;
    for (const auto& file : files) {
        file->replace();
        folders[file->target_.parent_path()] = file.get();
    }
    for (const auto& [folder, file] : folders) {
        file->flush_folder();
    }
}

void write_file(const std::filesystem::path& path, std::span<const std::byte> bytes)
{
    AtomicFile file(path);
    file.write(bytes);
    file.commit();
}

void write_file(const std::filesystem::path& path, std::string_view text)
{
    write_file(path, std::as_bytes(std::span(text)));
}

} // namespace lineament
