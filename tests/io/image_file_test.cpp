// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/image_file.hpp"

#include "lineament/core/random.hpp"
#include "lineament/io/file.hpp"
#include "support/matchers.hpp"

#include <cstdio>
#include <cstring>

#include <jpeglib.h>
#include <png.h>

namespace lineament {
namespace {

using test::TemporaryFolder;
using test::throws;

using Bytes = std::vector<std::byte>;

ImageU8 random_image(int width, int height, int channels, std::uint64_t seed = 1)
{
    ImageU8 image(width, height, channels);
    Random random(seed);
    for (std::uint8_t& value : image.data) {
        value = static_cast<std::uint8_t>(random.bits());
    }
    return image;
}

/// Smooth colours, which JPEG keeps within a few grey levels.
ImageU8 smooth_image(int width, int height, int channels)
{
    ImageU8 image(width, height, channels);
    for (int row = 0; row < height; ++row) {
        for (int column = 0; column < width; ++column) {
            for (int channel = 0; channel < channels; ++channel) {
                image.at(column, row, channel) =
                    static_cast<std::uint8_t>(40 + 2 * column + (channel + 1) * row + 20 * channel);
            }
        }
    }
    return image;
}

ImageU8 rgb_of_grey(const ImageU8& grey)
{
    ImageU8 image(grey.width, grey.height, 3);
    for (std::size_t i = 0; i < image.data.size(); ++i) {
        image.data[i] = grey.data[i / 3];
    }
    return image;
}

int largest_difference(const ImageU8& a, const ImageU8& b)
{
    if (a.width != b.width || a.height != b.height || a.channels != b.channels) {
        return 1000;
    }
    int largest = 0;
    for (std::size_t i = 0; i < a.data.size(); ++i) {
        largest = std::max(largest, std::abs(a.data[i] - b.data[i]));
    }
    return largest;
}

/// The parts one after the other.
Bytes join(std::initializer_list<std::span<const std::byte>> parts)
{
    Bytes joined;
    for (const auto& part : parts) {
        for (const std::byte byte : part) {
            joined.push_back(byte);
        }
    }
    return joined;
}

std::span<const std::byte> bytes_of(std::string_view text)
{
    return std::as_bytes(std::span(text));
}

Bytes big_endian(std::uint32_t value, int count)
{
    Bytes bytes;
    for (int i = count; i-- > 0;) {
        bytes.push_back(static_cast<std::byte>(value >> (8 * i)));
    }
    return bytes;
}

struct PngVariant
{
    int color_type = PNG_COLOR_TYPE_RGB;
    int bit_depth = 8;
    int interlace = PNG_INTERLACE_NONE;
    std::vector<png_color> palette = {};
    std::vector<png_byte> palette_alpha = {};
};

/// A PNG file written by libpng from packed rows.
Bytes write_png(const PngVariant& variant, int width, int height, const std::vector<std::uint8_t>& rows)
{
    Bytes bytes;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct(png);
    png_set_write_fn(
        png, &bytes,
        [](png_structp p, png_bytep data, std::size_t count) {
            auto& target = *static_cast<Bytes*>(png_get_io_ptr(p));
            const auto* const begin = reinterpret_cast<const std::byte*>(data);
            target.insert(target.end(), begin, begin + count);
        },
        [](png_structp) {});
    png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), variant.bit_depth,
                 variant.color_type, variant.interlace, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    if (!variant.palette.empty()) {
        png_set_PLTE(png, info, variant.palette.data(), static_cast<int>(variant.palette.size()));
    }
    if (!variant.palette_alpha.empty()) {
        png_set_tRNS(png, info, variant.palette_alpha.data(), static_cast<int>(variant.palette_alpha.size()), nullptr);
    }
    png_write_info(png, info);
    const std::size_t row_bytes = png_get_rowbytes(png, info);
    std::vector<png_bytep> pointers;
    for (int row = 0; row < height; ++row) {
        pointers.push_back(const_cast<png_bytep>(rows.data() + static_cast<std::size_t>(row) * row_bytes));
    }
    png_write_image(png, pointers.data());
    png_write_end(png, info);
    png_destroy_write_struct(&png, &info);
    return bytes;
}

/// A JPEG file written by libjpeg.
Bytes write_jpeg(const ImageU8& image, J_COLOR_SPACE input_space, J_COLOR_SPACE file_space, int num_scans = 0)
{
    jpeg_compress_struct info = {};
    jpeg_error_mgr errors = {};
    info.err = jpeg_std_error(&errors);
    jpeg_create_compress(&info);
    unsigned char* output = nullptr;
    unsigned long num_bytes = 0;
    jpeg_mem_dest(&info, &output, &num_bytes);
    info.image_width = static_cast<JDIMENSION>(image.width);
    info.image_height = static_cast<JDIMENSION>(image.height);
    info.input_components = image.channels;
    info.in_color_space = input_space;
    jpeg_set_defaults(&info);
    jpeg_set_colorspace(&info, file_space);
    jpeg_set_quality(&info, 98, TRUE);
    std::vector<jpeg_scan_info> scans;
    if (num_scans == 1) {
        jpeg_simple_progression(&info);
    }
    if (num_scans > 1) { // one coefficient a scan, bit by bit
        for (int component = 0; component < image.channels; ++component) {
            scans.push_back({1, {component}, 0, 0, 0, 0});
            for (int k = 1; k < 64; ++k) {
                scans.push_back({1, {component}, k, k, 0, 0});
            }
        }
        scans.resize(std::min<std::size_t>(scans.size(), static_cast<std::size_t>(num_scans)));
        info.scan_info = scans.data();
        info.num_scans = static_cast<int>(scans.size());
    }
    jpeg_start_compress(&info, TRUE);
    while (info.next_scanline < info.image_height) {
        JSAMPROW row = const_cast<JSAMPROW>(image.pixel(0, static_cast<int>(info.next_scanline)));
        jpeg_write_scanlines(&info, &row, 1);
    }
    jpeg_finish_compress(&info);
    jpeg_destroy_compress(&info);
    const auto* const begin = reinterpret_cast<const std::byte*>(output);
    Bytes bytes(begin, begin + num_bytes);
    std::free(output);
    return bytes;
}

/// An EXIF block of one directory with an orientation, in either byte order.
Bytes exif_block(int orientation, bool is_big_endian)
{
    std::vector<int> block;
    const auto put = [&](int value, int count) {
        for (int i = 0; i < count; ++i) {
            block.push_back((value >> (8 * (is_big_endian ? count - 1 - i : i))) & 0xff);
        }
    };
    block = {is_big_endian ? 'M' : 'I', is_big_endian ? 'M' : 'I'};
    put(42, 2);
    put(8, 4);
    put(2, 2);
    put(0x0100, 2); // another entry first
    put(4, 2);
    put(1, 4);
    put(640, 4);
    put(0x0112, 2);
    put(3, 2);
    put(1, 4);
    put(orientation, 2);
    put(0, 2);
    put(0, 4);
    Bytes bytes;
    for (const int value : block) {
        bytes.push_back(static_cast<std::byte>(value));
    }
    return bytes;
}

/// The EXIF block in a segment right after the start of the file.
Bytes jpeg_with_exif(const Bytes& jpeg, const Bytes& block)
{
    const std::span<const std::byte> file(jpeg);
    return join({file.first(2), big_endian(0xffe1, 2), big_endian(static_cast<std::uint32_t>(block.size() + 8), 2),
                 bytes_of(std::string_view("Exif\0\0", 6)), block, file.subspan(2)});
}

Bytes png_chunk(std::string_view type, const Bytes& content)
{
    const Bytes body = join({bytes_of(type), content});
    std::uint32_t crc = 0xffffffff; // CRC-32 of the PNG specification, bit by bit
    for (const std::byte byte : body) {
        crc ^= static_cast<std::uint32_t>(byte);
        for (int bit = 0; bit < 8; ++bit) {
            crc = (crc & 1) != 0 ? (crc >> 1) ^ 0xedb88320 : crc >> 1;
        }
    }
    return join({big_endian(static_cast<std::uint32_t>(content.size()), 4), body, big_endian(~crc, 4)});
}

/// The chunk put right after IHDR.
Bytes png_with_chunk(const Bytes& png, const Bytes& chunk)
{
    const std::span<const std::byte> file(png);
    return join({file.first(33), chunk, file.subspan(33)});
}

/// A PNG file that announces a size and holds nothing.
Bytes png_bomb(std::uint32_t width, std::uint32_t height)
{
    const Bytes header = join({big_endian(width, 4), big_endian(height, 4), big_endian(0x08020000, 4), Bytes(1)});
    return join({bytes_of("\x89PNG\r\n\x1a\n"), png_chunk("IHDR", header), png_chunk("IDAT", {})});
}

TEST(Png, WhatIsWrittenIsReadBackExactly)
{
    const TemporaryFolder folder;
    const ImageU8 rgb = random_image(37, 21, 3);
    save_png(folder / "a.png", rgb);
    EXPECT_EQ(load_image(folder / "a.png"), rgb);
    const ImageU8 grey = random_image(5, 9, 1);
    EXPECT_EQ(parse_image(format_png(grey), "a"), rgb_of_grey(grey));
    ImageU8 rgba(1, 1, 4);
    rgba.data = {200, 100, 0, 51}; // a fifth of it over white
    EXPECT_EQ(parse_image(format_png(rgba), "a").data, (std::vector<std::uint8_t>{244, 224, 204}));
    ImageU8 pixel(1, 1, 3, 7);
    EXPECT_EQ(parse_image(format_png(pixel), "a"), pixel);
}

TEST(Png, EveryDepthAndColorTypeGivesTheSamePictureInterlacedOrNot)
{
    const int width = 19;
    const int height = 11;
    Random random(2);
    for (const int interlace : {PNG_INTERLACE_NONE, PNG_INTERLACE_ADAM7}) {
        for (const int depth : {1, 2, 4, 8}) {
            // Grey and palette pictures of 2^depth values, packed from the high bits down.
            const int per_byte = 8 / depth;
            const std::size_t row_bytes = static_cast<std::size_t>((width + per_byte - 1) / per_byte);
            std::vector<std::uint8_t> rows(row_bytes * height);
            ImageU8 indices(width, height, 1);
            for (int row = 0; row < height; ++row) {
                for (int column = 0; column < width; ++column) {
                    const int value = random.index(1 << depth);
                    indices.at(column, row) = static_cast<std::uint8_t>(value);
                    rows[static_cast<std::size_t>(row) * row_bytes + static_cast<std::size_t>(column / per_byte)] |=
                        static_cast<std::uint8_t>(value << (8 - depth - depth * (column % per_byte)));
                }
            }
            ImageU8 grey = indices;
            for (std::uint8_t& value : grey.data) {
                value = static_cast<std::uint8_t>(value * 255 / ((1 << depth) - 1));
            }
            EXPECT_EQ(parse_image(write_png({PNG_COLOR_TYPE_GRAY, depth, interlace}, width, height, rows), "a"),
                      rgb_of_grey(grey))
                << "grey, depth " << depth;
            std::vector<png_color> palette;
            for (int i = 0; i < 1 << depth; ++i) {
                palette.push_back(
                    {static_cast<png_byte>(i * 7), static_cast<png_byte>(255 - i), static_cast<png_byte>(i * i)});
            }
            ImageU8 colors(width, height, 3);
            for (std::size_t i = 0; i < indices.data.size(); ++i) {
                const png_color& color = palette[indices.data[i]];
                colors.data[3 * i] = color.red;
                colors.data[3 * i + 1] = color.green;
                colors.data[3 * i + 2] = color.blue;
            }
            EXPECT_EQ(
                parse_image(write_png({PNG_COLOR_TYPE_PALETTE, depth, interlace, palette}, width, height, rows), "a"),
                colors)
                << "palette, depth " << depth;
            // Palette entry 0 transparent: white.
            for (std::size_t i = 0; i < indices.data.size(); ++i) {
                if (indices.data[i] == 0) {
                    std::memset(colors.data.data() + 3 * i, 255, 3);
                }
            }
            EXPECT_EQ(
                parse_image(write_png({PNG_COLOR_TYPE_PALETTE, depth, interlace, palette, {0}}, width, height, rows),
                            "a"),
                colors)
                << "palette with transparency, depth " << depth;
        }
        // 16 bits: value * 257 is exactly the 8-bit value.
        const ImageU8 rgb = random_image(width, height, 3);
        std::vector<std::uint8_t> rows;
        for (const std::uint8_t value : rgb.data) {
            rows.push_back(value);
            rows.push_back(value);
        }
        EXPECT_EQ(parse_image(write_png({PNG_COLOR_TYPE_RGB, 16, interlace}, width, height, rows), "a"), rgb);
        EXPECT_EQ(parse_image(write_png({PNG_COLOR_TYPE_RGB, 8, interlace}, width, height, rgb.data), "a"), rgb);
    }
}

TEST(Jpeg, GreyColorProgressiveAndPrintingColorsAreRead)
{
    const ImageU8 rgb = smooth_image(40, 30, 3);
    EXPECT_LE(largest_difference(parse_image(write_jpeg(rgb, JCS_RGB, JCS_YCbCr), "a"), rgb), 6);
    EXPECT_LE(largest_difference(parse_image(write_jpeg(rgb, JCS_RGB, JCS_RGB), "a"), rgb), 6);
    EXPECT_LE(largest_difference(parse_image(write_jpeg(rgb, JCS_RGB, JCS_YCbCr, 1), "a"), rgb), 6);
    EXPECT_LE(largest_difference(parse_image(format_jpeg(rgb, 98), "a"), rgb), 6);
    const ImageU8 grey = smooth_image(40, 30, 1);
    EXPECT_LE(largest_difference(parse_image(write_jpeg(grey, JCS_GRAYSCALE, JCS_GRAYSCALE), "a"), rgb_of_grey(grey)),
              3);
    EXPECT_LE(largest_difference(parse_image(format_jpeg(grey, 98), "a"), rgb_of_grey(grey)), 3);
    // Adobe files (libjpeg writes their marker) hold 255 for no ink.
    ImageU8 cmyk(40, 30, 4);
    for (std::size_t i = 0; i < 40 * 30; ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
            cmyk.data[4 * i + k] = rgb.data[3 * i + k];
        }
        cmyk.data[4 * i + 3] = 255;
    }
    EXPECT_LE(largest_difference(parse_image(write_jpeg(cmyk, JCS_CMYK, JCS_CMYK), "a"), rgb), 6);
    EXPECT_LE(largest_difference(parse_image(write_jpeg(cmyk, JCS_CMYK, JCS_YCCK), "a"), rgb), 6);
    for (std::size_t i = 0; i < 40 * 30; ++i) {
        cmyk.data[4 * i + 3] = 0; // all black ink
    }
    EXPECT_LE(largest_difference(parse_image(write_jpeg(cmyk, JCS_CMYK, JCS_CMYK), "a"), ImageU8(40, 30, 3, 0)), 3);
}

