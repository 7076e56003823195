// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "head_topology.hpp"

#include <Eigen/Core>

#include <map>
#include <string>

namespace lineament::build {

/// Soft masks (V weights in [0, 1]) of the regions face, nose, eyes, mouth, ears and neck. Nose, eyes, mouth and ears
/// are what the targets that shift them move.
/// @param reference  3 x V, the head's reference shape, mm.
[[nodiscard]] std::map<std::string, Eigen::VectorXd>
make_default_regions(const MakeHumanPackage& package, const HeadTopology& head, const Eigen::Matrix3Xd& reference);

} // namespace lineament::build
