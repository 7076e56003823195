// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What RealtimeFitter packs of a model, and the buffers it works in.                                  docs/realtime.md
#pragma once

#include "lineament/camera/camera.hpp"
#include "lineament/fit/contour.hpp"
#include "lineament/fit/fit_result.hpp"
#include "lineament/kernels/aligned_buffer.hpp"
#include "lineament/kernels/kernels.hpp"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace lineament::detail {

using kernels::AlignedBuffer;

/// Faces whose coefficients stay in the nearest cache, with a panel's columns.
inline constexpr int batch_size = 32;

/// Where the coordinates of points stand: x0 y0 z0 x1 ..., or all x, then all y, then all z, each padded to panels.
enum class CoordinateOrder
{
    interleaved,
    planar,
};

/// Mean and columns of points in panels of 64 coordinates.
struct PointPanels
{
    int num_points = 0;
    int num_panels = 0;
    int axis_step = 1; ///< From x to y of a point.
    int point_step = 3;
    AlignedBuffer<float> mean = {};
    AlignedBuffer<float> identity = {};
    AlignedBuffer<float> expression = {};

    [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(num_panels) * kernels::panel_size; }
};

/// Whether coefficients are finite and nothing made of them overflows in single precision.
[[nodiscard]] inline bool is_moderate(const Eigen::VectorXd& coefficients)
{
    return coefficients.cwiseAbs().sum() <= 1e6;
}

/// Panels with columns of 16-bit integers times a scale.
struct ShortPanels
{
    AlignedBuffer<std::int16_t> integers = {};
    std::vector<float> scales = {}; ///< Of the columns.
};

/// The memory of kernels::SparseColumns.
struct ColumnBlocks
{
    std::vector<kernels::SparseColumns::Run> runs = {};
    std::vector<int> offsets = {};
    std::vector<std::uint16_t> columns = {};
    AlignedBuffer<float> values = {};

    [[nodiscard]] kernels::SparseColumns view() const
    {
        return {runs.data(), static_cast<int>(runs.size()), offsets.data(), columns.data(), values.data()};
    }
};

/// Row-major rows of points, three each, in full width.
struct PointRows
{
    AlignedBuffer<float> mean = {}; ///< x0 y0 z0 x1 ...
    AlignedBuffer<float> identity = {};
    AlignedBuffer<float> expression = {};
};

/// One side's silhouette region.
struct ContourRegion
{
    struct Edge
    {
        std::array<int, 2> vertices;
        std::array<int, 2> triangles;
    };
    int first_candidate = 0;              ///< Among RealtimePack::candidates.
    std::vector<int> candidate_rows = {}; ///< Into RealtimePack::contour_rows.
    PointPanels vertices = {};            ///< Those of its triangles, ascending.
    std::vector<std::array<int, 3>> triangles = {};
    std::vector<Edge> edges = {};
    std::vector<int> rows = {}; ///< Of each region vertex, into contour_rows; -1: at no edge.
};

/// Triangles of the coarsest level that lie together, and their vertices: where these begin and end.
struct OccluderGroup
{
    int first_triangle, last_triangle; ///< Of RealtimePack::occluder_triangles; the last is not in it.
    int first_vertex, last_vertex;     ///< Of RealtimePack::occluder_group_vertices, likewise.
};

/// Where a landmark of the map is found.
struct MapEntry
{
    int fixed_index = -1; ///< Among the fixed points, or
    int rest_index = -1;  ///< among the others.
    bool is_outline = false;
    FaceSide side = FaceSide::left; ///< Of an outline landmark.
    bool is_measured = true;        ///< Its noise is finite.
};

/// Points that a fit evaluates together.
enum class PointSet
{
    fixed,
    rest,
    candidates,
    left_region,
    right_region,
    occluders,
};
inline constexpr int num_point_sets = 6;

/// A model in single precision, laid out for the kernels.
struct RealtimePack
{
    int num_shape = 0;        ///< m
    int num_expressions = 0;  ///< k
    int shape_width = 0;      ///< Of identity rows: m and a right side, rounded up.
    int expression_width = 0; ///< Of expression rows.
    bool has_contour = false;

