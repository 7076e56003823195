// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/checks.hpp"
#include "lineament/fit/fit_result.hpp"
#include "lineament/model/morphable_model.hpp"

#include <Eigen/Core>

namespace lineament {

/// S(a, 0) (3V, mm): the fitted face with its expression taken away.
/// @param kernels  For the products with the basis; nullptr: by Eigen, with the instructions of the caller's flags.
/// @throws InvalidArgument if the model has another number of coefficients.
[[nodiscard]] inline Eigen::VectorXf neutral_shape_of(const MorphableModel& model, const FitResult& fit,
                                                      const kernels::Kernels* kernels = nullptr)
{
    return model.shape.instance(fit.shape_coefficients, kernels);
}

/// S(a, psi) (3V, mm) of a fit.
/// @param kernels  As of neutral_shape_of.
/// @throws InvalidArgument if the model has another number of coefficients or lacks the expression set.
[[nodiscard]] inline Eigen::VectorXf shape_of(const MorphableModel& model, const FitResult& fit,
                                              const kernels::Kernels* kernels = nullptr)
{
    Eigen::VectorXf shape = neutral_shape_of(model, fit, kernels);
    if (!fit.expression_set.empty()) {
        const Blendshapes* set = model.find_expression_set(fit.expression_set);
        require(set != nullptr, "shape_of", "fit.expression_set", "one of the model's expression sets",
                "\"" + fit.expression_set + "\"");
        set->displace(fit.expression_coefficients, shape, kernels);
    }
    return shape;
}

} // namespace lineament
