// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/contour.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/fit/contour_support_impl.hpp"
#include "lineament/fit/inline.hpp"

#include <limits>

namespace lineament {

LINEAMENT_FIT_INLINE std::optional<FaceSide> outline_side(std::string_view scheme, std::string_view name)
{
    if (scheme != "ibug68") {
        if (!name.starts_with(outline_prefix)) {
            return std::nullopt;
        }
        name.remove_prefix(outline_prefix.size());
    }
    if (name.empty() || name.size() > 2 || name.find_first_not_of("0123456789") != std::string_view::npos ||
        name.front() == '0') {
        return std::nullopt;
    }
    int number = 0;
    for (const char digit : name) {
        number = 10 * number + (digit - '0');
    }
    if (number <= 8) {
        return FaceSide::right;
    }
    if (number >= 10 && number <= 17) {
        return FaceSide::left;
    }
    return std::nullopt;
}

LINEAMENT_FIT_INLINE ContourView contour_view(double yaw_rad, ContourView before, const ContourOptions& options)
{
    const double yaw_deg = degrees(yaw_rad);
    const double widened = before == ContourView::frontal ? options.hysteresis_deg : -options.hysteresis_deg;
    // Leaving the frontal view takes more than entering it.
    const double limit = options.frontal_yaw_deg + widened;
    if (std::abs(yaw_deg) <= limit) {
        return ContourView::frontal;
    }
    return yaw_deg > 0 ? ContourView::shows_right : ContourView::shows_left;
}

LINEAMENT_FIT_INLINE ContourMatches match_contour(const ContourModel& contour,
                                                  const Eigen::Ref<const Eigen::Matrix3Xf>& shape_vertices,
                                                  const Camera& camera, const LandmarkSet& landmarks,
                                                  ContourView before, const ContourOptions& options)
{
    require_size(shape_vertices.cols(), contour.num_vertices(), "match_contour", "shape_vertices");
    ContourMatches result;
    result.view = contour_view(angles_from_rotation(camera.camera_from_model).yaw, before, options);
    const double max_distance_px = options.max_distance_mm * camera.scale_px_per_mm;

    for (const FaceSide side : {FaceSide::right, FaceSide::left}) {
        const bool is_occluding =
            result.view == (side == FaceSide::left ? ContourView::shows_right : ContourView::shows_left);
        if (is_occluding && options.occluding_match == OccludingMatch::none) {
            continue;
        }
        std::vector<int> seen; // the outline landmarks of this side
        for (std::size_t l = 0; l < landmarks.landmarks.size(); ++l) {
            const Landmark& landmark = landmarks.landmarks[l];
            if (landmark.confidence > 0 && outline_side(landmarks.scheme, landmark.name) == side) {
                seen.push_back(static_cast<int>(l));
            }
        }
        if (seen.empty()) {
            continue;
        }
        const std::vector<int> vertices =
            is_occluding ? contour.silhouette_vertices(shape_vertices, camera, side, options.occlusion_depth_mm)
                         : contour.candidates(side);
        const Eigen::Matrix2Xd projected = detail::project_vertices(shape_vertices, vertices, camera);

        if (is_occluding && options.occluding_match == OccludingMatch::silhouette_to_landmark) {
            Eigen::Matrix2Xd points(2, static_cast<Eigen::Index>(seen.size()));
            for (std::size_t i = 0; i < seen.size(); ++i) {
                points.col(static_cast<Eigen::Index>(i)) = landmarks.landmarks[seen[i]].point_px;
            }
            for (std::size_t v = 0; v < vertices.size(); ++v) {
                const auto [nearest, distance_px] =
                    detail::nearest_column(points, projected.col(static_cast<Eigen::Index>(v)));
                if (distance_px <= max_distance_px) {
                    result.matches.push_back({seen[nearest], vertices[v], distance_px});
                }
            }
            continue;
        }
        for (const int l : seen) {
            const auto [nearest, distance_px] = detail::nearest_column(projected, landmarks.landmarks[l].point_px);
            if (nearest >= 0 && (!is_occluding || distance_px <= max_distance_px)) {
                result.matches.push_back({l, vertices[nearest], distance_px});
            }
        }
    }
    return result;
}

} // namespace lineament
