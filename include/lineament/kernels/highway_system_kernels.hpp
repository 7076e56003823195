// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The kernels that sum Gram matrices and solve their systems in single precision, on Highway's portable vectors; part
// of highway_kernels.hpp.
#include "lineament/kernels/highway_column_kernels.hpp" // before the guard: its vectors are used
#include "lineament/kernels/highway_product_sums.hpp"   // likewise
#include "lineament/kernels/scalar_kernels.hpp"

#ifdef LINEAMENT_USE_HIGHWAY

#include <hwy/highway.h>

// An include guard that opens once for each instruction set.
#if defined(LINEAMENT_KERNELS_HIGHWAY_SYSTEM_KERNELS_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef LINEAMENT_KERNELS_HIGHWAY_SYSTEM_KERNELS_HPP
#undef LINEAMENT_KERNELS_HIGHWAY_SYSTEM_KERNELS_HPP
#else
#define LINEAMENT_KERNELS_HIGHWAY_SYSTEM_KERNELS_HPP
#endif

#include <algorithm>

HWY_BEFORE_NAMESPACE();
namespace lineament::kernels::HWY_NAMESPACE {

/// Rows i..i+3 of a Gram matrix at a time, from the diagonal's vector on, added to what there is or to nothing.
template <class T>
HWY_INLINE void make_gram(const T* rows, int num_rows, int begin, int end, int width, bool adds, T* gram)
{
    constexpr int step = full_lanes<T>;
    for (int i = begin; i < end; i += 4) {
        T* target = gram + i * width;
        add_products_from<Sign::plus>(i / step * step, rows, rows + i, num_rows, width, width, adds ? target : nullptr,
                                      target);
    }
}

inline void add_gram(const float* rows, int num_rows, int begin, int end, int width, float* gram)
{
    make_gram(rows, num_rows, begin, end, width, true, gram);
}

inline void add_gram_double(const double* rows, int num_rows, int begin, int end, int width, double* gram)
{
    make_gram(rows, num_rows, begin, end, width, true, gram);
}

inline void set_gram(const float* rows, int num_rows, int begin, int end, int width, float* gram)
{
    make_gram(rows, num_rows, begin, end, width, false, gram);
}

/// U row by row in blocks of four, A = U^T D^-1 U with D the diagonal of U: no roots, and the only long chain is one
/// division a row. Below the diagonal comes L = U^T D^-1, whose rows are what the substitution back takes from b.
inline float solve_positive(float* system, int n, int width, float* x)
{
    constexpr int max_size = 256;
    if (n > max_size) {
        return scalar::solve_positive(system, n, width, x);
    }
    const Floats d;
    const hn::CappedTag<float, 4> four;
    alignas(64) float factors[4 * max_size]; // L(i + q, k) at 4 k + q
    alignas(64) float right_side[max_size + lanes];
    float inverses[max_size + 4];
    float least = 1;
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        float* r0 = system + i * width;
        float* r1 = r0 + width;
        float* r2 = r1 + width;
        float* r3 = r2 + width;
        const float diagonal[4] = {r0[i], r1[i + 1], r2[i + 2], r3[i + 3]};
        for (int k = 0; k < i; ++k) {
            hn::Store(hn::Mul(hn::Set(four, inverses[k]), hn::Load(four, system + k * width + i)), four,
                      factors + 4 * k);
        }
        const int first = i / lanes * lanes;
        add_products_from<Sign::minus>(first, system, factors, i, width, 4, r0, r0);

        // The block's own triangle, then its rows.
        const float d0 = r0[i];
        const float i0 = 1 / d0;
        const float f01 = r0[i + 1] * i0, f02 = r0[i + 2] * i0, f03 = r0[i + 3] * i0;
        const float d1 = r1[i + 1] - f01 * r0[i + 1];
        const float i1 = 1 / d1;
        const float u12 = r1[i + 2] - f01 * r0[i + 2], u13 = r1[i + 3] - f01 * r0[i + 3];
        const float f12 = u12 * i1, f13 = u13 * i1;
        const float d2 = r2[i + 2] - f02 * r0[i + 2] - f12 * u12;
        const float i2 = 1 / d2;
        const float u23 = r2[i + 3] - f02 * r0[i + 3] - f12 * u13;
        const float f23 = u23 * i2;
        const float d3 = r3[i + 3] - f03 * r0[i + 3] - f13 * u13 - f23 * u23;
        if (!(d0 > 0 && d1 > 0 && d2 > 0 && d3 > 0)) {
            return 0;
        }
        const float pivots[4] = {d0, d1, d2, d3};
        for (int q = 0; q < 4; ++q) {
            least = pivots[q] < least * diagonal[q] ? pivots[q] / diagonal[q] : least;
        }
        inverses[i] = i0;
        inverses[i + 1] = i1;
        inverses[i + 2] = i2;
        inverses[i + 3] = 1 / d3;
        const Vector v01 = hn::Set(d, f01), v02 = hn::Set(d, f02), v03 = hn::Set(d, f03);
        const Vector v12 = hn::Set(d, f12), v13 = hn::Set(d, f13), v23 = hn::Set(d, f23);
        for (int c = first; c < width; c += lanes) {
            const Vector a = hn::Load(d, r0 + c);
            const Vector b = hn::NegMulAdd(v01, a, hn::Load(d, r1 + c));
            const Vector e = hn::NegMulAdd(v12, b, hn::NegMulAdd(v02, a, hn::Load(d, r2 + c)));
            const Vector f = hn::NegMulAdd(v23, e, hn::NegMulAdd(v13, b, hn::NegMulAdd(v03, a, hn::Load(d, r3 + c))));
            hn::Store(b, d, r1 + c);
            hn::Store(e, d, r2 + c);
            hn::Store(f, d, r3 + c);
        }
        for (int k = 0; k < i; k += 4) {
            store_transposed(factors + 4 * k, r0 + k, width);
        }
        r1[i] = f01;
        r2[i] = f02;
        r3[i] = f03;
        r2[i + 1] = f12;
        r3[i + 1] = f13;
        r3[i + 2] = f23;
    }
    const int num_in_blocks = i;
    for (; i < n; ++i) { // what is left of a block
        float* row = system + i * width;
        const float diagonal = row[i];
        const int first = i / lanes * lanes;
        for (int k = 0; k < i; ++k) {
            factors[k] = system[k * width + i] * inverses[k];
        }
        for (int c = first; c < width; c += lanes) {
            Vector sum = hn::Load(d, row + c);
            Vector other = hn::Zero(d);
            const float* above = system + c;
            int k = 0;
            for (; k + 2 <= i; k += 2, above += 2 * width) {
                sum = hn::NegMulAdd(hn::Set(d, factors[k]), hn::Load(d, above), sum);
                other = hn::MulAdd(hn::Set(d, factors[k + 1]), hn::Load(d, above + width), other);
            }
            if (k < i) {
                sum = hn::NegMulAdd(hn::Set(d, factors[k]), hn::Load(d, above), sum);
            }
            hn::Store(hn::Sub(sum, other), d, row + c);
        }
        if (!(row[i] > 0)) {
            return 0;
        }
        least = row[i] < least * diagonal ? row[i] / diagonal : least;
        inverses[i] = 1 / row[i];
        std::copy_n(factors, i, row);
    }

