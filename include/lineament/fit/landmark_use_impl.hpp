// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/face_fitter.hpp" // before the guard: it includes the solvers, which include this file

#ifndef LINEAMENT_FIT_LANDMARK_USE_IMPL_HPP
#define LINEAMENT_FIT_LANDMARK_USE_IMPL_HPP

#include <cmath>
#include <string>
#include <vector>

namespace lineament::detail {

/// Names of landmarks are a few letters, for which a call to compare memory takes longer than this.
[[nodiscard]] inline bool is_same_name(const std::string& a, const std::string& b)
{
    if (a.size() != b.size()) {
        return false;
    }
    for (std::size_t i = 0; i < a.size(); ++i) {
        if (a[i] != b[i]) {
            return false;
        }
    }
    return true;
}

/// What a fit does with the landmarks of a set, as positions in it.
struct LandmarkUse
{
    std::vector<int> map_indices = {}; ///< Per landmark: its position in the landmark map, or -1.
    std::vector<int> fixed = {};       ///< Those tied to their map point.
    std::vector<int> outline = {};     ///< Those matched anew for each pose.
};

[[nodiscard]] inline bool is_outline_landmark(const FaceFitter& fitter, const Landmark& landmark)
{
    return outline_side(fitter.scheme(), landmark.name).has_value();
}

/// @throws InvalidArgument in the name of the function on a landmark that is not finite or beyond max_coordinate_px,
///         or a confidence outside [0, 1].
inline void require_usable(const Landmark& landmark, const char* function)
{
    const double depth_px = landmark.depth_px.value_or(0.0);
    const auto is_near = [](double px) { return std::abs(px) <= max_coordinate_px; }; // so it is finite
    if (is_near(landmark.point_px.x()) && is_near(landmark.point_px.y()) && is_near(depth_px) &&
        landmark.confidence >= 0 && landmark.confidence <= 1) {
        return; // no words for hundreds of good ones
    }
    const double largest_px = landmark.point_px.cwiseAbs().maxCoeff();
    const std::string place = "landmark \"" + landmark.name + "\"";
    require_finite(landmark.point_px, function, place.c_str());
    require(landmark.confidence >= 0 && landmark.confidence <= 1, function, (place + ".confidence").c_str(), "0 to 1",
            to_text(landmark.confidence));
    require(std::isfinite(depth_px), function, (place + ".depth_px").c_str(), "a finite number", to_text(depth_px));
    const bool is_depth_far = std::abs(depth_px) > max_coordinate_px;
    throw InvalidArgument(function, (place + (is_depth_far ? ".depth_px" : "")).c_str(),
                          "at most " + to_text(max_coordinate_px) + " px",
                          to_text(is_depth_far ? depth_px : largest_px));
}

/// Landmarks the scheme does not know, of confidence below least_confidence or of infinite noise are not used.
/// @param use  Its memory is used again.
/// @throws InvalidArgument in the name of the function on another scheme, a landmark that is not finite or beyond
///         max_coordinate_px, or a confidence outside [0, 1].
inline void set_use_of_landmarks(const FaceFitter& fitter, const LandmarkSet& landmarks, const char* function,
                                 LandmarkUse& use)
{
    require(landmarks.scheme == fitter.scheme(), function, "landmarks.scheme", fitter.scheme(), landmarks.scheme);
    const LandmarkMap& map = fitter.landmark_map();
    const Eigen::VectorXf* noise_mm = fitter.landmark_noise_mm();
    const auto& sides = fitter.outline_sides();
    const bool has_contour = fitter.contour().has_value();
    const bool is_all_fixed = fitter.options().contour == ContourMode::fixed;
    const bool takes_other_outlines = has_contour && fitter.scheme() != "ibug68";
    const std::size_t num_landmarks = landmarks.landmarks.size();
    use.map_indices.resize(num_landmarks);
    use.fixed.clear();
    use.outline.clear();
    use.fixed.reserve(num_landmarks);
    for (std::size_t l = 0; l < num_landmarks; ++l) {
        const Landmark& landmark = landmarks.landmarks[l];
        require_usable(landmark, function);
        const bool is_in_order =
            l < map.names.size() && is_same_name(map.names[l], landmark.name); // no search for hundreds
        const int map_index = is_in_order ? static_cast<int>(l) : map.index_of(landmark.name);
        use.map_indices[l] = map_index;
        if (landmark.confidence < least_confidence) {
            continue;
        }
        if (map_index < 0) {
            if (takes_other_outlines && is_outline_landmark(fitter, landmark)) {
                use.outline.push_back(static_cast<int>(l));
            }
            continue;
        }
        if (noise_mm != nullptr && std::isinf((*noise_mm)[map_index])) {
            continue;
        }
        if (is_all_fixed || !sides[static_cast<std::size_t>(map_index)]) {
            use.fixed.push_back(static_cast<int>(l));
        } else if (has_contour) {
            use.outline.push_back(static_cast<int>(l));
        }
    }
}

} // namespace lineament::detail

#endif
