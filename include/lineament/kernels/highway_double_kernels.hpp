// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The kernels in double precision on Highway's portable vectors; part of highway_kernels.hpp.
#include "lineament/kernels/kernels.hpp"

#ifdef LINEAMENT_USE_HIGHWAY

#include <hwy/highway.h>

// An include guard that opens once for each instruction set.
#if defined(LINEAMENT_KERNELS_HIGHWAY_DOUBLE_KERNELS_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef LINEAMENT_KERNELS_HIGHWAY_DOUBLE_KERNELS_HPP
#undef LINEAMENT_KERNELS_HIGHWAY_DOUBLE_KERNELS_HPP
#else
#define LINEAMENT_KERNELS_HIGHWAY_DOUBLE_KERNELS_HPP
#endif

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace lineament::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using DoubleTag = hn::CappedTag<double, double_step>;
using DoubleVector = hn::Vec<DoubleTag>;
inline constexpr int double_lanes = static_cast<int>(hn::MaxLanes(DoubleTag()));

inline void multiply_double_rows(const double* rows, int num_rows, int width, const double* x, double* out)
{
    const DoubleTag d;
    int r = 0;
    for (; r + 4 <= num_rows; r += 4, rows += 4 * width) { // four chains hide the latency
        DoubleVector s0 = hn::Zero(d), s1 = hn::Zero(d), s2 = hn::Zero(d), s3 = hn::Zero(d);
        for (int c = 0; c < width; c += double_lanes) {
            const DoubleVector factor = hn::Load(d, x + c);
            s0 = hn::MulAdd(factor, hn::Load(d, rows + c), s0);
            s1 = hn::MulAdd(factor, hn::Load(d, rows + width + c), s1);
            s2 = hn::MulAdd(factor, hn::Load(d, rows + 2 * width + c), s2);
            s3 = hn::MulAdd(factor, hn::Load(d, rows + 3 * width + c), s3);
        }
        out[r] = hn::GetLane(hn::SumOfLanes(d, s0));
        out[r + 1] = hn::GetLane(hn::SumOfLanes(d, s1));
        out[r + 2] = hn::GetLane(hn::SumOfLanes(d, s2));
        out[r + 3] = hn::GetLane(hn::SumOfLanes(d, s3));
    }
    for (; r < num_rows; ++r, rows += width) {
        DoubleVector sum = hn::Zero(d);
        for (int c = 0; c < width; c += double_lanes) {
            sum = hn::MulAdd(hn::Load(d, x + c), hn::Load(d, rows + c), sum);
        }
        out[r] = hn::GetLane(hn::SumOfLanes(d, sum));
    }
}

/// A pass over some vectors of the columns, whose sums stay in registers.
template <int num_vectors>
HWY_INLINE void add_double_columns(const double* rows, int num_rows, int width, const double* factors, double* sums)
{
    const DoubleTag d;
    DoubleVector even[num_vectors], odd[num_vectors]; // two chains each hide the latency
    for (int v = 0; v < num_vectors; ++v) {
        even[v] = hn::Load(d, sums + v * double_lanes);
        odd[v] = hn::Zero(d);
    }
    int r = 0;
    for (; r + 2 <= num_rows; r += 2, rows += 2 * width) {
        const DoubleVector f0 = hn::Set(d, factors[r]);
        const DoubleVector f1 = hn::Set(d, factors[r + 1]);
        for (int v = 0; v < num_vectors; ++v) {
            even[v] = hn::MulAdd(f0, hn::Load(d, rows + v * double_lanes), even[v]);
            odd[v] = hn::MulAdd(f1, hn::Load(d, rows + width + v * double_lanes), odd[v]);
        }
    }
    for (; r < num_rows; ++r, rows += width) {
        for (int v = 0; v < num_vectors; ++v) {
            even[v] = hn::MulAdd(hn::Set(d, factors[r]), hn::Load(d, rows + v * double_lanes), even[v]);
        }
    }
    for (int v = 0; v < num_vectors; ++v) {
        hn::Store(hn::Add(even[v], odd[v]), d, sums + v * double_lanes);
    }
}

inline void add_double_rows(const double* rows, int num_rows, int width, const double* factors, double* sums)
{
    int begin = 0;
    for (; begin + 4 * double_lanes <= width; begin += 4 * double_lanes) {
        add_double_columns<4>(rows + begin, num_rows, width, factors, sums + begin);
    }
    for (; begin < width; begin += double_lanes) {
        add_double_columns<1>(rows + begin, num_rows, width, factors, sums + begin);
    }
}

