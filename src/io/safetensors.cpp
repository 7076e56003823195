// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/safetensors.hpp"

#include "lineament/core/checks.hpp"
#include "lineament/io/file.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <limits>
#include <optional>
#include <set>

namespace lineament {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t prefix_bytes = 8;

std::string hex(std::uint64_t value)
{
    char text[32];
    std::snprintf(text, sizeof text, "0x%llx", static_cast<unsigned long long>(value));
    return text;
}

/// The text with control characters made visible, cut to a length that fits a message.
std::string shown(const std::string& text)
{
    std::string result;
    for (const char c : text.substr(0, 60)) {
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
            char escaped[8];
            std::snprintf(escaped, sizeof escaped, "\\x%02x", static_cast<unsigned>(static_cast<unsigned char>(c)));
            result += escaped;
        } else {
            result += c;
        }
    }
    return "'" + result + (text.size() > 60 ? "..." : "") + "'";
}

const char* name_of(TensorType type)
{
    switch (type) {
    case TensorType::float32:
        return "F32";
    case TensorType::float16:
        return "F16";
    case TensorType::int32:
        return "I32";
    case TensorType::int16:
        return "I16";
    }
    return "";
}

std::optional<TensorType> type_named(const std::string& name)
{
    for (const TensorType type : {TensorType::float32, TensorType::float16, TensorType::int32, TensorType::int16}) {
        if (name == name_of(type)) {
            return type;
        }
    }
    return std::nullopt;
}

/// A tensor's entry in the header, before it is checked against the file.
struct Entry
{
    std::string name = {};
    std::string type = {};
    std::vector<std::uint64_t> shape = {};
    std::vector<std::uint64_t> offsets = {};
};

/// Receives the header's JSON token by token, so that its size, depth and duplicate names are checked while it is read:
///   {"__metadata__": {text: text, ...}, name: {"dtype": text, "shape": [n, ...], "data_offsets": [begin, end]}, ...}
class HeaderReader : public nlohmann::json_sax<nlohmann::json>
{
public:
    std::map<std::string, std::string> metadata;
    std::vector<Entry> entries;
    std::string error;
    bool is_over_limit = false;

    bool key(std::string& text) override
    {
        if (depth_ == 1) {
            if (!names_.insert(text).second) {
                return fail("name " + shown(text) + " is used twice");
            }
            in_metadata_ = text == "__metadata__";
            if (!in_metadata_) {
                if (entries.size() == max_safetensors_tensors) {
                    is_over_limit = true;
                    return fail("more than " + std::to_string(max_safetensors_tensors) + " tensors");
                }
                entries.push_back({.name = text});
            }
        } else {
            key_ = text;
            if (in_metadata_ ? metadata.contains(text) : !fields_.insert(text).second) {
                return fail(where() + "key " + shown(text) + " is used twice");
            }
        }
        return true;
    }

    bool string(std::string& text) override
    {
        if (depth_ == 2 && in_metadata_) {
            metadata.emplace(key_, text);
            return true;
        }
        if (depth_ == 2 && key_ == "dtype") {
            entries.back().type = text;
            return true;
        }
        return fail(where() + "text " + shown(text) + " is not allowed here");
    }

    bool number_unsigned(number_unsigned_t value) override
    {
        std::vector<std::uint64_t>* const list = open_list();
        if (list == nullptr) {
            return fail(where() + "number " + std::to_string(value) + " is not allowed here");
        }
        if (list->size() == 8) {
            return fail(where() + key_ + " has more than 8 numbers");
        }
        list->push_back(value);
        return true;
    }
    bool number_integer(number_integer_t value) override
    {
        return fail(where() + key_ + " is " + std::to_string(value) + "; expected a whole number >= 0");
    }
    bool number_float(number_float_t, const std::string& text) override
    {
        return fail(where() + key_ + " is " + shown(text) + "; expected a whole number >= 0");
    }
    bool null() override { return fail(where() + "null is not allowed"); }
    bool boolean(bool) override { return fail(where() + "true or false is not allowed"); }
    bool binary(binary_t&) override { return fail("binary data are not allowed"); }

