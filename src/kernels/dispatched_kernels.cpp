// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// This file is compiled once for each instruction set; Highway picks one when the program runs.
#define LINEAMENT_USE_HIGHWAY
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "dispatched_kernels.cpp"
#include <hwy/foreach_target.h>

#include "lineament/kernels/highway_kernels.hpp"

#if HWY_ONCE
#include "lineament/kernels/dispatched_kernels.hpp"

#include <algorithm>

namespace lineament::kernels {

HWY_EXPORT(table);
HWY_EXPORT(target_bit);

const Kernels& dispatched_kernels()
{
    return *HWY_DYNAMIC_DISPATCH(table)();
}

std::vector<const Kernels*> supported_kernels()
{
    std::vector<const Kernels*> found;
    const std::int64_t supported = hwy::SupportedTargets();
    for (std::size_t i = 1; i < std::size(HWY_DISPATCH_TABLE(table)); ++i) { // entry 0 chooses
        const auto function = HWY_DISPATCH_TABLE(table)[i];
        if (function != nullptr && (HWY_DISPATCH_TABLE(target_bit)[i]() & supported) != 0) {
            found.push_back(function());
        }
    }
    if (std::find(found.begin(), found.end(), &scalar_kernels()) == found.end()) {
        found.push_back(&scalar_kernels());
    }
    return found;
}

} // namespace lineament::kernels
#endif
