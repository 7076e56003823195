// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace lineament {

/// Element types of the tensors we use, by their names in the file: F32, F16, I32, I16.
enum class TensorType
{
    float32,
    float16,
    int32,
    int16,
};

/// Bytes of one element.
[[nodiscard]] std::size_t size_of(TensorType type);

/// A named array in a safetensors file; a view of bytes that somebody else holds.
struct Tensor
{
    std::string name = {};
    TensorType type = TensorType::float32;
    std::vector<std::uint64_t> shape = {};    ///< Slowest index first.
    std::span<const std::byte> elements = {}; ///< Little-endian, densely packed.

    [[nodiscard]] std::size_t num_elements() const { return elements.size() / size_of(type); }
};

/// The parsed safetensors file: an 8-byte little-endian header length, a JSON header, raw tensors.
struct Safetensors
{
    std::map<std::string, std::string> metadata = {};
    std::vector<Tensor> tensors = {}; ///< In the order of their bytes.

    /// The tensor of that name, or nullptr.
    [[nodiscard]] const Tensor* find(const std::string& name) const;
};

/// Limits of a header; a file beyond them is refused (IoErrorKind::limit).
inline constexpr std::size_t max_safetensors_header_bytes = std::size_t{16} << 20;
inline constexpr std::size_t max_safetensors_tensors = 4096;

/// The tensors of a file in memory. The result refers to `bytes`.
///
/// Checked here: the header's length, its JSON and UTF-8, duplicate names, types, shape products (without overflow)
/// against byte counts, and that the tensors cover the rest of the file without overlap, gap or excess. Nothing is
/// allocated by a number from the file.
///
/// @param file_name  For messages.
/// @throws IoError (content, limit) naming file, tensor and the check that failed.
/// @par Reference  The safetensors format, https://github.com/huggingface/safetensors.
[[nodiscard]] Safetensors parse_safetensors(std::span<const std::byte> bytes, const std::string& file_name);

/// The bytes of a file with the metadata in the given order and the tensors in the given order.
/// @throws InvalidArgument on a name that is used twice, text that is not UTF-8, or elements that do not fill the
/// shape.
[[nodiscard]] std::vector<std::byte>
format_safetensors(const std::vector<std::pair<std::string, std::string>>& metadata,
                   const std::vector<Tensor>& tensors);

/// CRC-32C (Castagnoli) of the bytes, continued from `crc`.
/// @par Reference  Castagnoli, Braeuer and Herrmann, Optimization of Cyclic Redundancy-Check Codes with 24 and 32
///                 Parity Bits, IEEE Transactions on Communications 1993.
[[nodiscard]] std::uint32_t compute_crc32c(std::span<const std::byte> bytes, std::uint32_t crc = 0);

} // namespace lineament
