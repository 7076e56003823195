// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace lineament {

/// How a residual far beyond its noise counts in the joint energy. u is the squared residual in units of its noise.
enum class RobustLoss
{
    none,          ///< rho = u: least squares.
    student_t,     ///< rho = (nu + d) log(1 + u / nu), nu = 4, d the residual's dimension.
    geman_mcclure, ///< rho = c^2 u / (c^2 + u), c = 3: a wild landmark does not pull at all.
};

inline constexpr double student_t_degrees = 4.0;      ///< nu.
inline constexpr double geman_mcclure_width_sq = 9.0; ///< c^2.

/// rho(u), u >= 0; rho(0) = 0 and it never falls.                                          docs/joint-fit.md, Eq. (12)
[[nodiscard]] inline double robust_loss(RobustLoss loss, double squared_residual, int num_dimensions)
{
    switch (loss) {
    case RobustLoss::none:
        break;
    case RobustLoss::student_t:
        return (student_t_degrees + num_dimensions) * std::log1p(squared_residual / student_t_degrees);
    case RobustLoss::geman_mcclure:
        return geman_mcclure_width_sq * squared_residual / (geman_mcclure_width_sq + squared_residual);
    }
    return squared_residual;
}

/// rho'(u): the weight of the residual in re-weighted least squares.
[[nodiscard]] inline double robust_weight(RobustLoss loss, double squared_residual, int num_dimensions)
{
    switch (loss) {
    case RobustLoss::none:
        break;
    case RobustLoss::student_t:
        return (student_t_degrees + num_dimensions) / (student_t_degrees + squared_residual);
    case RobustLoss::geman_mcclure: {
        const double root = geman_mcclure_width_sq / (geman_mcclure_width_sq + squared_residual);
        return root * root;
    }
    }
    return 1.0;
}

} // namespace lineament
