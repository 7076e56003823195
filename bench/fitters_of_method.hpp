// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include <map>
#include <string>

namespace lineament::bench {

/// Fitters of one method, "thesis" or "joint", with its default options, for the schemes of both detectors; an
/// outline beside the mesh counts.
class FittersOfMethod
{
public:
    /// @param iterations  Of "thesis"; joint fits settle.
    FittersOfMethod(const MorphableModel& model, const std::string& method, int iterations = FitOptions().iterations)
    {
        for (const char* scheme : {"ibug68", "mediapipe478"}) {
            if (method == "joint") {
                JointOptions options;
                options.outline_beside_scheme = true;
                joint_.try_emplace(scheme, model, scheme, options, &kernels::dispatched_kernels());
            } else {
                FitOptions options;
                options.outline_beside_scheme = true;
                options.iterations = iterations;
                thesis_.try_emplace(scheme, model, scheme, options);
            }
        }
    }

    [[nodiscard]] FitResult fit(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px) const
    {
        return thesis_.empty() ? joint_.at(landmarks.scheme).fit(landmarks, principal_point_px).fit
                               : thesis_.at(landmarks.scheme).fit(landmarks, principal_point_px);
    }

private:
    std::map<std::string, FaceFitter> thesis_ = {};
    std::map<std::string, JointFitter> joint_ = {};
};

} // namespace lineament::bench
