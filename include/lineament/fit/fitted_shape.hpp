// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/checks.hpp"
#include "lineament/fit/fit_result.hpp"
#include "lineament/model/morphable_model.hpp"

#include <Eigen/Core>

namespace lineament {

/// S(a, 0) (3V, mm): the fitted face with its expression taken away.
/// @throws InvalidArgument if the model has another number of coefficients.
[[nodiscard]] inline Eigen::VectorXf neutral_shape_of(const MorphableModel& model, const FitResult& fit)
{
    return model.shape.instance(fit.shape_coefficients);
}

/// S(a, psi) (3V, mm) of a fit.
/// @throws InvalidArgument if the model has another number of coefficients or lacks the expression set.
[[nodiscard]] inline Eigen::VectorXf shape_of(const MorphableModel& model, const FitResult& fit)
{
    Eigen::VectorXf shape = neutral_shape_of(model, fit);
    if (!fit.expression_set.empty()) {
        const Blendshapes* set = model.find_expression_set(fit.expression_set);
        require(set != nullptr, "shape_of", "fit.expression_set", "one of the model's expression sets",
                "\"" + fit.expression_set + "\"");
        shape += set->displacement(fit.expression_coefficients);
    }
    return shape;
}

} // namespace lineament
