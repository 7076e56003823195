// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lineament {

/// The version of this library, MAJOR.MINOR.PATCH (semantic versioning). CMakeLists.txt reads it from here.
inline constexpr const char* version = "0.1.0";

} // namespace lineament
