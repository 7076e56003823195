// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The camera of RealtimeFit from weighted sums of its points.
#include "lineament/fit/realtime_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_REALTIME_POSE_IMPL_HPP
#define LINEAMENT_FIT_REALTIME_POSE_IMPL_HPP

#include "lineament/fit/pair_moments_impl.hpp"
#include "lineament/fit/pose_support_impl.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace lineament::detail {

inline void RealtimeFit::set_scale()
{
    const double scale = frame_.camera.scale_px_per_mm;
    frame_.scale_factor = fitter_.reference_.options().noise_units == NoiseUnits::model ? 1 / (scale * scale) : 1;
}

inline bool RealtimeFit::estimate_pose()
{
    // The common factor of the weights does not matter.
    const int first = frame_.are_fixed_moments_known ? pack_.first_match : 0;
    std::array<double, kernels::num_pose_moments> moments = {};
    if (frame_.are_fixed_moments_known) {
        moments = frame_.fixed_moments;
    }
    kernels_.add_pose_moments(work_.points.data() + 3 * first, frame_.seen_u.data() + first,
                              frame_.seen_v.data() + first, frame_.information.data() + first, num_points() - first,
                              moments.data());
    if (num_matches() == 0) {
        frame_.fixed_moments = moments;
        frame_.are_fixed_moments_known = true;
    }
    if (!estimate_pose_closed_form(moments.data())) {
        const Reference reference = reference_points();
        const PoseResult pose = lineament::estimate_pose(
            reference.points.at(Eigen::Map<const Eigen::VectorXd>(work_.alpha.data(), pack_.num_shape),
                                Eigen::Map<const Eigen::VectorXd>(frame_.psi.data(), pack_.num_expressions)),
            reference.image_points, reference.weights, frame_.camera.principal_point_px);
        ++workspace_.num_reference_solves_;
        if (pose.status != FitStatus::success) {
            return false;
        }
        frame_.camera = pose.camera;
    }
    update_jacobian();
    if (!frame_.has_scale) {
        frame_.has_scale = true;
        set_scale();
    }
    return true;
}

inline void RealtimeFit::update_jacobian()
{
    for (int row = 0; row < 2; ++row) {
        for (int column = 0; column < 3; ++column) {
            frame_.jacobian[3 * row + column] =
                static_cast<float>(frame_.camera.scale_px_per_mm * frame_.camera.camera_from_model(row, column));
        }
    }
}

/// Two rows s (R_2, t) to points relative to the principal point.
inline std::array<double, 8> RealtimeFit::image_from_model() const
{
    const double s = frame_.camera.scale_px_per_mm;
    const Eigen::Matrix3d& r = frame_.camera.camera_from_model;
    const Eigen::Vector2d& t = frame_.camera.translation_mm;
    return {s * r(0, 0), s * r(0, 1), s * r(0, 2), s * t.x(), s * r(1, 0), s * r(1, 1), s * r(1, 2), s * t.y()};
}

/// As FrameFit::turn_by_depth.
inline void RealtimeFit::turn_by_depth()
{
    if (!frame_.has_depth) {
        return;
    }
    PairMoments all, with_depth;
    int num_with_depth = 0;
    for (int i = 0; i < num_points(); ++i) {
        if (weight(i) > 0) {
            const Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3f>(work_.points.data() + 3 * i).cast<double>();
            const int landmark =
                i < pack_.first_match ? frame_.landmark_of_fixed[i] : frame_.match_landmarks[i - pack_.first_match];
            const std::optional<double> depth_px = landmarks_.landmarks[landmark].depth_px;
            const Eigen::Vector3d seen(frame_.seen_u[i], frame_.seen_v[i], depth_px.value_or(0.0));
            all.add(weight(i), point, seen);
            if (depth_px) {
                with_depth.add(weight(i), point, seen);
                ++num_with_depth;
            }
        }
    }
    // Image points are relative to the principal point here.
    Camera camera = frame_.camera;
    camera.principal_point_px.setZero();
    if (turn_camera_by_depth(all, with_depth, num_with_depth, camera)) {
        camera.principal_point_px = frame_.camera.principal_point_px;
        frame_.camera = camera;
        update_jacobian();
        fit_expression();
        update_match_positions();
    }
}

