// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// match_contour and ContourModel::silhouette_vertices without allocation, on points of the packed model.
#include "lineament/fit/realtime_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_REALTIME_CONTOUR_IMPL_HPP
#define LINEAMENT_FIT_REALTIME_CONTOUR_IMPL_HPP

#include "lineament/camera/angles.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

namespace lineament::detail {

inline void RealtimeFit::match_contour()
{
    if (frame_.has_outline) {
        const FitOptions& options = fitter_.reference_.options();
        frame_.view =
            contour_view(yaw_from_rotation(frame_.camera.camera_from_model), frame_.view, options.contour_matching);
        clear_matches();
        for (const FaceSide side : {FaceSide::right, FaceSide::left}) {
            if (frame_.outline[static_cast<int>(side)].count == 0) {
                continue;
            }
            if (frame_.view != (side == FaceSide::left ? ContourView::shows_right : ContourView::shows_left)) {
                match_candidates(side);
            } else if (options.contour == ContourMode::both &&
                       options.contour_matching.occluding_match != OccludingMatch::none) {
                frame_.first_silhouette_match = frame_.num_matches;
                match_silhouette(side);
                frame_.num_silhouette_matches = frame_.num_matches - frame_.first_silhouette_match;
            }
        }
        std::fill_n(frame_.information.data() + num_points(), 8, 0.0);
        update_match_positions();
    }
    set_scale();
}

inline void RealtimeFit::clear_matches()
{
    frame_.num_matches = 0;
    frame_.num_silhouette_matches = 0;
}

/// On the silhouette.
inline void RealtimeFit::add_match(const OutlineLandmarks& outline, int landmark, int row)
{
    const int point = num_points();
    const int match = frame_.num_matches++;
    frame_.match_landmarks[match] = outline.landmark_indices[landmark];
    frame_.match_rows[match] = row;
    frame_.match_candidates[match] = -1;
    frame_.match_roots[match] = outline.roots[landmark];
    frame_.seen_u[point] = frame_.seen_u[outline.first_slot + landmark];
    frame_.seen_v[point] = frame_.seen_v[outline.first_slot + landmark];
    frame_.information[point] = outline.information[landmark];
}

/// Of every landmark of a side with its nearest candidate.
inline void RealtimeFit::add_candidate_matches(const OutlineLandmarks& outline, const ContourRegion& region,
                                               const int* nearest)
{
    const int point = num_points();
    const int first = frame_.num_matches;
    const int max_count = OutlineLandmarks::max_count; // whole vectors, more than are used
    std::copy_n(frame_.seen_u.data() + outline.first_slot, max_count, frame_.seen_u.data() + point);
    std::copy_n(frame_.seen_v.data() + outline.first_slot, max_count, frame_.seen_v.data() + point);
    std::copy(outline.information.begin(), outline.information.end(), frame_.information.data() + point);
    std::copy(outline.landmark_indices.begin(), outline.landmark_indices.end(), frame_.match_landmarks.data() + first);
    std::copy(outline.roots.begin(), outline.roots.end(), frame_.match_roots.data() + first);
    int* const rows = frame_.match_rows.data() + first;
    int* const candidates = frame_.match_candidates.data() + first;
    for (int i = 0; i < outline.count; ++i) {
        rows[i] = region.candidate_rows[nearest[i]];
        candidates[i] = region.first_candidate + nearest[i];
    }
    frame_.num_matches = first + outline.count;
}

/// Ends a list of projected points as kernels read it.
inline void end_projected(int count, RealtimeBuffers& work)
{
    const int padding = kernels::round_up(count, 8) - count;
    std::fill_n(work.projected_u.data() + count, padding, std::numeric_limits<double>::infinity());
    std::fill_n(work.projected_v.data() + count, padding, std::numeric_limits<double>::infinity());
}

/// Position of the projected point nearest to (u, v), the first of equals, and the squared distance.
inline std::pair<int, double> RealtimeFit::nearest_projected(int count, double u, double v)
{
    double* squared = work_.squared_distances.data();
    const int nearest =
        kernels_.nearest_point(work_.projected_u.data(), work_.projected_v.data(), count, u, v, squared);
    return {nearest, squared[nearest]};
}

/// Where a model point is seen, in double precision as match_contour has it [px from the principal point].
[[nodiscard]] inline Eigen::Vector2d project_point(const Camera& camera, double x, double y, double z)
{
    const Eigen::Matrix3d& r = camera.camera_from_model;
    const double s = camera.scale_px_per_mm;
    return {s * (r(0, 0) * x + r(0, 1) * y + r(0, 2) * z + camera.translation_mm.x()),
            s * (r(1, 0) * x + r(1, 1) * y + r(1, 2) * z + camera.translation_mm.y())};
}

/// Where points x0 y0 z0 x1 ... are seen [px from the principal point]; whole vectors of them are read and written.
inline void RealtimeFit::project(const float* points, int count, AlignedBuffer<double>& u,
                                 AlignedBuffer<double>& v) const
{
    const std::array<double, 8> m = image_from_model();
    kernels_.see_points(points, count, m.data(), u.data(), v.data());
}

inline void RealtimeFit::match_candidates(FaceSide side_name)
{
    const int side = static_cast<int>(side_name);
    const ContourRegion& region = pack_.regions[side];
    evaluate_candidates();
    const int count = static_cast<int>(region.candidate_rows.size());
    if (count == 0) {
        return;
    }
    project(work_.candidates.data() + 3 * region.first_candidate, count, work_.projected_u, work_.projected_v);
    const OutlineLandmarks& outline = frame_.outline[side];
    int nearest[OutlineLandmarks::max_count];
    kernels_.nearest_points(work_.projected_u.data(), work_.projected_v.data(), count,
                            frame_.seen_u.data() + outline.first_slot, frame_.seen_v.data() + outline.first_slot,
                            outline.count, nearest);
    add_candidate_matches(outline, region, nearest);
}

inline void RealtimeFit::match_silhouette(FaceSide side_name)
{
    const int side = static_cast<int>(side_name);
    const ContourRegion& region = pack_.regions[side];
    const ContourOptions& options = fitter_.reference_.options().contour_matching;
    evaluate(side_name == FaceSide::left ? PointSet::left_region : PointSet::right_region, work_.region);
    find_silhouette(region);
    if (work_.silhouette.empty()) {
        return;
    }
    see_occluders();

    const int step = region.vertices.axis_step;
    const float* seen_x = work_.seen.data();
    const auto hidden = [&](int i) {
        const float* seen = seen_x + work_.silhouette[i];
        return is_hidden(seen[0], seen[step], seen[2 * step]);
    };
    int count = 0;
    for (const int vertex : work_.silhouette) {
        const float* points = work_.region.data() + vertex;
        const Eigen::Vector2d seen = project_point(frame_.camera, points[0], points[step], points[2 * step]);
        work_.projected_u[count] = seen.x();
        work_.projected_v[count] = seen.y();
        work_.projected_rows[count] = region.rows[vertex];
        ++count;
    }
    end_projected(count, work_);
    constexpr double infinity = std::numeric_limits<double>::infinity();
    const double max_distance_px = options.max_distance_mm * frame_.camera.scale_px_per_mm;
    const auto is_near = [&](double squared) { return squared < infinity && std::sqrt(squared) <= max_distance_px; };
    const OutlineLandmarks& outline = frame_.outline[side];
    const double* outline_u = frame_.seen_u.data() + outline.first_slot;
    const double* outline_v = frame_.seen_v.data() + outline.first_slot;
    if (options.occluding_match == OccludingMatch::landmark_to_silhouette) {
        for (int i = 0; i < outline.count; ++i) {
            // Hidden points are dropped when they are about to be matched: few are ever asked.
            auto [nearest, squared] = nearest_projected(count, outline_u[i], outline_v[i]);
            while (is_near(squared) && hidden(nearest)) {
                work_.projected_u[nearest] = infinity;
                std::tie(nearest, squared) = nearest_projected(count, outline_u[i], outline_v[i]);
            }
            if (is_near(squared)) {
                add_match(outline, i, work_.projected_rows[nearest]);
            }
        }
        return;
    }
    for (int i = 0; i < count; ++i) {
        int nearest = -1;
        double least = infinity;
        for (int l = 0; l < outline.count; ++l) {
            const double du = outline_u[l] - work_.projected_u[i];
            const double dv = outline_v[l] - work_.projected_v[i];
            if (du * du + dv * dv < least) {
                least = du * du + dv * dv;
                nearest = l;
            }
        }
        if (is_near(least) && !hidden(i)) {
            add_match(outline, nearest, work_.projected_rows[i]);
        }
    }
}

/// The camera as transform_points takes it: ContourModel's x, y and depth in mm.
inline void set_transform(const Camera& camera, float* transform)
{
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) {
            transform[4 * row + column] = static_cast<float>(camera.camera_from_model(row, column));
        }
        transform[4 * row + 3] = row < 2 ? static_cast<float>(camera.translation_mm[row]) : 0.0f;
    }
}

