// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "text.hpp"

#include "lineament/io/file.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace lineament::detail {

namespace {

template <typename Number>
std::optional<Number> parse_whole(std::string_view token)
{
    if (token.size() > 1 && token[0] == '+' && token[1] != '-') {
        token.remove_prefix(1);
    }
    Number value{};
    const char* end = token.data() + token.size();
    const auto [stop, error] = std::from_chars(token.data(), end, value);
    if (error != std::errc() || stop != end) {
        return std::nullopt;
    }
    return value;
}

bool is_decimal(std::string_view token)
{
    return token.find_first_not_of("+-.0123456789eE") == std::string_view::npos;
}

// A decimal text that does not fit: its exponent decides whether it is too small (then 0) or too large (then nothing).
std::optional<double> parse_double(std::string_view token)
{
    if (token.empty() || token.size() > 400 || !is_decimal(token)) {
        return std::nullopt;
    }
    if (const std::optional<double> value = parse_whole<double>(token)) {
        return std::isfinite(*value) ? value : std::nullopt;
    }
    const std::size_t exponent = token.find_first_of("eE");
    if (exponent != std::string_view::npos && exponent + 1 < token.size() && token[exponent + 1] == '-' &&
        parse_whole<double>(token.substr(0, exponent)) &&
        token.find_first_not_of("0123456789", exponent + 2) == std::string_view::npos && exponent + 2 < token.size()) {
        return 0.0;
    }
    return std::nullopt;
}

template <typename Number>
void append_shortest(std::string& text, Number value)
{
    char buffer[64];
    const auto result = std::to_chars(buffer, buffer + sizeof buffer, value);
    text.append(buffer, result.ptr);
}

} // namespace

std::optional<double> parse_number(std::string_view token)
{
    return parse_double(token);
}

std::optional<float> parse_float(std::string_view token)
{
    if (token.empty() || token.size() > 400 || !is_decimal(token)) {
        return std::nullopt;
    }
    if (const std::optional<float> value = parse_whole<float>(token)) {
        return std::isfinite(*value) ? value : std::nullopt;
    }
    const std::optional<double> value = parse_double(token);
    if (value && std::abs(*value) < 1.0) {
        return static_cast<float>(*value);
    }
    return std::nullopt;
}

std::optional<long long> parse_integer(std::string_view token)
{
    return parse_whole<long long>(token);
}

void append_number(std::string& text, double value)
{
    append_shortest(text, value);
}

void append_number(std::string& text, float value)
{
    append_shortest(text, value);
}

std::string in_quotes(std::string_view text)
{
    std::string result = "\"";
    for (const char c : text.substr(0, 40)) {
        const auto byte = static_cast<unsigned char>(c);
        if (byte < 0x20 || byte == 0x7f) {
            constexpr char digits[] = "0123456789abcdef";
            result += {'\\', 'x', digits[byte >> 4], digits[byte & 15]};
        } else {
            result += c;
        }
    }
    return result + (text.size() > 40 ? "...\"" : "\"");
}

std::string_view trimmed(std::string_view text)
{
    const std::size_t first = text.find_first_not_of(" \t");
    if (first == std::string_view::npos) {
        return text.substr(text.size());
    }
    return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

std::string decimal_comma_hint(std::string_view token)
{
    if (std::count(token.begin(), token.end(), ',') != 1 || token.size() > 400) {
        return {};
    }
    std::string with_point(token);
    with_point[with_point.find(',')] = '.';
    return parse_number(with_point) ? "; a decimal comma? Write a decimal point" : "";
}

std::string_view checked_text(std::string_view bytes, const std::string& path, const char* what)
{
    const std::string expected = std::string("expected ") + what;
    if (bytes.empty()) {
        throw content_error(path, "", expected + ", found an empty file (0 bytes)");
    }
    const std::string hint = content_hint(std::as_bytes(std::span(bytes.data(), bytes.size())));
    if (bytes.starts_with("\xff\xfe") || bytes.starts_with("\xfe\xff")) {
        throw content_error(path, "byte 0x0", expected + ", found UTF-16 text; save it as UTF-8");
    }
    if (bytes.starts_with("\xef\xbb\xbf")) {
        bytes.remove_prefix(3);
    }
    if (!hint.empty()) {
        throw content_error(path, "", expected + hint);
    }
    LineReader lines(bytes);
    while (lines.next()) {
        const std::size_t zero = lines.line().find('\0');
        if (zero != std::string_view::npos) {
            throw content_error(path, lines.place(lines.line().substr(zero)),
                                expected + ", found a zero byte: not a text file, or a damaged one");
        }
    }
    return bytes;
}

bool LineReader::next()
{
    if (rest_.empty()) {
        return false;
    }
    const std::size_t end = rest_.find_first_of("\r\n");
    line_ = rest_.substr(0, end);
    if (end == std::string_view::npos) {
        rest_ = {};
    } else {
        const bool is_pair = rest_[end] == '\r' && end + 1 < rest_.size() && rest_[end + 1] == '\n';
        rest_.remove_prefix(end + (is_pair ? 2 : 1));
    }
    ++number_;
    return true;
}

std::string LineReader::place(std::string_view piece) const
{
    return std::to_string(number_) + ":" + std::to_string(piece.data() - line_.data() + 1);
}

std::string_view take_token(std::string_view& rest)
{
    const std::size_t first = std::min(rest.find_first_not_of(" \t"), rest.size());
    rest.remove_prefix(first);
    const std::size_t length = std::min(rest.find_first_of(" \t"), rest.size());
    const std::string_view token = rest.substr(0, length);
    rest.remove_prefix(length);
    return token;
}

} // namespace lineament::detail
