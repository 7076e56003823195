// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "flatbuffer.hpp"

#include <vector>

namespace lineament::network {

/// A FlexBuffer whose root is a map from names to numbers and vectors of integers: the options of a custom operation.
/// @par Reference  FlatBuffers: "FlexBuffers", flatbuffers.dev.
class FlexMap
{
public:
    /// @param begin  Of the FlexBuffer in the file; errors name places in the file.
    FlexMap(const CheckedBytes& file, std::size_t begin, std::size_t count)
        : bytes_(file), begin_(begin), end_(begin + count)
    {
        if (count < 4) {
            bytes_.fail(begin, "options cut short");
        }
        const std::size_t root_width = width_of(bytes_.read<std::uint8_t>(end_ - 1));
        const auto type = bytes_.read<std::uint8_t>(end_ - 2);
        if ((type >> 2) != map_type || count < 2 + root_width) {
            bytes_.fail(end_ - 2, "options that are no map");
        }
        width_ = std::size_t{1} << (type & 3);
        values_ = target(end_ - 2 - root_width, root_width);
        num_values_ = integer(before(values_, width_), width_);
        if (num_values_ > count) {
            bytes_.fail(values_, "more options than bytes");
        }
        keys_width_ = width_of(integer(before(values_, 2 * width_), width_));
        keys_ = target(before(values_, 3 * width_), width_);
    }

    /// The integer or float of that name.
    [[nodiscard]] double number(std::string_view name) const
    {
        const Entry entry = find(name);
        switch (entry.type) {
        case 1: // signed, in place
            return static_cast<double>(sign_extended(integer(entry.place, width_), width_));
        case 2: // unsigned, in place
            return static_cast<double>(integer(entry.place, width_));
        case 3: // float, in place
            return real(entry.place, width_);
        case 6: // signed, elsewhere
            return static_cast<double>(sign_extended(integer(target(entry.place, width_), entry.width), entry.width));
        case 7: // unsigned, elsewhere
            return static_cast<double>(integer(target(entry.place, width_), entry.width));
        case 8: // float, elsewhere
            return real(target(entry.place, width_), entry.width);
        default:
            bytes_.fail(entry.place, "an option that is no number");
        }
    }

    /// The vector of integers of that name.
    [[nodiscard]] std::vector<std::int64_t> integers(std::string_view name) const
    {
        const Entry entry = find(name);
        if (entry.type != 11 && entry.type != 12) { // typed vectors of signed and unsigned integers
            bytes_.fail(entry.place, "an option that is no vector of integers");
        }
        const std::size_t begin = target(entry.place, width_);
        const std::uint64_t count = integer(before(begin, entry.width), entry.width);
        if (count > end_ - begin) {
            bytes_.fail(begin, "a vector longer than the options");
        }
        std::vector<std::int64_t> values;
        for (std::uint64_t i = 0; i < count; ++i) {
            const std::uint64_t raw = integer(begin + i * entry.width, entry.width);
            values.push_back(entry.type == 11 ? sign_extended(raw, entry.width) : static_cast<std::int64_t>(raw));
        }
        return values;
    }

private:
    static constexpr int map_type = 9;

    struct Entry
    {
        int type = 0;
        std::size_t width = 1;
        std::size_t place = 0;
    };

    [[nodiscard]] std::size_t width_of(std::uint64_t value) const
    {
        if (value != 1 && value != 2 && value != 4 && value != 8) {
            bytes_.fail(end_ - 1, "a number width other than 1, 2, 4, 8");
        }
        return static_cast<std::size_t>(value);
    }

    [[nodiscard]] std::uint64_t integer(std::size_t place, std::size_t width) const
    {
        if (place < begin_ || place > end_ || end_ - place < width) {
            bytes_.fail(place, "options that point outside themselves");
        }
        switch (width) {
        case 1:
            return bytes_.read<std::uint8_t>(place);
        case 2:
            return bytes_.read<std::uint16_t>(place);
        case 4:
            return bytes_.read<std::uint32_t>(place);
        default:
            return bytes_.read<std::uint64_t>(place);
        }
    }

    [[nodiscard]] static std::int64_t sign_extended(std::uint64_t raw, std::size_t width)
    {
        const int shift = static_cast<int>(64 - 8 * width);
        return static_cast<std::int64_t>(raw << shift) >> shift;
    }

    [[nodiscard]] double real(std::size_t place, std::size_t width) const
    {
        const std::uint64_t raw = integer(place, width);
        if (width == 4) {
            return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
        }
        if (width == 8) {
            return std::bit_cast<double>(raw);
        }
        bytes_.fail(place, "a float of unknown width");
    }

    [[nodiscard]] std::size_t before(std::size_t place, std::size_t distance) const
    {
        if (place < begin_ + distance) {
            bytes_.fail(place, "options that point before their begin");
        }
        return place - distance;
    }

    [[nodiscard]] std::size_t target(std::size_t place, std::size_t width) const
    {
        const std::uint64_t offset = integer(place, width);
        if (offset > place - begin_) {
            bytes_.fail(place, "options that point before their begin");
        }
        return place - static_cast<std::size_t>(offset);
    }

    [[nodiscard]] Entry find(std::string_view name) const
    {
        for (std::size_t i = 0; i < num_values_; ++i) {
            const std::size_t key = target(keys_ + i * keys_width_, keys_width_);
            if (key < end_ && end_ - key > name.size() && bytes_.range(key, name.size()) == name &&
                bytes_.read<char>(key + name.size()) == '\0') {
                const std::uint64_t type = integer(values_ + num_values_ * width_ + i, 1);
                return {.type = static_cast<int>(type >> 2),
                        .width = std::size_t{1} << (type & 3),
                        .place = values_ + i * width_};
            }
        }
        bytes_.fail(values_, "no option " + std::string(name));
    }

    const CheckedBytes& bytes_;
    std::size_t begin_;
    std::size_t end_;
    std::size_t width_ = 1;
    std::size_t keys_width_ = 1;
    std::size_t values_ = 0;
    std::size_t keys_ = 0;
    std::size_t num_values_ = 0;
};

} // namespace lineament::network
