// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/image_file.hpp"

#include "image_codecs.hpp"
#include "lineament/io/file.hpp"

#include <cmath>

namespace lineament {

namespace image_codecs {

void check_size(std::uint64_t width, std::uint64_t height, const std::string& name, const ImageLimits& limits)
{
    const double megapixels = static_cast<double>(width) * static_cast<double>(height) * 1e-6;
    if (!(megapixels <= limits.max_megapixels)) {
        throw IoError(IoErrorKind::limit, name, "",
                      "the picture has " + std::to_string(width) + " x " + std::to_string(height) + " pixels (" +
                          to_text(megapixels) + " megapixels); at most " + to_text(limits.max_megapixels) +
                          " are read (raise the limit with --max-megapixels)");
    }
}

void check_image(const ImageU8& image, const char* function)
{
    require(image.width > 0 && image.height > 0, function, "image", "at least one pixel",
            std::to_string(image.width) + " x " + std::to_string(image.height));
    const std::size_t expected = static_cast<std::size_t>(image.width) * image.height * image.channels;
    require(image.data.size() == expected, function, "image.data", std::to_string(expected) + " values",
            std::to_string(image.data.size()));
}

} // namespace image_codecs

ImageU8 parse_image(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits)
{
    require(limits.max_megapixels > 0, "parse_image", "max_megapixels", "a number > 0", to_text(limits.max_megapixels));
    if (bytes.empty()) {
        throw IoError(IoErrorKind::content, name, "", "file is empty (0 bytes); expected a PNG or JPEG image");
    }
    const std::optional<ContentGuess> guess = guess_content(bytes);
    const std::string kind = guess ? guess->kind : "";
    ImageU8 image;
    if (kind == "a PNG image") {
        image = image_codecs::decode_png(bytes, name, limits);
    } else if (kind == "a JPEG image") {
        image = image_codecs::decode_jpeg(bytes, name, limits);
    } else if (kind.ends_with(" image")) {
        throw IoError(IoErrorKind::content, name, "", "is " + kind + ", which is not supported; " + guess->advice);
    } else {
        throw IoError(IoErrorKind::content, name, "", "is not a PNG or JPEG image" + content_hint(bytes));
    }
    return image_codecs::apply_orientation(std::move(image), image_codecs::find_orientation(bytes));
}

ImageU8 load_image(const std::filesystem::path& path, const ImageLimits& limits)
{
    return parse_image(read_file(path), path.string(), limits);
}

void save_png(const std::filesystem::path& path, const ImageU8& image)
{
    write_file(path, format_png(image));
}

} // namespace lineament
