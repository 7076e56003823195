// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/error.hpp"

#include <optional>
#include <string>
#include <string_view>

namespace lineament::detail {

/// The whole token as a number, read without regard to the locale; empty if it is not one or does not fit. A plus sign
/// is taken, "nan" and "inf" are not.
[[nodiscard]] std::optional<double> parse_number(std::string_view token);

/// As parse_number, rounded once to float; numbers below the smallest float become 0.
[[nodiscard]] std::optional<float> parse_float(std::string_view token);

/// The whole token as an integer of at most 64 bits.
[[nodiscard]] std::optional<long long> parse_integer(std::string_view token);

/// Appends the shortest decimal text that reads back to the same number. The number must be finite.
void append_number(std::string& text, double value);
void append_number(std::string& text, float value);

/// The text in quotation marks as it can stand in a message: at most 40 characters, control bytes as \x..
[[nodiscard]] std::string in_quotes(std::string_view text);

/// Spaces and tabs removed at both ends.
[[nodiscard]] std::string_view trimmed(std::string_view text);

/// ", a decimal comma? Write a decimal point" if the token is a number with a comma in it, else an empty text.
[[nodiscard]] std::string decimal_comma_hint(std::string_view token);

/// @throws IoError (content) if the bytes are empty, UTF-16 text or hold a zero byte, naming what else they seem to be.
/// @returns the text without a UTF-8 byte order mark.
[[nodiscard]] std::string_view checked_text(std::string_view bytes, const std::string& path, const char* what);

/// Splits text into lines ended by LF, CRLF or CR.
class LineReader
{
public:
    explicit LineReader(std::string_view text) : rest_(text) {}

    /// Moves on to the next line; false at the end.
    [[nodiscard]] bool next();
    [[nodiscard]] std::string_view line() const { return line_; }
    [[nodiscard]] int number() const { return number_; } ///< Of the line, from 1.

    /// "line:column" of a piece of the current line.
    [[nodiscard]] std::string place(std::string_view piece) const;

private:
    std::string_view rest_;
    std::string_view line_ = {};
    int number_ = 0;
};

/// Takes the next run of characters other than space and tab off the front; empty at the end.
[[nodiscard]] std::string_view take_token(std::string_view& rest);

[[nodiscard]] inline IoError content_error(const std::string& path, const std::string& place, const std::string& what)
{
    return IoError(IoErrorKind::content, path, place, what);
}

} // namespace lineament::detail
