// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/kernels/kernels.hpp"

#include <benchmark/benchmark.h>

#include <cstdint>
#include <string>

namespace lineament::bench {

template <typename Function>
benchmark::internal::Benchmark* add(const std::string& name, Function function)
{
    return benchmark::RegisterBenchmark(name.c_str(), function)->Unit(benchmark::kMicrosecond);
}

/// The limit of what reads its numbers once: they are read in order, with one multiply-add for each.
void add_read_limit(const std::string& name, const kernels::Kernels& kernels, std::int64_t num_bytes);

/// The limit of what reads little: its arithmetic, in registers. None of the plain kernels.
void add_arithmetic_limit(const std::string& name, const kernels::Kernels& kernels, std::int64_t num_operations);

/// Single kernels as a fit calls them, and their limits.
void register_kernels(const kernels::Kernels& kernels);
/// The same by Eigen in double precision.
void register_reference_kernels();

} // namespace lineament::bench
