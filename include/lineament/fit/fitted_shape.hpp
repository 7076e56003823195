// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/checks.hpp"
#include "lineament/fit/fit_result.hpp"
#include "lineament/kernels/kernels.hpp"
#include "lineament/model/morphable_model.hpp"

#include <Eigen/Core>

#include <string>

namespace lineament {

namespace detail {

/// sum += the leading columns of a matrix times the coefficients, as many.
inline void add_columns(const Eigen::MatrixXf& matrix, const Eigen::VectorXf& coefficients,
                        const kernels::Kernels& kernels, Eigen::VectorXf& sum)
{
    kernels.add_columns(matrix.data(), matrix.rows(), static_cast<int>(matrix.rows()),
                        static_cast<int>(coefficients.size()), coefficients.data(), sum.data());
}

inline void require_coefficients(const Eigen::VectorXd& coefficients, Eigen::Index at_most, const char* place)
{
    require(coefficients.size() <= at_most, "shape_of", place, "at most " + std::to_string(at_most),
            std::to_string(coefficients.size()));
    require_finite(coefficients, "shape_of", place);
}

} // namespace detail

/// S(a, 0) (3V, mm): the fitted face with its expression taken away.
/// @param kernels  For the product with the basis; nullptr: by Eigen, with the instructions of the caller's flags.
/// @throws InvalidArgument if the model has another number of coefficients.
[[nodiscard]] inline Eigen::VectorXf neutral_shape_of(const MorphableModel& model, const FitResult& fit,
                                                      const kernels::Kernels* kernels = nullptr)
{
    const Eigen::VectorXd& alpha = fit.shape_coefficients;
    detail::require_coefficients(alpha, model.shape.num_coefficients(), "fit.shape_coefficients");
    if (kernels == nullptr) {
        return model.shape.instance(alpha);
    }
    Eigen::VectorXf shape = model.shape.mean;
    detail::add_columns(model.shape.basis,
                        model.shape.standard_deviations.head(alpha.size()).cwiseProduct(alpha.cast<float>()), *kernels,
                        shape);
    return shape;
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
        const Eigen::VectorXd& psi = fit.expression_coefficients;
        detail::require_coefficients(psi, set->num_coefficients(), "fit.expression_coefficients");
        if (kernels == nullptr) {
            shape += set->displacement(psi);
        } else {
            detail::add_columns(set->offsets, psi.cast<float>(), *kernels, shape);
        }
    }
    return shape;
}

} // namespace lineament