    bool start_object(std::size_t) override
    {
        fields_.clear();
        return depth_++ < 2 || fail(where() + "an object is not allowed here");
    }
    bool end_object() override
    {
        --depth_;
        if (depth_ == 1 && !in_metadata_ && fields_.size() != 3) {
            return fail(where() + "expected dtype, shape and data_offsets");
        }
        return true;
    }
    bool start_array(std::size_t) override
    {
        const bool is_list = depth_ == 2 && !in_metadata_ && (key_ == "shape" || key_ == "data_offsets");
        in_list_ = true;
        return is_list || fail(where() + "a list is not allowed here");
    }
    bool end_array() override
    {
        in_list_ = false;
        return true;
    }
    bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception& exception) override
    {
        std::string text = exception.what();
        text = text.substr(std::min(text.size(), text.find("] ") + 2));
        return fail("the header is not valid JSON (byte " + hex(prefix_bytes + position) + "): " + text);
    }

private:
    bool fail(const std::string& text)
    {
        error = text;
        return false;
    }
    [[nodiscard]] std::string where() const
    {
        if (in_metadata_) {
            return "__metadata__: ";
        }
        return entries.empty() ? "" : "tensor " + shown(entries.back().name) + ": ";
    }
    std::vector<std::uint64_t>* open_list()
    {
        if (!in_list_) {
            return nullptr;
        }
        return key_ == "shape" ? &entries.back().shape : &entries.back().offsets;
    }

    std::set<std::string> names_;
    std::set<std::string> fields_;
    std::string key_;
    int depth_ = 0;
    bool in_metadata_ = false;
    bool in_list_ = false;
};

/// Where the tensors begin, after the header's length is checked against the file's.
std::size_t find_data_start(std::span<const std::byte> bytes, const std::string& file_name)
{
    const auto fail = [&](const std::string& place, const std::string& what) {
        throw IoError(IoErrorKind::content, file_name, place, what + content_hint(bytes));
    };
    if (bytes.empty()) {
        fail("", "file is empty (0 bytes); a Lineament model is a safetensors file");
    }
    if (bytes.size() < prefix_bytes) {
        fail("",
             "file has " + std::to_string(bytes.size()) + " bytes; a safetensors file begins with an 8-byte length");
    }
    std::uint64_t length = 0;
    std::uint64_t reversed = 0;
    for (std::size_t i = 0; i < prefix_bytes; ++i) {
        length |= static_cast<std::uint64_t>(bytes[i]) << (8 * i);
        reversed = reversed << 8 | static_cast<std::uint64_t>(bytes[i]);
    }
    const std::uint64_t available = bytes.size() - prefix_bytes;
    if (length > available && reversed >= 2 && reversed <= available) {
        fail("byte 0x0", "the header's length has its bytes in reverse order (big-endian); it must be little-endian");
    }
    const bool looks_like_header = bytes.size() > prefix_bytes && bytes[prefix_bytes] == std::byte{'{'};
    if (length > available && looks_like_header && length <= max_safetensors_header_bytes) {
        fail("", "ends at " + hex(bytes.size()) + "; the header needs " + std::to_string(length) + " bytes, " +
                     std::to_string(available) + " left; download again?");
    }
    if (length < 2 || length > available || !looks_like_header) {
        fail("byte 0x0", "is not a safetensors file (header length " + std::to_string(length) + ", " +
                             std::to_string(available) + " bytes follow)");
    }
    if (length > max_safetensors_header_bytes) {
        throw IoError(IoErrorKind::limit, file_name, "byte 0x0",
                      "header of " + std::to_string(length) + " bytes; at most " +
                          std::to_string(max_safetensors_header_bytes) + " are read");
    }
    return prefix_bytes + static_cast<std::size_t>(length);
}

