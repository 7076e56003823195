// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/core/checks.hpp"
#include "lineament/io/landmark_file.hpp"
#include "lineament/vision/mesh_detector.hpp"

namespace lineament {

LandmarkSet ibug68_from_mediapipe(const LandmarkSet& set)
{
    require(set.scheme == "mediapipe478", "ibug68_from_mediapipe", "set.scheme", "mediapipe478", set.scheme);
    LandmarkSet result = {.scheme = "ibug68"};
    for (int i = 0; i < 468; ++i) {
        const std::string name = ibug68_name_of_mediapipe_point(i);
        if (name.empty()) {
            continue;
        }
        if (const std::optional<Landmark> landmark = set.find(std::to_string(i))) {
            result.landmarks.push_back(*landmark);
            result.landmarks.back().name = name;
        }
    }
    for (const Landmark& landmark : set.landmarks) {
        if (landmark.name.starts_with(outline_prefix)) {
            result.landmarks.push_back(landmark);
            result.landmarks.back().name.erase(0, outline_prefix.size());
        }
    }
    return result;
}

} // namespace lineament
