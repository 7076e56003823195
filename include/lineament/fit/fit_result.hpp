// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/core/landmarks.hpp"
#include "lineament/fit/contour_view.hpp"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace lineament {

/// What a solver can say of its answer. Anything but `success` comes with a reason in the result.
enum class FitStatus
{
    success,
    not_converged,           ///< An iteration limit was reached; the estimate is the best found.
    too_few_correspondences, ///< Fewer points than the unknowns need; the estimate is neutral.
    degenerate,              ///< Coincident, collinear or planar points; the estimate is neutral.
    implausible,             ///< A coefficient or the scale at its bound, a face that looks away from the camera, image
                             ///< points squeezed about a line, or most landmarks far from the fitted face.
};

/// The status as it stands in files and messages: "success", "not_converged", ...
[[nodiscard]] inline const char* to_string(FitStatus status)
{
    switch (status) {
    case FitStatus::success:
        return "success";
    case FitStatus::not_converged:
        return "not_converged";
    case FitStatus::too_few_correspondences:
        return "too_few_correspondences";
    case FitStatus::degenerate:
        return "degenerate";
    case FitStatus::implausible:
        return "implausible";
    }
    return "degenerate";
}

/// One landmark of a fit: where it was seen, where the fitted face has it, and how much it counted.
struct FittedLandmark
{
    std::string name = {};
    Eigen::Vector2d point_px = Eigen::Vector2d::Zero();
    Eigen::Vector2d fitted_px = Eigen::Vector2d::Zero();
    double weight = 0.0; ///< Relative weight in [0, 1]; 0: not used by the fit (unmatched contour, unknown name).
};

/// Wall time of the parts of a fit [microseconds].
struct FitTiming
{
    double pose_us = 0.0;
    double identity_us = 0.0;
    double expression_us = 0.0;
    double contour_us = 0.0;
    double total_us = 0.0;
};

/// Everything needed to draw one fitted face again.
struct FitResult
{
    FitStatus status = FitStatus::degenerate;
    std::string reason = {}; ///< Of a status other than success, in words.
    std::string method = "thesis";
    Camera camera = {};
    Eigen::VectorXd shape_coefficients = {}; ///< m, alpha, dimensionless.
    std::string expression_set = {};
    std::vector<std::string> expression_names = {};
    Eigen::VectorXd expression_coefficients = {}; ///< k, psi.
    std::vector<FittedLandmark> landmarks = {};   ///< In the order given.
    double rms_px = 0.0;                          ///< Root mean square distance of the landmarks with weight > 0.
    double chi_square = 0.0;                      ///< Weighted squares of residuals and priors at the solution.
    int degrees_of_freedom = 0;                   ///< 2 per used landmark, minus the camera's 6.
    int iterations = 0;
    /// Which outline was matched last. A fit that starts from this result keeps to it until the head has clearly
    /// turned, so that a head at the limit does not flicker; files do not keep it.
    ContourView contour_view = ContourView::frontal;
    FitTiming timing = {};
};

} // namespace lineament
