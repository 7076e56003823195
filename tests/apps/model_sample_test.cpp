// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "apps/run_program.hpp"

#include <algorithm>
#include <array>

namespace lineament {
namespace {

using test::Outcome;
using test::run;

constexpr int tile_px = 64;
constexpr int gap_px = 12;

ImageU8 sample(const test::TemporaryFolder& folder, const std::string& arguments)
{
    const Outcome outcome = run(folder, "model sample -o sheet.png --tile 64 " + arguments);
    EXPECT_EQ(outcome.exit_code, 0) << arguments << "\n" << outcome.error;
    EXPECT_EQ(outcome.out, "sheet.png\n");
    return outcome.exit_code == 0 ? load_image(folder / "sheet.png") : ImageU8();
}

/// The cells of a sheet, row by row, each with its caption.
std::vector<ImageU8> cells(const ImageU8& sheet, int columns, int rows)
{
    EXPECT_EQ(sheet.width, gap_px + columns * (tile_px + gap_px));
    EXPECT_EQ((sheet.height - gap_px) % rows, 0);
    const int height = (sheet.height - gap_px) / rows;
    EXPECT_GE(height, tile_px + gap_px);
    std::vector<ImageU8> result;
    for (int i = 0; i < columns * rows; ++i) {
        ImageU8& cell = result.emplace_back(tile_px, height - gap_px, 3);
        for (int row = 0; row < cell.height; ++row) {
            const int left = gap_px + i % columns * (tile_px + gap_px);
            std::copy_n(sheet.pixel(left, gap_px + i / columns * height + row), 3 * cell.width, cell.pixel(0, row));
        }
    }
    return result;
}

/// The part of a cell's picture, without the caption, that `accept` takes.
template <typename Accept>
double part_of(const ImageU8& cell, const Accept& accept)
{
    int count = 0;
    for (int row = 0; row < tile_px; ++row) {
        for (int column = 0; column < tile_px; ++column) {
            count += accept(cell.pixel(column, row)) ? 1 : 0;
        }
    }
    return static_cast<double>(count) / (tile_px * tile_px);
}

bool is_face(const std::uint8_t* rgb)
{
    constexpr std::array<std::uint8_t, 3> background = {246, 246, 244};
    return !std::equal(background.begin(), background.end(), rgb);
}

bool is_red(const std::uint8_t* rgb)
{
    return rgb[0] > 150 && rgb[1] < 90 && rgb[2] < 90;
}

TEST(ModelSample, EachSheetHoldsItsFaces)
{
    const test::TemporaryFolder folder;
    struct Sheet
    {
        std::string arguments;
        int num_faces;
        int columns;
    };
    for (const Sheet& expected :
         {Sheet{"--count 7", 7, 6}, Sheet{"--what random --count 3", 3, 3}, Sheet{"--what shape-modes --count 2", 4, 4},
          Sheet{"--what color-modes --count 2", 4, 4}, Sheet{"--what expressions", 6, 3},
          Sheet{"--what expressions --expressions arkit47", 47, 8}, Sheet{"--what levels", 6, 2},
          Sheet{"--what landmarks", 2, 2}}) {
        const int rows = (expected.num_faces + expected.columns - 1) / expected.columns;
        const std::vector<ImageU8> tiles = cells(sample(folder, expected.arguments), expected.columns, rows);
        const auto num_faces = static_cast<std::size_t>(expected.num_faces);
        for (std::size_t i = 0; i < tiles.size(); ++i) {
            const double part = part_of(tiles[i], is_face);
            if (i < num_faces) {
                EXPECT_GT(part, 0.25) << expected.arguments << ", tile " << i;
                EXPECT_LT(part, 0.75) << expected.arguments << ", tile " << i;
            } else {
                EXPECT_EQ(part, 1.0) << expected.arguments << ": cell " << i << " is as white as the sheet";
            }
            for (std::size_t j = 0; j < std::min(i, num_faces); ++j) {
                EXPECT_NE(tiles[i], tiles[j]) << expected.arguments << ", tiles " << i << " and " << j;
            }
        }
    }
}

TEST(ModelSample, TheSeedDecidesTheFaces)
{
    const test::TemporaryFolder folder;
    const ImageU8 first = sample(folder, "--count 2 --seed 4");
    EXPECT_EQ(first, sample(folder, "--count 2 --seed 4"));
    EXPECT_NE(first, sample(folder, "--count 2 --seed 5"));
}

TEST(ModelSample, ModesMoveByTheirDeviations)
{
    const test::TemporaryFolder folder;
    // Without captions, which tell the tiles apart.
    const auto pictures = [&](const std::string& arguments) {
        std::vector<ImageU8> tiles = cells(sample(folder, arguments), 2, 1);
        for (ImageU8& tile : tiles) {
            tile.data.resize(static_cast<std::size_t>(3 * tile_px * tile_px));
            tile.height = tile_px;
        }
        return tiles;
    };
    const std::vector<ImageU8> still = pictures("--what shape-modes --count 1 --sd 0");
    EXPECT_EQ(still[0], still[1]);
    const std::vector<ImageU8> moved = pictures("--what shape-modes --count 1 --sd 3");
    EXPECT_NE(part_of(moved[0], is_face), part_of(moved[1], is_face)) << "the first mode changes the head's outline";
    const std::vector<ImageU8> coloured = pictures("--what color-modes --count 1 --sd 3");
    EXPECT_EQ(part_of(coloured[0], is_face), part_of(coloured[1], is_face)) << "a colour leaves the outline as it is";
    EXPECT_NE(coloured[0], coloured[1]);
}

TEST(ModelSample, LandmarksAreMarked)
{
    const test::TemporaryFolder folder;
    for (const ImageU8& tile : cells(sample(folder, "--what landmarks"), 2, 1)) {
        EXPECT_GT(part_of(tile, is_red), 0.02);
    }
    EXPECT_EQ(part_of(cells(sample(folder, "--what levels"), 2, 3)[0], is_red), 0.0);
}

TEST(ModelSample, TheIsomapIsALineDrawing)
{
    const test::TemporaryFolder folder;
    const ImageU8 sheet = sample(folder, "--what isomap");
    ASSERT_EQ(sheet.width, 3 * tile_px);
    ASSERT_EQ(sheet.height, 3 * tile_px);
    const auto num_inked = std::count_if(sheet.data.begin(), sheet.data.end(), [](int value) { return value < 250; });
    EXPECT_GT(num_inked, static_cast<std::ptrdiff_t>(sheet.data.size() / 4));
    EXPECT_LT(num_inked, static_cast<std::ptrdiff_t>(sheet.data.size()));
}

TEST(ModelSample, WrongUseIsRefusedAndWritesNothing)
{
    const test::TemporaryFolder folder;
    for (const char* arguments : {"--what portraits", "--count 0", "--sd 6", "--tile 3", "--seed one",
                                  "--what expressions --expressions klingon"}) {
        const Outcome outcome = run(folder, std::string("model sample -o sheet.png ") + arguments);
        EXPECT_EQ(outcome.exit_code, 2) << arguments << "\n" << outcome.error;
        EXPECT_EQ(outcome.error.rfind("lineament: error: ", 0), 0U) << arguments << "\n" << outcome.error;
        EXPECT_FALSE(std::filesystem::exists(folder / "sheet.png")) << arguments;
    }
    EXPECT_EQ(run(folder, "model sample -o missing/sheet.png").exit_code, 4);
}

} // namespace
} // namespace lineament