TEST(Exif, EveryOrientationGivesTheUprightPicture)
{
    // Asymmetric: red in the upright picture's top-left quarter, blue in the top-right one, black below.
    ImageU8 upright(48, 32, 3);
    for (int row = 0; row < 16; ++row) {
        for (int column = 0; column < 48; ++column) {
            upright.at(column, row, column < 24 ? 0 : 2) = 255;
        }
    }
    // Where row 0 and column 0 of the stored picture lie in the upright one, as the EXIF standard says it:
    // 1 top left, 2 top right, 3 bottom right, 4 bottom left, 5 left top, 6 right top, 7 right bottom, 8 left bottom.
    for (int orientation = 1; orientation <= 8; ++orientation) {
        const bool is_turned = orientation >= 5;
        ImageU8 stored(is_turned ? 32 : 48, is_turned ? 48 : 32, 3);
        const bool first_row_is_at_far_side =
            orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
        const bool first_column_is_at_far_side =
            orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
        for (int row = 0; row < stored.height; ++row) {
            for (int column = 0; column < stored.width; ++column) {
                const int along_rows = first_row_is_at_far_side ? stored.height - 1 - row : row;
                const int along_columns = first_column_is_at_far_side ? stored.width - 1 - column : column;
                const int x = is_turned ? along_rows : along_columns;
                const int y = is_turned ? along_columns : along_rows;
                std::memcpy(stored.pixel(column, row), upright.pixel(x, y), 3);
            }
        }
        for (const bool is_big_endian : {false, true}) {
            const Bytes block = exif_block(orientation, is_big_endian);
            const ImageU8 from_png = parse_image(png_with_chunk(format_png(stored), png_chunk("eXIf", block)), "a");
            EXPECT_EQ(from_png, upright) << orientation;
            const ImageU8 from_jpeg = parse_image(jpeg_with_exif(format_jpeg(stored, 95), block), "a");
            ASSERT_EQ(from_jpeg.width, 48);
            EXPECT_GT(from_jpeg.at(8, 4, 0), 200) << orientation;
            EXPECT_GT(from_jpeg.at(40, 4, 2), 200) << orientation;
            EXPECT_LT(from_jpeg.at(8, 28, 0), 50) << orientation;
        }
    }
}

