// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace lineament {

/// Base of every exception the library throws.
class Error : public std::runtime_error
{
public:
    using std::runtime_error::runtime_error;
};

/// The caller broke a contract (shape, range, non-finite number, bad option). Thrown before any work is done.
/// The message reads "<function>: <parameter>: expected <expected>, got <got>".
class InvalidArgument : public Error
{
public:
    InvalidArgument(const std::string& function, const std::string& parameter, const std::string& expected,
                    const std::string& got)
        : Error(function + ": " + parameter + ": expected " + expected + ", got " + got)
    {}
};

/// Why reading or writing failed; the command line turns it into its exit code.
enum class IoErrorKind
{
    content, ///< The file was read but is not what it should be (exit code 3).
    system,  ///< The file or device failed: missing, denied, full, read-only (exit code 4).
    limit,   ///< A stated limit was exceeded: too large, too many (exit code 5).
};

/// The world failed: a file is missing, cut, damaged or cannot be written.
/// The message reads "<path>[:<place>]: <what>": expected and found, and what to do about it where that is known.
class IoError : public Error
{
public:
    /// @param place  Line, "line:column", "byte 0x1f" or JSON pointer; empty if the whole file is meant.
    IoError(IoErrorKind kind, std::string path, std::string place, const std::string& what)
        : Error(path + (place.empty() ? "" : ":" + place) + ": " + what), kind_(kind), path_(std::move(path)),
          place_(std::move(place))
    {}

    [[nodiscard]] IoErrorKind kind() const noexcept { return kind_; }
    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    [[nodiscard]] const std::string& place() const noexcept { return place_; }

private:
    IoErrorKind kind_;
    std::string path_;
    std::string place_;
};

} // namespace lineament
