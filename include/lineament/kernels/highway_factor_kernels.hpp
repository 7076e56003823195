// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Cholesky's factor of a positive definite matrix, its inverse, and what is solved with it, in either precision, on
// Highway's portable vectors; part of highway_kernels.hpp.
#include "lineament/kernels/kernels.hpp"

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

/// Vectors of up to 64 bytes.
template <class T>
using FullTag = hn::CappedTag<T, 64 / sizeof(T)>;
template <class T>
inline constexpr int full_lanes = static_cast<int>(hn::MaxLanes(FullTag<T>()));

/// Sums of four rows and `num_vectors` vectors of columns, changed by products of factors with rows.
template <class T, int num_vectors>
struct Block
{
    using Tag = FullTag<T>;
    static constexpr int lanes = full_lanes<T>;
    hn::Vec<Tag> sums[4][num_vectors];

    HWY_INLINE void load(const T* from, int width)
    {
        for (int q = 0; q < 4; ++q) {
            for (int v = 0; v < num_vectors; ++v) {
                sums[q][v] = hn::Load(Tag(), from + q * width + v * lanes);
            }
        }
    }
    HWY_INLINE void store(T* to, int width) const
    {
        for (int q = 0; q < 4; ++q) {
            for (int v = 0; v < num_vectors; ++v) {
                hn::Store(sums[q][v], Tag(), to + q * width + v * lanes);
            }
        }
    }
    HWY_INLINE void add(const T* factors, const T* row)
    {
        for (int v = 0; v < num_vectors; ++v) {
            const hn::Vec<Tag> value = hn::Load(Tag(), row + v * lanes);
            for (int q = 0; q < 4; ++q) {
                sums[q][v] = hn::MulAdd(hn::Set(Tag(), factors[q]), value, sums[q][v]);
            }
        }
    }
    HWY_INLINE void subtract(const T* factors, const T* row)
    {
        for (int v = 0; v < num_vectors; ++v) {
            const hn::Vec<Tag> value = hn::Load(Tag(), row + v * lanes);
            for (int q = 0; q < 4; ++q) {
                sums[q][v] = hn::NegMulAdd(hn::Set(Tag(), factors[q]), value, sums[q][v]);
            }
        }
    }
};

template <int num_vectors>
HWY_INLINE void add_lower_gram_block(const double* lower, int n, int width, int i, int c, double* gram)
{
    Block<double, num_vectors> block;
    block.load(gram + i * width + c, width);
    lower += c * width; // the rows before are 0 there
    for (int r = c; r < n; ++r, lower += width) {
        block.add(lower + i, lower + c);
    }
    block.store(gram + i * width + c, width);
}

inline void add_lower_gram(const double* lower, int n, int width, double* gram)
{
    for (int i = 0; i < width; i += 4) {
        int c = i / full_lanes<double> * full_lanes<double>;
        for (; c + 2 * full_lanes<double> <= width; c += 2 * full_lanes<double>) {
            add_lower_gram_block<2>(lower, n, width, i, c, gram);
        }
        if (c < width) {
            add_lower_gram_block<1>(lower, n, width, i, c, gram);
        }
    }
}

/// Rows i..i+3 of a system, some columns, less their products with the i rows above.
template <class T, int num_vectors>
HWY_INLINE void subtract_above(T* system, int width, int i, int c)
{
    Block<T, num_vectors> block;
    block.load(system + i * width + c, width);
    const T* above = system;
    for (int k = 0; k < i; ++k, above += width) {
        block.subtract(above + i, above + c);
    }
    block.store(system + i * width + c, width);
}