inline void project_points(const double* point_rows, int width, int num_points, const double* jacobians, float* out,
                           int out_width)
{
    const DoubleTag d;
    const hn::Rebind<float, DoubleTag> narrow;
    for (int i = 0; i < num_points; ++i, point_rows += 3 * width, jacobians += 6, out += 2 * out_width) {
        const DoubleVector ux = hn::Set(d, jacobians[0]), uy = hn::Set(d, jacobians[1]), uz = hn::Set(d, jacobians[2]);
        const DoubleVector vx = hn::Set(d, jacobians[3]), vy = hn::Set(d, jacobians[4]), vz = hn::Set(d, jacobians[5]);
        for (int c = 0; c < width; c += double_lanes) {
            const DoubleVector x = hn::Load(d, point_rows + c);
            const DoubleVector y = hn::Load(d, point_rows + width + c);
            const DoubleVector z = hn::Load(d, point_rows + 2 * width + c);
            hn::Store(hn::DemoteTo(narrow, hn::MulAdd(uz, z, hn::MulAdd(uy, y, hn::Mul(ux, x)))), narrow, out + c);
            hn::Store(hn::DemoteTo(narrow, hn::MulAdd(vz, z, hn::MulAdd(vy, y, hn::Mul(vx, x)))), narrow,
                      out + out_width + c);
        }
    }
}

/// Sums of four rows and `num_vectors` vectors of columns, changed by products of factors with rows.
template <int num_vectors>
struct DoubleBlock
{
    DoubleVector sums[4][num_vectors];

    HWY_INLINE void load(const double* from, int width)
    {
        for (int q = 0; q < 4; ++q) {
            for (int v = 0; v < num_vectors; ++v) {
                sums[q][v] = hn::Load(DoubleTag(), from + q * width + v * double_lanes);
            }
        }
    }
    HWY_INLINE void store(double* to, int width) const
    {
        for (int q = 0; q < 4; ++q) {
            for (int v = 0; v < num_vectors; ++v) {
                hn::Store(sums[q][v], DoubleTag(), to + q * width + v * double_lanes);
            }
        }
    }
    HWY_INLINE void add(const double* factors, const double* row)
    {
        for (int v = 0; v < num_vectors; ++v) {
            const DoubleVector value = hn::Load(DoubleTag(), row + v * double_lanes);
            for (int q = 0; q < 4; ++q) {
                sums[q][v] = hn::MulAdd(hn::Set(DoubleTag(), factors[q]), value, sums[q][v]);
            }
        }
    }
    HWY_INLINE void subtract(const double* factors, const double* row)
    {
        for (int v = 0; v < num_vectors; ++v) {
            const DoubleVector value = hn::Load(DoubleTag(), row + v * double_lanes);
            for (int q = 0; q < 4; ++q) {
                sums[q][v] = hn::NegMulAdd(hn::Set(DoubleTag(), factors[q]), value, sums[q][v]);
            }
        }
    }
};

template <int num_vectors>
HWY_INLINE void add_lower_gram_block(const double* lower, int n, int width, int i, int c, double* gram)
{
    DoubleBlock<num_vectors> block;
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
        int c = i / double_lanes * double_lanes;
        for (; c + 2 * double_lanes <= width; c += 2 * double_lanes) {
            add_lower_gram_block<2>(lower, n, width, i, c, gram);
        }
        if (c < width) {
            add_lower_gram_block<1>(lower, n, width, i, c, gram);
        }
    }
}

/// Rows i..i+3 of a system, some columns, less their products with the i rows above.
template <int num_vectors>
HWY_INLINE void subtract_above(double* system, int width, int i, int c)
{
    DoubleBlock<num_vectors> block;
    block.load(system + i * width + c, width);
    const double* above = system;
    for (int k = 0; k < i; ++k, above += width) {
        block.subtract(above + i, above + c);
    }
    block.store(system + i * width + c, width);
}

