// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/core/landmarks.hpp"
#include "lineament/fit/contour_view.hpp"
#include "lineament/model/morphable_model.hpp"

#include <Eigen/Core>

#include <array>
#include <optional>
#include <string_view>
#include <vector>

namespace lineament {

/// Which side of the face its owner would call left or right.
enum class FaceSide
{
    left,
    right,
};

/// How silhouette points and outline landmarks find each other.
enum class OccludingMatch
{
    silhouette_to_landmark, ///< Every silhouette vertex takes its nearest landmark (the thesis's rule): many to one.
    landmark_to_silhouette, ///< Every landmark takes its nearest silhouette vertex.
    none,                   ///< The side turned away gets no matches.
};

struct ContourOptions
{
    double frontal_yaw_deg = 7.5;   ///< Up to here both sides count as facing the camera.
    double hysteresis_deg = 1.0;    ///< A view is left only this far beyond the limit, so that it does not flicker.
    double max_distance_mm = 12.0;  ///< A silhouette match farther away than this, in model units, is dropped.
    double occlusion_depth_mm = 20; ///< A silhouette vertex is hidden if the head lies this far in front of it: more
                                    ///< than a round cheek rises within a cell of the depth buffer (15 mm).
    OccludingMatch occluding_match = OccludingMatch::landmark_to_silhouette;
};

/// One outline landmark tied to one model vertex.
struct ContourMatch
{
    int landmark_index = 0; ///< Into the landmark set given.
    int vertex = 0;
    double distance_px = 0.0; ///< Between the two when matched.
};

struct ContourMatches
{
    std::vector<ContourMatch> matches = {};
    ContourView view = ContourView::frontal; ///< Pass it to the next call.
};

/// What of a model can be seen as the outline of the face, prepared once: candidate vertices ear to chin for a side
/// that faces the camera, and for a side turned away its mesh edges with the two triangles at each.
///
/// Silhouette edges are taken where a jaw or cheek can be: not on ears or neck (masks "ears", "neck"), not above the
/// top of the outline landmarks, and above the mouth only outside |x| = 30 mm, so that no nose is taken for a cheek.
/// Edges at the border of the mesh or of that region do not count.
class ContourModel
{
public:
    /// @throws InvalidArgument if the model has no levels, or the scheme ibug68 is not among its landmark maps.
    explicit ContourModel(const MorphableModel& model);

    [[nodiscard]] Eigen::Index num_vertices() const { return num_vertices_; }

    /// Candidate vertices of a side, ear to chin.
    [[nodiscard]] const std::vector<int>& candidates(FaceSide side) const;

    /// The vertices read by silhouette_vertices: the leading `num_occluder_vertices()` (the coarsest level), and these
    /// of a side, ascending.
    [[nodiscard]] const std::vector<int>& region_vertices(FaceSide side) const { return side_of(side).vertices; }
    [[nodiscard]] Eigen::Index num_occluder_vertices() const { return num_occluder_vertices_; }

    /// An edge of the region where a silhouette can be, with the triangles at it.
    struct Edge
    {
        std::array<int, 2> vertices;
        std::array<int, 2> triangles; ///< Columns of triangles().
    };
    [[nodiscard]] const std::vector<Edge>& edges(FaceSide side) const { return side_of(side).edges; }
    /// The triangles at these edges, ascending.
    [[nodiscard]] const std::vector<int>& region_triangles(FaceSide side) const { return side_of(side).triangles; }
    [[nodiscard]] const Eigen::Matrix3Xi& triangles() const { return triangles_; }          ///< Of the finest level.
    [[nodiscard]] const Eigen::Matrix3Xi& occluder_triangles() const { return occluders_; } ///< Of the coarsest.

    /// Vertices on the silhouette of a side and not hidden by the rest of the head, ascending.
    ///
    /// An edge is on the silhouette if one of its triangles faces the camera and the other does not. Hidden means: the
    /// coarsest level's triangles, drawn into a depth buffer of 2 mm cells, lie `occlusion_depth_mm` in front.
    /// @param shape_vertices  3 x V, mm.
    [[nodiscard]] std::vector<int> silhouette_vertices(const Eigen::Ref<const Eigen::Matrix3Xf>& shape_vertices,
                                                       const Camera& camera, FaceSide side,
                                                       double occlusion_depth_mm = 20.0) const;

private:
    struct Side
    {
        std::vector<int> candidates = {};
        std::vector<Edge> edges = {};
        std::vector<int> triangles = {}; ///< At the edges, ascending, into triangles_.
        std::vector<int> vertices = {};  ///< Of these, without the occluders', ascending.
    };

    void add_edges(const MorphableModel& model);
    [[nodiscard]] const Side& side_of(FaceSide side) const { return side == FaceSide::left ? left_ : right_; }

    Eigen::Index num_vertices_ = 0;
    Eigen::Index num_occluder_vertices_ = 0;
    Eigen::Matrix3Xi triangles_ = {}; ///< Finest level.
    Eigen::Matrix3Xi occluders_ = {}; ///< Coarsest level.
    Side left_ = {};
    Side right_ = {};
};

/// The side of the face an outline landmark of ibug68 lies on: "1".."8" right, "10".."17" left; in sets of another
/// scheme with outline_prefix before the number. Nothing for any other name; "9", the chin, is a fixed point.
[[nodiscard]] std::optional<FaceSide> outline_side(std::string_view scheme, std::string_view name);

/// The view of a head at a yaw angle, given the view before (hysteresis).
[[nodiscard]] ContourView contour_view(double yaw_rad, ContourView before, const ContourOptions& options = {});

/// The outline landmarks of ibug68 tied to the vertices seen as the outline in this pose.
///
/// On a side that faces the camera each landmark takes the nearest projected candidate; on the side turned away
/// silhouette vertices and landmarks are matched by `occluding_match`. Landmarks of confidence 0 are left out.
///
/// @param shape_vertices  3 x V, mm. In a frontal view, or with the occluding side ignored, only candidates are read;
///                        otherwise these and the vertices ContourModel names for the side turned away.
/// @param before          The view of the round before; `frontal` at first.
/// @throws InvalidArgument if shape_vertices has another size.
/// @par Cost  One pass over the region's triangles and the coarsest level's; no ray is cast.
[[nodiscard]] ContourMatches match_contour(const ContourModel& contour,
                                           const Eigen::Ref<const Eigen::Matrix3Xf>& shape_vertices,
                                           const Camera& camera, const LandmarkSet& landmarks,
                                           ContourView before = ContourView::frontal,
                                           const ContourOptions& options = {});

} // namespace lineament

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/contour_impl.hpp"
#include "lineament/fit/silhouette_impl.hpp"
#endif