/// U row by row in blocks of four.
template <class T>
T factor_positive(T* system, int n, int width, T* inverse_diagonal)
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
        const T diagonal[4] = {r0[i], r1[i + 1], r2[i + 2], r3[i + 3]};
        int c = i / step * step;
        for (; c + 2 * step <= width; c += 2 * step) {
            subtract_above<T, 2>(system, width, i, c);
        }
        if (c < width) {
            subtract_above<T, 1>(system, width, i, c);
        }

        // The block's own triangle, then its rows.
        const T d0 = r0[i];
        const T s0 = 1 / std::sqrt(d0);
        const T u01 = s0 * r0[i + 1], u02 = s0 * r0[i + 2], u03 = s0 * r0[i + 3];
        const T d1 = r1[i + 1] - u01 * u01;
        const T s1 = 1 / std::sqrt(d1);
        const T u12 = s1 * (r1[i + 2] - u01 * u02), u13 = s1 * (r1[i + 3] - u01 * u03);
        const T d2 = r2[i + 2] - u02 * u02 - u12 * u12;
        const T s2 = 1 / std::sqrt(d2);
        const T u23 = s2 * (r2[i + 3] - u02 * u03 - u12 * u13);
        const T d3 = r3[i + 3] - u03 * u03 - u13 * u13 - u23 * u23;
        const T s3 = 1 / std::sqrt(d3);
        if (!(d0 > 0 && d1 > 0 && d2 > 0 && d3 > 0)) {
            return 0;
        }
        const T pivots[4] = {d0, d1, d2, d3};
        const T inverses[4] = {s0, s1, s2, s3};
        for (int q = 0; q < 4; ++q) {
            inverse_diagonal[i + q] = inverses[q];
            least = std::min(least, pivots[q] / diagonal[q]);
        }
        for (c = i / step * step; c < width; c += step) {
            const Numbers a = hn::Mul(hn::Set(d, s0), hn::Load(d, r0 + c));
            const Numbers b = hn::Mul(hn::Set(d, s1), hn::NegMulAdd(hn::Set(d, u01), a, hn::Load(d, r1 + c)));
            const Numbers e =
                hn::Mul(hn::Set(d, s2),
                        hn::NegMulAdd(hn::Set(d, u12), b, hn::NegMulAdd(hn::Set(d, u02), a, hn::Load(d, r2 + c))));
            const Numbers f = hn::NegMulAdd(hn::Set(d, u13), b, hn::NegMulAdd(hn::Set(d, u03), a, hn::Load(d, r3 + c)));
            hn::Store(a, d, r0 + c);
            hn::Store(b, d, r1 + c);
            hn::Store(e, d, r2 + c);
            hn::Store(hn::Mul(hn::Set(d, s3), hn::NegMulAdd(hn::Set(d, u23), e, f)), d, r3 + c);
        }
    }
    for (; i < n; ++i) { // what is left of a block
        T* row = system + i * width;
        const int begin = i / step * step;
        const T diagonal = row[i];
        const T* above = system;
        for (int k = 0; k < i; ++k, above += width) {
            const Numbers factor = hn::Set(d, above[i]);
            for (int c = begin; c < width; c += step) {
                hn::Store(hn::NegMulAdd(factor, hn::Load(d, above + c), hn::Load(d, row + c)), d, row + c);
            }
        }
        if (!(row[i] > 0)) {
            return 0;
        }
        least = std::min(least, row[i] / diagonal);
        inverse_diagonal[i] = 1 / std::sqrt(row[i]);
        const Numbers inverse = hn::Set(d, inverse_diagonal[i]);
        for (int c = begin; c < width; c += step) {
            hn::Store(hn::Mul(inverse, hn::Load(d, row + c)), d, row + c);
        }
    }
    return least;
}

/// Four rows of one vector each, in two chains that hide the latency.
template <class Tag>
struct FourRows
{
    using T = hn::TFromD<Tag>;
    hn::Vec<Tag> even[4], odd[4];

    HWY_INLINE explicit FourRows(const T* x)
    {
        for (int q = 0; q < 4; ++q) {
            even[q] = hn::Load(Tag(), x + q * num_right_sides);
            odd[q] = hn::Zero(Tag());
        }
    }
    /// Less factors[q step] times x.
    HWY_INLINE void subtract(hn::Vec<Tag> (&sums)[4], const T* factors, int step, const T* x)
    {
        const hn::Vec<Tag> value = hn::Load(Tag(), x);
        for (int q = 0; q < 4; ++q) {
            sums[q] = hn::NegMulAdd(hn::Set(Tag(), factors[q * step]), value, sums[q]);
        }
    }
};

/// What solves for the right sides of one vector, of x in rows of num_right_sides.
template <class Tag, class T>
struct VectorSolver
{
    using Numbers = hn::Vec<Tag>;
    static constexpr int step = num_right_sides;
    const T* system;
    int n;
    int width;
    const T* inverse_diagonal;
    T* x;

