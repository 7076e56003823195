// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "network_reader.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>

namespace lineament::network {
namespace {

constexpr std::size_t max_file_size = std::size_t{64} << 20;

} // namespace

Network parse_network(std::string_view bytes, const std::string& path)
{
    return NetworkReader(bytes, path).read();
}

Network load_network(const std::string& path, NetworkTrust trust)
{
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(path, error);
    std::ifstream file(path, std::ios::binary);
    if (error || !file) {
        throw IoError(IoErrorKind::system, path, "", "network not found or not readable; see models/README.md");
    }
    if (size > max_file_size) {
        throw IoError(IoErrorKind::limit, path, "", "expected a network of at most 64 MB");
    }
    std::string bytes(static_cast<std::size_t>(size), '\0');
    file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    if (static_cast<std::uintmax_t>(file.gcount()) != size) {
        throw IoError(IoErrorKind::system, path, "", "reading failed");
    }
    // face_detection_short_range, face_detection_full_range, face_landmark_with_attention: models/README.md
    static constexpr std::array<std::string_view, 3> known = {
        "3bc182eb9f33925d9e58b5c8d59308a760f4adea8f282370e428c51212c26633",
        "99bf9494d84f50acc6617d89873f71bf6635a841ea699c17cb3377f9507cfec3",
        "883b7411747bac657c30c462d305d312e9dec6adbf8b85e2f5d8d722fca9455d"};
    if (trust == NetworkTrust::known_only && std::find(known.begin(), known.end(), sha256(bytes)) == known.end()) {
        throw IoError(IoErrorKind::content, path, "",
                      "expected one of the networks listed in models/README.md, found a file of another SHA-256");
    }
    return parse_network(bytes, path);
}

} // namespace lineament::network
