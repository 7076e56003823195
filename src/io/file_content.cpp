// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/file.hpp"

#include <algorithm>
#include <cctype>

namespace lineament {

namespace {

using namespace std::string_view_literals;

/// Little-endian number of `count` bytes.
std::uint64_t number_at(std::string_view bytes, std::size_t offset, std::size_t count)
{
    std::uint64_t value = 0;
    for (std::size_t i = count; i-- > 0;) {
        value = value << 8 | static_cast<std::uint8_t>(bytes[offset + i]);
    }
    return value;
}

bool is_html(std::string_view head)
{
    std::string text(head.substr(0, 256));
    std::transform(text.begin(), text.end(), text.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    const std::size_t start = text.find_first_not_of(" \t\r\n\xef\xbb\xbf");
    if (start == std::string::npos) {
        return false;
    }
    const std::string_view trimmed = std::string_view(text).substr(start);
    return trimmed.starts_with("<!doctype html") || trimmed.starts_with("<html") || trimmed.starts_with("<head");
}

/// The two layouts of the models of eos, written by cereal: version, rows and columns of the mean of a PCA model; or
/// the number of blendshapes, then the length and text of the first name. All little-endian.
bool is_cereal(std::string_view head)
{
    if (head.size() < 20) {
        return false;
    }
    const std::uint64_t rows = number_at(head, 4, 4);
    const bool is_pca_model =
        number_at(head, 0, 4) <= 8 && rows >= 3 && rows % 3 == 0 && rows < 10'000'000 && number_at(head, 8, 4) == 1;
    const std::uint64_t count = number_at(head, 0, 8);
    const std::uint64_t length = number_at(head, 8, 8);
    const bool is_blendshapes = count >= 1 && count < 1000 && length >= 1 && length < 100 &&
                                std::isalnum(static_cast<unsigned char>(head[16])) != 0;
    return is_pca_model || is_blendshapes;
}

} // namespace

std::optional<ContentGuess> guess_content(std::span<const std::byte> bytes)
{
    const std::string_view head(reinterpret_cast<const char*>(bytes.data()), std::min<std::size_t>(bytes.size(), 512));
    struct Signature
    {
        std::string_view bytes;
        const char* kind;
        const char* advice;
    };
    constexpr const char* not_yet = "Lineament cannot read it yet";
    static constexpr Signature signatures[] = {
        {"version https://git-lfs.github.com/spec/"sv, "a git-LFS pointer", "run git lfs pull to get the file itself"},
        {"\x1f\x8b"sv, "a gzip archive", "unpack it first (gunzip)"},
        {"PK\x03\x04"sv, "a zip archive (or a .npz file)", "unpack it first; a .npz model Lineament cannot read yet"},
        {"BZh"sv, "a bzip2 archive", "unpack it first (bunzip2)"},
        {"\xfd"
         "7zXZ\0"sv,
         "an xz archive", "unpack it first (unxz)"},
        {"7z\xbc\xaf\x27\x1c"sv, "a 7-zip archive", "unpack it first"},
        {"\x28\xb5\x2f\xfd"sv, "a zstd archive", "unpack it first (unzstd)"},
        {"MATLAB 5.0"sv, "a MATLAB file", not_yet},
        {"MATLAB 7.3"sv, "a MATLAB 7.3 (HDF5) file", not_yet},
        {"\x89HDF\r\n\x1a\n"sv, "an HDF5 file", not_yet},
        {"\x89PNG\r\n\x1a\n"sv, "a PNG image", ""},
        {"\xff\xd8\xff"sv, "a JPEG image", ""},
        {"GIF8"sv, "a GIF image", "convert it to PNG or JPEG"},
        {"BM"sv, "a BMP image", "convert it to PNG or JPEG"},
        {"II*\0"sv, "a TIFF image", "convert it to PNG or JPEG"},
        {"MM\0*"sv, "a TIFF image", "convert it to PNG or JPEG"},
        {"glTF"sv, "a binary glTF (.glb) file", ""},
        {"ply\n"sv, "a PLY mesh", ""},
        {"ply\r"sv, "a PLY mesh", ""},
        {"%PDF"sv, "a PDF document", ""},
        {"\xff\xfe"sv, "UTF-16 text", "save it as UTF-8"},
        {"\xfe\xff"sv, "UTF-16 text", "save it as UTF-8"},
    };
    for (const Signature& signature : signatures) {
        if (head.starts_with(signature.bytes)) {
            return ContentGuess{signature.kind, signature.advice};
        }
    }
    if (is_html(head)) {
        return ContentGuess{"a web page (HTML), perhaps an error page", "download the file again"};
    }
    if (head.size() >= 2 && head[0] == '\x80' && head[1] >= 2 && head[1] <= 5) {
        return ContentGuess{"a Python pickle", "pickles can run code and are never loaded"};
    }
    if (head.size() >= 12 && head.starts_with("RIFF") && head.substr(8, 4) == "WEBP") {
        return ContentGuess{"a WebP image", "convert it to PNG or JPEG"};
    }
    if (head.size() >= 12 && head.substr(4, 4) == "ftyp") {
        const std::string_view brand = head.substr(8, 4);
        if (brand == "heic" || brand == "heix" || brand == "mif1" || brand == "msf1" || brand == "hevc") {
            return ContentGuess{"a HEIC image", "convert it to PNG or JPEG"};
        }
        if (brand == "avif" || brand == "avis") {
            return ContentGuess{"an AVIF image", "convert it to PNG or JPEG"};
        }
        return ContentGuess{"an MP4 or QuickTime video", ""};
    }
    if (head.size() >= 9 && number_at(head, 0, 8) < (1u << 28) && head[8] == '{') {
        return ContentGuess{"a safetensors file", ""};
    }
    if (is_cereal(head)) {
        return ContentGuess{"an eos model (.bin, written by cereal)", not_yet};
    }
    return std::nullopt;
}

std::string content_hint(std::span<const std::byte> bytes)
{
    const std::optional<ContentGuess> guess = guess_content(bytes);
    if (!guess) {
        return {};
    }
    return "; it seems to be " + guess->kind + (guess->advice.empty() ? "" : ": " + guess->advice);
}

} // namespace lineament
