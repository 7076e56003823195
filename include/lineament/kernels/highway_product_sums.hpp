// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Sums of rows times factors, held in registers, of which Gram matrices and Cholesky's factors are made; part of
// highway_kernels.hpp.
#include "lineament/kernels/kernels.hpp"

#ifdef LINEAMENT_USE_HIGHWAY

#include <hwy/highway.h>

// An include guard that opens once for each instruction set.
#if defined(LINEAMENT_KERNELS_HIGHWAY_PRODUCT_SUMS_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef LINEAMENT_KERNELS_HIGHWAY_PRODUCT_SUMS_HPP
#undef LINEAMENT_KERNELS_HIGHWAY_PRODUCT_SUMS_HPP
#else
#define LINEAMENT_KERNELS_HIGHWAY_PRODUCT_SUMS_HPP
#endif

HWY_BEFORE_NAMESPACE();
namespace lineament::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Vectors of up to 64 bytes.
template <class T>
using FullTag = hn::CappedTag<T, 64 / sizeof(T)>;
template <class T>
inline constexpr int full_lanes = static_cast<int>(hn::MaxLanes(FullTag<T>()));
/// With vectors of 64 bytes there are 32 registers, not 16.
template <class T>
inline constexpr bool has_many_registers = full_lanes<T> * sizeof(T) == 64;

enum class Sign
{
    plus,
    minus,
};

/// Four rows of `from` and N vectors of columns of them, with the sum over k of factors[k factor_step + q] times row k
/// of `rows` added to or taken from row q, become those of `target`. `from` may be `target`, or nullptr for zeros.
template <int N, Sign sign, class T>
HWY_INLINE void add_products(const T* rows, const T* factors, int count, int width, int factor_step, const T* from,
                             T* target)
{
    const FullTag<T> d;
    using Numbers = hn::Vec<FullTag<T>>;
    constexpr int step = full_lanes<T>;
    constexpr int num_chains = N == 1 || (N == 2 && has_many_registers<T>) ? 2 : 1; // hide each other's latency
    Numbers sums[num_chains][4][N];
    for (int q = 0; q < 4; ++q) {
        for (int v = 0; v < N; ++v) {
            sums[0][q][v] = from != nullptr ? hn::Load(d, from + q * width + v * step) : hn::Zero(d);
            sums[num_chains - 1][q][v] = num_chains == 1 ? sums[0][q][v] : hn::Zero(d);
        }
    }
    const auto add = [&](int chain) HWY_ATTR {
        Numbers values[N];
        for (int v = 0; v < N; ++v) {
            values[v] = hn::Load(d, rows + v * step);
        }
        for (int q = 0; q < 4; ++q) {
            const Numbers factor = hn::Set(d, factors[q]);
            for (int v = 0; v < N; ++v) {
                Numbers& sum = sums[chain][q][v];
                sum = sign == Sign::plus ? hn::MulAdd(factor, values[v], sum) : hn::NegMulAdd(factor, values[v], sum);
            }
        }
        rows += width;
        factors += factor_step;
    };
    int k = 0;
    for (; k + num_chains <= count; k += num_chains) {
        add(0);
        if (num_chains == 2) {
            add(1);
        }
    }
    if (k < count) {
        add(0);
    }
    for (int q = 0; q < 4; ++q) {
        for (int v = 0; v < N; ++v) {
            const Numbers sum = num_chains == 1 ? sums[0][q][v] : hn::Add(sums[0][q][v], sums[num_chains - 1][q][v]);
            hn::Store(sum, d, target + q * width + v * step);
        }
    }
}

/// The same of the columns from c on.
template <Sign sign, class T>
HWY_INLINE void add_products_from(int c, const T* rows, const T* factors, int count, int width, int factor_step,
                                  const T* from, T* target)
{
    constexpr int step = full_lanes<T>;
    constexpr int most = has_many_registers<T> ? 4 : 2; // with four rows they fit into the registers
    for (; width - c >= most * step; c += most * step) {
        add_products<most, sign>(rows + c, factors, count, width, factor_step, from != nullptr ? from + c : nullptr,
                                 target + c);
    }
    const int left = (width - c) / step;
    if (left == 3) {
        add_products<most - 1, sign>(rows + c, factors, count, width, factor_step, from != nullptr ? from + c : nullptr,
                                     target + c);
    } else if (left == 2) {
        add_products<2, sign>(rows + c, factors, count, width, factor_step, from != nullptr ? from + c : nullptr,
                              target + c);
    } else if (left == 1) {
        add_products<1, sign>(rows + c, factors, count, width, factor_step, from != nullptr ? from + c : nullptr,
                              target + c);
    }
}

/// Rows of four, one after the other, become columns, anywhere.
HWY_INLINE void store_transposed(const float* from, float* to, int step)
{
#if HWY_TARGET == HWY_SCALAR || HWY_TARGET == HWY_EMU128
    for (int i = 0; i < 16; ++i) {
        to[i % 4 * step + i / 4] = from[i];
    }
#else
    const hn::CappedTag<float, 4> d;
    const auto r0 = hn::Load(d, from);
    const auto r1 = hn::Load(d, from + 4);
    const auto r2 = hn::Load(d, from + 8);
    const auto r3 = hn::Load(d, from + 12);
    const auto even_low = hn::InterleaveLower(d, r0, r2);
    const auto even_high = hn::InterleaveUpper(d, r0, r2);
    const auto odd_low = hn::InterleaveLower(d, r1, r3);
    const auto odd_high = hn::InterleaveUpper(d, r1, r3);
    hn::StoreU(hn::InterleaveLower(d, even_low, odd_low), d, to);
    hn::StoreU(hn::InterleaveUpper(d, even_low, odd_low), d, to + step);
    hn::StoreU(hn::InterleaveLower(d, even_high, odd_high), d, to + 2 * step);
    hn::StoreU(hn::InterleaveUpper(d, even_high, odd_high), d, to + 3 * step);
#endif
}

} // namespace lineament::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif // once for each instruction set
#endif // LINEAMENT_USE_HIGHWAY
