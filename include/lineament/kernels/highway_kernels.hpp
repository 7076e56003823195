// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The kernels on Highway's portable vectors, for the instruction set this translation unit is compiled for. Empty
// unless LINEAMENT_USE_HIGHWAY is defined; src/kernels compiles it once for each set.
#include "lineament/kernels/scalar_kernels.hpp"

#ifdef LINEAMENT_USE_HIGHWAY

#include <hwy/highway.h>

// An include guard that opens once for each instruction set.
#if defined(LINEAMENT_KERNELS_HIGHWAY_KERNELS_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef LINEAMENT_KERNELS_HIGHWAY_KERNELS_HPP
#undef LINEAMENT_KERNELS_HIGHWAY_KERNELS_HPP
#else
#define LINEAMENT_KERNELS_HIGHWAY_KERNELS_HPP
#endif

#include <cmath>

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

template <typename Read, typename T>
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
                sums.add(hn::Set(d, coefficients[j]), Read{column});
            }
            sums.store(out + p * panel_size + begin);
        }
        panels += static_cast<std::ptrdiff_t>(num_columns) * panel_size;
    }
}

inline void combine_panels(const float* base, const float* panels, int num_panels, int num_columns,
                           const float* coefficients, float* out)
{
    combine<ReadFloat>(base, panels, num_panels, num_columns, coefficients, out);
}

inline void combine_panels_int16(const float* base, const std::int16_t* panels, int num_panels, int num_columns,
                                 const float* coefficients, float* out)
{
    combine<ReadInt16>(base, panels, num_panels, num_columns, coefficients, out);
}

inline void combine_grams(const float* grams, int width, const float* scales, float* gram)
{
    const Floats d;
    const int size = width * width;
    const Vector s0 = hn::Set(d, scales[0]);
    const Vector s1 = hn::Set(d, scales[1]);
    const Vector s2 = hn::Set(d, scales[2]);
    const Vector s3 = hn::Set(d, scales[3]);
    const Vector s4 = hn::Set(d, scales[4]);
    const Vector s5 = hn::Set(d, scales[5]);
    for (int i = 0; i < width; ++i) {
        for (int at = i * width + i / lanes * lanes; at < (i + 1) * width; at += lanes) {
            const float* from = grams + at;
            Vector sum = hn::Mul(s0, hn::Load(d, from));
            Vector other = hn::Mul(s1, hn::Load(d, from + size));
            sum = hn::MulAdd(s2, hn::Load(d, from + 2 * size), sum);
            other = hn::MulAdd(s3, hn::Load(d, from + 3 * size), other);
            sum = hn::MulAdd(s4, hn::Load(d, from + 4 * size), sum);
            other = hn::MulAdd(s5, hn::Load(d, from + 5 * size), other);
            hn::Store(hn::Add(sum, other), d, gram + at);
        }
    }
}

inline void project_rows(const float* point_rows, int width, const int* indices, int count, const float* jacobian,
                         const float* roots, float* out)
{
    const Floats d;
    for (int i = 0; i < count; ++i, out += 2 * width) {
        const float* rows = point_rows + static_cast<std::ptrdiff_t>(3 * width) * indices[i];
        const Vector ux = hn::Set(d, roots[i] * jacobian[0]);
        const Vector uy = hn::Set(d, roots[i] * jacobian[1]);
        const Vector uz = hn::Set(d, roots[i] * jacobian[2]);
        const Vector vx = hn::Set(d, roots[i] * jacobian[3]);
        const Vector vy = hn::Set(d, roots[i] * jacobian[4]);
        const Vector vz = hn::Set(d, roots[i] * jacobian[5]);
        for (int c = 0; c < width; c += lanes) {
            const Vector x = hn::Load(d, rows + c);
            const Vector y = hn::Load(d, rows + width + c);
            const Vector z = hn::Load(d, rows + 2 * width + c);
            hn::Store(hn::MulAdd(uz, z, hn::MulAdd(uy, y, hn::Mul(ux, x))), d, out + c);
            hn::Store(hn::MulAdd(vz, z, hn::MulAdd(vy, y, hn::Mul(vx, x))), d, out + width + c);
        }
    }
}

