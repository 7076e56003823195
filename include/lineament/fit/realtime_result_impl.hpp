// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/realtime_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_REALTIME_RESULT_IMPL_HPP
#define LINEAMENT_FIT_REALTIME_RESULT_IMPL_HPP

#include "lineament/fit/fit_summary_impl.hpp"

#include <algorithm>
#include <limits>
#include <utility>

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

    std::array<double, 8> m = image_from_model();
    m[3] += frame_.camera.principal_point_px.x();
    m[7] += frame_.camera.principal_point_px.y();
    const auto project = [m](const float* point) {
        const double x = point[0], y = point[1], z = point[2];
        return Eigen::Vector2d(m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7]);
    };
    const std::size_t num_matches = frame_.matches.size();
    double largest_information = std::numeric_limits<double>::min();
    for (const auto& [information, count] : {std::pair(&frame_.fixed_information, pack_.fixed.num_points),
                                             std::pair(&frame_.match_information, static_cast<int>(num_matches))}) {
        if (count > 0) {
            largest_information =
                std::max(largest_information, Eigen::Map<const Eigen::VectorXd>(information->data(), count).maxCoeff());
        }
    }
    const double largest_weight = frame_.scale_factor * largest_information;
    const std::size_t count = landmarks_.landmarks.size();
    result.landmarks.resize(count);
    for (std::size_t l = 0; l < count; ++l) {
        const Landmark& landmark = landmarks_.landmarks[l];
        FittedLandmark& fitted = result.landmarks[l];
        if (!is_same_name(fitted.name, landmark.name)) {
            fitted.name = landmark.name;
        }
        fitted.point_px = landmark.point_px;
        fitted.weight = 0;
    }
    double chi_square = 0;
    for (int f = 0; f < pack_.fixed.num_points; ++f) {
        const int landmark = frame_.landmark_of_fixed[f];
        if (landmark >= 0) {
            add_used_point(project(work_.fixed.data() + 3 * f), fixed_weight(f), largest_weight,
                           result.landmarks[landmark], chi_square);
        }
    }
    for (std::size_t i = 0; i < num_matches; ++i) {
        add_used_point(project(work_.match_positions.data() + 3 * i), frame_.scale_factor * frame_.match_information[i],
                       largest_weight, result.landmarks[frame_.matches[i].landmark_index], chi_square);
    }
    result.chi_square = chi_square;
    bool is_rest_known = false;
    for (std::size_t l = 0; l < count; ++l) {
        FittedLandmark& fitted = result.landmarks[l];
        if (fitted.weight != 0) {
            continue;
        }
        const int index = frame_.map_indices[l];
        if (index < 0) {
            fitted.fitted_px = fitted.point_px;
        } else if (pack_.map[index].fixed_index >= 0) {
            fitted.fitted_px = project(work_.fixed.data() + 3 * pack_.map[index].fixed_index);
        } else {
            if (!is_rest_known) {
                evaluate(PointSet::rest, work_.rest);
                is_rest_known = true;
            }
            fitted.fitted_px = project(work_.rest.data() + 3 * pack_.map[index].rest_index);
        }
    }
    sum_up(options, result);
}

} // namespace lineament::detail

#endif
