// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The kernels in double precision on Highway's portable vectors; part of highway_kernels.hpp.
#include "lineament/kernels/highway_product_sums.hpp" // before the guard: it turns rows into columns

#ifdef LINEAMENT_USE_HIGHWAY

#include <hwy/highway.h>

// An include guard that opens once for each instruction set.
#if defined(LINEAMENT_KERNELS_HIGHWAY_DOUBLE_KERNELS_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef LINEAMENT_KERNELS_HIGHWAY_DOUBLE_KERNELS_HPP
#undef LINEAMENT_KERNELS_HIGHWAY_DOUBLE_KERNELS_HPP
#else
#define LINEAMENT_KERNELS_HIGHWAY_DOUBLE_KERNELS_HPP
#endif

#include <cstdint>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace lineament::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using DoubleTag = hn::CappedTag<double, double_step>;
using DoubleVector = hn::Vec<DoubleTag>;
inline constexpr int double_lanes = static_cast<int>(hn::MaxLanes(DoubleTag()));

/// The sums of four vectors' lanes, out[0] to out[3].
HWY_INLINE void store_sums(DoubleVector s0, DoubleVector s1, DoubleVector s2, DoubleVector s3, double* out)
{
#if HWY_TARGET == HWY_SCALAR // has one lane, and nothing that moves lanes
    out[0] = hn::GetLane(s0);
    out[1] = hn::GetLane(s1);
    out[2] = hn::GetLane(s2);
    out[3] = hn::GetLane(s3);
#else
    const DoubleTag d;
    const DoubleVector s01 = hn::Add(hn::InterleaveLower(d, s0, s1), hn::InterleaveUpper(d, s0, s1)); // in each block
    const DoubleVector s23 = hn::Add(hn::InterleaveLower(d, s2, s3), hn::InterleaveUpper(d, s2, s3));
    if constexpr (double_lanes <= 2) {
        hn::StoreU(s01, d, out);
        hn::StoreU(s23, d, out + 2);
    } else {
        const DoubleVector s = hn::Add(hn::ConcatLowerLower(d, s23, s01), hn::ConcatUpperUpper(d, s23, s01));
        if constexpr (double_lanes == 4) {
            hn::StoreU(s, d, out);
        } else {
            const hn::Half<DoubleTag> half;
            const auto lower = hn::LowerHalf(half, s), upper = hn::UpperHalf(half, s);
            hn::StoreU(hn::Add(hn::ConcatLowerLower(half, upper, lower), hn::ConcatUpperUpper(half, upper, lower)),
                       half, out);
        }
    }
#endif
}

HWY_INLINE DoubleVector load_wide(const float* from)
{
    return hn::PromoteTo(DoubleTag(), hn::Load(hn::Rebind<float, DoubleTag>(), from));
}

inline void multiply_wide(const float* rows, int num_rows, int width, const double* x, double* out)
{
    const DoubleTag d;
    int r = 0;
    for (; r + 4 <= num_rows; r += 4, rows += 4 * width) { // four chains hide the latency
        DoubleVector s0 = hn::Zero(d), s1 = hn::Zero(d), s2 = hn::Zero(d), s3 = hn::Zero(d);
        for (int c = 0; c < width; c += double_lanes) {
            const DoubleVector factor = hn::Load(d, x + c);
            s0 = hn::MulAdd(factor, load_wide(rows + c), s0);
            s1 = hn::MulAdd(factor, load_wide(rows + width + c), s1);
            s2 = hn::MulAdd(factor, load_wide(rows + 2 * width + c), s2);
            s3 = hn::MulAdd(factor, load_wide(rows + 3 * width + c), s3);
        }
        store_sums(s0, s1, s2, s3, out + r);
    }
    for (; r < num_rows; ++r, rows += width) {
        DoubleVector sum = hn::Zero(d);
        for (int c = 0; c < width; c += double_lanes) {
            sum = hn::MulAdd(hn::Load(d, x + c), load_wide(rows + c), sum);
        }
        out[r] = hn::GetLane(hn::SumOfLanes(d, sum));
    }
}

