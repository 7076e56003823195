// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <ctime>
#include <vector>

namespace lineament::bench {

/// 0 for no values.
[[nodiscard]] inline double quantile(std::vector<double> values, double part)
{
    std::sort(values.begin(), values.end());
    return values.empty() ? 0.0 : values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1) + 0.5)];
}

[[nodiscard]] inline double median(const std::vector<double>& values)
{
    return quantile(values, 0.5);
}

/// Processor time of this thread: does not count what other programs and the decoder's threads take.
[[nodiscard]] inline double thread_ms()
{
    timespec time = {};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return 1000.0 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

} // namespace lineament::bench
