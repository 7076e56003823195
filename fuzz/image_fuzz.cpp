// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Hostile PNG and JPEG files: what is accepted is an RGB picture within the limits. The mutator starts from small valid
// pictures and enters the right checksums of PNG chunks.
#include "lineament/core/error.hpp"
#include "lineament/core/random.hpp"
#include "lineament/io/image_file.hpp"

#include <cstdlib>
#include <cstring>

namespace {

constexpr double max_megapixels = 0.25; // so that one input takes milliseconds

/// CRC-32 of the PNG specification.
std::uint32_t compute_crc32(const std::uint8_t* data, std::size_t size)
{
    std::uint32_t crc = 0xffffffff;
    for (std::size_t i = 0; i < size; ++i) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; ++bit) {
            crc = (crc & 1) != 0 ? (crc >> 1) ^ 0xedb88320u : crc >> 1;
        }
    }
    return ~crc;
}

void enter_checksums(std::uint8_t* data, std::size_t size)
{
    std::size_t offset = 8;
    while (offset + 12 <= size) {
        const std::size_t length = static_cast<std::size_t>(data[offset]) << 24 | data[offset + 1] << 16 |
                                   data[offset + 2] << 8 | data[offset + 3];
        if (length > size - offset - 12) {
            return;
        }
        const std::uint32_t crc = compute_crc32(data + offset + 4, length + 4);
        for (std::size_t i = 0; i < 4; ++i) {
            data[offset + 8 + length + i] = static_cast<std::uint8_t>(crc >> (24 - 8 * i));
        }
        offset += 12 + length;
    }
}

} // namespace

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned int seed)
{
    lineament::Random random(seed);
    if (size < 16 || random.index(50) == 0) {
        lineament::ImageU8 image(9, 7, random.index(2) == 0 ? 1 : 3);
        for (std::uint8_t& value : image.data) {
            value = static_cast<std::uint8_t>(random.bits());
        }
        const auto valid = random.index(2) == 0 ? lineament::format_png(image) : lineament::format_jpeg(image);
        if (valid.size() <= max_size) {
            std::memcpy(data, valid.data(), valid.size());
            size = valid.size();
        }
    }
    size = LLVMFuzzerMutate(data, size, max_size);
    if (size > 8 && data[0] == 0x89 && random.index(10) != 0) {
        enter_checksums(data, size);
    }
    return size;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    const std::vector<std::byte> file(reinterpret_cast<const std::byte*>(data),
                                      reinterpret_cast<const std::byte*>(data) + size); // a block of exact size
    try {
        const lineament::ImageU8 image = lineament::parse_image(file, "fuzz", {.max_megapixels = max_megapixels});
        const std::size_t num_pixels = static_cast<std::size_t>(image.width) * image.height;
        if (image.empty() || image.channels != 3 || image.data.size() != 3 * num_pixels ||
            static_cast<double>(num_pixels) > 1e6 * max_megapixels) {
            std::abort();
        }
    } catch (const lineament::IoError&) {
    }
    return 0;
}
