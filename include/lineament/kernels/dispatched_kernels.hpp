// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/kernels/kernels.hpp"

#include <vector>

namespace lineament::kernels {

/// The kernels of the best instruction set this machine has: AVX-512, AVX2, SSE4, SSSE3 or none of them. Part of the
/// compiled library lineament::kernels.
[[nodiscard]] const Kernels& dispatched_kernels();

/// The kernels of each instruction set this machine has, and the plain ones; for tests and benchmarks.
[[nodiscard]] std::vector<const Kernels*> supported_kernels();

} // namespace lineament::kernels
