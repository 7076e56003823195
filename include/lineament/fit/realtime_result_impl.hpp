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

/// The landmarks as given, and where the fitted face has them.
inline void RealtimeFit::write_landmarks(FitResult& result)
{
    const std::size_t count = landmarks_.landmarks.size();
    result.landmarks.resize(count);
    const Landmark* const given = landmarks_.landmarks.data();
    for (std::size_t l = 0; l < count; ++l) {
        const Landmark& landmark = given[l];
        FittedLandmark& fitted = result.landmarks[l];
        if (!is_same_name(fitted.name, landmark.name)) {
            fitted.name = landmark.name;
        }
        fitted.point_px = landmark.point_px;
        fitted.weight = 0;
    }
    const int num_used = write_used_landmarks(result);
    if (num_used < static_cast<int>(count)) {
        write_other_landmarks(result);
    }
}

/// Those that the fit used, and what it says of all of them; their number.
inline int RealtimeFit::write_used_landmarks(FitResult& result)
{
    project(work_.points.data(), num_points(), work_.fitted_u, work_.fitted_v);
    // What does not change is held on to: the compiler cannot know that writing the result leaves it alone.
    const double* const fitted_u = work_.fitted_u.data();
    const double* const fitted_v = work_.fitted_v.data();
    const double* const seen_u = frame_.seen_u.data();
    const double* const seen_v = frame_.seen_v.data();
    const double* const information = frame_.information.data();
    const int* const landmark_of_fixed = frame_.landmark_of_fixed.data();
    FittedLandmark* const landmarks = result.landmarks.data();
    const Eigen::Vector2d principal_point_px = frame_.camera.principal_point_px;
    const double scale_factor = frame_.scale_factor;
    const int num_fixed = pack_.fixed.num_points;
    const double largest_information = Eigen::Map<const Eigen::VectorXd>(information, num_points()).maxCoeff();
    const double inverse_largest = 1 / largest_information;

    UsedLandmarks used = {DistanceJudge(frame_.camera.scale_px_per_mm)};
    double sum = 0;
    for (int f = 0; f < num_fixed; ++f) {
        if (landmark_of_fixed[f] >= 0) {
            const double du = fitted_u[f] - seen_u[f], dv = fitted_v[f] - seen_v[f];
            const double squared = du * du + dv * dv;
            FittedLandmark& fitted = landmarks[landmark_of_fixed[f]];
            fitted.fitted_px = Eigen::Vector2d(fitted_u[f], fitted_v[f]) + principal_point_px;
            fitted.weight = information[f] * inverse_largest;
            sum += information[f] * squared;
            used.add(fitted.weight, squared);
        }
    }
    result.chi_square = scale_factor * sum;
    for (int i = 0; i < num_matches(); ++i) {
        const int point = pack_.first_match + i;
        add_used_point(Eigen::Vector2d(fitted_u[point], fitted_v[point]) + principal_point_px, weight(point),
                       scale_factor * largest_information, landmarks[frame_.matches[i].landmark_index],
                       result.chi_square);
    }
    for (const OutlineLandmarks& outline : frame_.outline) { // several matches may be those of one landmark
        for (int i = 0; i < outline.count; ++i) {
            const FittedLandmark& fitted = landmarks[outline.landmark_indices[i]];
            if (fitted.weight > 0) {
                used.add(fitted.weight, (fitted.fitted_px - fitted.point_px).squaredNorm());
            }
        }
    }
    sum_up(fitter_.reference_.options(), used, result);
    return used.count;
}

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
