// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/vision/dlib_outline.hpp"

#include "lineament/vision/mesh_detector.hpp"

namespace lineament {

void add_dlib_outline(LandmarkSet& mesh_points, DlibDetector& detector, const ImageU8& picture)
{
    constexpr int chin = 9; // no part of the outline: a point of the mesh too
    const LandmarkSet found = detector.landmarks(picture, box_of(ibug68_from_mediapipe(mesh_points)));
    for (int number = 1; number <= 17; ++number) {
        if (number == chin) {
            continue;
        }
        if (std::optional<Landmark> landmark = found.find(std::to_string(number))) {
            landmark->name.insert(0, outline_prefix);
            mesh_points.landmarks.push_back(*landmark);
        }
    }
}

} // namespace lineament
