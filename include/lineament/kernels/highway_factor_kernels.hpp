// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Cholesky's factor of a positive definite matrix and its inverse, in either precision, on Highway's portable vectors;
// part of highway_kernels.hpp.
#include "lineament/kernels/highway_product_sums.hpp" // before the guard: its sums are used

#ifdef LINEAMENT_USE_HIGHWAY

#include <hwy/highway.h>

// An include guard that opens once for each instruction set.
#if defined(LINEAMENT_KERNELS_HIGHWAY_FACTOR_KERNELS_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef LINEAMENT_KERNELS_HIGHWAY_FACTOR_KERNELS_HPP
#undef LINEAMENT_KERNELS_HIGHWAY_FACTOR_KERNELS_HPP
#else
#define LINEAMENT_KERNELS_HIGHWAY_FACTOR_KERNELS_HPP
#endif

#include <algorithm>
#include <cmath>

HWY_BEFORE_NAMESPACE();
namespace lineament::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// L's rows before a column are 0 there.
inline void add_lower_gram(const double* lower, int n, int width, double* gram)
{
    constexpr int step = full_lanes<double>;
    for (int i = 0; i < width; i += 4) {
        for (int c = i / step * step; c < width && c < n; c += 2 * step) {
            const double* rows = lower + c * width;
            double* target = gram + i * width + c;
            if (c + 2 * step <= width) {
                add_products<2, Sign::plus>(rows + c, rows + i, n - c, width, width, target, target);
            } else {
                add_products<1, Sign::plus>(rows + c, rows + i, n - c, width, width, target, target);
            }
        }
    }
}