TEST(Exif, ADamagedBlockLeavesThePictureAsStored)
{
    const ImageU8 image = random_image(6, 4, 3);
    const Bytes png = format_png(image);
    const Bytes whole = exif_block(6, true);
    EXPECT_EQ(parse_image(png_with_chunk(png, png_chunk("eXIf", whole)), "a").width, 4);
    for (const int orientation : {0, 9, 65535}) {
        EXPECT_EQ(parse_image(png_with_chunk(png, png_chunk("eXIf", exif_block(orientation, false))), "a"), image);
    }
    for (std::size_t size = 0; size < whole.size() - 8; ++size) {
        const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
        const ImageU8 read = parse_image(png_with_chunk(png, png_chunk("eXIf", cut)), "a");
        EXPECT_EQ(read.data.size(), image.data.size()) << size;
    }
    Bytes far = whole;
    std::fill(far.begin() + 4, far.begin() + 8, std::byte{0xff}); // directory beyond the end
    EXPECT_EQ(parse_image(png_with_chunk(png, png_chunk("eXIf", far)), "a"), image);
    Bytes many = whole;
    many[8] = many[9] = std::byte{0xff}; // 65535 entries announced
    many[22] = std::byte{0x77};          // and no orientation
    EXPECT_EQ(parse_image(png_with_chunk(png, png_chunk("eXIf", many)), "a"), image);
}

