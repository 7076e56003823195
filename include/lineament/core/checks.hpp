// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/error.hpp"

#include <Eigen/Core>

#include <cassert>
#include <cmath>
#include <cstdio>
#include <string>

/// States one of our own invariants; checked in debug builds only. Never used on input.
#define LINEAMENT_ASSERT(condition) assert(condition)

namespace lineament {

/// The number as the shortest decimal text that names it to 9 digits; for messages, independent of the locale's sign
/// conventions for not-a-number.
[[nodiscard]] inline std::string to_text(double value)
{
    if (std::isnan(value)) {
        return "nan";
    }
    if (std::isinf(value)) {
        return value > 0 ? "inf" : "-inf";
    }
    char buffer[32];
    std::snprintf(buffer, sizeof buffer, "%.9g", value);
    for (char& c : buffer) {
        if (c == ',') {
            c = '.';
        }
    }
    return buffer;
}

/// @throws InvalidArgument naming function, parameter, expected and got, unless the condition holds.
inline void require(bool condition, const char* function, const char* parameter, const std::string& expected,
                    const std::string& got)
{
    if (!condition) {
        throw InvalidArgument(function, parameter, expected, got);
    }
}

/// @throws InvalidArgument naming the first entry (column-major position) that is not finite.
template <typename Derived>
void require_finite(const Eigen::DenseBase<Derived>& values, const char* function, const char* parameter)
{
    for (Eigen::Index column = 0; column < values.cols(); ++column) {
        for (Eigen::Index row = 0; row < values.rows(); ++row) {
            const double value = static_cast<double>(values.derived().coeff(row, column));
            if (!std::isfinite(value)) {
                throw InvalidArgument(
                    function, std::string(parameter) + "(" + std::to_string(row) + ", " + std::to_string(column) + ")",
                    "a finite number", to_text(value));
            }
        }
    }
}

/// @throws InvalidArgument unless `size` is `expected`.
inline void require_size(Eigen::Index size, Eigen::Index expected, const char* function, const char* parameter)
{
    if (size != expected) { // no words before they are needed
        throw InvalidArgument(function, parameter, "size " + std::to_string(expected), std::to_string(size));
    }
}

} // namespace lineament