inline void multiply_rows(const float* point_rows, int width, const int* indices, int count, const float* x, float* out)
{
    const Floats d;
    for (int i = 0; i < count; ++i) {
        const float* rows = point_rows + static_cast<std::ptrdiff_t>(3 * width) * indices[i];
        Vector sx = hn::Zero(d);
        Vector sy = hn::Zero(d);
        Vector sz = hn::Zero(d);
        for (int c = 0; c < width; c += lanes) {
            const Vector factor = hn::Load(d, x + c);
            sx = hn::MulAdd(factor, hn::Load(d, rows + c), sx);
            sy = hn::MulAdd(factor, hn::Load(d, rows + width + c), sy);
            sz = hn::MulAdd(factor, hn::Load(d, rows + 2 * width + c), sz);
        }
        out[3 * i] = hn::GetLane(hn::SumOfLanes(d, sx));
        out[3 * i + 1] = hn::GetLane(hn::SumOfLanes(d, sy));
        out[3 * i + 2] = hn::GetLane(hn::SumOfLanes(d, sz));
    }
}

/// target[q][c] += sign sum_r rows[r][i + q] rows[r][c] for q = 0..3 and two vectors of columns c.
template <bool Subtract>
HWY_INLINE void add_block(const float* rows, int num_rows, int width, int i, int c, float* target)
{
    const Floats d;
    Vector a0 = hn::Load(d, target), a1 = hn::Load(d, target + lanes);
    Vector b0 = hn::Load(d, target + width), b1 = hn::Load(d, target + width + lanes);
    Vector c0 = hn::Load(d, target + 2 * width), c1 = hn::Load(d, target + 2 * width + lanes);
    Vector d0 = hn::Load(d, target + 3 * width), d1 = hn::Load(d, target + 3 * width + lanes);
    const auto step = [](Vector factor, Vector value, Vector sum) HWY_ATTR {
        return Subtract ? hn::NegMulAdd(factor, value, sum) : hn::MulAdd(factor, value, sum);
    };
    for (int r = 0; r < num_rows; ++r, rows += width) {
        const Vector v0 = hn::Load(d, rows + c);
        const Vector v1 = hn::Load(d, rows + c + lanes);
        const Vector fa = hn::Set(d, rows[i]);
        const Vector fb = hn::Set(d, rows[i + 1]);
        const Vector fc = hn::Set(d, rows[i + 2]);
        const Vector fd = hn::Set(d, rows[i + 3]);
        a0 = step(fa, v0, a0);
        a1 = step(fa, v1, a1);
        b0 = step(fb, v0, b0);
        b1 = step(fb, v1, b1);
        c0 = step(fc, v0, c0);
        c1 = step(fc, v1, c1);
        d0 = step(fd, v0, d0);
        d1 = step(fd, v1, d1);
    }
    hn::Store(a0, d, target);
    hn::Store(a1, d, target + lanes);
    hn::Store(b0, d, target + width);
    hn::Store(b1, d, target + width + lanes);
    hn::Store(c0, d, target + 2 * width);
    hn::Store(c1, d, target + 2 * width + lanes);
    hn::Store(d0, d, target + 3 * width);
    hn::Store(d1, d, target + 3 * width + lanes);
}

/// The same for one vector of columns: where the width is an odd number of vectors.
template <bool Subtract>
HWY_INLINE void add_narrow_block(const float* rows, int num_rows, int width, int i, int c, float* target)
{
    const Floats d;
    Vector sums[4] = {hn::Load(d, target), hn::Load(d, target + width), hn::Load(d, target + 2 * width),
                      hn::Load(d, target + 3 * width)};
    for (int r = 0; r < num_rows; ++r, rows += width) {
        const Vector value = hn::Load(d, rows + c);
        for (int q = 0; q < 4; ++q) {
            const Vector factor = hn::Set(d, rows[i + q]);
            sums[q] = Subtract ? hn::NegMulAdd(factor, value, sums[q]) : hn::MulAdd(factor, value, sums[q]);
        }
    }
    for (int q = 0; q < 4; ++q) {
        hn::Store(sums[q], d, target + q * width);
    }
}

