// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <string_view>

namespace lineament::detail {

using Json = nlohmann::ordered_json;

/// The JSON value in the text: one document, UTF-8, no repeated keys, nested at most 64 deep.
/// @throws IoError (content) with the place of the first fault: line:column, or the JSON pointer of a key that stands
///   twice and of a number that is too large.
[[nodiscard]] Json parse_json(std::string_view text, const std::string& path);

/// The value as text: objects and arrays of objects indented, everything else on one line; numbers that are not finite
/// become null.
[[nodiscard]] std::string format_json(const Json& value);

/// Reads members of a JSON value and names their place, a JSON pointer, in every error.
class JsonReader
{
public:
    JsonReader(const Json& value, const std::string& path, std::string pointer = {})
        : value_(&value), path_(&path), pointer_(std::move(pointer))
    {}

    [[nodiscard]] const Json& value() const { return *value_; }
    [[nodiscard]] bool has(const char* key) const;
    [[nodiscard]] JsonReader member(const std::string& key) const; ///< @throws IoError if it is missing.
    [[nodiscard]] std::size_t size() const;                        ///< Of an array. @throws IoError if it is none.
    [[nodiscard]] JsonReader element(std::size_t index) const;     ///< @throws IoError if it is missing.
    [[nodiscard]] double number() const;                           ///< Finite. @throws IoError
    [[nodiscard]] int integer(int low, int high) const;            ///< @throws IoError outside low..high.
    [[nodiscard]] std::string text() const;                        ///< @throws IoError
    [[noreturn]] void fail(const std::string& expected) const;     ///< @throws IoError: expected, found and the place.

private:
    const Json* value_;
    const std::string* path_;
    std::string pointer_;
};

} // namespace lineament::detail
