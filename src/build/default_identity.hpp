// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "head_topology.hpp"

#include <Eigen/Core>

namespace lineament::build {

/// The adult shape between all origins and sexes (3 x base vertices, mm): where the head is cut and masks are made.
[[nodiscard]] Eigen::Matrix3Xd load_reference(const MakeHumanPackage& package);

/// The mean of the population (3 x base vertices, mm).
[[nodiscard]] Eigen::Matrix3Xd load_population_mean(const MakeHumanPackage& package);

/// The displacements of the head's vertices (3V x n, mm), one standard deviation of an independent cause a column: sex,
/// age and origin together, height, and each slider.
[[nodiscard]] Eigen::MatrixXd load_population_displacements(const MakeHumanPackage& package, const HeadTopology& head);

/// The standard deviation of a slider in slider units; 0: not used.
[[nodiscard]] double slider_standard_deviation(const MakeHumanModifier& modifier);

} // namespace lineament::build
