// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/angles.hpp"
#include "lineament/fit/fit_result.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <vector>

namespace lineament {

struct FrameSelectionOptions
{
    double bin_deg = 10.0; ///< Width of the bins of yaw and pitch, > 0; bins are centred on 0.
    int max_frames = 20;   ///< >= 1.
};

/// Frames that see the head from well-spread directions: of every yaw and pitch bin the one with the least rms in model
/// units, and of these at most `max_frames`, from the most frontal on always the one farthest from those chosen.
///
/// Frames of a status other than success are left out. @return positions in `fits`, ascending.
/// @throws InvalidArgument on bad options.
[[nodiscard]] inline std::vector<int> select_spread_frames(std::span<const FitResult> fits,
                                                           const FrameSelectionOptions& options = {})
{
    require(std::isfinite(options.bin_deg) && options.bin_deg > 0, "select_spread_frames", "options.bin_deg",
            "a finite number > 0", to_text(options.bin_deg));
    require(options.max_frames >= 1, "select_spread_frames", "options.max_frames", ">= 1",
            std::to_string(options.max_frames));
    struct Candidate
    {
        int frame;
        double rms_mm;
        Eigen::Vector2d angles_deg;
    };
    std::map<std::pair<int, int>, Candidate> bins;
    for (std::size_t f = 0; f < fits.size(); ++f) {
        if (fits[f].status != FitStatus::success) {
            continue;
        }
        const HeadAngles angles = angles_from_rotation(fits[f].camera.camera_from_model);
        const Candidate candidate{static_cast<int>(f), fits[f].rms_px / fits[f].camera.scale_px_per_mm,
                                  Eigen::Vector2d(degrees(angles.yaw), degrees(angles.pitch))};
        const std::pair<int, int> bin(static_cast<int>(std::lround(candidate.angles_deg.x() / options.bin_deg)),
                                      static_cast<int>(std::lround(candidate.angles_deg.y() / options.bin_deg)));
        const auto [best, is_new] = bins.try_emplace(bin, candidate);
        if (!is_new && candidate.rms_mm < best->second.rms_mm) {
            best->second = candidate;
        }
    }
    std::vector<Candidate> left;
    for (const auto& [bin, candidate] : bins) {
        left.push_back(candidate);
    }
    std::vector<Eigen::Vector2d> chosen_angles;
    std::vector<int> chosen;
    while (!left.empty() && static_cast<int>(chosen.size()) < options.max_frames) {
        // Most frontal first, then farthest from the nearest chosen.
        const auto score = [&](const Candidate& candidate) {
            double nearest = std::numeric_limits<double>::infinity();
            for (const Eigen::Vector2d& angles : chosen_angles) {
                nearest = std::min(nearest, (angles - candidate.angles_deg).norm());
            }
            return chosen_angles.empty() ? -candidate.angles_deg.norm() : nearest;
        };
        const auto next = std::max_element(left.begin(), left.end(),
                                           [&](const Candidate& a, const Candidate& b) { return score(a) < score(b); });
        chosen.push_back(next->frame);
        chosen_angles.push_back(next->angles_deg);
        left.erase(next);
    }
    std::sort(chosen.begin(), chosen.end());
    return chosen;
}

} // namespace lineament
