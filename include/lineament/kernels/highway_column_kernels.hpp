// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The kernels that sum a model's columns to points and meshes, on Highway's portable vectors; part of
// highway_kernels.hpp.
#include "lineament/kernels/kernels.hpp"

#ifdef LINEAMENT_USE_HIGHWAY

#include <hwy/cache_control.h>
#include <hwy/highway.h>

// An include guard that opens once for each instruction set.
#if defined(LINEAMENT_KERNELS_HIGHWAY_COLUMN_KERNELS_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef LINEAMENT_KERNELS_HIGHWAY_COLUMN_KERNELS_HPP
#undef LINEAMENT_KERNELS_HIGHWAY_COLUMN_KERNELS_HPP
#else
#define LINEAMENT_KERNELS_HIGHWAY_COLUMN_KERNELS_HPP
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace lineament::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Floats = hn::CappedTag<float, 16>;
using Vector = hn::Vec<Floats>;
inline constexpr int lanes = static_cast<int>(hn::MaxLanes(Floats()));
/// Columns in one pass: eight vectors in registers, or a whole panel.
inline constexpr int chunk = 8 * lanes < panel_size ? 8 * lanes : panel_size;

/// Eight (with 16 lanes four) vectors of sums side by side.
struct Sums
{
    Vector v0, v1, v2, v3, v4, v5, v6, v7;

    HWY_INLINE void load(const float* from)
    {
        const Floats d;
        v0 = hn::Load(d, from);
        v1 = hn::Load(d, from + lanes);
        v2 = hn::Load(d, from + 2 * lanes);
        v3 = hn::Load(d, from + 3 * lanes);
        if constexpr (chunk == 8 * lanes) {
            v4 = hn::Load(d, from + 4 * lanes);
            v5 = hn::Load(d, from + 5 * lanes);
            v6 = hn::Load(d, from + 6 * lanes);
            v7 = hn::Load(d, from + 7 * lanes);
        }
    }
    HWY_INLINE void store(float* to) const
    {
        const Floats d;
        hn::Store(v0, d, to);
        hn::Store(v1, d, to + lanes);
        hn::Store(v2, d, to + 2 * lanes);
        hn::Store(v3, d, to + 3 * lanes);
        if constexpr (chunk == 8 * lanes) {
            hn::Store(v4, d, to + 4 * lanes);
            hn::Store(v5, d, to + 5 * lanes);
            hn::Store(v6, d, to + 6 * lanes);
            hn::Store(v7, d, to + 7 * lanes);
        }
    }
    template <typename Read>
    HWY_INLINE void add(Vector factor, const Read& read)
    {
        v0 = hn::MulAdd(factor, read(0), v0);
        v1 = hn::MulAdd(factor, read(lanes), v1);
        v2 = hn::MulAdd(factor, read(2 * lanes), v2);
        v3 = hn::MulAdd(factor, read(3 * lanes), v3);
        if constexpr (chunk == 8 * lanes) {
            v4 = hn::MulAdd(factor, read(4 * lanes), v4);
            v5 = hn::MulAdd(factor, read(5 * lanes), v5);
            v6 = hn::MulAdd(factor, read(6 * lanes), v6);
            v7 = hn::MulAdd(factor, read(7 * lanes), v7);
        }
    }
};

/// Reads of single precision columns, and of 16-bit ones.
struct ReadFloat
{
    const float* from;
    HWY_INLINE Vector operator()(int offset) const { return hn::Load(Floats(), from + offset); }
};
struct ReadInt16
{
    const std::int16_t* from;
    HWY_INLINE Vector operator()(int offset) const
    {
        const hn::Rebind<std::int32_t, Floats> wide;
        const hn::Rebind<std::int16_t, Floats> narrow;
        return hn::ConvertTo(Floats(), hn::PromoteTo(wide, hn::Load(narrow, from + offset)));
    }
};

/// Asks for numbers that will be read before long; beyond the end of the columns too, which does no harm.
template <typename T>
HWY_INLINE void fetch_chunk(const T* from)
{
    constexpr int line = 64 / static_cast<int>(sizeof(T));
    for (int c = 0; c < chunk; c += line) {
        hwy::Prefetch(from + c);
    }
}

/// `fetches`: asks for columns 16 ahead, which beats the processor's own guesses where they come from far caches.
template <typename Read, bool fetches, typename T>
HWY_INLINE void combine(const float* base, const T* panels, int num_panels, int num_columns, const float* coefficients,
                        float* out)
{
    const Floats d;
    for (int p = 0; p < num_panels; ++p) {
        for (int begin = 0; begin < panel_size; begin += chunk) {
            Sums sums;
            sums.load(base + p * panel_size + begin);
            const T* column = panels + begin;
            for (int j = 0; j < num_columns; ++j, column += panel_size) {
                if (fetches) {
                    fetch_chunk(column + 16 * panel_size);
                }
                sums.add(hn::Set(d, coefficients[j]), Read{column});
            }
            sums.store(out + p * panel_size + begin);
        }
        panels += static_cast<std::ptrdiff_t>(num_columns) * panel_size;
    }
}

/// A single panel is one of a batch of faces; its columns, and few ones, lie in the nearest cache.
template <typename Read, typename T>
HWY_INLINE void combine(const float* base, const T* panels, int num_panels, int num_columns, const float* coefficients,
                        float* out)
{
    if (num_columns == 0) {
        std::copy_n(base, num_panels * panel_size, out);
    } else if (num_panels == 1 || num_panels * num_columns <= 32) {
        combine<Read, false>(base, panels, num_panels, num_columns, coefficients, out);
    } else {
        combine<Read, true>(base, panels, num_panels, num_columns, coefficients, out);
    }
}