/// lineament::estimate_pose from sums; false where it would not be clearly a success.
inline bool RealtimeFit::estimate_pose_closed_form(const double* moments)
{
    const double inverse = 1 / moments[0];
    const double mx = moments[1] * inverse, my = moments[2] * inverse, mz = moments[3] * inverse;
    const double mu = moments[4] * inverse, mv = moments[5] * inverse;
    const double xx = moments[6] * inverse - mx * mx, xy = moments[7] * inverse - mx * my;
    const double xz = moments[8] * inverse - mx * mz, yy = moments[9] * inverse - my * my;
    const double yz = moments[10] * inverse - my * mz, zz = moments[11] * inverse - mz * mz;
    const double ux = moments[12] * inverse - mu * mx, uy = moments[13] * inverse - mu * my;
    const double uz = moments[14] * inverse - mu * mz, vx = moments[15] * inverse - mv * mx;
    const double vy = moments[16] * inverse - mv * my, vz = moments[17] * inverse - mv * mz;

    const double cxx = yy * zz - yz * yz, cxy = xz * yz - xy * zz, cxz = xy * yz - xz * yy; // cofactors
    const double cyy = xx * zz - xz * xz, cyz = xy * xz - xx * yz, czz = xx * yy - xy * xy;
    const double determinant = xx * cxx + xy * cxy + xz * cxz;
    const double trace = xx + yy + zz;
    // The least variance is at least 4 det / trace^2, the largest at most the trace.
    if (!(4 * determinant > 2e-4 * trace * trace * trace)) {
        return false;
    }
    // The rows times the determinant: their directions are what is asked for.
    double r1[3] = {ux * cxx + uy * cxy + uz * cxz, ux * cxy + uy * cyy + uz * cyz, ux * cxz + uy * cyz + uz * czz};
    double r2[3] = {vx * cxx + vy * cxy + vz * cxz, vx * cxy + vy * cyy + vz * cyz, vx * cxz + vy * cyz + vz * czz};
    const double squared1 = r1[0] * r1[0] + r1[1] * r1[1] + r1[2] * r1[2];
    const double squared2 = r2[0] * r2[0] + r2[1] * r2[1] + r2[2] * r2[2];
    const double least = std::min(squared1, squared2);
    if (!(least * trace > 1e-12 * determinant * determinant) || !(least > 1e-4 * std::max(squared1, squared2))) {
        return false;
    }
    const double inverse1 = 1 / std::sqrt(squared1), inverse2 = 1 / std::sqrt(squared2);
    const double product = r1[0] * r2[0] + r1[1] * r2[1] + r1[2] * r2[2];
    const double lengths = std::sqrt(squared1 * squared2);
    if (!(std::abs(product) < 0.999 * lengths)) {
        return false;
    }
    const double plus = 0.5 * std::sqrt(lengths / (lengths + product));
    const double minus = 0.5 * std::sqrt(lengths / (lengths - product));
    const double same = plus + minus, cross = plus - minus;
    for (int a = 0; a < 3; ++a) {
        const double first = r1[a] * inverse1, second = r2[a] * inverse2;
        r1[a] = same * first + cross * second;
        r2[a] = cross * first + same * second;
    }
    const double r3z = r1[0] * r2[1] - r1[1] * r2[0];
    const double correlation = r1[0] * ux + r1[1] * uy + r1[2] * uz + r2[0] * vx + r2[1] * vy + r2[2] * vz;
    const auto variance_along = [&](const double* r) {
        return r[0] * (r[0] * xx + 2 * r[1] * xy + 2 * r[2] * xz) + r[1] * (r[1] * yy + 2 * r[2] * yz) +
               r[2] * r[2] * zz;
    };
    const double p11 = variance_along(r1), p22 = variance_along(r2); // of the points as posed
    const double scale = correlation / (p11 + p22);
    const double inverse_scale = (p11 + p22) / correlation;
    if (!(scale > 1e-9) || -r3z < min_facing_cosine + 1e-6) {
        return false;
    }
    const double p12 = r1[0] * (r2[0] * xx + r2[1] * xy + r2[2] * xz) + r1[1] * (r2[0] * xy + r2[1] * yy + r2[2] * yz) +
                       r1[2] * (r2[0] * xz + r2[1] * yz + r2[2] * zz);
    Eigen::Matrix2d seen, adjugate;
    seen << r1[0] * ux + r1[1] * uy + r1[2] * uz, r2[0] * ux + r2[1] * uy + r2[2] * uz,
        r1[0] * vx + r1[1] * vy + r1[2] * vz, r2[0] * vx + r2[1] * vy + r2[2] * vz;
    adjugate << p22, -p12, -p12, p11;
    if (is_squeezed(seen * adjugate)) { // a factor does not matter
        return false;
    }
    for (int a = 0; a < 3; ++a) {
        frame_.camera.camera_from_model(0, a) = r1[a];
        frame_.camera.camera_from_model(1, a) = r2[a];
    }
    frame_.camera.camera_from_model(2, 0) = r1[1] * r2[2] - r1[2] * r2[1];
    frame_.camera.camera_from_model(2, 1) = r1[2] * r2[0] - r1[0] * r2[2];
    frame_.camera.camera_from_model(2, 2) = r3z;
    frame_.camera.scale_px_per_mm = scale;
    frame_.camera.translation_mm.x() = mu * inverse_scale - (r1[0] * mx + r1[1] * my + r1[2] * mz);
    frame_.camera.translation_mm.y() = mv * inverse_scale - (r2[0] * mx + r2[1] * my + r2[2] * mz);
    return true;
}

} // namespace lineament::detail

#endif