    HWY_INLINE Numbers times(Numbers sum, int i) const
    {
        const Numbers value = hn::Mul(sum, hn::Set(Tag(), inverse_diagonal[i]));
        hn::Store(value, Tag(), x + i * step);
        return value;
    }
    HWY_INLINE static Numbers less(Numbers sum, const T* factor, Numbers value)
    {
        return hn::NegMulAdd(hn::Set(Tag(), *factor), value, sum);
    }

    /// U^T y = b
    HWY_INLINE void solve_lower() const
    {
        const Tag d;
        const int whole = n / 4 * 4;
        int begin = 0; // of what is not zero
        const auto is_zero = [&](int i)
                                 HWY_ATTR { return hn::AllTrue(d, hn::Eq(hn::Load(d, x + i * step), hn::Zero(d))); };
        while (begin < whole && is_zero(begin) && is_zero(begin + 1) && is_zero(begin + 2) && is_zero(begin + 3)) {
            begin += 4;
        }
        for (int i = begin; i < whole; i += 4) {
            FourRows<Tag> rows(x + i * step);
            for (int k = begin; k < i; k += 2) {
                rows.subtract(rows.even, system + k * width + i, 1, x + k * step);
                rows.subtract(rows.odd, system + (k + 1) * width + i, 1, x + (k + 1) * step);
            }
            const T* u0 = system + i * width + i;
            const T* u1 = u0 + width;
            const T* u2 = u1 + width;
            const Numbers y0 = times(hn::Add(rows.even[0], rows.odd[0]), i);
            const Numbers y1 = times(less(hn::Add(rows.even[1], rows.odd[1]), u0 + 1, y0), i + 1);
            const Numbers y2 = times(less(less(hn::Add(rows.even[2], rows.odd[2]), u0 + 2, y0), u1 + 2, y1), i + 2);
            times(less(less(less(hn::Add(rows.even[3], rows.odd[3]), u0 + 3, y0), u1 + 3, y1), u2 + 3, y2), i + 3);
        }
        for (int i = whole; i < n; ++i) {
            Numbers sum = hn::Load(d, x + i * step);
            for (int k = begin; k < i; ++k) {
                sum = less(sum, system + k * width + i, hn::Load(d, x + k * step));
            }
            times(sum, i);
        }
    }

    /// U x = y
    HWY_INLINE void solve_upper() const
    {
        const Tag d;
        const int whole = n / 4 * 4;
        for (int i = n - 1; i >= whole; --i) {
            Numbers sum = hn::Load(d, x + i * step);
            for (int c = i + 1; c < n; ++c) {
                sum = less(sum, system + i * width + c, hn::Load(d, x + c * step));
            }
            times(sum, i);
        }
        for (int i = whole - 4; i >= 0; i -= 4) {
            FourRows<Tag> rows(x + i * step);
            const T* u0 = system + i * width;
            int c = i + 4;
            for (; c + 2 <= n; c += 2) {
                rows.subtract(rows.even, u0 + c, width, x + c * step);
                rows.subtract(rows.odd, u0 + c + 1, width, x + (c + 1) * step);
            }
            if (c < n) {
                rows.subtract(rows.even, u0 + c, width, x + c * step);
            }
            u0 += i;
            const T* u1 = u0 + width;
            const T* u2 = u1 + width;
            const Numbers x3 = times(hn::Add(rows.even[3], rows.odd[3]), i + 3);
            const Numbers x2 = times(less(hn::Add(rows.even[2], rows.odd[2]), u2 + 3, x3), i + 2);
            const Numbers x1 = times(less(less(hn::Add(rows.even[1], rows.odd[1]), u1 + 3, x3), u1 + 2, x2), i + 1);
            times(less(less(less(hn::Add(rows.even[0], rows.odd[0]), u0 + 3, x3), u0 + 2, x2), u0 + 1, x1), i);
        }
    }
};

template <class T>
void solve_factored(const T* system, int n, int width, const T* inverse_diagonal, T* x)
{
    using Tag = hn::CappedTag<T, num_right_sides>;
    for (int begin = 0; begin < num_right_sides; begin += static_cast<int>(hn::MaxLanes(Tag()))) {
        const VectorSolver<Tag, T> solver{system, n, width, inverse_diagonal, x + begin};
        solver.solve_lower();
        solver.solve_upper();
    }
}

