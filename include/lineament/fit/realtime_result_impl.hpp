// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/realtime_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_REALTIME_RESULT_IMPL_HPP
#define LINEAMENT_FIT_REALTIME_RESULT_IMPL_HPP

#include "lineament/fit/fit_summary_impl.hpp"

#include <algorithm>

namespace lineament::detail {

/// FrameFit::result, into memory that is there.
inline void RealtimeFit::write(FitResult& result, int iterations)
{
    const FitOptions& options = fitter_.reference_.options();
    if (identity_status_ != FitStatus::success) {
        frame_.status = identity_status_;
        frame_.reason = identity_reason_;
    }
    result.status = frame_.status;
    result.reason = frame_.reason;
    note_held_expressions(frame_.num_held, options.max_expression, result);
    result.method = "thesis";
    result.camera = frame_.camera;
    result.iterations = iterations;
    result.contour_view = frame_.view;
    result.shape_coefficients = Eigen::Map<const Eigen::VectorXd>(work_.alpha.data(), pack_.num_shape);
    result.expression_coefficients = Eigen::Map<const Eigen::VectorXd>(frame_.psi.data(), pack_.num_expressions);
    const Blendshapes* expressions = fitter_.reference_.expressions();
    if (expressions == nullptr) {
        result.expression_set.clear();
        result.expression_names.clear();
    } else {
        result.expression_set = expressions->name;
        if (result.expression_names != expressions->names) {
            result.expression_names = expressions->names;
        }
    }

    write_landmarks(result);
}

inline void RealtimeFit::write_names(FitResult& result) const
{
    const std::size_t count = landmarks_.landmarks.size();
    result.landmarks.resize(count);
    const Landmark* const given = landmarks_.landmarks.data();
    const std::uint64_t* const keys = frame_.name_keys.data();
    FittedLandmark* const landmarks = result.landmarks.data();
    for (std::size_t l = 0; l < count; ++l) {
        if (!is_same_name(landmarks[l].name, keys[l], given[l].name)) {
            landmarks[l].name = given[l].name;
        }
    }
}

/// The landmarks as given, where the fitted face has them, and what it says of those that the fit used.
inline void RealtimeFit::write_landmarks(FitResult& result)
{
    // What does not change is held on to: the compiler cannot know that writing the result leaves it alone.
    const int num_points = this->num_points();
    const double* const information = frame_.information.data();
    const double* const fitted_u = work_.fitted_u.data();
    const double* const fitted_v = work_.fitted_v.data();
    const double* const squared = work_.squared_residuals.data();
    const int* const slots = frame_.slots.data();
    const Landmark* const given = landmarks_.landmarks.data();
    const std::size_t count = landmarks_.landmarks.size();
    const Eigen::Vector2d principal_point_px = frame_.camera.principal_point_px;
    const int first_outline_slot = frame_.first_outline_slot;

    project(work_.points.data(), num_points, work_.fitted_u, work_.fitted_v);
    using Values = Eigen::Map<const Eigen::ArrayXd, Eigen::Aligned64>;
    Eigen::Map<Eigen::ArrayXd, Eigen::Aligned64>(work_.squared_residuals.data(), num_points) =
        (Values(fitted_u, num_points) - Values(frame_.seen_u.data(), num_points)).square() +
        (Values(fitted_v, num_points) - Values(frame_.seen_v.data(), num_points)).square();
    const std::array<int, 2 * OutlineLandmarks::max_count + 1> shown = shown_matches();
    const double inverse_largest = 1 / Values(information, num_points).maxCoeff();

    write_names(result);
    FittedLandmark* const landmarks = result.landmarks.data();
    UsedLandmarks used = {DistanceJudge(frame_.camera.scale_px_per_mm)};
    for (std::size_t l = 0; l < count; ++l) {
        FittedLandmark& fitted = landmarks[l];
        fitted.point_px = given[l].point_px;
        const int point = slots[l] < first_outline_slot ? slots[l] : shown[slots[l] - first_outline_slot];
        if (point >= 0 && information[point] > 0) {
            fitted.fitted_px = Eigen::Vector2d(fitted_u[point], fitted_v[point]) + principal_point_px;
            fitted.weight = information[point] * inverse_largest;
            used.add(fitted.weight, squared[point]);
        } else {
            fitted.weight = 0;
        }
    }
    result.chi_square =
        frame_.scale_factor * Values(information, num_points).matrix().dot(Values(squared, num_points).matrix());
    sum_up(fitter_.reference_.options(), used, result);
    if (used.count < static_cast<int>(count)) {
        write_other_landmarks(result);
    }
}

/// The nearest match of each outline landmark, in the order of their slots; -1: none.
inline std::array<int, 2 * OutlineLandmarks::max_count + 1> RealtimeFit::shown_matches() const
{
    std::array<int, 2 * OutlineLandmarks::max_count + 1> shown; // the last one is that of landmarks not used
    shown.fill(-1);
    const double* const squared = work_.squared_residuals.data();
    for (int i = 0; i < num_matches(); ++i) {
        const int point = pack_.first_match + i;
        int& nearest = shown[frame_.slots[frame_.match_landmarks[i]] - frame_.first_outline_slot];
        if (nearest < 0 || squared[point] < squared[nearest]) {
            nearest = point;
        }
    }
    return shown;
}

/// Landmarks without weight, where the fitted face has them.
inline void RealtimeFit::write_other_landmarks(FitResult& result)
{
    evaluate(PointSet::rest, work_.rest);
    std::array<double, 8> m = image_from_model();
    m[3] += frame_.camera.principal_point_px.x();
    m[7] += frame_.camera.principal_point_px.y();
    for (std::size_t l = 0; l < result.landmarks.size(); ++l) {
        FittedLandmark& fitted = result.landmarks[l];
        if (fitted.weight != 0) {
            continue;
        }
        const int index = frame_.map_indices[l];
        if (index < 0) {
            fitted.fitted_px = fitted.point_px;
            continue;
        }
        const MapEntry& entry = pack_.map[index];
        const float* point = entry.fixed_index >= 0 ? work_.points.data() + 3 * entry.fixed_index
                                                    : work_.rest.data() + 3 * entry.rest_index;
        const double x = point[0], y = point[1], z = point[2];
        fitted.fitted_px = {m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7]};
    }
}

} // namespace lineament::detail

#endif
