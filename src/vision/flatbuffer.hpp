// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/error.hpp"

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

namespace lineament::network {

/// A file of little-endian numbers and relative offsets; every access is checked against its end.
class CheckedBytes
{
public:
    CheckedBytes(std::string_view bytes, const std::string& path) : bytes_(bytes), path_(path) {}

    [[nodiscard]] std::size_t size() const { return bytes_.size(); }

    [[noreturn]] void fail(std::size_t place, const std::string& expected) const
    {
        throw IoError(IoErrorKind::content, path_, "byte " + std::to_string(place),
                      "expected a TensorFlow Lite network, found " + expected);
    }

    template <typename Number>
    [[nodiscard]] Number read(std::size_t place) const
    {
        static_assert(std::endian::native == std::endian::little);
        if (place > bytes_.size() || bytes_.size() - place < sizeof(Number)) {
            fail(place, "the end of the file inside a number");
        }
        Number number;
        std::memcpy(&number, bytes_.data() + place, sizeof number);
        return number;
    }

    [[nodiscard]] std::string_view range(std::size_t place, std::size_t count) const
    {
        if (place > bytes_.size() || bytes_.size() - place < count) {
            fail(place, "a field longer than the file");
        }
        return bytes_.substr(place, count);
    }

private:
    std::string_view bytes_;
    const std::string& path_;
};

/// A vector in a FlatBuffer: where its elements begin and how many there are.
struct FlatVector
{
    std::size_t begin = 0;
    std::size_t count = 0;
};

/// A table of a FlatBuffer: fields by number, absent ones have their default.
/// @par Reference  FlatBuffers: "FlatBuffer Internals", flatbuffers.dev.
class FlatTable
{
public:
    FlatTable(const CheckedBytes& bytes, std::size_t place) : bytes_(&bytes), place_(place)
    {
        const std::int64_t table = static_cast<std::int64_t>(place) - bytes.read<std::int32_t>(place);
        if (table < 0 || table >= static_cast<std::int64_t>(bytes.size())) {
            bytes.fail(place, "a table whose field list lies outside the file");
        }
        fields_ = static_cast<std::size_t>(table);
        fields_size_ = bytes.read<std::uint16_t>(fields_);
    }

    [[nodiscard]] std::size_t place() const { return place_; }

    template <typename Number>
    [[nodiscard]] Number number(int field, Number otherwise) const
    {
        const std::size_t at = place_of(field);
        return at == 0 ? otherwise : bytes_->read<Number>(at);
    }

    [[nodiscard]] bool has(int field) const { return place_of(field) != 0; }

    /// @pre has(field)
    [[nodiscard]] FlatTable table(int field) const { return {*bytes_, target(place_of(field))}; }

    /// The vector; empty if the field is absent.
    [[nodiscard]] FlatVector vector(int field, std::size_t element_size) const
    {
        const std::size_t at = place_of(field);
        if (at == 0) {
            return {};
        }
        const std::size_t begin = target(at);
        const std::size_t count = bytes_->read<std::uint32_t>(begin);
        (void)bytes_->range(begin + 4, count * element_size);
        return {.begin = begin + 4, .count = count};
    }

    [[nodiscard]] FlatTable element(const FlatVector& vector, std::size_t index) const
    {
        return {*bytes_, target(vector.begin + 4 * index)};
    }

private:
    [[nodiscard]] std::size_t place_of(int field) const
    {
        const std::size_t entry = 4 + 2 * static_cast<std::size_t>(field);
        if (entry + 2 > fields_size_) {
            return 0;
        }
        const std::uint16_t offset = bytes_->read<std::uint16_t>(fields_ + entry);
        return offset == 0 ? 0 : place_ + offset;
    }

    [[nodiscard]] std::size_t target(std::size_t at) const { return at + bytes_->read<std::uint32_t>(at); }

    const CheckedBytes* bytes_;
    std::size_t place_ = 0;
    std::size_t fields_ = 0;
    std::size_t fields_size_ = 0;
};

} // namespace lineament::network
