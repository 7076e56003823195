// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The kernels on Highway's portable vectors, for the instruction set this translation unit is compiled for. Empty
// unless LINEAMENT_USE_HIGHWAY is defined; src/kernels compiles it once for each set.
#include "lineament/kernels/scalar_kernels.hpp"

#ifdef LINEAMENT_USE_HIGHWAY

#if defined(__AVX512VBMI2__) && !defined(HWY_WANT_AVX3_DL)
#define HWY_WANT_AVX3_DL // without it Highway 1.0.3 refuses flags that include this set
#endif
#include <hwy/highway.h>

#include "lineament/kernels/highway_camera_kernels.hpp"
#include "lineament/kernels/highway_column_kernels.hpp"
#include "lineament/kernels/highway_double_kernels.hpp"
#include "lineament/kernels/highway_factor_kernels.hpp"
#include "lineament/kernels/highway_solve_kernels.hpp"
#include "lineament/kernels/highway_system_kernels.hpp"

// An include guard that opens once for each instruction set.
#if defined(LINEAMENT_KERNELS_HIGHWAY_KERNELS_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef LINEAMENT_KERNELS_HIGHWAY_KERNELS_HPP
#undef LINEAMENT_KERNELS_HIGHWAY_KERNELS_HPP
#else
#define LINEAMENT_KERNELS_HIGHWAY_KERNELS_HPP
#endif

#include <algorithm>
#include <cstdint>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace lineament::kernels::HWY_NAMESPACE {

