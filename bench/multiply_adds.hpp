// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/kernels/kernels.hpp"

#include <cstdint>

namespace lineament::bench {

/// Multiply-adds of vectors that stay in registers, twelve chains side by side: the most arithmetic that one core can
/// do. At least `num_operations` of single numbers, a multiply-add counted as two. Returns a sum of all of it.
using MultiplyAdds = float (*)(std::int64_t num_operations);

/// Of the kernels' instruction set; nullptr for the plain ones.
[[nodiscard]] MultiplyAdds multiply_adds_of(const kernels::Kernels& kernels);

} // namespace lineament::bench