template <class T>
void solve_lower(const T* system, int n, int width, const T* inverse_diagonal, T* x)
{
    using Tag = hn::CappedTag<T, num_right_sides>;
    for (int begin = 0; begin < num_right_sides; begin += static_cast<int>(hn::MaxLanes(Tag()))) {
        VectorSolver<Tag, T>{system, n, width, inverse_diagonal, x + begin}.solve_lower();
    }
}

/// Rows i..i+3 of U^-T, some columns, less their products with the rows above, which are 0 before row c.
template <class T, int num_vectors>
HWY_INLINE void subtract_inverse_above(const T* system, int width, int i, int c, T* inverse, int inverse_width)
{
    Block<T, num_vectors> block;
    block.load(inverse + i * inverse_width + c, inverse_width);
    for (int k = c; k < i; ++k) {
        block.subtract(system + k * width + i, inverse + k * inverse_width + c);
    }
    block.store(inverse + i * inverse_width + c, inverse_width);
}

/// U^-T row by row in blocks of four.
template <class T>
void invert_factor(const T* system, int n, int width, T* inverse, int inverse_width)
{
    const FullTag<T> d;
    using Numbers = hn::Vec<FullTag<T>>;
    constexpr int step = full_lanes<T>;
    std::fill_n(inverse, n * inverse_width, T(0));
    for (int i = 0; i < n; ++i) {
        inverse[i * inverse_width + i] = 1;
    }
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        int c = 0;
        for (; c < i && c + 2 * step <= inverse_width; c += 2 * step) {
            subtract_inverse_above<T, 2>(system, width, i, c, inverse, inverse_width);
        }
        if (c < i) {
            subtract_inverse_above<T, 1>(system, width, i, c, inverse, inverse_width);
        }
        const T* u0 = system + i * width + i;
        const T* u1 = u0 + width;
        const T* u2 = u1 + width;
        const T* u3 = u2 + width;
        const T s0 = 1 / u0[0], s1 = 1 / u1[1], s2 = 1 / u2[2], s3 = 1 / u3[3];
        T* r0 = inverse + i * inverse_width;
        T* r1 = r0 + inverse_width;
        T* r2 = r1 + inverse_width;
        T* r3 = r2 + inverse_width;
        for (c = 0; c < i + 4; c += step) {
            const Numbers a = hn::Mul(hn::Set(d, s0), hn::Load(d, r0 + c));
            const Numbers b = hn::Mul(hn::Set(d, s1), hn::NegMulAdd(hn::Set(d, u0[1]), a, hn::Load(d, r1 + c)));
            const Numbers e =
                hn::Mul(hn::Set(d, s2),
                        hn::NegMulAdd(hn::Set(d, u1[2]), b, hn::NegMulAdd(hn::Set(d, u0[2]), a, hn::Load(d, r2 + c))));
            const Numbers f =
                hn::NegMulAdd(hn::Set(d, u1[3]), b, hn::NegMulAdd(hn::Set(d, u0[3]), a, hn::Load(d, r3 + c)));
            hn::Store(a, d, r0 + c);
            hn::Store(b, d, r1 + c);
            hn::Store(e, d, r2 + c);
            hn::Store(hn::Mul(hn::Set(d, s3), hn::NegMulAdd(hn::Set(d, u2[3]), e, f)), d, r3 + c);
        }
    }
    for (; i < n; ++i) { // what is left of a block
        T* row = inverse + i * inverse_width;
        for (int k = 0; k < i; ++k) {
            const Numbers factor = hn::Set(d, system[k * width + i]);
            for (int c = 0; c <= k; c += step) {
                hn::Store(hn::NegMulAdd(factor, hn::Load(d, inverse + k * inverse_width + c), hn::Load(d, row + c)), d,
                          row + c);
            }
        }
        const Numbers scale = hn::Set(d, 1 / system[i * width + i]);
        for (int c = 0; c <= i; c += step) {
            hn::Store(hn::Mul(scale, hn::Load(d, row + c)), d, row + c);
        }
    }
}

} // namespace lineament::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif // once for each instruction set
#endif // LINEAMENT_USE_HIGHWAY