/// work_.silhouette: the region's vertices on the silhouette, hidden or not, ascending; and the cells around them.
inline void RealtimeFit::find_silhouette(const ContourRegion& region)
{
    const int step = region.vertices.axis_step;
    float transform[12];
    set_transform(frame_.camera, transform);
    kernels_.transform_points(work_.region.data(), step, region.vertices.num_points, transform, work_.seen.data(),
                              step);
    const float* x = work_.seen.data();
    const float* y = x + step;
    unsigned char* is_facing = work_.is_facing.data(); // bytes may lie anywhere: hold on to where they do
    for (const auto& [a, b, c] : region.triangles) {
        *is_facing++ = (x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a]) < 0; // y points down
    }
    is_facing = work_.is_facing.data();
    unsigned char* is_marked = work_.is_marked.data();
    const int count = static_cast<int>(region.rows.size());
    std::fill_n(is_marked, count, static_cast<unsigned char>(0));
    for (const ContourRegion::Edge& edge : region.edges) {
        if (is_facing[edge.triangles[0]] != is_facing[edge.triangles[1]]) {
            is_marked[edge.vertices[0]] = 1;
            is_marked[edge.vertices[1]] = 1;
        }
    }
    work_.silhouette.resize(count);
    int* end = work_.silhouette.data(); // without a branch on what cannot be foreseen
    for (int vertex = 0; vertex < count; ++vertex) {
        *end = vertex;
        end += is_marked[vertex];
    }
    work_.silhouette.resize(end - work_.silhouette.data());
    if (work_.silhouette.empty()) {
        return;
    }
    constexpr float infinity = std::numeric_limits<float>::infinity();
    float low_x = infinity, high_x = -infinity, low_y = infinity, high_y = -infinity;
    for (const int vertex : work_.silhouette) {
        low_x = std::min(low_x, x[vertex]);
        high_x = std::max(high_x, x[vertex]);
        low_y = std::min(low_y, y[vertex]);
        high_y = std::max(high_y, y[vertex]);
    }
    const auto num_cells = [](float length) {
        return static_cast<int>(std::min(length * DepthCells::inverse_size + 1, 1024.0f)); // as many as DepthBuffer's
    };
    work_.depth_cells = {low_x, low_y, num_cells(high_x - low_x), num_cells(high_y - low_y)};
}

