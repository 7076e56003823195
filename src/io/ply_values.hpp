// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "text.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// What stands in the body of a PLY file.
namespace lineament::ply {

using detail::content_error;
using detail::in_quotes;
using detail::take_token;
using detail::trimmed;

enum class Type
{
    i8,
    u8,
    i16,
    u16,
    i32,
    u32,
    f32,
    f64,
};

inline constexpr std::array<std::size_t, 8> type_sizes = {1, 1, 2, 2, 4, 4, 4, 8};

inline std::optional<Type> type_of(std::string_view name)
{
    static constexpr std::array<std::array<std::string_view, 2>, 8> names = {{{"char", "int8"},
                                                                              {"uchar", "uint8"},
                                                                              {"short", "int16"},
                                                                              {"ushort", "uint16"},
                                                                              {"int", "int32"},
                                                                              {"uint", "uint32"},
                                                                              {"float", "float32"},
                                                                              {"double", "float64"}}};
    for (std::size_t i = 0; i < names.size(); ++i) {
        if (name == names[i][0] || name == names[i][1]) {
            return static_cast<Type>(i);
        }
    }
    return std::nullopt;
}

inline bool is_integer(Type type)
{
    return type != Type::f32 && type != Type::f64;
}

struct Property
{
    std::string name = {};
    Type type = Type::f32;
    std::optional<Type> count_type = std::nullopt; ///< Of a list.
    std::string place = {};
};

struct Element
{
    std::string name = {};
    std::size_t count = 0;
    std::vector<Property> properties = {};
    std::string place = {};
};

enum class Encoding
{
    ascii,
    little,
    big,
};

// The values after the header, one after the other.
class Values
{
public:
    Values(std::string_view bytes, std::size_t start, int lines_before, Encoding encoding, const std::string& path)
        : bytes_(bytes), at_(start), encoding_(encoding), path_(path), lines_(bytes.substr(start)),
          lines_before_(lines_before)
    {}

    void start_row(const Element& element, std::size_t row)
    {
        element_ = &element;
        row_ = row;
        if (encoding_ == Encoding::ascii) {
            do {
                if (!lines_.next()) {
                    line_ = {};
                    fail("expected " + what() + ", found the end of the file: cut short?");
                }
                line_ = trimmed(lines_.line());
            } while (line_.empty());
            token_ = line_;
        }
    }

    void end_row()
    {
        if (encoding_ == Encoding::ascii && !trimmed(line_).empty()) {
            token_ = trimmed(line_);
            fail("expected no more values for " + what() + ", found " + in_quotes(token_));
        }
    }

    double next(Type type) { return encoding_ == Encoding::ascii ? next_ascii(type) : next_binary(type); }

    [[noreturn]] void fail(const std::string& text) const
    {
        if (encoding_ != Encoding::ascii) {
            constexpr char digits[] = "0123456789abcdef";
            std::string hex;
            for (std::size_t value = at_; value > 0 || hex.empty(); value /= 16) {
                hex.insert(hex.begin(), digits[value % 16]);
            }
            throw content_error(path_, "byte 0x" + hex, text);
        }
        const std::string column =
            line_.data() == nullptr ? "" : ":" + std::to_string(token_.data() - lines_.line().data() + 1);
        throw content_error(path_, std::to_string(lines_before_ + lines_.number()) + column, text);
    }

    [[nodiscard]] std::string what() const { return element_->name + " " + std::to_string(row_); }

    [[nodiscard]] bool has_rest() const { return encoding_ == Encoding::ascii ? false : at_ < bytes_.size(); }

private:
    double next_ascii(Type type)
    {
        token_ = take_token(line_);
        if (token_.empty()) {
            token_ = line_;
            fail("expected another value for " + what() + ", found the end of the line");
        }
        std::optional<double> value;
        if (type == Type::f32) {
            value = detail::parse_float(token_);
        } else {
            value = detail::parse_number(token_);
        }
        if (!value || (is_integer(type) && *value != std::floor(*value))) {
            fail(std::string("expected a finite ") + (is_integer(type) ? "integer" : "number") + " for " + what() +
                 ", found " + in_quotes(token_) + detail::decimal_comma_hint(token_));
        }
        return *value;
    }

    double next_binary(Type type)
    {
        const std::size_t size = type_sizes[static_cast<std::size_t>(type)];
        if (bytes_.size() - at_ < size) {
            fail("expected " + what() + ", found the end of the file: cut short?");
        }
        std::uint64_t bits = 0;
        for (std::size_t i = 0; i < size; ++i) {
            const std::size_t place = encoding_ == Encoding::little ? i : size - 1 - i;
            bits |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes_[at_ + i])) << (8 * place);
        }
        at_ += size;
        switch (type) {
        case Type::i8:
            return static_cast<std::int8_t>(bits);
        case Type::i16:
            return static_cast<std::int16_t>(bits);
        case Type::i32:
            return static_cast<std::int32_t>(bits);
        case Type::f32:
            return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
        case Type::f64:
            return std::bit_cast<double>(bits);
        case Type::u8:
        case Type::u16:
        case Type::u32:
            break;
        }
        return static_cast<double>(bits);
    }

    std::string_view bytes_;
    std::size_t at_;
    Encoding encoding_;
    const std::string& path_;
    detail::LineReader lines_;
    int lines_before_;
    std::string_view line_ = {};
    std::string_view token_ = {};
    const Element* element_ = nullptr;
    std::size_t row_ = 0;
};

} // namespace lineament::ply
