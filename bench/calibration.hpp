// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibration_kernel.hpp"

#include <benchmark/benchmark.h>

namespace lineament::bench {

/// The calibration kernel beside other benchmarks.
inline void calibration(benchmark::State& state)
{
    CalibrationKernel kernel;
    for (auto _ : state) {
        benchmark::DoNotOptimize(kernel.run());
    }
}

} // namespace lineament::bench