/// The entry as a tensor, after its type, shape and offsets are checked against each other and `data`.
Tensor check_entry(const Entry& entry, std::span<const std::byte> data, std::size_t data_start,
                   const std::string& file_name)
{
    const auto fail = [&](const std::string& what) {
        throw IoError(IoErrorKind::content, file_name, "", "tensor " + shown(entry.name) + ": " + what);
    };
    Tensor tensor{.name = entry.name, .shape = entry.shape};
    const std::optional<TensorType> type = type_named(entry.type);
    if (!type) {
        fail("type " + shown(entry.type) + " is not one of F32, F16, I32, I16");
    }
    tensor.type = *type;
    if (entry.offsets.size() != 2 || entry.offsets[0] > entry.offsets[1]) {
        fail("data_offsets must be [begin, end] with begin <= end");
    }
    const std::uint64_t num_bytes = entry.offsets[1] - entry.offsets[0];
    // Checked in this order so that the product cannot overflow: the running product never exceeds the file.
    std::uint64_t product = size_of(*type);
    const bool has_zero = std::find(entry.shape.begin(), entry.shape.end(), 0u) != entry.shape.end();
    if (has_zero) {
        product = 0;
    } else {
        for (const std::uint64_t size : entry.shape) {
            if (size > std::numeric_limits<std::uint64_t>::max() / product) {
                fail("the product of its shape overflows (size " + std::to_string(size) + ")");
            }
            product *= size;
        }
    }
    if (product != num_bytes) {
        fail("shape and type need " + std::to_string(product) + " bytes, data_offsets give " +
             std::to_string(num_bytes));
    }
    if (entry.offsets[1] > data.size()) {
        const std::uint64_t left = data.size() - std::min<std::uint64_t>(entry.offsets[0], data.size());
        throw IoError(IoErrorKind::content, file_name, "",
                      "ends at " + hex(data_start + data.size()) + "; tensor " + shown(entry.name) + " needs " +
                          std::to_string(num_bytes) + " bytes, " + std::to_string(left) + " left; download again?");
    }
    tensor.elements = data.subspan(entry.offsets[0], num_bytes);
    return tensor;
}

} // namespace

std::size_t size_of(TensorType type)
{
    return type == TensorType::float32 || type == TensorType::int32 ? 4 : 2;
}

const Tensor* Safetensors::find(const std::string& name) const
{
    const auto found = std::find_if(tensors.begin(), tensors.end(), [&](const Tensor& t) { return t.name == name; });
    return found == tensors.end() ? nullptr : &*found;
}

Safetensors parse_safetensors(std::span<const std::byte> bytes, const std::string& file_name)
{
    const std::size_t data_start = find_data_start(bytes, file_name);
    const auto* const header = reinterpret_cast<const char*>(bytes.data()) + prefix_bytes;
    HeaderReader reader;
    if (!nlohmann::json::sax_parse(header, header + (data_start - prefix_bytes), &reader)) {
        throw IoError(reader.is_over_limit ? IoErrorKind::limit : IoErrorKind::content, file_name, "", reader.error);
    }
    Safetensors result;
    result.metadata = std::move(reader.metadata);
    std::sort(reader.entries.begin(), reader.entries.end(), [](const Entry& a, const Entry& b) {
        return a.offsets < b.offsets || (a.offsets == b.offsets && a.name < b.name);
    });
    const std::span<const std::byte> data = bytes.subspan(data_start);
    std::uint64_t end = 0;
    std::string previous = "the header";
    for (const Entry& entry : reader.entries) {
        const Tensor tensor = check_entry(entry, data, data_start, file_name);
        const std::uint64_t begin = entry.offsets[0];
        if (begin != end) {
            const std::uint64_t amount = begin < end ? end - begin : begin - end;
            throw IoError(IoErrorKind::content, file_name, "byte " + hex(data_start + std::min(begin, end)),
                          "tensor " + shown(entry.name) + (begin < end ? " overlaps " : " leaves a gap after ") +
                              previous + " (" + std::to_string(amount) + " bytes)");
        }
        end = entry.offsets[1];
        previous = shown(entry.name);
        result.tensors.push_back(tensor);
    }
    if (end != data.size()) {
        throw IoError(IoErrorKind::content, file_name, "byte " + hex(data_start + end),
                      std::to_string(data.size() - end) + " bytes after the last tensor at " + hex(data_start + end));
    }
    return result;
}

