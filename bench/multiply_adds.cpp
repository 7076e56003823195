// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// This file is compiled once for each instruction set, as src/kernels/dispatched_kernels.cpp is.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "multiply_adds.cpp"
#include <hwy/foreach_target.h>

#include <hwy/highway.h>

#include "multiply_adds.hpp"

#include <iterator>
#include <string_view>

HWY_BEFORE_NAMESPACE();
namespace lineament::bench::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

float multiply_adds(std::int64_t num_operations)
{
    const hn::CappedTag<float, 16> d;
    const auto factor = hn::Set(d, 0.5f);
    const auto summand = hn::Iota(d, 1.0f);
    // Twelve starts, or the compiler might find chains to be the same.
    auto v0 = hn::Iota(d, 0.0f), v1 = hn::Iota(d, 2.0f), v2 = hn::Iota(d, 3.0f), v3 = hn::Iota(d, 4.0f);
    auto v4 = hn::Iota(d, 5.0f), v5 = hn::Iota(d, 6.0f), v6 = hn::Iota(d, 7.0f), v7 = hn::Iota(d, 8.0f);
    auto v8 = hn::Iota(d, 9.0f), v9 = hn::Iota(d, 10.0f), v10 = hn::Iota(d, 11.0f), v11 = hn::Iota(d, 12.0f);
    const std::int64_t a_round = 2 * 12 * static_cast<std::int64_t>(hn::Lanes(d));
    for (std::int64_t done = 0; done < num_operations; done += a_round) {
        v0 = hn::MulAdd(v0, factor, summand);
        v1 = hn::MulAdd(v1, factor, summand);
        v2 = hn::MulAdd(v2, factor, summand);
        v3 = hn::MulAdd(v3, factor, summand);
        v4 = hn::MulAdd(v4, factor, summand);
        v5 = hn::MulAdd(v5, factor, summand);
        v6 = hn::MulAdd(v6, factor, summand);
        v7 = hn::MulAdd(v7, factor, summand);
        v8 = hn::MulAdd(v8, factor, summand);
        v9 = hn::MulAdd(v9, factor, summand);
        v10 = hn::MulAdd(v10, factor, summand);
        v11 = hn::MulAdd(v11, factor, summand);
    }
    const auto low = hn::Add(hn::Add(hn::Add(v0, v1), hn::Add(v2, v3)), hn::Add(v4, v5));
    const auto high = hn::Add(hn::Add(hn::Add(v6, v7), hn::Add(v8, v9)), hn::Add(v10, v11));
    return hn::GetLane(hn::SumOfLanes(d, hn::Add(low, high)));
}

const char* target_name()
{
    return hwy::TargetName(HWY_TARGET);
}

} // namespace lineament::bench::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lineament::bench {

HWY_EXPORT(multiply_adds);
HWY_EXPORT(target_name);

MultiplyAdds multiply_adds_of(const kernels::Kernels& kernels)
{
    for (std::size_t i = 1; i < std::size(HWY_DISPATCH_TABLE(target_name)); ++i) { // entry 0 chooses
        const auto name = HWY_DISPATCH_TABLE(target_name)[i];
        if (name != nullptr && std::string_view(name()) == kernels.name) {
            return HWY_DISPATCH_TABLE(multiply_adds)[i];
        }
    }
    return nullptr;
}

} // namespace lineament::bench
#endif