/// U row by row in blocks of four.
inline double factor_positive(double* system, int n, int width)
{
    const DoubleTag d;
    double least = 1;
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        double* r0 = system + i * width;
        double* r1 = r0 + width;
        double* r2 = r1 + width;
        double* r3 = r2 + width;
        const double diagonal[4] = {r0[i], r1[i + 1], r2[i + 2], r3[i + 3]};
        int c = i / double_lanes * double_lanes;
        for (; c + 2 * double_lanes <= width; c += 2 * double_lanes) {
            subtract_above<2>(system, width, i, c);
        }
        if (c < width) {
            subtract_above<1>(system, width, i, c);
        }

        // The block's own triangle, then its rows.
        const double d0 = r0[i];
        const double s0 = 1 / std::sqrt(d0);
        const double u01 = s0 * r0[i + 1], u02 = s0 * r0[i + 2], u03 = s0 * r0[i + 3];
        const double d1 = r1[i + 1] - u01 * u01;
        const double s1 = 1 / std::sqrt(d1);
        const double u12 = s1 * (r1[i + 2] - u01 * u02), u13 = s1 * (r1[i + 3] - u01 * u03);
        const double d2 = r2[i + 2] - u02 * u02 - u12 * u12;
        const double s2 = 1 / std::sqrt(d2);
        const double u23 = s2 * (r2[i + 3] - u02 * u03 - u12 * u13);
        const double d3 = r3[i + 3] - u03 * u03 - u13 * u13 - u23 * u23;
        const double s3 = 1 / std::sqrt(d3);
        if (!(d0 > 0 && d1 > 0 && d2 > 0 && d3 > 0)) {
            return 0;
        }
        const double pivots[4] = {d0, d1, d2, d3};
        for (int q = 0; q < 4; ++q) {
            least = std::min(least, pivots[q] / diagonal[q]);
        }
        for (c = i / double_lanes * double_lanes; c < width; c += double_lanes) {
            const DoubleVector a = hn::Mul(hn::Set(d, s0), hn::Load(d, r0 + c));
            const DoubleVector b = hn::Mul(hn::Set(d, s1), hn::NegMulAdd(hn::Set(d, u01), a, hn::Load(d, r1 + c)));
            const DoubleVector e =
                hn::Mul(hn::Set(d, s2),
                        hn::NegMulAdd(hn::Set(d, u12), b, hn::NegMulAdd(hn::Set(d, u02), a, hn::Load(d, r2 + c))));
            const DoubleVector f =
                hn::NegMulAdd(hn::Set(d, u13), b, hn::NegMulAdd(hn::Set(d, u03), a, hn::Load(d, r3 + c)));
            hn::Store(a, d, r0 + c);
            hn::Store(b, d, r1 + c);
            hn::Store(e, d, r2 + c);
            hn::Store(hn::Mul(hn::Set(d, s3), hn::NegMulAdd(hn::Set(d, u23), e, f)), d, r3 + c);
        }
    }
    for (; i < n; ++i) { // what is left of a block
        double* row = system + i * width;
        const int begin = i / double_lanes * double_lanes;
        const double diagonal = row[i];
        const double* above = system;
        for (int k = 0; k < i; ++k, above += width) {
            const DoubleVector factor = hn::Set(d, above[i]);
            for (int c = begin; c < width; c += double_lanes) {
                hn::Store(hn::NegMulAdd(factor, hn::Load(d, above + c), hn::Load(d, row + c)), d, row + c);
            }
        }
        if (!(row[i] > 0)) {
            return 0;
        }
        least = std::min(least, row[i] / diagonal);
        const DoubleVector inverse = hn::Set(d, 1 / std::sqrt(row[i]));
        for (int c = begin; c < width; c += double_lanes) {
            hn::Store(hn::Mul(inverse, hn::Load(d, row + c)), d, row + c);
        }
    }
    return least;
}

/// Blocks of one vector's length; within a block, and beyond the last whole one, number by number.
inline void solve_factored(const double* system, int n, int width, double* x)
{
    const DoubleTag d;
    const int whole = n / double_step * double_step;
    for (int begin = 0; begin < n; begin += double_step) {
        const int end = std::min(begin + double_step, n);
        for (int i = begin; i < end; ++i) {
            const double* row = system + i * width;
            x[i] /= row[i];
            for (int c = i + 1; c < end; ++c) {
                x[c] -= row[c] * x[i];
            }
        }
        for (int c = end; c < whole; c += double_lanes) {
            DoubleVector value = hn::Load(d, x + c);
            for (int i = begin; i < end; ++i) {
                value = hn::NegMulAdd(hn::Set(d, x[i]), hn::Load(d, system + i * width + c), value);
            }
            hn::Store(value, d, x + c);
        }
        for (int c = std::max(end, whole); c < n; ++c) {
            for (int i = begin; i < end; ++i) {
                x[c] -= system[i * width + c] * x[i];
            }
        }
    }
    for (int begin = (n - 1) / double_step * double_step; begin >= 0; begin -= double_step) {
        const int end = std::min(begin + double_step, n);
        for (int i = end - 1; i >= begin; --i) {
            const double* row = system + i * width;
            DoubleVector sum = hn::Zero(d);
            for (int c = end; c < whole; c += double_lanes) {
                sum = hn::MulAdd(hn::Load(d, row + c), hn::Load(d, x + c), sum);
            }
            x[i] -= hn::GetLane(hn::SumOfLanes(d, sum));
            for (int c = std::max(end, whole); c < n; ++c) {
                x[i] -= row[c] * x[c];
            }
        }
        for (int i = end - 1; i >= begin; --i) {
            const double* row = system + i * width;
            for (int c = i + 1; c < end; ++c) {
                x[i] -= row[c] * x[c];
            }
            x[i] /= row[i];
        }
    }
}