/// Rows i..i+3 of the upper triangle, from the vector of the diagonal on.
template <bool Subtract>
HWY_INLINE void add_block_row(const float* rows, int num_rows, int width, int i, float* gram)
{
    int c = i / lanes * lanes;
    if (c + 2 * lanes > width || (width - c) % (2 * lanes) != 0) {
        add_narrow_block<Subtract>(rows, num_rows, width, i, c, gram + i * width + c);
        c += lanes;
    }
    for (; c < width; c += 2 * lanes) {
        add_block<Subtract>(rows, num_rows, width, i, c, gram + i * width + c);
    }
}

inline void add_gram(const float* rows, int num_rows, int width, float* gram)
{
    for (int i = 0; i < width; i += 4) {
        add_block_row<false>(rows, num_rows, width, i, gram);
    }
}

inline void add_rows(const float* rows, int num_rows, int width, const float* factors, float* sums)
{
    const Floats d;
    int begin = 0;
    for (; begin + chunk <= width; begin += chunk) {
        Sums partial;
        partial.load(sums + begin);
        const float* row = rows + begin;
        for (int r = 0; r < num_rows; ++r, row += width) {
            partial.add(hn::Set(d, factors[r]), ReadFloat{row});
        }
        partial.store(sums + begin);
    }
    for (; begin < width; begin += lanes) { // four chains hide the latency
        Vector partial[4] = {hn::Load(d, sums + begin), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
        const float* row = rows + begin;
        int r = 0;
        for (; r + 4 <= num_rows; r += 4, row += 4 * width) {
            for (int q = 0; q < 4; ++q) {
                partial[q] = hn::MulAdd(hn::Set(d, factors[r + q]), hn::Load(d, row + q * width), partial[q]);
            }
        }
        for (; r < num_rows; ++r, row += width) {
            partial[0] = hn::MulAdd(hn::Set(d, factors[r]), hn::Load(d, row), partial[0]);
        }
        hn::Store(hn::Add(hn::Add(partial[0], partial[1]), hn::Add(partial[2], partial[3])), d, sums + begin);
    }
}

inline float solve_positive(float* system, int n, int width, float* x)
{
    const Floats d;
    float least = 1;
    // U row by row in blocks of four: first all that the rows above take away, then the block within itself.
    for (int i = 0; i < n; i += 4) {
        const int rows = n - i < 4 ? n - i : 4;
        float diagonals[4];
        for (int q = 0; q < rows; ++q) {
            diagonals[q] = system[(i + q) * width + i + q];
        }
        if (rows == 4) {
            add_block_row<true>(system, i, width, i, system);
        } else {
            for (int q = 0; q < rows; ++q) {
                float* row = system + (i + q) * width;
                for (int c = i / lanes * lanes; c < width; c += lanes) {
                    Vector sum = hn::Load(d, row + c);
                    for (int k = 0; k < i; ++k) {
                        const float* above = system + k * width;
                        sum = hn::NegMulAdd(hn::Set(d, above[i + q]), hn::Load(d, above + c), sum);
                    }
                    hn::Store(sum, d, row + c);
                }
            }
        }
        for (int q = 0; q < rows; ++q) {
            float* row = system + (i + q) * width;
            const float pivot = row[i + q];
            if (!(pivot > 0)) {
                return 0;
            }
            least = pivot < least * diagonals[q] ? pivot / diagonals[q] : least;
            const Vector inverse = hn::Set(d, 1 / std::sqrt(pivot));
            const int from = (i + q) / lanes * lanes;
            for (int c = from; c < width; c += lanes) {
                hn::Store(hn::Mul(inverse, hn::Load(d, row + c)), d, row + c);
            }
            for (int below = q + 1; below < rows; ++below) {
                float* other = system + (i + below) * width;
                const Vector factor = hn::Set(d, row[i + below]);
                for (int c = (i + below) / lanes * lanes; c < width; c += lanes) {
                    hn::Store(hn::NegMulAdd(factor, hn::Load(d, row + c), hn::Load(d, other + c)), d, other + c);
                }
            }
        }
    }
    for (int c = 0; c < width; c += lanes) {
        hn::Store(hn::Zero(d), d, x + c);
    }
    for (int end = n; end > 0;) { // x is still 0 where it is not known, so whole vectors may be taken
        const int begin = (end - 1) / 4 * 4;
        float sums[4] = {0, 0, 0, 0};
        const int last = round_up(n, lanes);
        for (int q = 0; q < end - begin; ++q) {
            const float* row = system + (begin + q) * width;
            Vector sum = hn::Zero(d);
            for (int c = end / lanes * lanes; c < last; c += lanes) {
                sum = hn::MulAdd(hn::Load(d, row + c), hn::Load(d, x + c), sum);
            }
            sums[q] = hn::GetLane(hn::SumOfLanes(d, sum));
        }
        for (int q = end - begin - 1; q >= 0; --q) {
            const float* row = system + (begin + q) * width;
            float value = row[n] - sums[q];
            for (int c = begin + q + 1; c < end; ++c) {
                value -= row[c] * x[c];
            }
            x[begin + q] = value / row[begin + q];
        }
        end = begin;
    }
    return least;
}

inline void pose_moments(const double* points, int stride, double* moments)
{
    using Doubles = hn::CappedTag<double, 8>;
    using V = hn::Vec<Doubles>;
    const Doubles d;
    const V zero = hn::Zero(d);
    V w1 = zero, wx = zero, wy = zero, wz = zero, wu = zero, wv = zero, xx = zero, xy = zero, xz = zero;
    V yy = zero, yz = zero, zz = zero, ux = zero, uy = zero, uz = zero, vx = zero, vy = zero, vz = zero;
    for (int i = 0; i < stride; i += static_cast<int>(hn::MaxLanes(d))) {
        const V x = hn::Load(d, points + i);
        const V y = hn::Load(d, points + stride + i);
        const V z = hn::Load(d, points + 2 * stride + i);
        const V w = hn::Load(d, points + 5 * stride + i);
        const V u = hn::Mul(w, hn::Load(d, points + 3 * stride + i));
        const V v = hn::Mul(w, hn::Load(d, points + 4 * stride + i));
        const V a = hn::Mul(w, x);
        const V b = hn::Mul(w, y);
        const V c = hn::Mul(w, z);
        w1 = hn::Add(w1, w);
        wx = hn::Add(wx, a);
        wy = hn::Add(wy, b);
        wz = hn::Add(wz, c);
        wu = hn::Add(wu, u);
        wv = hn::Add(wv, v);
        xx = hn::MulAdd(a, x, xx);
        xy = hn::MulAdd(a, y, xy);
        xz = hn::MulAdd(a, z, xz);
        yy = hn::MulAdd(b, y, yy);
        yz = hn::MulAdd(b, z, yz);
        zz = hn::MulAdd(c, z, zz);
        ux = hn::MulAdd(u, x, ux);
        uy = hn::MulAdd(u, y, uy);
        uz = hn::MulAdd(u, z, uz);
        vx = hn::MulAdd(v, x, vx);
        vy = hn::MulAdd(v, y, vy);
        vz = hn::MulAdd(v, z, vz);
    }
    const V sums[num_pose_moments] = {w1, wx, wy, wz, wu, wv, xx, xy, xz, yy, yz, zz, ux, uy, uz, vx, vy, vz};
    for (int t = 0; t < num_pose_moments; ++t) {
        moments[t] = hn::GetLane(hn::SumOfLanes(d, sums[t]));
    }
}

/// This instruction set's kernels; without vectors the plain ones, which the compiler knows better.
[[nodiscard]] inline const Kernels* table()
{
#if HWY_TARGET == HWY_SCALAR || HWY_TARGET == HWY_EMU128
    return &scalar_kernels();
#else
    static const Kernels kernels = {hwy::TargetName(HWY_TARGET),
                                    combine_panels,
                                    combine_panels_int16,
                                    combine_grams,
                                    project_rows,
                                    multiply_rows,
                                    add_gram,
                                    add_rows,
                                    solve_positive,
                                    pose_moments};
    return &kernels;
#endif
}

[[nodiscard]] inline std::int64_t target_bit()
{
    return HWY_TARGET;
}

/// The kernels for the flags of this translation unit.
[[nodiscard]] inline const Kernels& highway_kernels()
{
    return *table();
}

} // namespace lineament::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#ifndef HWY_TARGET_INCLUDE // compiled once
namespace lineament::kernels {
using HWY_NAMESPACE::highway_kernels;
}
#endif

#endif // once for each instruction set
#endif // LINEAMENT_USE_HIGHWAY