inline void combine_panels(const float* base, const float* panels, int num_panels, int num_columns,
                           const float* coefficients, float* out)
{
    combine<ReadFloat>(base, panels, num_panels, num_columns, coefficients, out);
}

inline void combine_blocks(const float* base, const SparseColumns& columns, const float* coefficients, float* out)
{
    const Floats d;
    constexpr int num_vectors = block_size / lanes;
    const int* offset = columns.offsets;
    const std::uint16_t* column = columns.columns;
    const float* values = columns.values;
    const int num_runs = columns.num_runs;
    for (int r = 0; r < num_runs; ++r) {
        const auto [num_columns, num_blocks] = columns.runs[r];
        for (int b = 0; b < num_blocks; ++b, ++offset) {
            Vector sums[num_vectors];
            for (int v = 0; v < num_vectors; ++v) {
                sums[v] = hn::Load(d, base + *offset + v * lanes);
            }
            for (int j = 0; j < num_columns; ++j, ++column, values += block_size) {
                hwy::Prefetch(values + 16 * block_size);
                const Vector coefficient = hn::Set(d, coefficients[*column]);
                for (int v = 0; v < num_vectors; ++v) {
                    sums[v] = hn::MulAdd(coefficient, hn::Load(d, values + v * lanes), sums[v]);
                }
            }
            for (int v = 0; v < num_vectors; ++v) {
                hn::Store(sums[v], d, out + *offset + v * lanes);
            }
        }
    }
}

inline void multiply_panels(const float* panels, int num_panels, int num_columns, const float* x, float* out)
{
    const Floats d;
    for (int j = 0; j < num_columns; ++j) {
        Vector s0 = hn::Zero(d), s1 = hn::Zero(d), s2 = hn::Zero(d), s3 = hn::Zero(d);
        for (int p = 0; p < num_panels; ++p) {
            const float* column = panels + static_cast<std::ptrdiff_t>(p * num_columns + j) * panel_size;
            const float* factors = x + p * panel_size;
            for (int c = 0; c < panel_size; c += 4 * lanes) { // four chains hide the latency
                s0 = hn::MulAdd(hn::Load(d, factors + c), hn::Load(d, column + c), s0);
                s1 = hn::MulAdd(hn::Load(d, factors + c + lanes), hn::Load(d, column + c + lanes), s1);
                s2 = hn::MulAdd(hn::Load(d, factors + c + 2 * lanes), hn::Load(d, column + c + 2 * lanes), s2);
                s3 = hn::MulAdd(hn::Load(d, factors + c + 3 * lanes), hn::Load(d, column + c + 3 * lanes), s3);
            }
        }
        out[j] = hn::GetLane(hn::SumOfLanes(d, hn::Add(hn::Add(s0, s1), hn::Add(s2, s3))));
    }
}

inline void combine_panels_int16(const float* base, const std::int16_t* panels, int num_panels, int num_columns,
                                 const float* coefficients, float* out)
{
    combine<ReadInt16>(base, panels, num_panels, num_columns, coefficients, out);
}

inline void widen(const std::int16_t* from, int count, float* out)
{
    for (int i = 0; i < count; i += lanes) {
        hn::Store(ReadInt16{from}(i), Floats(), out + i);
    }
}

/// A tile of rows stays in registers while the columns pass; its pieces of them lie far apart, but each is long enough
/// to be read at the speed of memory.
template <int num_vectors>
HWY_INLINE void add_columns_to_tile(const float* columns, std::ptrdiff_t step, int num_columns,
                                    const float* coefficients, float* out)
{
    const Floats d;
    Vector sums[num_vectors];
    for (int v = 0; v < num_vectors; ++v) {
        sums[v] = hn::LoadU(d, out + v * lanes);
    }
    for (int j = 0; j < num_columns; ++j, columns += step) {
        if (coefficients[j] == 0) {
            continue;
        }
        const Vector factor = hn::Set(d, coefficients[j]);
        for (int v = 0; v < num_vectors; ++v) {
            sums[v] = hn::MulAdd(factor, hn::LoadU(d, columns + v * lanes), sums[v]);
        }
    }
    for (int v = 0; v < num_vectors; ++v) {
        hn::StoreU(sums[v], d, out + v * lanes);
    }
}

inline void add_columns(const float* columns, std::ptrdiff_t step, int num_rows, int num_columns,
                        const float* coefficients, float* out)
{
    constexpr int num_vectors = lanes == 16 ? 16 : 8; // as many as half the registers hold
    int r = 0;
    for (; r + num_vectors * lanes <= num_rows; r += num_vectors * lanes) {
        add_columns_to_tile<num_vectors>(columns + r, step, num_columns, coefficients, out + r);
    }
    for (; r + lanes <= num_rows; r += lanes) {
        add_columns_to_tile<1>(columns + r, step, num_columns, coefficients, out + r);
    }
    for (int j = 0; j < num_columns; ++j) {
        for (int rest = r; rest < num_rows && coefficients[j] != 0; ++rest) {
            out[rest] += coefficients[j] * columns[j * step + rest];
        }
    }
}

} // namespace lineament::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif // once for each instruction set
#endif // LINEAMENT_USE_HIGHWAY
