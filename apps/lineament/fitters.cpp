// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "fitters.hpp"

#include "console.hpp"

#include "lineament/vision/mesh_detector.hpp"

namespace lineament::cli {

LandmarkSet Fitters::in_scheme_of_model(LandmarkSet landmarks) const
{
    if (model_->find_landmark_map(landmarks.scheme) != nullptr) {
        return landmarks;
    }
    if (landmarks.scheme == "mediapipe478" && model_->find_landmark_map("ibug68") != nullptr) {
        return ibug68_from_mediapipe(landmarks);
    }
    std::string known;
    for (const LandmarkMap& map : model_->landmark_maps) {
        known += (known.empty() ? "" : ", ") + map.scheme;
    }
    throw Failure(bad_input, "the model " + model_->name + " has no landmarks of the scheme " + landmarks.scheme +
                                 " (it has: " + known + ")");
}

const FaceFitter& Fitters::for_scheme(const std::string& scheme)
{
    const auto known = fitters_.find(scheme);
    return known != fitters_.end() ? known->second
                                   : fitters_.emplace(scheme, FaceFitter(*model_, scheme, options_)).first->second;
}

} // namespace lineament::cli
