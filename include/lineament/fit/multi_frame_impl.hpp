// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/multi_frame.hpp"

#include "lineament/fit/frame_fit_impl.hpp"
#include "lineament/fit/inline.hpp"

namespace lineament {

LINEAMENT_FIT_INLINE MultiFrameResult fit_frames(const FaceFitter& fitter, std::span<const LandmarkSet> frames,
                                                 const Eigen::Vector2d& principal_point_px, PriorCount prior_count)
{
    MultiFrameResult result;
    Eigen::VectorXd alpha = Eigen::VectorXd::Zero(fitter.num_shape_coefficients());
    const Eigen::VectorXd neutral = alpha;
    std::vector<detail::FrameFit> fits;
    std::vector<char> has_pose;
    fits.reserve(frames.size());
    for (const LandmarkSet& landmarks : frames) {
        fits.emplace_back(fitter, landmarks, principal_point_px, nullptr);
        has_pose.push_back(fits.back().estimate_pose(alpha));
        if (has_pose.back()) {
            fits.back().fit_expression(alpha);
        }
    }
    IdentityResult identity;
    const int iterations = fitter.options().iterations;
    for (int iteration = 0; iteration < iterations; ++iteration) {
        IdentitySystem system(alpha.size());
        int num_used = 0;
        for (std::size_t f = 0; f < fits.size(); ++f) {
            if (has_pose[f]) {
                fits[f].match_contour(alpha);
                has_pose[f] = fits[f].estimate_pose(alpha);
            }
            if (has_pose[f]) {
                fits[f].add_to(system, alpha);
                ++num_used;
            }
        }
        if (num_used == 0) {
            break;
        }
        IdentityOptions options;
        options.regularization =
            fitter.options().regularization * (prior_count == PriorCount::per_frame ? num_used : 1);
        identity = system.solve(options);
        alpha = identity.coefficients;
        for (std::size_t f = 0; f < fits.size(); ++f) {
            if (has_pose[f]) {
                fits[f].fit_expression(alpha);
            }
        }
    }
    for (std::size_t f = 0; f < fits.size(); ++f) {
        result.num_used_frames += has_pose[f];
        if (has_pose[f]) {
            fits[f].turn_by_depth(alpha);
        }
    }
    if (result.num_used_frames == 0) {
        alpha = neutral;
        result.reason = "no frame has a usable pose";
    } else {
        result.status = identity.status;
        result.reason = identity.reason;
    }
    for (std::size_t f = 0; f < fits.size(); ++f) {
        result.frames.push_back(fits[f].result(has_pose[f] ? alpha : neutral, iterations));
    }
    result.shape_coefficients = alpha;
    return result;
}

LINEAMENT_FIT_INLINE MultiFrameResult fit_frames(const MorphableModel& model, std::span<const LandmarkSet> frames,
                                                 const Eigen::Vector2d& principal_point_px,
                                                 const MultiFrameOptions& options)
{
    const FaceFitter fitter(model, frames.empty() ? "ibug68" : frames.front().scheme, options.fit);
    return fit_frames(fitter, frames, principal_point_px, options.prior_count);
}

} // namespace lineament
