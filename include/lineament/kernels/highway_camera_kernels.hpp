// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What a perspective camera sees, on Highway's portable vectors; part of highway_kernels.hpp.
#include "lineament/kernels/kernels.hpp"

#ifdef LINEAMENT_USE_HIGHWAY

#include <hwy/highway.h>

// An include guard that opens once for each instruction set.
#if defined(LINEAMENT_KERNELS_HIGHWAY_CAMERA_KERNELS_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef LINEAMENT_KERNELS_HIGHWAY_CAMERA_KERNELS_HPP
#undef LINEAMENT_KERNELS_HIGHWAY_CAMERA_KERNELS_HPP
#else
#define LINEAMENT_KERNELS_HIGHWAY_CAMERA_KERNELS_HPP
#endif

HWY_BEFORE_NAMESPACE();
namespace lineament::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Points turned into the camera's axes, and where they are seen [mm].
template <class Tag>
struct SeenPoints
{
    using Vector = hn::Vec<Tag>;
    Vector x, y, z, inverse_depth, u, v;

    HWY_INLINE SeenPoints(Tag d, const PerspectiveCamera& camera, const double* points)
    {
        Vector px, py, pz;
        hn::LoadInterleaved3(d, points, px, py, pz);
        const auto turned = [&](const double* row) HWY_ATTR {
            return hn::MulAdd(hn::Set(d, row[2]), pz,
                              hn::MulAdd(hn::Set(d, row[1]), py, hn::Mul(hn::Set(d, row[0]), px)));
        };
        x = turned(camera.turn);
        y = turned(camera.turn + 3);
        z = turned(camera.turn + 6);
        const Vector one = hn::Set(d, 1.0);
        inverse_depth = hn::Div(one, hn::MulAdd(hn::Set(d, camera.phi), z, one));
        u = hn::Mul(inverse_depth, hn::Add(x, hn::Set(d, camera.translation[0])));
        v = hn::Mul(inverse_depth, hn::Add(y, hn::Set(d, camera.translation[1])));
    }
};

/// Points begin.. in vectors of a tag, as many as there are whole ones; returns where the next begins.
template <class Tag>
HWY_INLINE int camera_residuals_from(Tag d, const PerspectiveCamera& camera, const double* points,
                                     const double* landmarks, const double* roots, int count, int begin,
                                     double* residuals)
{
    const int step = static_cast<int>(hn::Lanes(d));
    const hn::Vec<Tag> scale = hn::Set(d, camera.scale);
    int i = begin;
    for (; i + step <= count; i += step) {
        const SeenPoints<Tag> seen(d, camera, points + 3 * i);
        hn::Vec<Tag> u, v;
        hn::LoadInterleaved2(d, landmarks + 2 * i, u, v);
        const auto du = hn::MulAdd(scale, seen.u, hn::Sub(hn::Set(d, camera.centre[0]), u));
        const auto dv = hn::MulAdd(scale, seen.v, hn::Sub(hn::Set(d, camera.centre[1]), v));
        hn::StoreU(hn::MulAdd(hn::LoadU(d, roots + i), du, hn::Mul(hn::LoadU(d, roots + count + i), dv)), d,
                   residuals + i);
        hn::StoreU(hn::Mul(hn::LoadU(d, roots + 2 * count + i), dv), d, residuals + count + i);
    }
    return i;
}

inline void camera_residuals(const PerspectiveCamera& camera, const double* points, const double* landmarks,
                             const double* roots, int count, double* residuals)
{
    int i = camera_residuals_from(hn::CappedTag<double, 8>(), camera, points, landmarks, roots, count, 0, residuals);
    i = camera_residuals_from(hn::CappedTag<double, 2>(), camera, points, landmarks, roots, count, i, residuals);
    camera_residuals_from(hn::CappedTag<double, 1>(), camera, points, landmarks, roots, count, i, residuals);
}

template <class Tag>
HWY_INLINE int weigh_by_student_t_from(Tag d, const double* residuals, const double* dimensions, double nu,
                                       double least, int count, int begin, double* roots, double* weighted)
{
    using Vector = hn::Vec<Tag>;
    const int step = static_cast<int>(hn::Lanes(d));
    const Vector one = hn::Set(d, 1.0), degrees = hn::Set(d, nu);
    int i = begin;
    for (; i + step <= count; i += step) {
        const Vector x = hn::LoadU(d, residuals + i), y = hn::LoadU(d, residuals + count + i);
        const Vector dimension = hn::LoadU(d, dimensions + i);
        const Vector squared = hn::MulAdd(x, x, hn::Mul(y, y));
        const Vector inverse = hn::Div(one, hn::Add(degrees, squared));
        const Vector weight = hn::Mul(hn::Add(degrees, dimension), inverse);
        const Vector slope = hn::Mul(hn::Div(hn::Set(d, 2.0), dimension), hn::Mul(squared, inverse));
        const Vector root = hn::Sqrt(hn::Mul(weight, hn::Max(hn::Set(d, least), hn::Sub(one, slope))));
        const Vector factor = hn::Div(weight, root);
        hn::StoreU(root, d, roots + i);
        hn::StoreU(hn::Mul(factor, x), d, weighted + i);
        hn::StoreU(hn::Mul(factor, y), d, weighted + count + i);
    }
    return i;
}