TEST(ParseImage, RefusesEveryTruncation)
{
    const ImageU8 image = smooth_image(24, 16, 3);
    const Bytes png = format_png(image);
    const Bytes jpeg = jpeg_with_exif(write_jpeg(image, JCS_RGB, JCS_YCbCr), exif_block(3, true));
    const Bytes progressive = write_jpeg(image, JCS_RGB, JCS_YCbCr, 1);
    for (const Bytes& file : {png, jpeg, progressive}) {
        EXPECT_NO_THROW((void)parse_image(file, "a"));
        for (std::size_t size = 0; size < file.size(); ++size) {
            const Bytes cut(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(size));
            EXPECT_THROW((void)parse_image(cut, "a"), IoError) << size << " of " << file.size();
        }
    }
}

TEST(ParseImage, SurvivesEveryDamagedByte)
{
    const ImageU8 image = smooth_image(17, 9, 3);
    for (const Bytes& file : {format_png(image), jpeg_with_exif(format_jpeg(image), exif_block(8, false))}) {
        for (std::size_t i = 0; i < file.size(); ++i) {
            for (const int value : {0x00, 0x7f, 0xff}) {
                Bytes damaged = file;
                damaged[i] = static_cast<std::byte>(value);
                try {
                    const ImageU8 read = parse_image(damaged, "a", {.max_megapixels = 1.0});
                    EXPECT_EQ(read.channels, 3);
                    EXPECT_EQ(read.data.size(), 3u * static_cast<std::size_t>(read.width) * read.height);
                } catch (const IoError&) {
                }
            }
        }
    }
}

