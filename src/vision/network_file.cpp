// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "network_reader.hpp"

#include <filesystem>
#include <fstream>

namespace lineament::network {
namespace {

constexpr std::size_t max_file_size = std::size_t{64} << 20;

template <typename Number>
std::string listed(const std::vector<Number>& numbers, const char* separator)
{
    std::string text;
    for (const Number number : numbers) {
        text += (text.empty() ? "" : separator) + std::to_string(number);
    }
    return text.empty() ? "none" : text;
}

} // namespace

Network parse_network(std::string_view bytes, const std::string& path)
{
    Network network = NetworkReader(bytes, path).read();
    network.path = path;
    return network;
}

Network load_network(const std::string& path, std::string_view expected_sha256)
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
    if (!expected_sha256.empty()) {
        const std::string found = sha256(bytes);
        if (found != expected_sha256) {
            throw IoError(IoErrorKind::content, path, "",
                          "expected the network of SHA-256 " + std::string(expected_sha256) +
                              " (models/README.md), found " + found);
        }
    }
    return parse_network(bytes, path);
}

void expect_shapes(const Network& network, const std::vector<int>& input_shape,
                   const std::vector<std::size_t>& output_sizes)
{
    const std::vector<int>& found_input = network.tensors[network.input].shape;
    if (found_input != input_shape) {
        throw IoError(IoErrorKind::content, network.path, "input",
                      "expected " + listed(input_shape, " x ") + " values, found " + listed(found_input, " x "));
    }
    std::vector<std::size_t> found_sizes;
    for (const int output : network.outputs) {
        found_sizes.push_back(network.tensors[output].size());
    }
    if (found_sizes != output_sizes) {
        throw IoError(IoErrorKind::content, network.path, "outputs",
                      "expected " + listed(output_sizes, ", ") + " values, found " + listed(found_sizes, ", "));
    }
}

} // namespace lineament::network
