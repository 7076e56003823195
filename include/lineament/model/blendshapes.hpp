// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/checks.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <string>
#include <vector>

namespace lineament {

/// A named set of expression blendshapes: the offset of an expression psi from the neutral face is D psi, with
/// psi in [0, 1]^k.                                                                        docs/maths.md, Eq. (1)
struct Blendshapes
{
    std::string name = {};                    ///< Of the set: "ekman6", "arkit47".
    std::vector<std::string> names = {};      ///< k, of the blendshapes.
    Eigen::MatrixXf offsets = {};             ///< 3V x k, mm, D.
    Eigen::VectorXf standard_deviations = {}; ///< k, of psi; the width of its prior.

    [[nodiscard]] Eigen::Index num_coefficients() const { return offsets.cols(); }

    /// D psi (3V). Missing trailing coefficients are 0.
    /// @throws InvalidArgument if there are more coefficients than blendshapes, or one is not finite.
    [[nodiscard]] Eigen::VectorXf displacement(const Eigen::Ref<const Eigen::VectorXd>& coefficients) const
    {
        require(coefficients.size() <= num_coefficients(), "Blendshapes::displacement", "coefficients",
                "at most " + std::to_string(num_coefficients()), std::to_string(coefficients.size()));
        require_finite(coefficients, "Blendshapes::displacement", "coefficients");
        return offsets.leftCols(coefficients.size()) * coefficients.cast<float>();
    }

    /// The leading `count` vertices' rows.
    [[nodiscard]] Blendshapes first_vertices(Eigen::Index count) const
    {
        require(count >= 0 && 3 * count <= offsets.rows(), "Blendshapes::first_vertices", "count",
                "0 to " + std::to_string(offsets.rows() / 3), std::to_string(count));
        return {name, names, offsets.topRows(3 * count), standard_deviations};
    }
};

} // namespace lineament
