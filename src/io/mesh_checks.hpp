// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/mesh.hpp"

namespace lineament::detail {

/// @throws InvalidArgument unless every number is finite, every index in range and all sizes agree.
void check_mesh(const Mesh& mesh, const char* function);

/// "a sentence about 1 triangle" for the warnings of readers: triangles that use a vertex twice. 0 if there are none.
[[nodiscard]] Eigen::Index count_degenerate(const Eigen::Matrix3Xi& triangles);

} // namespace lineament::detail