inline float sum_squares(const float* numbers, int count)
{
    const FullTag<float> d;
    constexpr int step = full_lanes<float>;
    hn::Vec<FullTag<float>> sums[4] = {hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
    int i = 0;
    for (; i + 4 * step <= count; i += 4 * step) {
        for (int q = 0; q < 4; ++q) {
            const auto value = hn::Load(d, numbers + i + q * step);
            sums[q] = hn::MulAdd(value, value, sums[q]);
        }
    }
    for (; i < count; i += step) {
        const auto value = hn::Load(d, numbers + i);
        sums[0] = hn::MulAdd(value, value, sums[0]);
    }
    return hn::GetLane(hn::SumOfLanes(d, hn::Add(hn::Add(sums[0], sums[1]), hn::Add(sums[2], sums[3]))));
}

/// What four rows of a block do to each other once the rows above are taken off: D^-1 U of their own triangle, and the
/// roots of D^-1.
template <class T>
struct BlockTriangle
{
    T f01, f02, f03, f12, f13, f23;
    T scales[4];

    /// Columns `begin` to `end` of four rows.
    HWY_INLINE void apply(T* r0, int width, int begin, int end) const
    {
        const FullTag<T> d;
        using Numbers = hn::Vec<FullTag<T>>;
        T* r1 = r0 + width;
        T* r2 = r1 + width;
        T* r3 = r2 + width;
        const Numbers v01 = hn::Set(d, f01), v02 = hn::Set(d, f02), v03 = hn::Set(d, f03);
        const Numbers v12 = hn::Set(d, f12), v13 = hn::Set(d, f13), v23 = hn::Set(d, f23);
        for (int c = begin; c < end; c += full_lanes<T>) {
            const Numbers a = hn::Load(d, r0 + c);
            const Numbers b = hn::NegMulAdd(v01, a, hn::Load(d, r1 + c));
            const Numbers e = hn::NegMulAdd(v12, b, hn::NegMulAdd(v02, a, hn::Load(d, r2 + c)));
            const Numbers f = hn::NegMulAdd(v23, e, hn::NegMulAdd(v13, b, hn::NegMulAdd(v03, a, hn::Load(d, r3 + c))));
            hn::Store(hn::Mul(hn::Set(d, scales[0]), a), d, r0 + c);
            hn::Store(hn::Mul(hn::Set(d, scales[1]), b), d, r1 + c);
            hn::Store(hn::Mul(hn::Set(d, scales[2]), e), d, r2 + c);
            hn::Store(hn::Mul(hn::Set(d, scales[3]), f), d, r3 + c);
        }
    }
};

/// Rows i..i+3 of the unit matrix less their products with the rows above of U^-T, which are 0 before row c.
/// @param factors  Columns i..i+3 of U.
template <class T>
HWY_INLINE void subtract_above_from_units(const T* factors, int width, int i, T* inverse, int inverse_width)
{
    constexpr int step = full_lanes<T>;
    int c = 0;
    for (; c < i; c += 2 * step) {
        const T* above = inverse + c * inverse_width + c;
        T* target = inverse + i * inverse_width + c;
        if (c + 2 * step <= inverse_width) {
            add_products<2, Sign::minus, T>(above, factors + c * width, i - c, inverse_width, width, nullptr, target);
        } else {
            add_products<1, Sign::minus, T>(above, factors + c * width, i - c, inverse_width, width, nullptr, target);
        }
    }
    for (int q = 0; q < 4; ++q) {
        T* row = inverse + (i + q) * inverse_width;
        std::fill(row + std::min(c, inverse_width), row + inverse_width, T(0));
        row[i + q] = 1;
    }
}

/// Row i of U^-T.
template <class T>
HWY_INLINE void invert_row(const T* factors, int width, int i, T scale, T* inverse, int inverse_width)
{
    const FullTag<T> d;
    constexpr int step = full_lanes<T>;
    T* row = inverse + i * inverse_width;
    std::fill_n(row, inverse_width, T(0));
    row[i] = 1;
    for (int k = 0; k < i; ++k) {
        const auto factor = hn::Set(d, factors[k * width]);
        for (int c = 0; c <= k; c += step) {
            hn::Store(hn::NegMulAdd(factor, hn::Load(d, inverse + k * inverse_width + c), hn::Load(d, row + c)), d,
                      row + c);
        }
    }
    for (int c = 0; c <= i; c += step) {
        hn::Store(hn::Mul(hn::Set(d, scale), hn::Load(d, row + c)), d, row + c);
    }
}

/// U row by row in blocks of four, and U^-T beside it, whose sums hide how long the triangles take.
template <class T>
T factor_and_invert(const T* matrix, int n, int begin, int width, T* system, T* inverse_diagonal, int num_inverted,
                    T* inverse, int inverse_width)
{
    const FullTag<T> d;
    using Numbers = hn::Vec<FullTag<T>>;
    constexpr int step = full_lanes<T>;
    T least = 1;
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        T* r0 = system + i * width;
        T* r1 = r0 + width;
        T* r2 = r1 + width;
        T* r3 = r2 + width;
        const int at = begin + i;
        const T* rows = matrix + i * width;
        const T diagonal[4] = {rows[at], rows[width + at + 1], rows[2 * width + at + 2], rows[3 * width + at + 3]};
        const int first = at / step * step;
        add_products_from<Sign::minus>(first, system, system + at, i, width, width, rows, r0);

        // The block's own triangle, D^-1 first: the only long chain is one division a row. Then its rows.
        BlockTriangle<T> triangle;
        const T d0 = r0[at];
        const T i0 = 1 / d0;
        triangle.f01 = r0[at + 1] * i0;
        triangle.f02 = r0[at + 2] * i0;
        triangle.f03 = r0[at + 3] * i0;
        const T d1 = r1[at + 1] - triangle.f01 * r0[at + 1];
        const T i1 = 1 / d1;
        const T w12 = r1[at + 2] - triangle.f01 * r0[at + 2], w13 = r1[at + 3] - triangle.f01 * r0[at + 3];
        triangle.f12 = w12 * i1;
        triangle.f13 = w13 * i1;
        const T d2 = r2[at + 2] - triangle.f02 * r0[at + 2] - triangle.f12 * w12;
        const T i2 = 1 / d2;
        const T w23 = r2[at + 3] - triangle.f02 * r0[at + 3] - triangle.f12 * w13;
        triangle.f23 = w23 * i2;
        const T d3 = r3[at + 3] - triangle.f03 * r0[at + 3] - triangle.f13 * w13 - triangle.f23 * w23;
        if (!(d0 > 0 && d1 > 0 && d2 > 0 && d3 > 0)) {
            return 0;
        }
        const T pivots[4] = {d0, d1, d2, d3};
        const T inverse_pivots[4] = {i0, i1, i2, 1 / d3};
        for (int q = 0; q < 4; ++q) {
            inverse_diagonal[i + q] = triangle.scales[q] = std::sqrt(inverse_pivots[q]);
            least = pivots[q] < least * diagonal[q] ? pivots[q] / diagonal[q] : least;
        }
        if (i < num_inverted) {
            subtract_above_from_units(system + at, width, i, inverse, inverse_width);
            triangle.apply(inverse + i * inverse_width, inverse_width, 0, i + 4);
        }
        triangle.apply(r0, width, first, width);
    }
    for (; i < n; ++i) { // what is left of a block
        T* row = system + i * width;
        const int at = begin + i, first = at / step * step;
        if (matrix != system) {
            std::copy(matrix + i * width + first, matrix + (i + 1) * width, row + first);
        }
        const T diagonal = row[at];
        const T* above = system;
        for (int k = 0; k < i; ++k, above += width) {
            const Numbers factor = hn::Set(d, above[at]);
            for (int c = first; c < width; c += step) {
                hn::Store(hn::NegMulAdd(factor, hn::Load(d, above + c), hn::Load(d, row + c)), d, row + c);
            }
        }
        if (!(row[at] > 0)) {
            return 0;
        }
        least = std::min(least, row[at] / diagonal);
        inverse_diagonal[i] = 1 / std::sqrt(row[at]);
        const Numbers scale = hn::Set(d, inverse_diagonal[i]);
        for (int c = first; c < width; c += step) {
            hn::Store(hn::Mul(scale, hn::Load(d, row + c)), d, row + c);
        }
        if (i < num_inverted) {
            invert_row(system + at, width, i, inverse_diagonal[i], inverse, inverse_width);
        }
    }
    return least;
}

template <class T>
T factor_positive(const T* matrix, int n, int begin, int width, T* system, T* inverse_diagonal)
{
    return factor_and_invert<T>(matrix, n, begin, width, system, inverse_diagonal, 0, nullptr, 0);
}

/// U^-T row by row in blocks of four.
template <class T>
void invert_factor(const T* system, int n, int width, const T* inverse_diagonal, T* inverse, int inverse_width)
{
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        subtract_above_from_units(system + i, width, i, inverse, inverse_width);
        const T* u0 = system + i * width + i;
        const T* u1 = u0 + width;
        const T* u2 = u1 + width;
        const T* s = inverse_diagonal + i;
        const BlockTriangle<T> triangle = {u0[1] * s[0],
                                           u0[2] * s[0],
                                           u0[3] * s[0],
                                           u1[2] * s[1],
                                           u1[3] * s[1],
                                           u2[3] * s[2],
                                           {s[0], s[1], s[2], s[3]}};
        triangle.apply(inverse + i * inverse_width, inverse_width, 0, i + 4);
    }
    for (; i < n; ++i) { // what is left of a block
        invert_row(system + i, width, i, inverse_diagonal[i], inverse, inverse_width);
    }
}

} // namespace lineament::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif // once for each instruction set
#endif // LINEAMENT_USE_HIGHWAY
