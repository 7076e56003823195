// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What the fitters say of a fit that has ended.
#include "lineament/fit/face_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_FIT_SUMMARY_IMPL_HPP
#define LINEAMENT_FIT_FIT_SUMMARY_IMPL_HPP

#include <cmath>
#include <string>

namespace lineament::detail {

/// Farther than this from where the fitted face has it [mm at the face's scale], a landmark is far: a tenth of the
/// distance between the outer eye corners, past which detections count as failed. The median of 10^4 faces with 3 px of
/// noise at 100 px between the eyes was at most 4 mm, that of points under permuted names at least 14.
inline constexpr double far_landmark_mm = 10.0;

/// Where landmarks of more than half of all weight are far, the fit is not of these landmarks, however well it settled.
class DistanceJudge
{
public:
    explicit DistanceJudge(double scale_px_per_mm) : limit_px_(far_landmark_mm * scale_px_per_mm) {}
    void add(double weight, double squared_distance_px)
    {
        total_ += weight;
        far_ += squared_distance_px > limit_px_ * limit_px_ ? weight : 0.0;
    }

    /// A success is implausible where most are far.
    void judge(FitResult& result) const
    {
        if (result.status == FitStatus::success && 2 * far_ > total_) {
            result.status = FitStatus::implausible;
            result.reason = "most landmarks lie farther than " + to_text(far_landmark_mm) + " mm from the fitted face";
        }
    }

private:
    double limit_px_;
    double total_ = 0.0;
    double far_ = 0.0;
};

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

/// Sums over the landmarks that a fit used.
struct UsedLandmarks
{
    DistanceJudge distances;
    int count = 0;
    double squares = 0.0;

    void add(double weight, double squared_distance_px)
    {
        ++count;
        squares += squared_distance_px;
        distances.add(weight, squared_distance_px);
    }
};

/// Once every landmark is in `used`, and every point in result.chi_square: error, priors and degrees of freedom.
/// @param used  A copy, so that the caller's sums can stay in registers.
inline void sum_up(const FitOptions& options, UsedLandmarks used, FitResult& result)
{
    used.distances.judge(result);
    result.rms_px = std::sqrt(used.squares / used.count);
    result.chi_square += options.regularization * result.shape_coefficients.squaredNorm() +
                         (result.expression_coefficients / options.expression_sigma).squaredNorm();
    result.degrees_of_freedom = 2 * used.count - 6;
}

/// The same of result.landmarks.
inline void sum_up(const FitOptions& options, FitResult& result)
{
    UsedLandmarks used = {DistanceJudge(result.camera.scale_px_per_mm)};
    for (const FittedLandmark& landmark : result.landmarks) {
        if (landmark.weight > 0) {
            used.add(landmark.weight, (landmark.fitted_px - landmark.point_px).squaredNorm());
        }
    }
    sum_up(options, used, result);
}

} // namespace lineament::detail

#endif
