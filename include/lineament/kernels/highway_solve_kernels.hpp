// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What is solved with Cholesky's factor of a positive definite matrix, in either precision, on Highway's portable
// vectors; part of highway_kernels.hpp.
#include "lineament/kernels/highway_product_sums.hpp" // before the guard: its vectors are used
#include "lineament/kernels/scalar_factor_kernels.hpp"

#ifdef LINEAMENT_USE_HIGHWAY

#include <hwy/highway.h>

// An include guard that opens once for each instruction set.
#if defined(LINEAMENT_KERNELS_HIGHWAY_SOLVE_KERNELS_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef LINEAMENT_KERNELS_HIGHWAY_SOLVE_KERNELS_HPP
#undef LINEAMENT_KERNELS_HIGHWAY_SOLVE_KERNELS_HPP
#else
#define LINEAMENT_KERNELS_HIGHWAY_SOLVE_KERNELS_HPP
#endif

#include <algorithm>

HWY_BEFORE_NAMESPACE();
namespace lineament::kernels::HWY_NAMESPACE {

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
    if (width > max_width_for_one) {
        scalar::solve_for_one(system, n, begin, width, inverse_diagonal, x);
        return;
    }
    using Tag = FullTag<float>;
    const Tag d;
    constexpr int step = full_lanes<float>;
    alignas(64) float y[max_width_for_one];
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

} // namespace lineament::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif // once for each instruction set
#endif // LINEAMENT_USE_HIGHWAY