TEST(ParseImage, RefusesAPictureOverTheLimitFromItsHeaderAlone)
{
    EXPECT_TRUE(throws<IoError>([] { (void)parse_image(png_bomb(65535, 65535), "a.png"); }, "a.png", "65535 x 65535",
                                "at most 64", "--max-megapixels"));
    EXPECT_TRUE(throws<IoError>([] { (void)parse_image(png_bomb(0x7fffffff, 0x7fffffff), "a"); }, "--max-megapixels"));
    Bytes jpeg = format_jpeg(smooth_image(16, 16, 3));
    for (std::size_t i = 0; i + 9 < jpeg.size(); ++i) {
        if (jpeg[i] == std::byte{0xff} && jpeg[i + 1] == std::byte{0xc0}) { // frame header: height, width
            std::fill(jpeg.begin() + static_cast<std::ptrdiff_t>(i) + 5,
                      jpeg.begin() + static_cast<std::ptrdiff_t>(i) + 9, std::byte{0xfe});
            break;
        }
    }
    EXPECT_TRUE(throws<IoError>([&] { (void)parse_image(jpeg, "a"); }, "65278 x 65278", "--max-megapixels"));
    const ImageU8 image(1000, 1000, 3);
    EXPECT_NO_THROW((void)parse_image(format_png(image), "a", {.max_megapixels = 1.0}));
    try {
        (void)parse_image(format_png(image), "a", {.max_megapixels = 0.99});
        FAIL();
    } catch (const IoError& error) {
        EXPECT_EQ(error.kind(), IoErrorKind::limit);
    }
}

