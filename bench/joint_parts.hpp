// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/kernels/kernels.hpp"

namespace lineament::bench {

/// Fits of JointFitter as those of RealtimeFitter, with the meshes of the latter.
void register_joint_parts(const kernels::Kernels& kernels);
/// Single fits and those of some images in double precision, without kernels, with the meshes of the model.
void register_reference_joint_parts();

} // namespace lineament::bench
