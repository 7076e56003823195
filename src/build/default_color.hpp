// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "head_topology.hpp"

#include "lineament/model/pca_model.hpp"

#include <Eigen/Core>

#include <map>
#include <string>

namespace lineament::build {

/// The colour model: principal components of the skins sampled at the vertices (mirrored skins count too), then modes
/// of our own for brows, redness, yellowness and beard shadow, made orthogonal to them; by falling standard deviation.
/// The eyes and brows are painted.
/// @param reference  3 x V, the head's reference shape, mm.
[[nodiscard]] PcaModel make_default_color(const MakeHumanPackage& package, const HeadTopology& head,
                                          const Eigen::Matrix3Xd& reference,
                                          const std::map<std::string, Eigen::VectorXd>& regions);

} // namespace lineament::build