    std::vector<MapEntry> map = {};
    PointPanels fixed = {}; ///< Landmarks tied to their points.
    int first_match = 0;    ///< Points of a fit are the fixed ones, and from here on, a multiple of 8, the matches.
    PointPanels rest = {};  ///< The others, for the result only.
    PointRows fixed_rows = {};
    std::vector<double> fixed_information = {}; ///< Weight of each before scale and confidence.
    double contour_information = 0.0;           ///< Of a matched landmark.
    /// Six matrices, docs/realtime.md, Eq. (5), of all fixed points with these weights.
    AlignedBuffer<float> identity_grams = {};
    AlignedBuffer<float> expression_grams = {};

    PointPanels candidates = {}; ///< Of both sides.
    PointPanels occluders = {};
    std::vector<std::array<int, 3>> occluder_triangles = {}; ///< Group by group.
    std::vector<OccluderGroup> occluder_groups = {};
    std::vector<int> occluder_group_vertices = {};
    std::array<ContourRegion, 2> regions = {}; ///< By FaceSide.
    PointRows contour_rows = {};
    std::vector<int> contour_vertices = {}; ///< Of these rows.
    int max_matches = 0;

    PointPanels mesh = {};
    ShortPanels short_identity = {}, short_expression = {}; ///< If any, instead of the columns in `mesh`.
    ColumnBlocks mesh_expression_blocks = {};               ///< Where that spares reading, these columns once more.

    [[nodiscard]] const PointPanels& panels(PointSet set) const
    {
        switch (set) {
        case PointSet::fixed:
            return fixed;
        case PointSet::rest:
            return rest;
        case PointSet::candidates:
            return candidates;
        case PointSet::left_region:
            return regions[static_cast<int>(FaceSide::left)].vertices;
        case PointSet::right_region:
            return regions[static_cast<int>(FaceSide::right)].vertices;
        case PointSet::occluders:
            break;
        }
        return occluders;
    }
};

/// S(a, 0) wherever a fit looks, each set of points evaluated when it is first asked for.
struct NeutralShape
{
    AlignedBuffer<float> alpha_row = {}; ///< What the known sets belong to.
    std::array<bool, num_point_sets> is_known = {};
    std::array<AlignedBuffer<float>, num_point_sets> points = {};
    AlignedBuffer<float> contour = {}; ///< Of each of contour_rows, those that are known.
    std::vector<unsigned char> is_row_known = {};
    AlignedBuffer<float> mesh = {};
};

/// The cells in which ContourModel asks for depths, from the corner of the silhouette's box.
struct DepthCells
{
    static constexpr float inverse_size = 1.0f / 2.0f;
    float low_x = 0, low_y = 0;
    int columns = 0, rows = 0;
};

/// The outline landmarks of one side.
struct OutlineLandmarks
{
    static constexpr int max_count = 8;

    int count = 0;
    int first_slot = 0; ///< Of max_count in RealtimeFrame::seen_u and seen_v.
    std::array<int, max_count> landmark_indices = {};
    std::array<double, max_count> information = {}; ///< Weight before scale.
    std::array<float, max_count> roots = {};        ///< Its root.
};

/// What the fit of one image keeps from step to step, beside the identity.
struct RealtimeFrame
{
    std::vector<int> landmark_of_fixed = {};    ///< -1: not seen.
    std::vector<int> map_indices = {};          ///< Of each landmark given.
    std::vector<std::uint64_t> name_keys = {};  ///< Of each, by name_key.
    std::vector<int> slots = {};                ///< Of each, where in seen_u and seen_v it stands.
    int first_outline_slot = 0, spare_slot = 0; ///< Those of the outline, by side; that of all that are not used.
    bool is_plain = false; ///< The landmarks were the map's, in its order, seen for certain and without depth.
    /// Where points are seen, and behind them outline landmarks, matched or not [px], from the principal point.
    AlignedBuffer<double> seen_u = {}, seen_v = {};
    AlignedBuffer<double> information = {};       ///< Weight before scale; 0: not seen, or no point.
    std::array<OutlineLandmarks, 2> outline = {}; ///< By FaceSide.
    bool has_outline = false;
    bool has_depth = false; ///< Of any landmark that the fit can use.
    bool is_nominal = true; ///< Every fixed point seen with confidence 1: the Gram matrices hold.
    int num_fixed_seen = 0;