    // Each x, once it is known, is taken from what is left of the right side; that of x itself is not needed then.
    for (i = 0; i < n; ++i) {
        right_side[i] = system[i * width + n] * inverses[i];
    }
    for (int c = 0; c < width; c += lanes) {
        hn::Store(hn::Zero(d), d, x + c);
    }
    const auto take_from_right_side = [&](int row, int end) HWY_ATTR {
        const Vector factor = hn::Set(d, x[row]);
        for (int c = 0; c < end; c += lanes) {
            hn::Store(hn::NegMulAdd(factor, hn::Load(d, system + row * width + c), hn::Load(d, right_side + c)), d,
                      right_side + c);
        }
    };
    for (i = n - 1; i >= num_in_blocks; --i) {
        x[i] = right_side[i];
        take_from_right_side(i, i);
    }
    for (i = num_in_blocks - 4; i >= 0; i -= 4) {
        const float* l1 = system + (i + 1) * width;
        const float* l2 = l1 + width;
        const float* l3 = l2 + width;
        const float x3 = right_side[i + 3];
        const float x2 = right_side[i + 2] - l3[i + 2] * x3;
        const float x1 = right_side[i + 1] - l3[i + 1] * x3 - l2[i + 1] * x2;
        const float x0 = right_side[i] - l3[i] * x3 - l2[i] * x2 - l1[i] * x1;
        x[i] = x0;
        x[i + 1] = x1;
        x[i + 2] = x2;
        x[i + 3] = x3;
        const Vector v0 = hn::Set(d, x0), v1 = hn::Set(d, x1), v2 = hn::Set(d, x2), v3 = hn::Set(d, x3);
        for (int c = 0; c < i; c += lanes) {
            const Vector far = hn::MulAdd(v3, hn::Load(d, l3 + c), hn::Mul(v2, hn::Load(d, l2 + c)));
            Vector sum = hn::NegMulAdd(v1, hn::Load(d, l1 + c), hn::Load(d, right_side + c));
            sum = hn::NegMulAdd(v0, hn::Load(d, l1 - width + c), sum);
            hn::Store(hn::Sub(sum, far), d, right_side + c);
        }
    }
    return least;
}

