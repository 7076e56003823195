// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/face_fitter.hpp"

#include <Eigen/Core>

#include <span>
#include <string>
#include <vector>

namespace lineament {

/// How often the prior on the identity counts when images are stacked.
enum class PriorCount
{
    once,      ///< One identity, one prior: more images, more certainty.
    per_frame, ///< Multiplied by the number of images, as other programs do; more images then hardly help.
};

struct MultiFrameOptions
{
    FitOptions fit = {};
    PriorCount prior_count = PriorCount::once;
};

struct MultiFrameResult
{
    FitStatus status = FitStatus::too_few_correspondences;
    std::string reason = {};
    Eigen::VectorXd shape_coefficients = {}; ///< m, shared by all frames.
    std::vector<FitResult> frames = {};      ///< In the order given; one without a pose keeps its own status.
    int num_used_frames = 0;                 ///< With a usable pose; the others do not touch the identity.
};

/// One identity from several images of one person, each with its own camera and expression: the rows of Eq. (4) of all
/// frames stacked over one prior, the rest as in FaceFitter::fit.                         docs/maths.md, section 8
///
/// @throws InvalidArgument as FaceFitter and FaceFitter::fit.
/// @par Reference  Huber, Real-time 3D Morphable Shape Model Fitting to Monocular In-the-wild Videos, PhD thesis,
///                 University of Surrey 2017, section 5.1.
[[nodiscard]] MultiFrameResult fit_frames(const FaceFitter& fitter, std::span<const LandmarkSet> frames,
                                          const Eigen::Vector2d& principal_point_px,
                                          PriorCount prior_count = PriorCount::once);

/// As above, with a fitter made for the scheme of the first frame; no frames: too_few_correspondences.
[[nodiscard]] MultiFrameResult fit_frames(const MorphableModel& model, std::span<const LandmarkSet> frames,
                                          const Eigen::Vector2d& principal_point_px,
                                          const MultiFrameOptions& options = {});

} // namespace lineament

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/multi_frame_impl.hpp"
#endif