std::vector<std::byte> format_safetensors(const std::vector<std::pair<std::string, std::string>>& metadata,
                                          const std::vector<Tensor>& tensors)
{
    Json header = Json::object();
    Json& texts = header["__metadata__"] = Json::object();
    for (const auto& [key, text] : metadata) {
        require(!texts.contains(key), "format_safetensors", "metadata", "different keys", shown(key) + " twice");
        texts[key] = text;
    }
    std::uint64_t offset = 0;
    for (const Tensor& tensor : tensors) {
        std::uint64_t num_bytes = size_of(tensor.type);
        for (const std::uint64_t size : tensor.shape) {
            num_bytes *= size;
        }
        require(num_bytes == tensor.elements.size(), "format_safetensors", tensor.name.c_str(),
                std::to_string(num_bytes) + " bytes", std::to_string(tensor.elements.size()));
        require(!header.contains(tensor.name), "format_safetensors", "tensors", "different names",
                shown(tensor.name) + " twice");
        Json& entry = header[tensor.name] = Json::object();
        entry["dtype"] = name_of(tensor.type);
        entry["shape"] = tensor.shape;
        entry["data_offsets"] = {offset, offset + num_bytes};
        offset += num_bytes;
    }
    std::string text;
    try {
        text = header.dump();
    } catch (const nlohmann::json::exception&) {
        throw InvalidArgument("format_safetensors", "metadata", "texts and names in UTF-8", "other bytes");
    }
    text.resize((text.size() + 7) / 8 * 8, ' '); // so that the tensors are aligned
    std::vector<std::byte> bytes(prefix_bytes);
    bytes.reserve(prefix_bytes + text.size() + offset);
    for (std::size_t i = 0; i < prefix_bytes; ++i) {
        bytes[i] = static_cast<std::byte>(static_cast<std::uint64_t>(text.size()) >> (8 * i));
    }
    const auto header_bytes = std::as_bytes(std::span(text));
    bytes.insert(bytes.end(), header_bytes.begin(), header_bytes.end());
    for (const Tensor& tensor : tensors) {
        bytes.insert(bytes.end(), tensor.elements.begin(), tensor.elements.end());
    }
    return bytes;
}

std::uint32_t compute_crc32c(std::span<const std::byte> bytes, std::uint32_t crc)
{
    // Eight tables, so that eight bytes are taken at a time.
    static const auto tables = [] {
        std::array<std::array<std::uint32_t, 256>, 8> result{};
        for (std::uint32_t i = 0; i < 256; ++i) {
            std::uint32_t value = i;
            for (int bit = 0; bit < 8; ++bit) {
                value = (value >> 1) ^ ((value & 1) != 0 ? 0x82f63b78u : 0u);
            }
            result[0][i] = value;
        }
        for (std::size_t t = 1; t < 8; ++t) {
            for (std::size_t i = 0; i < 256; ++i) {
                result[t][i] = (result[t - 1][i] >> 8) ^ result[0][result[t - 1][i] & 0xff];
            }
        }
        return result;
    }();
    crc = ~crc;
    std::size_t i = 0;
    for (; i + 8 <= bytes.size(); i += 8) {
        std::uint32_t next = 0;
        for (std::size_t k = 0; k < 4; ++k) {
            next ^= tables[7 - k][((crc >> (8 * k)) & 0xff) ^ static_cast<std::uint32_t>(bytes[i + k])];
            next ^= tables[3 - k][static_cast<std::uint32_t>(bytes[i + 4 + k])];
        }
        crc = next;
    }
    for (; i < bytes.size(); ++i) {
        crc = (crc >> 8) ^ tables[0][(crc ^ static_cast<std::uint32_t>(bytes[i])) & 0xff];
    }
    return ~crc;
}

} // namespace lineament
