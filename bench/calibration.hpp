// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <benchmark/benchmark.h>

namespace lineament::bench {

/// Multiply-adds over 4 MB: what the times of other benchmarks are divided by, to be compared between machines.
inline void calibration(benchmark::State& state)
{
    const Eigen::VectorXf values = Eigen::VectorXf::LinSpaced(1 << 20, 0.0f, 1.0f);
    for (auto _ : state) {
        benchmark::DoNotOptimize(values.squaredNorm());
    }
}

} // namespace lineament::bench
