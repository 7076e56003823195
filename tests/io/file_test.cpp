// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/file.hpp"

#include "support/matchers.hpp"

#include <csignal>
#include <fstream>
#include <functional>

#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

namespace lineament {
namespace {

using test::TemporaryFolder;
using test::throws;

std::vector<std::byte> bytes_of(std::string_view text)
{
    const auto bytes = std::as_bytes(std::span(text));
    return {bytes.begin(), bytes.end()};
}

std::size_t num_entries(const std::filesystem::path& folder)
{
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

IoErrorKind kind_of(const std::function<void()>& function)
{
    try {
        function();
    } catch (const IoError& error) {
        return error.kind();
    }
    throw std::runtime_error("no IoError");
}

TEST(ReadFile, WhatWasWrittenIsReadBackByteForByte)
{
    const TemporaryFolder folder;
    for (const std::size_t size : {0, 1, 4096, 1'000'003}) {
        std::string text(size, '\0');
        for (std::size_t i = 0; i < size; ++i) {
            text[i] = static_cast<char>(i * 31 + (i >> 8));
        }
        write_file(folder / "a.bin", text);
        EXPECT_EQ(read_file(folder / "a.bin"), bytes_of(text));
        EXPECT_EQ(read_text_file(folder / "a.bin"), text);
    }
}

TEST(ReadFile, NamesWhatIsNotARegularFileWithoutHanging)
{
    const TemporaryFolder folder;
    ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
    EXPECT_TRUE(throws<IoError>([&] { (void)read_file(folder / "pipe"); }, folder / "pipe", "is a pipe"));
    EXPECT_TRUE(throws<IoError>([&] { (void)read_file(folder.path()); }, "is a folder"));
    EXPECT_TRUE(throws<IoError>([&] { (void)read_file("/dev/zero"); }, "/dev/zero", "is a device"));
    EXPECT_TRUE(throws<IoError>([&] { (void)read_file(folder / "none"); }, folder / "none", "No such file"));
    EXPECT_EQ(kind_of([&] { (void)read_file(folder / "pipe"); }), IoErrorKind::system);
    EXPECT_EQ(kind_of([&] { (void)read_file(folder / "none"); }), IoErrorKind::system);
}

TEST(ReadFile, NamesAFileThatMayNotBeRead)
{
    if (geteuid() == 0) {
        GTEST_SKIP() << "the superuser may read everything";
    }
    const TemporaryFolder folder;
    write_file(folder / "a", "x");
    chmod((folder / "a").c_str(), 0);
    EXPECT_TRUE(throws<IoError>([&] { (void)read_file(folder / "a"); }, "Permission denied"));
}

TEST(ReadFile, AFileOverTheLimitIsRefusedBeforeMemoryIsTaken)
{
    const TemporaryFolder folder;
    write_file(folder / "a", "12345");
    EXPECT_EQ(read_text_file(folder / "a", {.max_bytes = 5}), "12345");
    EXPECT_EQ(kind_of([&] { (void)read_file(folder / "a", {.max_bytes = 4}); }), IoErrorKind::limit);
    write_file(folder / "huge", "");
    std::filesystem::resize_file(folder / "huge", std::uintmax_t{1} << 40); // sparse
    EXPECT_TRUE(throws<IoError>([&] { (void)read_file(folder / "huge"); }, "1099511627776 bytes", "at most"));
}

TEST(WriteFile, ReplacesAnOldFileAndKeepsItsPermissions)
{
    const TemporaryFolder folder;
    write_file(folder / "a", "old");
    chmod((folder / "a").c_str(), 0640);
    write_file(folder / "a", "new");
    EXPECT_EQ(read_text_file(folder / "a"), "new");
    struct stat status = {};
    ASSERT_EQ(stat((folder / "a").c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0640u);
    EXPECT_EQ(num_entries(folder.path()), 1u);
}

TEST(WriteFile, FollowsASymbolicLink)
{
    const TemporaryFolder folder;
    write_file(folder / "real", "old");
    std::filesystem::create_symlink("real", folder / "link");
    write_file(folder / "link", "new");
    EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
    EXPECT_EQ(read_text_file(folder / "real"), "new");
}

TEST(WriteFile, RefusesAFolderADeviceAndAMissingFolder)
{
    const TemporaryFolder folder;
    std::filesystem::create_directory(folder / "sub");
    EXPECT_TRUE(throws<IoError>([&] { write_file(folder / "sub", "x"); }, folder / "sub", "is a folder"));
    EXPECT_TRUE(throws<IoError>([&] { write_file("/dev/null", "x"); }, "is a device"));
    EXPECT_TRUE(throws<IoError>([&] { write_file(folder / "none/a", "x"); }, "none/a", "No such file"));
    EXPECT_EQ(num_entries(folder.path()), 1u);
}

TEST(WriteFile, AFailedWriteLeavesTheOldFileAndNoTemporaryOne)
{
    const TemporaryFolder folder;
    write_file(folder / "a", "old");
    rlimit old_limit = {};
    getrlimit(RLIMIT_FSIZE, &old_limit);
    const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit small = {10'000, old_limit.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    const std::string text(100'000, 'x');
    const auto result =
        throws<IoError>([&] { write_file(folder / "a", text); }, folder / "a", "100000 bytes", "File too large");
    setrlimit(RLIMIT_FSIZE, &old_limit);
    std::signal(SIGXFSZ, old_handler);
    EXPECT_TRUE(result);
    EXPECT_EQ(read_text_file(folder / "a"), "old");
    EXPECT_EQ(num_entries(folder.path()), 1u);
}

TEST(AtomicFile, WithoutCommitNothingChanges)
{
    const TemporaryFolder folder;
    write_file(folder / "a.mp4", "old");
    {
        AtomicFile file(folder / "a.mp4");
        EXPECT_EQ(file.temporary_path().extension(), ".mp4");
        EXPECT_EQ(file.temporary_path().parent_path(), folder.path());
        std::ofstream(file.temporary_path()) << "half";
    }
    EXPECT_EQ(read_text_file(folder / "a.mp4"), "old");
    EXPECT_EQ(num_entries(folder.path()), 1u);
}

TEST(AtomicFile, CommitPublishesWhatAnotherWriterWroteUnderTheTemporaryName)
{
    const TemporaryFolder folder;
    AtomicFile file(folder / "a.mp4");
    std::filesystem::remove(file.temporary_path()); // some writers make the file anew
    std::ofstream(file.temporary_path()) << "video";
    EXPECT_FALSE(std::filesystem::exists(folder / "a.mp4"));
    file.commit();
    EXPECT_EQ(read_text_file(folder / "a.mp4"), "video");
    EXPECT_EQ(num_entries(folder.path()), 1u);
}

TEST(FileBatch, FilesAppearTogetherOnCommitAndNotWithoutIt)
{
    const TemporaryFolder folder;
    std::filesystem::create_directory(folder / "b");
    write_file(folder / "old", "old");
    {
        FileBatch batch;
        batch.write(folder / "old", "new");
        batch.write(folder / "b/more", "more");
        EXPECT_EQ(read_text_file(folder / "old"), "old");
        EXPECT_FALSE(std::filesystem::exists(folder / "b/more"));
    }
    EXPECT_EQ(num_entries(folder.path()), 2u);
    EXPECT_EQ(num_entries(folder / "b"), 0u);
    FileBatch batch;
    batch.write(folder / "old", "newer");
    batch.write(folder / "b/more", "more");
    batch.write(folder / "b/more", "most");
    batch.commit();
    EXPECT_EQ(read_text_file(folder / "old"), "newer");
    EXPECT_EQ(read_text_file(folder / "b/more"), "most");
    EXPECT_EQ(num_entries(folder.path()), 2u);
    EXPECT_EQ(num_entries(folder / "b"), 1u);
    batch.commit(); // nothing is left to do
}

TEST(FileBatch, AFileThatCannotBeMadeLeavesTheOthersAsTheyWere)
{
    const TemporaryFolder folder;
    write_file(folder / "old", "old");
    {
        FileBatch batch;
        batch.write(folder / "old", "new");
        EXPECT_TRUE(throws<IoError>([&] { batch.write(folder / "none/b", "b"); }, "none/b"));
    }
    EXPECT_EQ(read_text_file(folder / "old"), "old");
    EXPECT_EQ(num_entries(folder.path()), 1u);
}

TEST(GuessContent, NamesWhatIsOftenMistakenForSomethingElse)
{
    const auto kind = [](std::string_view text) {
        const auto guess = guess_content(std::as_bytes(std::span(text)));
        return guess ? guess->kind : "";
    };
    using namespace std::string_view_literals;
    EXPECT_THAT(kind("\n<!DOCTYPE HTML><title>404"), testing::HasSubstr("HTML"));
    EXPECT_THAT(kind("version https://git-lfs.github.com/spec/v1\noid"), testing::HasSubstr("git-LFS"));
    EXPECT_THAT(kind("\x1f\x8b\x08"), testing::HasSubstr("gzip"));
    EXPECT_THAT(kind("PK\x03\x04"), testing::HasSubstr("zip"));
    EXPECT_THAT(kind("\x80\x04\x95"), testing::HasSubstr("pickle"));
    EXPECT_THAT(kind("MATLAB 5.0 MAT-file"), testing::HasSubstr("MATLAB"));
    EXPECT_THAT(kind("\x89HDF\r\n\x1a\n"), testing::HasSubstr("HDF5"));
    EXPECT_THAT(kind("\x89PNG\r\n\x1a\n"), testing::HasSubstr("PNG"));
    EXPECT_THAT(kind("\xff\xd8\xff\xe0"), testing::HasSubstr("JPEG"));
    EXPECT_THAT(kind("\xff\xfev\0"sv), testing::HasSubstr("UTF-16"));
    EXPECT_THAT(kind("\x01\0\0\0\x68\x28\0\0\x01\0\0\0\x5c\x81\x58\xc2\0\0\0\0"sv), testing::HasSubstr("eos"));
    EXPECT_THAT(kind("\x06\0\0\0\0\0\0\0\x05\0\0\0\0\0\0\0anger"sv), testing::HasSubstr("eos"));
    EXPECT_EQ(kind("v 0 0 0\nv 1 0 0\n"), "");
    EXPECT_EQ(kind(""), "");
}

TEST(GuessContent, ModelsOfOtherProgramsCannotBeReadYetAndAreSentToNoCommand)
{
    using namespace std::string_view_literals;
    const auto hint = [](std::string_view text) { return content_hint(std::as_bytes(std::span(text))); };
    for (const std::string_view text : {"MATLAB 5.0 MAT-file"sv, "MATLAB 7.3 MAT-file"sv, "\x89HDF\r\n\x1a\n"sv,
                                        "PK\x03\x04"sv, "\x01\0\0\0\x68\x28\0\0\x01\0\0\0\x5c\x81\x58\xc2\0\0\0\0"sv}) {
        EXPECT_THAT(hint(text), testing::HasSubstr("yet"));
        EXPECT_THAT(hint(text), testing::Not(testing::HasSubstr("convert")));
    }
    EXPECT_THAT(hint("\x80\x04\x95"),
                testing::AllOf(testing::HasSubstr("never loaded"), testing::Not(testing::HasSubstr("convert"))));
    EXPECT_THAT(hint("GIF8"), testing::HasSubstr("convert it to PNG")) << "what another program can convert";
}

TEST(GuessContent, RecognisesRealEosModels)
{
    LINEAMENT_REQUIRE_REAL_DATA("models/sfm_eos/sfm_shape_3448.bin");
    for (const char* name : {"sfm_shape_3448.bin", "expression_blendshapes_3448.bin"}) {
        const auto bytes = read_file(test::real_data_folder() / "models/sfm_eos" / name);
        EXPECT_THAT(content_hint(bytes), testing::HasSubstr("eos model")) << name;
    }
}

} // namespace
} // namespace lineament
