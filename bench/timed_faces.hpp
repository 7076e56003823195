// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The faces that realtime_bench times, and their fitters.
#pragma once

#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/kernels/kernels.hpp"
#include "lineament/model/morphable_model.hpp"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace lineament::bench {

inline const Eigen::Vector2d centre(320, 240);

/// lineament-face-1.
[[nodiscard]] const MorphableModel& face_model();

/// Faces drawn from the priors, yaw within 45 degrees (`yaw_deg` fixed: just that), 1.5 px of noise.
[[nodiscard]] const std::vector<LandmarkSet>& faces(int yaw_deg);

/// One face moving by little from frame to frame: 64 frames there, then from the start again.
[[nodiscard]] std::vector<LandmarkSet> video();

/// What a mesh is made of.
enum class MeshKind
{
    none,
    as_stored, ///< By lineament-face-1, in 16 bits where the kernels prefer these.
    single,    ///< Columns in single precision, of a model that was never rounded to 16 bits.
};

[[nodiscard]] const char* suffix_of(MeshKind mesh);

[[nodiscard]] FitOptions options_of(ContourMode mode, const std::string& expression_set, int iterations = 5);

/// Made once for each set of arguments.
[[nodiscard]] const RealtimeFitter& fitter_of(const kernels::Kernels& kernels, const FitOptions& options,
                                              MeshKind mesh = MeshKind::as_stored);

} // namespace lineament::bench
