// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

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
        double& product = products_[count_++ % num_chains][num_dimensions - 1];
        product *= ratio;
        if (product > largest_factor) {
            sum_ += (student_t_degrees + num_dimensions) * std::log(product);
            product = 1;
        }
    }
    [[nodiscard]] double sum() const
    {
        double sum = sum_;
        for (int d = 0; d < 2; ++d) {
            double product = 1;
            for (const auto& chain : products_) {
                product *= chain[d];
            }
            sum += (student_t_degrees + d + 1) * std::log(product);
        }
        return sum;
    }

private:
    static constexpr std::size_t num_chains = 4;   ///< So that none waits for the last product.
    static constexpr double largest_factor = 1e70; ///< The product of all chains is a number.

    RobustLoss loss_;
    double sum_ = 0;
    std::size_t count_ = 0;
    double products_[num_chains][2] = {{1, 1}, {1, 1}, {1, 1}, {1, 1}}; ///< Of residuals of one and of two dimensions.
};

/// The least curvature of those below, in units of the weight, so that it stays positive.
inline constexpr double least_curvature = 0.1;

/// What a residual says of the unknowns, and how hard it pulls.
struct RobustDerivatives
{
    double weight = 1.0; ///< rho'(u): of the residual in re-weighted least squares.
    /// rho'(u) + (2/d) u rho''(u): of rho(|z|^2) / 2 in z, averaged over directions; at least `least` times the weight.
    double curvature = 1.0;
};

[[nodiscard]] inline RobustDerivatives robust_derivatives(RobustLoss loss, double squared_residual, int num_dimensions,
                                                          double least = least_curvature)
{
    double weight = 1.0, relative_slope = 0.0; // rho' and -u rho'' / rho'
    switch (loss) {
    case RobustLoss::none:
        break;
    case RobustLoss::student_t: {
        const double inverse = 1 / (student_t_degrees + squared_residual);
        weight = (student_t_degrees + num_dimensions) * inverse;
        relative_slope = squared_residual * inverse;
        break;
    }
    case RobustLoss::geman_mcclure: {
        const double inverse = 1 / (geman_mcclure_width_sq + squared_residual);
        weight = geman_mcclure_width_sq * inverse * geman_mcclure_width_sq * inverse;
        relative_slope = 2 * squared_residual * inverse;
        break;
    }
    }
    return {weight, weight * std::max(least, 1 - 2.0 / num_dimensions * relative_slope)};
}

[[nodiscard]] inline double robust_weight(RobustLoss loss, double squared_residual, int num_dimensions)
{
    return robust_derivatives(loss, squared_residual, num_dimensions).weight;
}

} // namespace lineament
