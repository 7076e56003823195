// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
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

/// Sum of losses. The logarithms of Student's t are taken of products: a few instead of one a residual.
class RobustSum
{
public:
    explicit RobustSum(RobustLoss loss) : loss_(loss) {}

    void add(double squared_residual, int num_dimensions)
    {
        const double ratio = 1 + squared_residual / student_t_degrees;
        if (loss_ != RobustLoss::student_t || !(ratio < largest_factor)) {
            sum_ += robust_loss(loss_, squared_residual, num_dimensions);
            return;
        }
        double& product = products_[num_dimensions - 1];
        product *= ratio;
        if (product > largest_factor) {
            sum_ += (student_t_degrees + num_dimensions) * std::log(product);
            product = 1;
        }
    }
    [[nodiscard]] double sum() const
    {
        return sum_ + (student_t_degrees + 1) * std::log(products_[0]) +
               (student_t_degrees + 2) * std::log(products_[1]);
    }

private:
    static constexpr double largest_factor = 1e150; ///< The product of two is a number.

    RobustLoss loss_;
    double sum_ = 0;
    double products_[2] = {1, 1}; ///< Of residuals of one and of two dimensions.
};

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

/// rho'(u) + (2/d) u rho''(u): the curvature of rho(|z|^2) / 2 in z, averaged over directions; at least a tenth of the
/// weight, so that it stays positive. What a residual says of the unknowns, where the weight says how hard it pulls.
[[nodiscard]] inline double robust_curvature(RobustLoss loss, double squared_residual, int num_dimensions)
{
    const double weight = robust_weight(loss, squared_residual, num_dimensions);
    double slope = 0; // rho''
    switch (loss) {
    case RobustLoss::none:
        break;
    case RobustLoss::student_t:
        slope = -weight / (student_t_degrees + squared_residual);
        break;
    case RobustLoss::geman_mcclure:
        slope = -2 * weight / (geman_mcclure_width_sq + squared_residual);
        break;
    }
    return std::max(0.1 * weight, weight + 2.0 / num_dimensions * squared_residual * slope);
}

} // namespace lineament