/// Where the coarsest level is seen, and the boxes of its groups of triangles.
inline void RealtimeFit::see_occluders()
{
    evaluate(PointSet::occluders, work_.occluders);
    float transform[12];
    set_transform(frame_.camera, transform);
    const Eigen::Map<const Eigen::Matrix<float, 4, 3>> columns(transform); // transposed: a row of the camera each
    const auto column = [&](int c) { return Eigen::Array4f(columns(c, 0), columns(c, 1), columns(c, 2), 0.0f); };
    const Eigen::Array4f of_x = column(0), of_y = column(1), of_z = column(2), shift = column(3);
    for (int i = 0; i < pack_.occluders.num_points; ++i) {
        const float* point = work_.occluders.data() + 3 * i;
        work_.occluders_seen[i] = of_x * point[0] + of_y * point[1] + of_z * point[2] + shift;
    }
    for (std::size_t g = 0; g < pack_.occluder_groups.size(); ++g) {
        const OccluderGroup& group = pack_.occluder_groups[g];
        Eigen::Array4f low = work_.occluders_seen[pack_.occluder_group_vertices[group.first_vertex]];
        Eigen::Array4f high = low;
        for (int at = group.first_vertex + 1; at < group.last_vertex; ++at) {
            const Eigen::Array4f& seen = work_.occluders_seen[pack_.occluder_group_vertices[at]];
            low = low.min(seen);
            high = high.max(seen);
        }
        work_.group_lows[g] = low;
        work_.group_highs[g] = high;
    }
}

