// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/vision/video.hpp"

#include "lineament/core/error.hpp"
#include "support/matchers.hpp"

#include <cmath>
#include <cstdlib>
#include <fstream>

namespace lineament {
namespace {

using test::throws;

/// Four flat quarters whose colours follow from the frame's number.
ImageU8 numbered_picture(int width, int height, int number)
{
    ImageU8 picture(width, height, 3);
    for (int row = 0; row < height; ++row) {
        for (int column = 0; column < width; ++column) {
            const bool left = column < width / 2;
            const bool top = row < height / 2;
            std::uint8_t* pixel = picture.pixel(column, row);
            pixel[0] = top && left ? 220 : 40;
            pixel[1] = top && !left ? 200 : 60;
            pixel[2] = static_cast<std::uint8_t>(30 + (number * 8) % 200);
        }
    }
    return picture;
}

/// Frames of the pattern at the given times.
void write_clip(const std::string& path, int width, int height, const std::vector<double>& times)
{
    VideoWriter writer(path);
    for (std::size_t i = 0; i < times.size(); ++i) {
        writer.write(numbered_picture(width, height, static_cast<int>(i)), times[i]);
    }
    writer.finish();
}

std::vector<double> steady_times(int count, double frame_rate)
{
    std::vector<double> times;
    for (int i = 0; i < count; ++i) {
        times.push_back(i / frame_rate);
    }
    return times;
}

std::vector<VideoFrame> read_all(VideoReader& reader)
{
    std::vector<VideoFrame> frames;
    while (std::optional<VideoFrame> frame = reader.next()) {
        frames.push_back(std::move(*frame));
    }
    return frames;
}

int colour_difference(const ImageU8& a, const ImageU8& b, int column, int row)
{
    int largest = 0;
    for (int channel = 0; channel < 3; ++channel) {
        largest = std::max(largest, std::abs(int(a.at(column, row, channel)) - int(b.at(column, row, channel))));
    }
    return largest;
}

std::string content_of(const std::string& path)
{
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

void cut_file(const std::string& from, const std::string& to, double part)
{
    const std::string content = content_of(from);
    std::ofstream(to, std::ios::binary) << content.substr(
        0, static_cast<std::size_t>(part * static_cast<double>(content.size())));
}

TEST(Video, ReaderReturnsEveryWrittenFrameWithItsTimeAndColours)
{
    const test::TemporaryFolder folder;
    const std::vector<double> times = steady_times(70, 30000.0 / 1001.0);
    write_clip(folder / "clip.mp4", 64, 48, times);
    VideoReader reader(folder / "clip.mp4");
    EXPECT_EQ(reader.info().width, 64);
    EXPECT_EQ(reader.info().height, 48);
    const std::vector<VideoFrame> frames = read_all(reader);
    ASSERT_EQ(frames.size(), times.size());
    for (std::size_t i = 0; i < frames.size(); ++i) {
        EXPECT_EQ(frames[i].index, static_cast<std::int64_t>(i));
        EXPECT_NEAR(frames[i].time_s, times[i], 1e-9);
        const ImageU8 expected = numbered_picture(64, 48, static_cast<int>(i));
        for (const auto& [column, row] : {std::pair(16, 12), {48, 12}, {16, 36}, {48, 36}}) {
            EXPECT_LE(colour_difference(frames[i].picture, expected, column, row), 8) << "frame " << i;
        }
    }
    EXPECT_TRUE(frames[0].keyframe);
    EXPECT_EQ(reader.problem(), std::nullopt);
    EXPECT_EQ(reader.num_repaired_times(), 0);
    EXPECT_EQ(reader.next(), std::nullopt) << "the end stays the end";
}

TEST(Video, VariableFrameRateIsKept)
{
    const test::TemporaryFolder folder;
    const std::vector<double> times = {0.0, 0.02, 0.1, 0.15, 1.0, 1.01, 3.5, 3.6};
    write_clip(folder / "clip.mp4", 32, 32, times);
    VideoReader reader(folder / "clip.mp4");
    const std::vector<VideoFrame> frames = read_all(reader);
    ASSERT_EQ(frames.size(), times.size());
    for (std::size_t i = 0; i < frames.size(); ++i) {
        EXPECT_NEAR(frames[i].time_s, times[i], 1.0 / 60000.0);
    }
}

TEST(Video, OddSizesArePaddedByRepeatingTheBorder)
{
    for (const auto& [width, height] : {std::pair(33, 31), {1, 1}, {3, 5}, {250, 2}}) {
        const test::TemporaryFolder folder;
        write_clip(folder / "clip.mp4", width, height, steady_times(3, 25.0));
        VideoReader reader(folder / "clip.mp4");
        EXPECT_EQ(reader.info().width, width + width % 2);
        EXPECT_EQ(reader.info().height, height + height % 2);
        const std::vector<VideoFrame> frames = read_all(reader);
        ASSERT_EQ(frames.size(), 3u);
        EXPECT_EQ(frames[0].picture.width, reader.info().width);
        EXPECT_EQ(frames[0].picture.height, reader.info().height);
    }
}

TEST(Video, CutFileGivesItsFramesFirstAndThenTheProblem)
{
    LINEAMENT_REQUIRE_REAL_DATA("video/expressions_hand_occlusion.mp4"); // its index lies in front
    const test::TemporaryFolder folder;
    const std::string whole_path = (test::real_data_folder() / "video/expressions_hand_occlusion.mp4").string();
    VideoReader whole(whole_path);
    const std::size_t num_frames = read_all(whole).size();
    cut_file(whole_path, folder / "cut.mp4", 0.6);
    VideoReader reader(folder / "cut.mp4");
    const std::vector<VideoFrame> frames = read_all(reader);
    EXPECT_GT(frames.size(), num_frames / 3);
    EXPECT_LT(frames.size(), num_frames);
    ASSERT_TRUE(reader.problem().has_value());
    EXPECT_THAT(*reader.problem(), testing::HasSubstr("stopped after frame " + std::to_string(frames.size())));
    EXPECT_THAT(*reader.problem(), testing::HasSubstr("of announced " + std::to_string(num_frames)));
}

TEST(Video, FragmentedFilePlaysUpToTheLastWholeFragmentWhereverItIsCut)
{
    const test::TemporaryFolder folder;
    VideoWriter writer(folder / "clip.mp4", {.keyframe_interval = 10});
    for (int i = 0; i < 60; ++i) {
        writer.write(numbered_picture(64, 64, i), i / 25.0);
    }
    writer.finish();
    for (const double part : {0.3, 0.5, 0.7, 0.9}) {
        cut_file(folder / "clip.mp4", folder / "cut.mp4", part);
        VideoReader reader(folder / "cut.mp4");
        const std::vector<VideoFrame> frames = read_all(reader);
        EXPECT_GE(static_cast<double>(frames.size()), 60 * part - 20) << part;
        EXPECT_LT(frames.size(), 60u);
        EXPECT_TRUE(reader.problem().has_value()) << part;
    }
}

TEST(Video, RotationMetadataIsApplied)
{
    const test::TemporaryFolder folder;
    write_clip(folder / "upright.mp4", 64, 32, steady_times(5, 25.0));
    // The display matrix of the track header, ISO/IEC 14496-12 (8.3.2): 9 big-endian numbers, 16.16 and 2.30 fixed
    // point, 40 bytes after the box's version field. Written for a clockwise quarter turn.
    std::string content = content_of(folder / "upright.mp4");
    const std::size_t header = content.find("tkhd");
    ASSERT_NE(header, std::string::npos);
    const std::string one("\0\1\0\0", 4);
    const std::string minus_one("\xff\xff\0\0", 4);
    const std::string zero(4, '\0');
    content.replace(header + 4 + 40, 20, zero + one + zero + minus_one + zero);
    std::ofstream(folder / "turned.mp4", std::ios::binary) << content;
    VideoReader reader(folder / "turned.mp4");
    EXPECT_EQ(reader.info().rotation_deg, 90);
    EXPECT_EQ(reader.info().width, 32);
    EXPECT_EQ(reader.info().height, 64);
    const ImageU8 picture = reader.next()->picture;
    const ImageU8 stored = numbered_picture(64, 32, 0);
    // Turned clockwise, the stored top-left quarter is shown top right.
    for (const auto& [column, row] : {std::pair(8, 16), {24, 16}, {8, 48}, {24, 48}}) {
        for (int channel = 0; channel < 3; ++channel) {
            EXPECT_NEAR(picture.at(column, row, channel), stored.at(row, 31 - column, channel), 10);
        }
    }
}

TEST(Video, FilesThatAreNoVideoAreRefusedByName)
{
    const test::TemporaryFolder folder;
    EXPECT_TRUE(throws<IoError>([&] { VideoReader(folder / "missing.mp4"); }, "missing.mp4", "no such file"));
    EXPECT_TRUE(throws<IoError>([&] { VideoReader(folder.path().string()); }, "folder"));
    std::ofstream(folder / "empty.mp4").flush();
    EXPECT_TRUE(throws<IoError>([&] { VideoReader(folder / "empty.mp4"); }, "empty.mp4", "empty file"));
    std::ofstream(folder / "notes.txt") << "once upon a time there was no video\n";
    EXPECT_TRUE(throws<IoError>([&] { VideoReader(folder / "notes.txt"); }, "notes.txt", "expected a video"));
    std::ofstream(folder / "list.m3u8") << "#EXTM3U\n#EXTINF:1,\nhttp://localhost/x.ts\n#EXT-X-ENDLIST\n";
    EXPECT_TRUE(throws<IoError>([&] { VideoReader(folder / "list.m3u8"); }, "list.m3u8", "expected a video"));
    std::ofstream(folder / "picture.png", std::ios::binary)
        << std::string("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\1\0\0\0\1\10\2\0\0\0\x90wS\xde", 33);
    EXPECT_TRUE(throws<IoError>([&] { VideoReader(folder / "picture.png"); }, "picture.png"));
    write_clip(folder / "clip.mp4", 32, 32, steady_times(10, 25.0));
    cut_file(folder / "clip.mp4", folder / "head.mp4", 0.05);
    EXPECT_TRUE(throws<IoError>([&] { VideoReader(folder / "head.mp4"); }, "head.mp4"));
}

TEST(Video, FileWithoutAVideoStreamIsRefused)
{
    const test::TemporaryFolder folder;
    write_clip(folder / "clip.mp4", 32, 32, steady_times(5, 25.0));
    std::string content = content_of(folder / "clip.mp4");
    const std::size_t handler = content.find("vide", content.find("hdlr"));
    ASSERT_NE(handler, std::string::npos);
    content.replace(handler, 4, "soun"); // now the track says that it holds sound
    std::ofstream(folder / "sound.mp4", std::ios::binary) << content;
    EXPECT_TRUE(throws<IoError>([&] { VideoReader(folder / "sound.mp4"); }, "sound.mp4"));
}

TEST(Video, DamagedBytesNeitherCrashNorMakeTimeRunBackwards)
{
    const test::TemporaryFolder folder;
    write_clip(folder / "clip.mp4", 96, 64, steady_times(40, 25.0));
    const std::string whole = content_of(folder / "clip.mp4");
    for (std::size_t step = 1; step <= 40; ++step) {
        std::string content = whole;
        for (std::size_t place = step * 97 % 911; place < content.size(); place += 997 + step * 13) {
            content[place] = static_cast<char>(content[place] ^ (0x11 + step));
        }
        std::ofstream(folder / "damaged.mp4", std::ios::binary) << content;
        try {
            VideoReader reader(folder / "damaged.mp4");
            double last = -1.0;
            while (const std::optional<VideoFrame> frame = reader.next()) {
                EXPECT_GT(frame->time_s, last);
                last = frame->time_s;
                ASSERT_LT(frame->index, 1000);
            }
        } catch (const IoError&) {
            // Refused by name: as good.
        }
    }
}

TEST(Video, WriterRefusesBrokenContracts)
{
    const test::TemporaryFolder folder;
    EXPECT_TRUE(throws<InvalidArgument>([&] { VideoWriter(folder / "a.mp4", {.quality = -1.0}); }, "quality"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { VideoWriter(folder / "a.mp4", {.expected_frame_rate = NAN}); },
                                        "expected_frame_rate"));
    VideoWriter writer(folder / "a.mp4");
    writer.write(numbered_picture(16, 16, 0), 0.5);
    EXPECT_TRUE(throws<InvalidArgument>([&] { writer.write(numbered_picture(16, 16, 1), 0.5); }, "time_s", "later"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { writer.write(numbered_picture(16, 16, 1), NAN); }, "time_s"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { writer.write(numbered_picture(16, 18, 1), 1.0); }, "16 x 18"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { writer.write(ImageU8(16, 16, 1), 1.0); }, "channels"));
    EXPECT_EQ(writer.num_frames(), 1);
}

TEST(Video, WriterDiscardsTheFileUnlessFinished)
{
    const test::TemporaryFolder folder;
    {
        VideoWriter writer(folder / "a.mp4");
        writer.write(numbered_picture(16, 16, 0), 0.0);
    }
    EXPECT_FALSE(std::filesystem::exists(folder / "a.mp4"));
    EXPECT_TRUE(throws<IoError>([&] { VideoWriter(folder / "b.mp4").finish(); }, "no picture was written"));
}

TEST(Video, WriterNamesAFileThatCannotBeWritten)
{
    EXPECT_TRUE(throws<IoError>([] { VideoWriter("/no/such/folder/a.mp4"); }, "/no/such/folder/a.mp4"));
    if (!std::filesystem::exists("/dev/full")) {
        GTEST_SKIP() << "/dev/full not found";
    }
    const auto fill = [] {
        VideoWriter writer("/dev/full");
        for (int i = 0; i < 100; ++i) {
            writer.write(numbered_picture(64, 64, i), i / 25.0);
        }
        writer.finish();
    };
    EXPECT_TRUE(throws<IoError>(fill, "/dev/full"));
    EXPECT_TRUE(std::filesystem::exists("/dev/full"));
}

TEST(Video, EveryRealClipIsReadToItsEnd)
{
    LINEAMENT_REQUIRE_REAL_DATA("video");
    int num_clips = 0;
    for (const auto& entry : std::filesystem::directory_iterator(test::real_data_folder() / "video")) {
        VideoReader reader(entry.path().string());
        double last = -1.0;
        std::int64_t count = 0;
        while (const std::optional<VideoFrame> frame = reader.next()) {
            ASSERT_GT(frame->time_s, last);
            ASSERT_EQ(frame->picture.width, reader.info().width);
            last = frame->time_s;
            ++count;
        }
        EXPECT_GT(count, 20) << entry.path();
        EXPECT_EQ(reader.problem(), std::nullopt) << entry.path();
        ++num_clips;
    }
    EXPECT_GT(num_clips, 0);
}

} // namespace
} // namespace lineament