/// Rows i..i+3 of U^-T, some columns, less their products with the rows above, which are 0 before row c.
template <int num_vectors>
HWY_INLINE void subtract_inverse_above(const double* system, int width, int i, int c, double* inverse,
                                       int inverse_width)
{
    DoubleBlock<num_vectors> block;
    block.load(inverse + i * inverse_width + c, inverse_width);
    for (int k = c; k < i; ++k) {
        block.subtract(system + k * width + i, inverse + k * inverse_width + c);
    }
    block.store(inverse + i * inverse_width + c, inverse_width);
}

/// U^-T row by row in blocks of four.
inline void invert_factor(const double* system, int n, int width, double* inverse, int inverse_width)
{
    const DoubleTag d;
    std::fill_n(inverse, n * inverse_width, 0.0);
    for (int i = 0; i < n; ++i) {
        inverse[i * inverse_width + i] = 1;
    }
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        int c = 0;
        for (; c < i && c + 2 * double_lanes <= inverse_width; c += 2 * double_lanes) {
            subtract_inverse_above<2>(system, width, i, c, inverse, inverse_width);
        }
        if (c < i) {
            subtract_inverse_above<1>(system, width, i, c, inverse, inverse_width);
        }
        const double* u0 = system + i * width + i;
        const double* u1 = u0 + width;
        const double* u2 = u1 + width;
        const double* u3 = u2 + width;
        const double s0 = 1 / u0[0], s1 = 1 / u1[1], s2 = 1 / u2[2], s3 = 1 / u3[3];
        double* r0 = inverse + i * inverse_width;
        double* r1 = r0 + inverse_width;
        double* r2 = r1 + inverse_width;
        double* r3 = r2 + inverse_width;
        for (c = 0; c < i + 4; c += double_lanes) {
            const DoubleVector a = hn::Mul(hn::Set(d, s0), hn::Load(d, r0 + c));
            const DoubleVector b = hn::Mul(hn::Set(d, s1), hn::NegMulAdd(hn::Set(d, u0[1]), a, hn::Load(d, r1 + c)));
            const DoubleVector e =
                hn::Mul(hn::Set(d, s2),
                        hn::NegMulAdd(hn::Set(d, u1[2]), b, hn::NegMulAdd(hn::Set(d, u0[2]), a, hn::Load(d, r2 + c))));
            const DoubleVector f =
                hn::NegMulAdd(hn::Set(d, u1[3]), b, hn::NegMulAdd(hn::Set(d, u0[3]), a, hn::Load(d, r3 + c)));
            hn::Store(a, d, r0 + c);
            hn::Store(b, d, r1 + c);
            hn::Store(e, d, r2 + c);
            hn::Store(hn::Mul(hn::Set(d, s3), hn::NegMulAdd(hn::Set(d, u2[3]), e, f)), d, r3 + c);
        }
    }
    for (; i < n; ++i) { // what is left of a block
        double* row = inverse + i * inverse_width;
        for (int k = 0; k < i; ++k) {
            const DoubleVector factor = hn::Set(d, system[k * width + i]);
            for (int c = 0; c <= k; c += double_lanes) {
                hn::Store(hn::NegMulAdd(factor, hn::Load(d, inverse + k * inverse_width + c), hn::Load(d, row + c)), d,
                          row + c);
            }
        }
        const DoubleVector scale = hn::Set(d, 1 / system[i * width + i]);
        for (int c = 0; c <= i; c += double_lanes) {
            hn::Store(hn::Mul(scale, hn::Load(d, row + c)), d, row + c);
        }
    }
}

