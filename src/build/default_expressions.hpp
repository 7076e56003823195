// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "head_topology.hpp"

#include "lineament/model/blendshapes.hpp"

#include <vector>

namespace lineament::build {

/// The expression sets "ekman6" and "arkit47" (offsets in unscaled mm).
/// @param reference  3 x V, the head's reference shape, mm.
[[nodiscard]] std::vector<Blendshapes>
make_default_expressions(const MakeHumanPackage& package, const HeadTopology& head, const Eigen::Matrix3Xd& reference);

} // namespace lineament::build