    // Of matches, room for RealtimePack::max_matches.
    int num_matches = 0;
    int num_silhouette_matches = 0; ///< They follow each other, from first_silhouette_match on.
    int first_silhouette_match = 0;
    std::vector<int> match_landmarks = {};
    std::vector<int> match_rows = {};       ///< Of RealtimePack::contour_rows.
    std::vector<int> match_candidates = {}; ///< Among RealtimePack::candidates; -1: found on the silhouette.
    std::vector<float> match_roots = {};    ///< Roots of the information.

    std::vector<double> psi = {};
    std::vector<signed char> bound_state = {}; ///< 0 free, -1 at 0, 1 at the upper bound.
    int num_held = 0;
    ContourView view = ContourView::frontal;
    Camera camera = {};
    std::array<float, 6> jacobian = {}; ///< s R_2.
    bool has_scale = false;
    double scale_factor = 1; ///< Weight of a point: this times its information.
    std::array<double, kernels::num_pose_moments> fixed_moments = {}; ///< Of the fixed points as they are, if known.
    bool are_fixed_moments_known = false;
    FitStatus status = FitStatus::success;
    std::string reason = {};
};

/// What several images say of the identity at given cameras and expressions, whatever their number: for each point
/// sum w J^T J (xx yy zz xy xz yz) and sum w J^T (y - x).                                      docs/realtime.md
struct IdentitySums
{
    std::array<double, 6> grams = {}; ///< How often each matrix of RealtimePack::identity_grams counts.
    AlignedBuffer<double> fixed_right_side = {};
    std::vector<double> fixed_information = {}; ///< Of images that lack a point.
    bool has_fixed_information = false;
    std::vector<double> contour_information = {}, contour_right_side = {}; ///< Of each of contour_rows.
    std::vector<unsigned char> is_touched = {};
    std::vector<int> touched = {}; ///< Rows that are not zero.
};

/// Everything a fit writes; sized once.
struct RealtimeBuffers
{
    std::vector<RealtimeFrame> frames = {}; ///< The first one is that of single fits.
    IdentitySums sums = {};
    NeutralShape neutral = {};
    std::vector<double> alpha = {};
    AlignedBuffer<float> alpha_row = {}, psi_row = {}; ///< Padded to full width.

    AlignedBuffer<float> points = {}; ///< S(a, psi) of fixed points and matches.
    AlignedBuffer<float> rest = {};   ///< And of the others.
    std::vector<int> new_rows = {};   ///< Matched, but not known of this identity.
    AlignedBuffer<float> new_points = {}, match_offset = {};

    std::vector<int> present = {};
    std::vector<float> roots = {};
    AlignedBuffer<float> factors = {}; ///< Of the rows of points.
    AlignedBuffer<float> rows = {};    ///< Projected.
    AlignedBuffer<float> system = {};  ///< Widest of all.
    AlignedBuffer<float> gram = {};
    AlignedBuffer<float> right_side = {}, step = {}, free_step = {}, gradient = {};
    std::vector<signed char> next_state = {};
    AlignedBuffer<float> is_free = {}; ///< 1 of expressions that are, 0 of others.
    std::vector<int> free = {};

    AlignedBuffer<float> candidates = {};
    AlignedBuffer<float> region = {}, seen = {}; ///< Planar.
    std::vector<unsigned char> is_facing = {}, is_marked = {};
    std::vector<int> silhouette = {};
    DepthCells depth_cells = {};
    AlignedBuffer<float> occluders = {};
    std::vector<Eigen::Array4f> occluders_seen = {};               ///< x, y and depth [mm].
    std::vector<Eigen::Array4f> group_lows = {}, group_highs = {}; ///< Of each group the box.
    AlignedBuffer<double> projected_u = {}, projected_v = {}, squared_distances = {};
    AlignedBuffer<double> fitted_u = {}, fitted_v = {}, squared_residuals = {};
    std::vector<int> projected_rows = {};
    AlignedBuffer<float> mesh = {}, mesh_coefficients = {};
    AlignedBuffer<float> batch_coefficients = {}; ///< Of batch_size faces.
    AlignedBuffer<float> batch_panel = {};        ///< Of one face.
    AlignedBuffer<float> batch_columns = {};      ///< Of that panel, widened.
};

} // namespace lineament::detail