inline void combine_grams(const float* grams, int num_columns, int width, const float* scales, float* gram)
{
    const Floats d;
    const int size = width * width;
    const Vector s0 = hn::Set(d, scales[0]);
    const Vector s1 = hn::Set(d, scales[1]);
    const Vector s2 = hn::Set(d, scales[2]);
    const Vector s3 = hn::Set(d, scales[3]);
    const Vector s4 = hn::Set(d, scales[4]);
    const Vector s5 = hn::Set(d, scales[5]);
    for (int i = 0; i < num_columns; ++i) {
        for (int at = i * width + i / lanes * lanes; at < i * width + num_columns; at += lanes) {
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
    const Vector ux = hn::Set(d, jacobian[0]), uy = hn::Set(d, jacobian[1]), uz = hn::Set(d, jacobian[2]);
    const Vector vx = hn::Set(d, jacobian[3]), vy = hn::Set(d, jacobian[4]), vz = hn::Set(d, jacobian[5]);
    for (int i = 0; i < count; ++i, out += 2 * width) {
        const float* rows = point_rows + static_cast<std::ptrdiff_t>(3 * width) * indices[i];
        const Vector root = hn::Set(d, roots[i]);
        for (int c = 0; c < width; c += lanes) {
            const Vector x = hn::Load(d, rows + c);
            const Vector y = hn::Load(d, rows + width + c);
            const Vector z = hn::Load(d, rows + 2 * width + c);
            const Vector u = hn::MulAdd(uz, z, hn::MulAdd(uy, y, hn::Mul(ux, x)));
            const Vector v = hn::MulAdd(vz, z, hn::MulAdd(vy, y, hn::Mul(vx, x)));
            hn::Store(hn::Mul(root, u), d, out + c);
            hn::Store(hn::Mul(root, v), d, out + width + c);
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

/// N vectors of columns of add_point_rows; x, y and z in a chain each, which hide the latency of each other.
template <int N>
HWY_INLINE void add_point_columns(const float* point_rows, int width, const int* indices, int count,
                                  const float* factors, float* sums)
{
    const Floats d;
    Vector partial[3][N];
    for (int v = 0; v < N; ++v) {
        partial[0][v] = hn::Load(d, sums + v * lanes);
        partial[1][v] = hn::Zero(d);
        partial[2][v] = hn::Zero(d);
    }
    for (int i = 0; i < count; ++i, factors += 3) {
        const float* row = point_rows + static_cast<std::ptrdiff_t>(3 * width) * indices[i];
        for (int a = 0; a < 3; ++a, row += width) {
            const Vector factor = hn::Set(d, factors[a]);
            for (int v = 0; v < N; ++v) {
                partial[a][v] = hn::MulAdd(factor, hn::Load(d, row + v * lanes), partial[a][v]);
            }
        }
    }
    for (int v = 0; v < N; ++v) {
        hn::Store(hn::Add(partial[0][v], hn::Add(partial[1][v], partial[2][v])), d, sums + v * lanes);
    }
}

inline void add_point_rows(const float* point_rows, int width, const int* indices, int count, const float* factors,
                           float* sums)
{
    constexpr int most = 4;
    int c = 0;
    if (count == 0) { // then there may be no rows
        return;
    }
    for (; c + most * lanes <= width; c += most * lanes) {
        add_point_columns<most>(point_rows + c, width, indices, count, factors, sums + c);
    }
    for (; c < width; c += lanes) {
        add_point_columns<1>(point_rows + c, width, indices, count, factors, sums + c);
    }
}

inline void transform_points(const float* points, int step, int count, const float* m, float* out, int out_step)
{
    const Floats d;
    for (int a = 0; a < 3; ++a, m += 4, out += out_step) {
        const Vector mx = hn::Set(d, m[0]);
        const Vector my = hn::Set(d, m[1]);
        const Vector mz = hn::Set(d, m[2]);
        const Vector mw = hn::Set(d, m[3]);
        for (int i = 0; i < count; i += lanes) {
            const Vector x = hn::Load(d, points + i);
            const Vector y = hn::Load(d, points + step + i);
            const Vector z = hn::Load(d, points + 2 * step + i);
            hn::Store(hn::Add(hn::MulAdd(mz, z, hn::MulAdd(my, y, hn::Mul(mx, x))), mw), d, out + i);
        }
    }
}

/// Of distances seen one after the other, for a vector of points, the first of the least of each.
class FirstLeast
{
public:
    HWY_INLINE FirstLeast()
        : least_(hn::Set(DoubleTag(), std::numeric_limits<double>::infinity())), first_(hn::Zero(Integers())),
          index_(hn::Zero(Integers()))
    {}
    HWY_INLINE void see(DoubleVector distance)
    {
        const auto is_nearer = hn::Lt(distance, least_);
        least_ = hn::Min(distance, least_);
        first_ = hn::IfThenElse(hn::RebindMask(Integers(), is_nearer), index_, first_);
        index_ = hn::Add(index_, hn::Set(Integers(), 1));
    }
    HWY_INLINE void store(int count, int* first) const
    {
        alignas(64) std::int64_t found[double_lanes];
        hn::Store(first_, Integers(), found);
        for (int j = 0; j < count && j < double_lanes; ++j) {
            first[j] = static_cast<int>(found[j]);
        }
    }

private:
    using Integers = hn::Rebind<std::int64_t, DoubleTag>;
    DoubleVector least_;
    hn::Vec<Integers> first_, index_;
};

/// Several points a vector, so that nothing is searched across it.
inline void nearest_points(const double* u, const double* v, int count, const double* to_u, const double* to_v,
                           int num_to, int* nearest)
{
    const DoubleTag d;
    for (int begin = 0; begin < num_to; begin += double_lanes) {
        const DoubleVector centre_u = hn::Load(d, to_u + begin);
        const DoubleVector centre_v = hn::Load(d, to_v + begin);
        FirstLeast least;
        for (int i = 0; i < count; ++i) {
            const DoubleVector du = hn::Sub(hn::Set(d, u[i]), centre_u);
            const DoubleVector dv = hn::Sub(hn::Set(d, v[i]), centre_v);
            least.see(hn::Add(hn::Mul(du, du), hn::Mul(dv, dv)));
        }
        least.store(num_to - begin, nearest + begin);
    }
}

inline void nearest_segments(const double* segments, int step, int count, const double* to_u, const double* to_v,
                             int num_to, int* nearest)
{
    const DoubleTag d;
    const DoubleVector zero = hn::Zero(d), one = hn::Set(d, 1.0);
    for (int begin = 0; begin < num_to; begin += double_lanes) {
        const DoubleVector end_u = hn::Load(d, to_u + begin), end_v = hn::Load(d, to_v + begin);
        FirstLeast least;
        for (int i = 0; i < count; ++i) {
            const double* segment = segments + i;
            const DoubleVector u = hn::Sub(end_u, hn::Set(d, segment[0]));
            const DoubleVector v = hn::Sub(end_v, hn::Set(d, segment[step]));
            const DoubleVector along_u = hn::Set(d, segment[2 * step]), along_v = hn::Set(d, segment[3 * step]);
            const DoubleVector share =
                hn::Mul(hn::Add(hn::Mul(u, along_u), hn::Mul(v, along_v)), hn::Set(d, segment[4 * step]));
            const DoubleVector fraction = hn::Min(hn::Max(share, zero), one);
            const DoubleVector du = hn::Sub(hn::Mul(fraction, along_u), u);
            const DoubleVector dv = hn::Sub(hn::Mul(fraction, along_v), v);
            least.see(hn::Add(hn::Mul(du, du), hn::Mul(dv, dv)));
        }
        least.store(num_to - begin, nearest + begin);
    }
}

inline void see_points(const float* points, int count, const double* m, double* u, double* v)
{
    const DoubleTag d;
    const hn::Rebind<float, DoubleTag> narrow;
    const DoubleVector ax = hn::Set(d, m[0]), ay = hn::Set(d, m[1]), az = hn::Set(d, m[2]), a0 = hn::Set(d, m[3]);
    const DoubleVector bx = hn::Set(d, m[4]), by = hn::Set(d, m[5]), bz = hn::Set(d, m[6]), b0 = hn::Set(d, m[7]);
    for (int i = 0; i < count; i += double_lanes) {
        hn::Vec<decltype(narrow)> px, py, pz;
        hn::LoadInterleaved3(narrow, points + 3 * i, px, py, pz);
        const DoubleVector x = hn::PromoteTo(d, px), y = hn::PromoteTo(d, py), z = hn::PromoteTo(d, pz);
        hn::Store(hn::MulAdd(az, z, hn::MulAdd(ay, y, hn::MulAdd(ax, x, a0))), d, u + i);
        hn::Store(hn::MulAdd(bz, z, hn::MulAdd(by, y, hn::MulAdd(bx, x, b0))), d, v + i);
    }
}

/// This instruction set's kernels; without vectors the plain ones, which the compiler knows better.
[[nodiscard]] inline const Kernels* table()
{
#if HWY_TARGET == HWY_SCALAR || HWY_TARGET == HWY_EMU128
    return &scalar_kernels();
#else
    static const Kernels kernels = {hwy::TargetName(HWY_TARGET),
                                    lanes >= 8,
                                    combine_panels,
                                    combine_panels_int16,
                                    widen,
                                    add_columns,
                                    combine_blocks,
                                    multiply_panels,
                                    combine_grams,
                                    project_rows,
                                    multiply_rows,
                                    add_gram,
                                    set_gram,
                                    add_rows,
                                    add_point_rows,
                                    solve_positive,
                                    solve_few,
                                    transform_points,
                                    add_pose_moments,
                                    residual_factors,
                                    nearest_point,
                                    nearest_points,
                                    nearest_segments,
                                    see_points,
                                    multiply_wide,
                                    add_wide,
                                    pull_points,
                                    project_points,
                                    blend_rows,
                                    turn_columns,
                                    add_turned_points,
                                    camera_residuals,
                                    weigh_by_student_t,
                                    camera_derivatives,
                                    add_gram_double,
                                    add_lower_gram,
                                    factor_positive<double>,
                                    solve_factored<double>,
                                    invert_factor<double>,
                                    factor_positive<float>,
                                    factor_and_invert<float>,
                                    solve_factored<float>,
                                    solve_for_one,
                                    solve_lower<float>,
                                    invert_factor<float>,
                                    sum_squares};
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