inline void add_pose_moments(const float* points, const double* seen_u, const double* seen_v, const double* weights,
                             int count, double* moments)
{
    using V = DoubleVector;
    const DoubleTag d;
    const hn::Rebind<float, DoubleTag> narrow;
    const V zero = hn::Zero(d);
    V w1 = zero, wx = zero, wy = zero, wz = zero, wu = zero, wv = zero, xx = zero, xy = zero, xz = zero;
    V yy = zero, yz = zero, zz = zero, ux = zero, uy = zero, uz = zero, vx = zero, vy = zero, vz = zero;
    for (int i = 0; i < count; i += double_lanes) {
        hn::Vec<decltype(narrow)> px, py, pz;
        hn::LoadInterleaved3(narrow, points + 3 * i, px, py, pz);
        const V x = hn::PromoteTo(d, px), y = hn::PromoteTo(d, py), z = hn::PromoteTo(d, pz);
        const V w = hn::Load(d, weights + i);
        const V u = hn::Mul(w, hn::Load(d, seen_u + i));
        const V v = hn::Mul(w, hn::Load(d, seen_v + i));
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
        moments[t] += hn::GetLane(hn::SumOfLanes(d, sums[t]));
    }
}

inline void residual_factors(const float* points, const double* u, const double* v, const double* w, double scale,
                             int count, const double* m, float* factors)
{
    using V = DoubleVector;
    const DoubleTag d;
    const hn::Rebind<float, DoubleTag> narrow;
    const V ax = hn::Set(d, m[0]), ay = hn::Set(d, m[1]), az = hn::Set(d, m[2]), a0 = hn::Set(d, m[3]);
    const V factor = hn::Set(d, scale);
    const V bx = hn::Set(d, m[4]), by = hn::Set(d, m[5]), bz = hn::Set(d, m[6]), b0 = hn::Set(d, m[7]);
    for (int i = 0; i < count; i += double_lanes) {
        hn::Vec<decltype(narrow)> px, py, pz;
        hn::LoadInterleaved3(narrow, points + 3 * i, px, py, pz);
        const V x = hn::PromoteTo(d, px), y = hn::PromoteTo(d, py), z = hn::PromoteTo(d, pz);
        const V seen_u = hn::MulAdd(az, z, hn::MulAdd(ay, y, hn::MulAdd(ax, x, a0)));
        const V seen_v = hn::MulAdd(bz, z, hn::MulAdd(by, y, hn::MulAdd(bx, x, b0)));
        const V weight = hn::Mul(factor, hn::Load(d, w + i));
        const V du = hn::Mul(weight, hn::Sub(hn::Load(d, u + i), seen_u));
        const V dv = hn::Mul(weight, hn::Sub(hn::Load(d, v + i), seen_v));
        hn::StoreInterleaved3(hn::DemoteTo(narrow, hn::MulAdd(ax, du, hn::Mul(bx, dv))),
                              hn::DemoteTo(narrow, hn::MulAdd(ay, du, hn::Mul(by, dv))),
                              hn::DemoteTo(narrow, hn::MulAdd(az, du, hn::Mul(bz, dv))), narrow, factors + 3 * i);
    }
}

inline int nearest_point(const double* u, const double* v, int count, double to_u, double to_v, double* squared)
{
    const DoubleTag d;
    const int step = double_lanes;
    const auto centre_u = hn::Set(d, to_u);
    const auto centre_v = hn::Set(d, to_v);
    auto least = hn::Set(d, std::numeric_limits<double>::infinity());
    for (int i = 0; i < count; i += step) {
        const auto du = hn::Sub(hn::Load(d, u + i), centre_u);
        const auto dv = hn::Sub(hn::Load(d, v + i), centre_v);
        const auto distance = hn::Add(hn::Mul(du, du), hn::Mul(dv, dv));
        hn::Store(distance, d, squared + i);
        least = hn::Min(least, distance);
    }
    least = hn::MinOfLanes(d, least);
    for (int i = 0; i < count; i += step) {
        const std::intptr_t found = hn::FindFirstTrue(d, hn::Eq(hn::Load(d, squared + i), least));
        if (found >= 0) {
            return i + static_cast<int>(found);
        }
    }
    return 0;
}

} // namespace lineament::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif // once for each instruction set
#endif // LINEAMENT_USE_HIGHWAY
