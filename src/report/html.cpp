// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "report/html.hpp"

#include "lineament/io/image_file.hpp"
#include "lineament/render/draw.hpp"

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <vector>

namespace lineament::html {

namespace {

constexpr std::string_view replacement = "\xEF\xBF\xBD"; // U+FFFD

// Length of the well-formed UTF-8 sequence at the start of the text; 0 if there is none (Unicode 15, table 3-7).
std::size_t utf8_length(std::string_view text)
{
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const auto is_tail = [&](std::size_t i, unsigned low = 0x80, unsigned high = 0xBF) {
        return i < text.size() && byte(i) >= low && byte(i) <= high;
    };
    const unsigned lead = byte(0);
    if (lead < 0x80) {
        return 1;
    }
    if (lead >= 0xC2 && lead <= 0xDF) {
        return is_tail(1) ? 2 : 0;
    }
    if (lead >= 0xE0 && lead <= 0xEF) {
        const unsigned low = lead == 0xE0 ? 0xA0 : 0x80;
        const unsigned high = lead == 0xED ? 0x9F : 0xBF;
        return is_tail(1, low, high) && is_tail(2) ? 3 : 0;
    }
    if (lead >= 0xF0 && lead <= 0xF4) {
        const unsigned low = lead == 0xF0 ? 0x90 : 0x80;
        const unsigned high = lead == 0xF4 ? 0x8F : 0xBF;
        return is_tail(1, low, high) && is_tail(2) && is_tail(3) ? 4 : 0;
    }
    return 0;
}

// Copies well-formed text; `special` appends its own form of an ASCII byte and returns whether it did.
template <typename Special>
std::string rewrite(std::string_view text, Special special)
{
    std::string result;
    result.reserve(text.size());
    while (!text.empty()) {
        const std::size_t length = utf8_length(text);
        const char c = text.front();
        if (length == 0) {
            result += replacement;
            text.remove_prefix(1);
            continue;
        }
        if (length > 1 || !special(result, c)) {
            result += text.substr(0, length);
        }
        text.remove_prefix(length);
    }
    return result;
}

bool is_control(char c)
{
    return static_cast<unsigned char>(c) < 0x20 || c == 0x7F;
}

template <typename Scalar>
std::string base64_little_endian(std::span<const Scalar> values)
{
    std::vector<std::byte> bytes;
    bytes.reserve(values.size() * sizeof(Scalar));
    for (const Scalar value : values) {
        std::uint32_t bits;
        if constexpr (sizeof(Scalar) == 4) {
            bits = std::bit_cast<std::uint32_t>(value);
        } else {
            bits = std::bit_cast<std::uint16_t>(value);
        }
        for (std::size_t i = 0; i < sizeof(Scalar); ++i) {
            bytes.push_back(static_cast<std::byte>(bits >> (8 * i) & 255u));
        }
    }
    return base64(bytes);
}

} // namespace

std::string escape(std::string_view text)
{
    return rewrite(text, [](std::string& out, char c) {
        switch (c) {
        case '&':
            out += "&amp;";
            return true;
        case '<':
            out += "&lt;";
            return true;
        case '>':
            out += "&gt;";
            return true;
        case '"':
            out += "&quot;";
            return true;
        case '\'':
            out += "&#39;";
            return true;
        default:
            if (is_control(c) && c != '\n' && c != '\t') {
                out += replacement;
                return true;
            }
            return false;
        }
    });
}

std::string json_string(std::string_view text)
{
    const std::string body = rewrite(text, [](std::string& out, char c) {
        if (c == '"' || c == '\\') {
            out += '\\';
            out += c;
            return true;
        }
        if (is_control(c) || c == '<' || c == '>' || c == '&') {
            constexpr std::string_view digits = "0123456789abcdef";
            out += "\\u00";
            out += digits[static_cast<unsigned char>(c) >> 4];
            out += digits[static_cast<unsigned char>(c) & 15];
            return true;
        }
        return false;
    });
    return '"' + body + '"';
}

std::string number(double value, int digits)
{
    if (!std::isfinite(value)) {
        return "\xE2\x80\x93"; // en dash
    }
    std::array<char, 400> buffer;
    const auto end =
        std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, std::chars_format::fixed, digits);
    std::string text(buffer.data(), end.ptr);
    if (text.front() == '-' && text.find_first_not_of("-0.") == std::string::npos) {
        text.erase(0, 1); // no minus zero
    }
    return text;
}

std::string json_number(float value)
{
    if (!std::isfinite(value)) {
        return "null";
    }
    std::array<char, 32> buffer;
    const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
    return {buffer.data(), end.ptr};
}

std::string base64(std::span<const std::byte> bytes)
{
    constexpr std::string_view alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    text.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
        std::uint32_t group = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            group = group << 8 | (k < count ? std::to_integer<std::uint32_t>(bytes[i + k]) : 0u);
        }
        for (std::size_t k = 0; k < 4; ++k) {
            text += k <= count ? alphabet[group >> (18 - 6 * k) & 63] : '=';
        }
    }
    return text;
}

std::string base64_floats(std::span<const float> values)
{
    return base64_little_endian(values);
}

std::string base64_int16(std::span<const std::int16_t> values)
{
    return base64_little_endian(values);
}

std::string base64_uint32(std::span<const std::uint32_t> values)
{
    return base64_little_endian(values);
}

std::string image_address(const ImageU8& picture, int max_side_px)
{
    const double ratio = std::min(1.0, static_cast<double>(max_side_px) / std::max(picture.width, picture.height));
    const auto reduced = [&](int side) { return std::max(1, static_cast<int>(std::lround(ratio * side))); };
    const ImageU8 small = ratio < 1.0 ? resize(picture, reduced(picture.width), reduced(picture.height)) : picture;
    const bool has_alpha = small.channels == 4;
    const std::vector<std::byte> file = has_alpha ? format_png(small) : format_jpeg(small);
    return (has_alpha ? "data:image/png;base64," : "data:image/jpeg;base64,") + base64(file);
}

} // namespace lineament::html