/// Gauss and Jordan's elimination in rows of eight numbers, the right side behind the n of the matrix; a row that is
/// not free says x_i = x_i.
template <int n>
inline float solve_few(const float* matrix, int width, const float* right_side, const float* is_free, float* x,
                       float* residual)
{
    const hn::CappedTag<float, 8> d;
    constexpr int step = static_cast<int>(hn::MaxLanes(d));
    constexpr int num_vectors = 8 / step;
    using V = hn::Vec<decltype(d)>;
    alignas(64) float rows[n][8];                // the compiler keeps them in registers
    const auto at = [&](int c, int v) HWY_ATTR { // whether this is column c
        return hn::Eq(hn::Iota(d, static_cast<float>(v * step)), hn::Set(d, static_cast<float>(c)));
    };
    for (int i = 0; i < n; ++i) {
        const auto is_row_free = hn::Ne(hn::Set(d, is_free[i]), hn::Zero(d));
        const V last = hn::IfThenElse(is_row_free, hn::Set(d, right_side[i]), hn::Set(d, x[i]));
        for (int v = 0; v < num_vectors; ++v) {
            const V unit = hn::IfThenElseZero(at(i, v), hn::Set(d, 1.0f));
            const V row = hn::IfThenElse(is_row_free, hn::Load(d, matrix + i * width + v * step), unit);
            hn::Store(hn::IfThenElse(at(n, v), last, row), d, rows[i] + v * step);
        }
    }
    const V one = hn::Set(d, 1.0f);
    V least = one;
    const auto eliminate = [&](int p) HWY_ATTR {
        const V pivot = hn::Set(d, rows[p][p]);
        const V inverse = hn::Div(one, pivot);
        const V relative = hn::Div(pivot, hn::Abs(hn::Set(d, matrix[p * width + p])));
        const auto is_row_free = hn::Ne(hn::Set(d, is_free[p]), hn::Zero(d));
        const V least_of_both = hn::IfThenElse(hn::Lt(least, relative), least, relative); // NaN, if the pivot is
        least = hn::IfThenElse(is_row_free, least_of_both, least);
        V pivot_row[num_vectors];
        for (int v = 0; v < num_vectors; ++v) {
            pivot_row[v] = hn::Mul(hn::Load(d, rows[p] + v * step), inverse);
            hn::Store(pivot_row[v], d, rows[p] + v * step);
        }
        for (int i = 0; i < n; ++i) {
            if (i == p) {
                continue;
            }
            const V factor = hn::Set(d, rows[i][p]);
            for (int v = 0; v < num_vectors; ++v) {
                const V row = hn::Load(d, rows[i] + v * step);
                hn::Store(hn::NegMulAdd(factor, pivot_row[v], row), d, rows[i] + v * step);
            }
        }
    };
    // One after the other, without a loop, so that the rows stay in registers.
    eliminate(0);
    if constexpr (n > 1) {
        eliminate(1);
    }
    if constexpr (n > 2) {
        eliminate(2);
    }
    if constexpr (n > 3) {
        eliminate(3);
    }
    if constexpr (n > 4) {
        eliminate(4);
    }
    if constexpr (n > 5) {
        eliminate(5);
    }
    if constexpr (n > 6) {
        eliminate(6);
    }
    V rest[num_vectors];
    V solution[num_vectors];
    for (int v = 0; v < num_vectors; ++v) {
        rest[v] = hn::Load(d, right_side + v * step);
        solution[v] = hn::Zero(d);
    }
    for (int i = 0; i < n; ++i) {
        const V value = hn::Set(d, rows[i][n]);
        for (int v = 0; v < num_vectors; ++v) {
            solution[v] = hn::IfThenElse(at(i, v), value, solution[v]);
            rest[v] = hn::NegMulAdd(value, hn::Load(d, matrix + i * width + v * step), rest[v]);
        }
    }
    for (int v = 0; v < num_vectors; ++v) {
        hn::Store(solution[v], d, x + v * step);
        hn::Store(rest[v], d, residual + v * step);
    }
    return hn::GetLane(least);
}

inline float solve_few(const float* matrix, int n, int width, const float* right_side, const float* is_free, float* x,
                       float* residual)
{
    switch (n) {
    case 1:
        return solve_few<1>(matrix, width, right_side, is_free, x, residual);
    case 2:
        return solve_few<2>(matrix, width, right_side, is_free, x, residual);
    case 3:
        return solve_few<3>(matrix, width, right_side, is_free, x, residual);
    case 4:
        return solve_few<4>(matrix, width, right_side, is_free, x, residual);
    case 5:
        return solve_few<5>(matrix, width, right_side, is_free, x, residual);
    case 6:
        return solve_few<6>(matrix, width, right_side, is_free, x, residual);
    default:
        return solve_few<max_few>(matrix, width, right_side, is_free, x, residual);
    }
}

} // namespace lineament::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif // once for each instruction set
#endif // LINEAMENT_USE_HIGHWAY
