// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Cholesky's factor of a positive definite matrix, its inverse, and what is solved with it, in either precision, on
// Highway's portable vectors; part of highway_kernels.hpp.
#include "lineament/kernels/highway_product_sums.hpp" // before the guard: its sums are used
#include "lineament/kernels/scalar_kernels.hpp"

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

/// For one right side. The four numbers that the next block needs first are taken on in registers, the others by
/// vectors behind them.
inline void solve_for_one(const float* system, int n, int begin, int width, const float* inverse_diagonal, float* x)
{
    constexpr int max_width = 512;
    if (width > max_width) {
        scalar::solve_for_one(system, n, begin, width, inverse_diagonal, x);
        return;
    }
    using Tag = FullTag<float>;
    const Tag d;
    constexpr int step = full_lanes<float>;
    alignas(64) float y[max_width];
    std::fill_n(y, width, 0.0f);
    const int whole = n / 4 * 4;

    // U^T y = b, b in x
    float b[4] = {};
    for (int q = 0; q < 4 && whole > 0; ++q) {
        b[q] = x[begin + q];
    }
    for (int i = 0; i < whole; i += 4) {
        const int at = begin + i;
        const float* u0 = system + i * width;
        const float* u1 = u0 + width;
        const float* u2 = u1 + width;
        const float* u3 = u2 + width;
        const float y0 = b[0] * inverse_diagonal[i];
        const float y1 = (b[1] - u0[at + 1] * y0) * inverse_diagonal[i + 1];
        const float y2 = (b[2] - u0[at + 2] * y0 - u1[at + 2] * y1) * inverse_diagonal[i + 2];
        const float y3 = (b[3] - u0[at + 3] * y0 - u1[at + 3] * y1 - u2[at + 3] * y2) * inverse_diagonal[i + 3];
        y[at] = y0;
        y[at + 1] = y1;
        y[at + 2] = y2;
        y[at + 3] = y3;
        if (i + 4 < whole) {
            for (int q = 0; q < 4; ++q) {
                const int c = at + 4 + q;
                b[q] = (x[c] - u0[c] * y0 - u1[c] * y1) - (u2[c] * y2 + u3[c] * y3);
            }
        }
        const auto v0 = hn::Set(d, y0), v1 = hn::Set(d, y1), v2 = hn::Set(d, y2), v3 = hn::Set(d, y3);
        for (int c = (at + 4) / step * step; c < width; c += step) {
            const auto one =
                hn::NegMulAdd(v1, hn::Load(d, u1 + c), hn::NegMulAdd(v0, hn::Load(d, u0 + c), hn::Load(d, x + c)));
            const auto other = hn::MulAdd(v3, hn::Load(d, u3 + c), hn::Mul(v2, hn::Load(d, u2 + c)));
            hn::Store(hn::Sub(one, other), d, x + c);
        }
    }
    for (int i = whole; i < n; ++i) {
        const float* row = system + i * width + begin;
        y[begin + i] = x[begin + i] * inverse_diagonal[i];
        for (int c = i + 1; c < n; ++c) {
            x[begin + c] -= row[c] * y[begin + i];
        }
    }

    // U x = y
    std::fill_n(x, width, 0.0f);
    for (int i = n - 1; i >= whole; --i) {
        const float* row = system + i * width + begin;
        float sum = y[begin + i];
        for (int c = i + 1; c < n; ++c) {
            sum -= row[c] * x[begin + c];
        }
        x[begin + i] = sum * inverse_diagonal[i];
    }
    float last[4] = {}; // x of the block behind
    for (int q = 0; q < 4 && begin + whole + q < width; ++q) {
        last[q] = x[begin + whole + q];
    }
    for (int i = whole - 4; i >= 0; i -= 4) {
        const int at = begin + i;
        const float* rows[4];
        float sums[4];
        for (int q = 0; q < 4; ++q) {
            rows[q] = system + (i + q) * width;
        }
        hn::Vec<Tag> products[4] = {hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
        int c = (at + 8) / step * step;
        if (c < width) { // behind the block behind alone
            const auto behind = hn::Ge(hn::Iota(d, static_cast<float>(c)), hn::Set(d, static_cast<float>(at + 8)));
            const auto value = hn::Load(d, x + c);
            for (int q = 0; q < 4; ++q) {
                products[q] = hn::Mul(hn::IfThenElseZero(behind, hn::Load(d, rows[q] + c)), value);
            }
        }
        for (c += step; c < width; c += step) {
            const auto value = hn::Load(d, x + c);
            for (int q = 0; q < 4; ++q) {
                products[q] = hn::MulAdd(hn::Load(d, rows[q] + c), value, products[q]);
            }
        }
        for (int q = 0; q < 4; ++q) {
            const float* row = rows[q] + at + 4;
            float sum = y[at + q] - hn::GetLane(hn::SumOfLanes(d, products[q]));
            if (at + 4 < width) {
                sum = (sum - row[0] * last[0] - row[1] * last[1]) - (row[2] * last[2] + row[3] * last[3]);
            }
            sums[q] = sum;
        }
        last[3] = sums[3] * inverse_diagonal[i + 3];
        last[2] = (sums[2] - rows[2][at + 3] * last[3]) * inverse_diagonal[i + 2];
        last[1] = (sums[1] - rows[1][at + 3] * last[3] - rows[1][at + 2] * last[2]) * inverse_diagonal[i + 1];
        last[0] = (sums[0] - rows[0][at + 3] * last[3] - rows[0][at + 2] * last[2] - rows[0][at + 1] * last[1]) *
                  inverse_diagonal[i];
        for (int q = 0; q < 4; ++q) {
            x[at + q] = last[q];
        }
    }
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