/// Whether DepthBuffer would have a depth more than occlusion_depth_mm in front of this point of the silhouette:
/// whether a triangle of the coarsest level has, at the centre of the point's cell.
inline bool RealtimeFit::is_hidden(float x, float y, float depth) const
{
    const DepthCells& cells = work_.depth_cells;
    const int column = static_cast<int>((x - cells.low_x) * DepthCells::inverse_size);
    const int row = static_cast<int>((y - cells.low_y) * DepthCells::inverse_size);
    if (column >= cells.columns || row >= cells.rows) {
        return false;
    }
    const float px = static_cast<float>(column) + 0.5f, py = static_cast<float>(row) + 0.5f;
    const float limit = depth - static_cast<float>(fitter_.reference_.options().contour_matching.occlusion_depth_mm);
    // Boxes a little wider than they are, so that rounding loses none.
    const float centre_x = cells.low_x + px / DepthCells::inverse_size;
    const float centre_y = cells.low_y + py / DepthCells::inverse_size;
    const Eigen::Array4f above(centre_x + 0.01f, centre_y + 0.01f, limit + 0.01f, 1.0f);
    const Eigen::Array4f below(centre_x - 0.01f, centre_y - 0.01f, -std::numeric_limits<float>::infinity(), -1.0f);
    for (std::size_t g = 0; g < pack_.occluder_groups.size(); ++g) {
        if ((work_.group_lows[g] > above).any() || (work_.group_highs[g] < below).any()) {
            continue;
        }
        for (int t = pack_.occluder_groups[g].first_triangle; t < pack_.occluder_groups[g].last_triangle; ++t) {
            const Eigen::Array4f& a = work_.occluders_seen[pack_.occluder_triangles[t][0]];
            const Eigen::Array4f& b = work_.occluders_seen[pack_.occluder_triangles[t][1]];
            const Eigen::Array4f& c = work_.occluders_seen[pack_.occluder_triangles[t][2]];
            const auto to_cells = [](float value, float low) { return (value - low) * DepthCells::inverse_size; };
            const float ax = to_cells(a.x(), cells.low_x), ay = to_cells(a.y(), cells.low_y);
            const float bx = to_cells(b.x(), cells.low_x), by = to_cells(b.y(), cells.low_y);
            const float cx = to_cells(c.x(), cells.low_x), cy = to_cells(c.y(), cells.low_y);
            const float area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
            const float inverse_area = 1.0f / area;
            const float of_b = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) * inverse_area;
            const float of_c = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) * inverse_area;
            if (area != 0 && of_b >= 0 && of_c >= 0 && of_b + of_c <= 1 &&
                a.z() + of_b * (b.z() - a.z()) + of_c * (c.z() - a.z()) < limit) {
                return true;
            }
        }
    }
    return false;
}

} // namespace lineament::detail

#endif