inline void weigh_by_student_t(const double* residuals, const double* dimensions, double nu, double least, int count,
                               double* roots, double* weighted)
{
    int i = weigh_by_student_t_from(hn::CappedTag<double, 8>(), residuals, dimensions, nu, least, count, 0, roots,
                                    weighted);
    i = weigh_by_student_t_from(hn::CappedTag<double, 2>(), residuals, dimensions, nu, least, count, i, roots,
                                weighted);
    weigh_by_student_t_from(hn::CappedTag<double, 1>(), residuals, dimensions, nu, least, count, i, roots, weighted);
}

template <class Tag>
HWY_INLINE int camera_derivatives_from(Tag d, const PerspectiveCamera& camera, const double* points,
                                       const double* offsets, const double* roots, const double* factors, int count,
                                       int begin, double* derivatives)
{
    using Vector = hn::Vec<Tag>;
    const int step = static_cast<int>(hn::Lanes(d));
    const Vector zero = hn::Zero(d);
    int i = begin;
    for (; i + step <= count; i += step) {
        const SeenPoints<Tag> seen(d, camera, points + 3 * i);
        Vector ox, oy, oz;
        hn::LoadInterleaved3(d, offsets + 3 * i, ox, oy, oz);

        // The rows of factor U, with the scale.
        const Vector factor = hn::Mul(hn::LoadU(d, factors + i), hn::Mul(hn::Set(d, camera.scale), seen.inverse_depth));
        const Vector g00 = hn::Mul(factor, hn::LoadU(d, roots + i));
        const Vector g01 = hn::Mul(factor, hn::LoadU(d, roots + count + i));
        const Vector g11 = hn::Mul(factor, hn::LoadU(d, roots + 2 * count + i));
        double* to = derivatives + i;
        const auto store_pair = [&](Vector a, Vector b, int first, int second) HWY_ATTR {
            hn::StoreU(hn::MulAdd(g00, a, hn::Mul(g01, b)), d, to + first * count);
            hn::StoreU(hn::Mul(g11, b), d, to + second * count);
        };

        // d x / d P = scale (1 0 a; 0 1 b), P = R X
        const Vector minus_phi = hn::Set(d, -camera.phi);
        const Vector a = hn::Mul(minus_phi, seen.u), b = hn::Mul(minus_phi, seen.v);
        Vector by_offset_u = zero, by_offset_v = zero;
        for (int axis = 0; axis < 3; ++axis) {
            const Vector down = hn::Set(d, camera.turn[6 + axis]);
            const Vector by_u = hn::MulAdd(a, down, hn::Set(d, camera.turn[axis]));
            const Vector by_v = hn::MulAdd(b, down, hn::Set(d, camera.turn[3 + axis]));
            const Vector offset = axis == 0 ? ox : axis == 1 ? oy : oz;
            by_offset_u = hn::MulAdd(by_u, offset, by_offset_u);
            by_offset_v = hn::MulAdd(by_v, offset, by_offset_v);
            store_pair(by_u, by_v, axis, 3 + axis);
        }
        store_pair(hn::Mul(a, seen.y), hn::MulSub(b, seen.y, seen.z), 6, 12);
        store_pair(hn::NegMulAdd(a, seen.x, seen.z), hn::Neg(hn::Mul(b, seen.x)), 7, 13);
        store_pair(hn::Neg(seen.y), seen.x, 8, 14);
        store_pair(hn::Sub(seen.u, by_offset_u), hn::Sub(seen.v, by_offset_v), 9, 15);
        store_pair(hn::Set(d, 1.0), zero, 10, 16);
        store_pair(zero, hn::Set(d, 1.0), 11, 17);
        store_pair(hn::Neg(hn::Mul(seen.z, seen.u)), hn::Neg(hn::Mul(seen.z, seen.v)), 18, 19);
    }
    return i;
}

inline void camera_derivatives(const PerspectiveCamera& camera, const double* points, const double* offsets,
                               const double* roots, const double* factors, int count, double* derivatives)
{
    int i = camera_derivatives_from(hn::CappedTag<double, 8>(), camera, points, offsets, roots, factors, count, 0,
                                    derivatives);
    i = camera_derivatives_from(hn::CappedTag<double, 2>(), camera, points, offsets, roots, factors, count, i,
                                derivatives);
    camera_derivatives_from(hn::CappedTag<double, 1>(), camera, points, offsets, roots, factors, count, i, derivatives);
}

} // namespace lineament::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif // once for each instruction set
#endif // LINEAMENT_USE_HIGHWAY