TEST(ParseImage, RefusesAJpegOfTooManyScans)
{
    const ImageU8 image = smooth_image(16, 16, 3);
    EXPECT_NO_THROW((void)parse_image(write_jpeg(smooth_image(16, 16, 1), JCS_GRAYSCALE, JCS_GRAYSCALE, 64), "a"));
    try {
        (void)parse_image(write_jpeg(image, JCS_RGB, JCS_YCbCr, 192), "a");
        FAIL();
    } catch (const IoError& error) {
        EXPECT_EQ(error.kind(), IoErrorKind::limit);
        EXPECT_THAT(error.what(), testing::HasSubstr("100 scans"));
    }
}

TEST(ParseImage, NamesAFormatThatIsNotSupported)
{
    const auto refused = [](std::string_view content, const auto&... texts) {
        const auto bytes = std::as_bytes(std::span(content));
        return throws<IoError>([&] { (void)parse_image(bytes, "a.jpg"); }, texts...);
    };
    using namespace std::string_view_literals;
    EXPECT_TRUE(refused("GIF89a\1\0\1\0", "a.jpg: is a GIF image", "not supported", "convert it to PNG or JPEG"));
    EXPECT_TRUE(refused("RIFF\0\0\0\0WEBPVP8 "sv, "WebP", "convert"));
    EXPECT_TRUE(refused("\0\0\0\x18"
                        "ftypheic\0\0\0\0"sv,
                        "HEIC", "convert"));
    EXPECT_TRUE(refused("BM\0\0\0\0"sv, "BMP", "convert"));
    EXPECT_TRUE(refused("II*\0\x08\0\0\0"sv, "TIFF", "convert"));
    EXPECT_TRUE(refused("", "file is empty (0 bytes)"));
    EXPECT_TRUE(refused("<html>", "not a PNG or JPEG", "HTML"));
    EXPECT_TRUE(refused("hello", "not a PNG or JPEG"));
}

TEST(LoadImage, TheContentDecidesNotTheName)
{
    const TemporaryFolder folder;
    const ImageU8 image = random_image(4, 4, 3);
    write_file(folder / "a.jpg", format_png(image));
    EXPECT_EQ(load_image(folder / "a.jpg"), image);
    EXPECT_TRUE(throws<IoError>([&] { (void)load_image(folder / "none.png"); }, "none.png", "No such file"));
}

TEST(FormatImage, RefusesWhatIsNotAPicture)
{
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)format_png(ImageU8()); }, "format_png"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)format_png(ImageU8(2, 2, 2)); }, "channels"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)format_jpeg(ImageU8(2, 2, 4)); }, "channels"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)format_jpeg(ImageU8(2, 2, 3), 0); }, "quality"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)format_jpeg(ImageU8(65501, 1, 3)); }, "65500"));
    ImageU8 short_data(4, 4, 3);
    short_data.data.pop_back();
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_png(short_data); }, "48 values"));
}

TEST(LoadImage, ReadsRealPhotos)
{
    LINEAMENT_REQUIRE_REAL_DATA("images");
    int num_read = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(test::real_data_folder() / "images")) {
        const std::string extension = entry.path().extension().string();
        if (extension == ".jpg" || extension == ".png" || extension == ".jpeg") {
            const ImageU8 image = load_image(entry.path());
            EXPECT_FALSE(image.empty()) << entry.path();
            ++num_read;
        }
    }
    EXPECT_GT(num_read, 0);
}

} // namespace
} // namespace lineament