/// A pass over some vectors of the columns, whose sums stay in registers.
template <int num_vectors>
HWY_INLINE void add_wide_columns(const float* rows, int num_rows, int width, const double* factors, double* sums)
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
            even[v] = hn::MulAdd(f0, load_wide(rows + v * double_lanes), even[v]);
            odd[v] = hn::MulAdd(f1, load_wide(rows + width + v * double_lanes), odd[v]);
        }
    }
    for (; r < num_rows; ++r, rows += width) {
        for (int v = 0; v < num_vectors; ++v) {
            even[v] = hn::MulAdd(hn::Set(d, factors[r]), load_wide(rows + v * double_lanes), even[v]);
        }
    }
    for (int v = 0; v < num_vectors; ++v) {
        hn::Store(hn::Add(even[v], odd[v]), d, sums + v * double_lanes);
    }
}

inline void add_wide(const float* rows, int num_rows, int width, const double* factors, double* sums)
{
    int begin = 0;
    for (; begin + 4 * double_lanes <= width; begin += 4 * double_lanes) {
        add_wide_columns<4>(rows + begin, num_rows, width, factors, sums + begin);
    }
    for (; begin < width; begin += double_lanes) {
        add_wide_columns<1>(rows + begin, num_rows, width, factors, sums + begin);
    }
}

inline void pull_points(const double* residuals, const double* jacobians, int count, double* pulls)
{
    const DoubleTag d;
    int i = 0;
    for (; i + double_lanes <= count; i += double_lanes) {
        const DoubleVector u = hn::LoadU(d, residuals + i), v = hn::LoadU(d, residuals + count + i);
        const auto pull = [&](int axis) HWY_ATTR {
            return hn::MulAdd(u, hn::LoadU(d, jacobians + axis * count + i),
                              hn::Mul(v, hn::LoadU(d, jacobians + (3 + axis) * count + i)));
        };
        hn::StoreInterleaved3(pull(0), pull(1), pull(2), d, pulls + 3 * i);
    }
    for (; i < count; ++i) {
        for (int axis = 0; axis < 3; ++axis) {
            pulls[3 * i + axis] =
                residuals[i] * jacobians[axis * count + i] + residuals[count + i] * jacobians[(3 + axis) * count + i];
        }
    }
}

/// Columns `begin` to `end` of the two rows that a point becomes.
template <class Tag>
HWY_INLINE void project_point(Tag d, const float* point_rows, int width, int begin, int end, const float* jacobian,
                              float* out, int out_width)
{
    const auto ux = hn::Set(d, jacobian[0]), uy = hn::Set(d, jacobian[1]), uz = hn::Set(d, jacobian[2]);
    const auto vx = hn::Set(d, jacobian[3]), vy = hn::Set(d, jacobian[4]), vz = hn::Set(d, jacobian[5]);
    for (int c = begin; c < end; c += static_cast<int>(hn::Lanes(d))) {
        const auto x = hn::LoadU(d, point_rows + c);
        const auto y = hn::LoadU(d, point_rows + width + c);
        const auto z = hn::LoadU(d, point_rows + 2 * width + c);
        hn::StoreU(hn::MulAdd(uz, z, hn::MulAdd(uy, y, hn::Mul(ux, x))), d, out + c);
        hn::StoreU(hn::MulAdd(vz, z, hn::MulAdd(vy, y, hn::Mul(vx, x))), d, out + out_width + c);
    }
}

