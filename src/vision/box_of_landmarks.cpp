// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/core/checks.hpp"
#include "lineament/vision/dlib_detector.hpp"

#include <cmath>

namespace lineament {
namespace {

// Medians over the detections in annotated photos (bench/detector_bench): the side of the detector's box
// in units of the landmarks' spread, and its centre relative to their centroid in units of its side.
constexpr double side_per_spread = 3.41;
constexpr double centre_y_per_side = 0.005;

} // namespace

FaceBox box_of(const LandmarkSet& landmarks)
{
    Eigen::Matrix<double, 2, 51> points;
    points.setConstant(std::nan(""));
    for (const Landmark& landmark : landmarks.landmarks) {
        for (int i = 0; i < 51; ++i) {
            if (landmark.name == std::to_string(18 + i)) {
                points.col(i) = landmark.point_px;
            }
        }
    }
    require(landmarks.scheme == "ibug68", "box_of", "landmarks", "scheme ibug68", landmarks.scheme);
    for (int i = 0; i < 51; ++i) {
        require(points.col(i).allFinite(), "box_of", "landmarks", "finite points 18 ... 68",
                "none for " + std::to_string(18 + i));
    }
    const Eigen::Vector2d centroid = points.rowwise().mean();
    const double spread = std::sqrt((points.colwise() - centroid).squaredNorm() / 51.0);
    require(spread > 0.0, "box_of", "landmarks", "points that differ", "all in one point");
    const double side = side_per_spread * spread;
    return {.left = centroid.x() - 0.5 * side,
            .top = centroid.y() + (centre_y_per_side - 0.5) * side,
            .width = side,
            .height = side};
}

} // namespace lineament
