// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

namespace lineament::build {

/// 0 up to `low`, 1 from `high` on, 3 t^2 - 2 t^3 between; `low` may be the larger one, which reverses it.
[[nodiscard]] inline double smoothstep(double low, double high, double x)
{
    const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

} // namespace lineament::build