inline void project_points(const float* point_rows, int width, int num_points, const double* jacobians, double scale,
                           float* out, int out_width)
{
    const hn::CappedTag<float, 2 * double_step> d;
    const hn::CappedTag<float, double_step> half;
    const int whole = width / (2 * double_step) * (2 * double_step);
    for (int i = 0; i < num_points; ++i, point_rows += 3 * width, out += 2 * out_width) {
        float jacobian[6];
        for (int k = 0; k < 6; ++k) {
            jacobian[k] = static_cast<float>(scale * jacobians[k * num_points + i]);
        }
        project_point(d, point_rows, width, 0, whole, jacobian, out, out_width);
        project_point(half, point_rows, width, whole, width, jacobian, out, out_width);
    }
}

inline void blend_rows(const float* first, const float* second, float fraction, int count, float* out)
{
    const hn::CappedTag<float, double_step> d;
    const auto of_first = hn::Set(d, 1 - fraction), of_second = hn::Set(d, fraction);
    for (int i = 0; i < count; i += static_cast<int>(hn::Lanes(d))) {
        hn::Store(hn::MulAdd(of_second, hn::Load(d, second + i), hn::Mul(of_first, hn::Load(d, first + i))), d,
                  out + i);
    }
}

inline void turn_columns(const double* columns, int count, int num_columns, float* out, int out_step)
{
    const hn::CappedTag<double, 4> d;
    int i = 0;
    if constexpr (hn::MaxLanes(d) == 4) {
        const hn::Rebind<float, decltype(d)> narrow;
        alignas(16) float four[16];
        for (; i + 4 <= count && num_columns >= 4; i += 4) {
            for (int k = 0; k < num_columns; k += 4) {
                const int begin = k + 4 <= num_columns ? k : num_columns - 4; // the last four overlap others
                for (int q = 0; q < 4; ++q) {
                    const auto values = hn::LoadU(d, columns + (begin + q) * count + i);
                    hn::Store(hn::DemoteTo(narrow, values), narrow, four + 4 * q);
                }
                store_transposed(four, out + i * out_step + begin, out_step);
            }
        }
    }
    for (; i < count; ++i) {
        for (int k = 0; k < num_columns; ++k) {
            out[i * out_step + k] = static_cast<float>(columns[k * count + i]);
        }
    }
}

inline void add_turned_points(const float* point_rows, int width, int num_points, const double* matrices,
                              const int* targets, float* out, int out_width)
{
    const hn::CappedTag<float, double_step> d;
    for (int i = 0; i < num_points; ++i, point_rows += 3 * width, matrices += 9) {
        if (targets[i] < 0) {
            continue;
        }
        const auto coefficient = [&](int k) HWY_ATTR { return hn::Set(d, static_cast<float>(matrices[k])); };
        const auto xx = coefficient(0), xy = coefficient(1), xz = coefficient(2);
        const auto yx = coefficient(3), yy = coefficient(4), yz = coefficient(5);
        const auto zx = coefficient(6), zy = coefficient(7), zz = coefficient(8);
        float* to = out + 3 * targets[i] * out_width;
        for (int c = 0; c < width; c += static_cast<int>(hn::Lanes(d))) {
            const auto x = hn::Load(d, point_rows + c);
            const auto y = hn::Load(d, point_rows + width + c);
            const auto z = hn::Load(d, point_rows + 2 * width + c);
            const auto add = [&](auto by_x, auto by_y, auto by_z, float* sum) HWY_ATTR {
                hn::Store(hn::MulAdd(by_z, z, hn::MulAdd(by_y, y, hn::MulAdd(by_x, x, hn::Load(d, sum)))), d, sum);
            };
            add(xx, xy, xz, to + c);
            add(yx, yy, yz, to + out_width + c);
            add(zx, zy, zz, to + 2 * out_width + c);
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
    double sums[num_pose_moments + 2];
    store_sums(w1, wx, wy, wz, sums);
    store_sums(wu, wv, xx, xy, sums + 4);
    store_sums(xz, yy, yz, zz, sums + 8);
    store_sums(ux, uy, uz, vx, sums + 12);
    store_sums(vy, vz, zero, zero, sums + 16);
    for (int t = 0; t < num_pose_moments; ++t) {
        moments[t] += sums[t];
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
