// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What FaceFitter and RealtimeFitter say of a fit that has ended.
#include "lineament/fit/face_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_FIT_SUMMARY_IMPL_HPP
#define LINEAMENT_FIT_FIT_SUMMARY_IMPL_HPP

#include <cmath>
#include <string>

namespace lineament::detail {

/// A success with expressions at their upper bound is implausible.
inline void note_held_expressions(int num_held, double upper_bound, FitResult& result)
{
    if (result.status == FitStatus::success && num_held > 0) {
        result.status = FitStatus::implausible;
        result.reason = std::to_string(num_held) + " expression coefficients were held at " + to_text(upper_bound);
    }
}

/// Counts a point of the fit, seen at `fitted_px`, for its landmark; of several matches of one the nearest is shown.
inline void add_used_point(const Eigen::Vector2d& fitted_px, double weight, double largest_weight,
                           FittedLandmark& landmark, double& chi_square)
{
    const double distance = (fitted_px - landmark.point_px).squaredNorm();
    chi_square += weight * distance;
    if (landmark.weight == 0 || distance < (landmark.fitted_px - landmark.point_px).squaredNorm()) {
        landmark.fitted_px = fitted_px;
    }
    landmark.weight = weight / largest_weight;
}

/// Once every point is counted: error, priors and degrees of freedom.
inline void sum_up(const FitOptions& options, FitResult& result)
{
    int num_used = 0;
    double sum = 0;
    for (const FittedLandmark& landmark : result.landmarks) {
        if (landmark.weight > 0) {
            ++num_used;
            sum += (landmark.fitted_px - landmark.point_px).squaredNorm();
        }
    }
    result.rms_px = std::sqrt(sum / num_used);
    result.chi_square += options.regularization * result.shape_coefficients.squaredNorm() +
                         (result.expression_coefficients / options.expression_sigma).squaredNorm();
    result.degrees_of_freedom = 2 * num_used - 6;
}

} // namespace lineament::detail

#endif
