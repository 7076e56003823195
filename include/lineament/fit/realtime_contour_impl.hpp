// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// match_contour and ContourModel::silhouette_vertices without allocation, on points of the packed model.
#include "lineament/fit/realtime_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_REALTIME_CONTOUR_IMPL_HPP
#define LINEAMENT_FIT_REALTIME_CONTOUR_IMPL_HPP

#include "lineament/camera/angles.hpp"

namespace lineament::detail {

inline void RealtimeFit::match_contour()
{
    if (has_outline_) {
        const FitOptions& options = fitter_.reference_.options();
        view_ = contour_view(angles_from_rotation(camera_.camera_from_model).yaw, view_, options.contour_matching);
        work_.matches.clear();
        work_.match_rows.clear();
        for (const FaceSide side : {FaceSide::right, FaceSide::left}) {
            if (work_.outline[static_cast<int>(side)].empty()) {
                continue;
            }
            if (view_ != (side == FaceSide::left ? ContourView::shows_right : ContourView::shows_left)) {
                match_candidates(side);
            } else if (options.contour == ContourMode::both &&
                       options.contour_matching.occluding_match != OccludingMatch::none) {
                match_silhouette(side);
            }
        }
        update_matches_neutral();
        update_positions();
    }
    set_scale();
}

inline void RealtimeFit::add_match(const OutlineLandmark& landmark, int row)
{
    work_.matches.push_back(
        {landmark.landmark_index, landmark.u, landmark.v, landmark.confidence * pack_.contour_information});
    work_.match_rows.push_back(row);
}

/// Position of the point nearest to (u, v) of the first `count` projected ones and the squared distance; -1: none.
[[nodiscard]] inline std::pair<int, double> nearest_projected(const RealtimeBuffers& work, int count, double u,
                                                              double v)
{
    int nearest = -1;
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < count; ++i) {
        const double du = work.projected_u[i] - u;
        const double dv = work.projected_v[i] - v;
        const double distance = du * du + dv * dv;
        if (distance < least) {
            least = distance;
            nearest = i;
        }
    }
    return {nearest, least};
}

/// Where a model point is seen, in double precision as match_contour has it [px from the principal point].
[[nodiscard]] inline Eigen::Vector2d project_point(const Camera& camera, double x, double y, double z)
{
    const Eigen::Matrix3d& r = camera.camera_from_model;
    const double s = camera.scale_px_per_mm;
    return {s * (r(0, 0) * x + r(0, 1) * y + r(0, 2) * z + camera.translation_mm.x()),
            s * (r(1, 0) * x + r(1, 1) * y + r(1, 2) * z + camera.translation_mm.y())};
}

inline void RealtimeFit::match_candidates(FaceSide side_name)
{
    const int side = static_cast<int>(side_name);
    const ContourRegion& region = pack_.regions[side];
    evaluate(region.candidates, neutral().candidates[side], work_.neutral.candidates[side], work_.candidates[side]);
    const int step = region.candidates.axis_step;
    const float* points = work_.candidates[side].data();
    const int count = region.candidates.num_points;
    for (int i = 0; i < count; ++i) {
        const Eigen::Vector2d seen = project_point(camera_, points[i], points[step + i], points[2 * step + i]);
        work_.projected_u[i] = seen.x();
        work_.projected_v[i] = seen.y();
    }
    for (const OutlineLandmark& landmark : work_.outline[side]) {
        const int nearest = nearest_projected(work_, count, landmark.u, landmark.v).first;
        if (nearest >= 0) {
            add_match(landmark, region.candidate_rows[nearest]);
        }
    }
}

inline void RealtimeFit::match_silhouette(FaceSide side_name)
{
    const int side = static_cast<int>(side_name);
    const ContourRegion& region = pack_.regions[side];
    const ContourOptions& options = fitter_.reference_.options().contour_matching;
    evaluate(pack_.occluders, neutral().occluders, work_.neutral.occluders, work_.occluders);
    evaluate(region.vertices, neutral().regions[side], work_.neutral.regions[side], work_.region);
    find_silhouette(region);

    const int num_occluders = pack_.occluders.num_points;
    int count = 0;
    for (const int vertex : work_.silhouette) {
        const bool is_occluder = vertex < num_occluders;
        const float* points = is_occluder ? work_.occluders.data() : work_.region.data();
        const int step = is_occluder ? pack_.occluders.axis_step : region.vertices.axis_step;
        const int at = is_occluder ? vertex : vertex - num_occluders;
        const Eigen::Vector2d seen = project_point(camera_, points[at], points[step + at], points[2 * step + at]);
        work_.projected_u[count] = seen.x();
        work_.projected_v[count] = seen.y();
        work_.projected_rows[count] = region.rows[vertex];
        ++count;
    }
    const double max_distance_px = options.max_distance_mm * camera_.scale_px_per_mm;
    const std::vector<OutlineLandmark>& outline = work_.outline[side];
    if (options.occluding_match == OccludingMatch::landmark_to_silhouette) {
        for (const OutlineLandmark& landmark : outline) {
            const auto [nearest, squared] = nearest_projected(work_, count, landmark.u, landmark.v);
            if (nearest >= 0 && std::sqrt(squared) <= max_distance_px) {
                add_match(landmark, work_.projected_rows[nearest]);
            }
        }
        return;
    }
    for (int i = 0; i < count; ++i) {
        const OutlineLandmark* nearest = nullptr;
        double least = std::numeric_limits<double>::infinity();
        for (const OutlineLandmark& landmark : outline) {
            const double du = landmark.u - work_.projected_u[i];
            const double dv = landmark.v - work_.projected_v[i];
            if (du * du + dv * dv < least) {
                least = du * du + dv * dv;
                nearest = &landmark;
            }
        }
        if (nearest != nullptr && std::sqrt(least) <= max_distance_px) {
            add_match(*nearest, work_.projected_rows[i]);
        }
    }
}

/// work_.silhouette: the region's vertices on the silhouette and not hidden, ascending.
inline void RealtimeFit::find_silhouette(const ContourRegion& region)
{
    const Eigen::Matrix3f r = camera_.camera_from_model.cast<float>();
    const Eigen::Vector2f t = camera_.translation_mm.cast<float>();
    const float xx = r(0, 0), xy = r(0, 1), xz = r(0, 2), yx = r(1, 0), yy = r(1, 1), yz = r(1, 2);
    const float zx = r(2, 0), zy = r(2, 1), zz = r(2, 2), tx = t.x(), ty = t.y();
    const auto see = [&](const float* points, int step, int count, int to) {
        const float* x = points;
        const float* y = points + step;
        const float* z = points + 2 * step;
        float* seen_x = work_.seen_x.data() + to;
        float* seen_y = work_.seen_y.data() + to;
        float* seen_z = work_.seen_z.data() + to;
        for (int i = 0; i < count; ++i) {
            seen_x[i] = xx * x[i] + xy * y[i] + xz * z[i] + tx;
            seen_y[i] = yx * x[i] + yy * y[i] + yz * z[i] + ty;
            seen_z[i] = zx * x[i] + zy * y[i] + zz * z[i];
        }
    };
    const int num_occluders = pack_.occluders.num_points;
    see(work_.occluders.data(), pack_.occluders.axis_step, num_occluders, 0);
    see(work_.region.data(), region.vertices.axis_step, region.vertices.num_points, num_occluders);

    const float* x = work_.seen_x.data();
    const float* y = work_.seen_y.data();
    for (std::size_t i = 0; i < region.triangles.size(); ++i) {
        const auto& [a, b, c] = region.triangles[i];
        work_.is_facing[i] = (x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a]) < 0; // y points down
    }
    std::fill_n(work_.is_marked.begin(), region.rows.size(), static_cast<unsigned char>(0));
    for (const ContourRegion::Edge& edge : region.edges) {
        const unsigned char turns = work_.is_facing[edge.triangles[0]] ^ work_.is_facing[edge.triangles[1]];
        work_.is_marked[edge.vertices[0]] |= turns;
        work_.is_marked[edge.vertices[1]] |= turns;
    }
    work_.silhouette.clear();
    for (int vertex = 0; vertex < static_cast<int>(region.rows.size()); ++vertex) {
        if (work_.is_marked[vertex]) {
            work_.silhouette.push_back(vertex);
        }
    }
    if (!work_.silhouette.empty()) {
        drop_hidden();
    }
}

/// What DepthBuffer decides, asked only at the cells of silhouette vertices: a triangle is drawn where one of these is.
inline void RealtimeFit::drop_hidden()
{
    constexpr float inverse_cell = 1.0f / 2.0f;
    const float depth_mm = static_cast<float>(fitter_.reference_.options().contour_matching.occlusion_depth_mm);
    const float* x = work_.seen_x.data();
    const float* y = work_.seen_y.data();
    const float* z = work_.seen_z.data();
    float low_x = x[work_.silhouette.front()], high_x = low_x;
    float low_y = y[work_.silhouette.front()], high_y = low_y;
    float farthest = z[work_.silhouette.front()];
    for (const int vertex : work_.silhouette) {
        low_x = std::min(low_x, x[vertex]);
        high_x = std::max(high_x, x[vertex]);
        low_y = std::min(low_y, y[vertex]);
        high_y = std::max(high_y, y[vertex]);
        farthest = std::max(farthest, z[vertex]);
    }
    const int columns = static_cast<int>(std::min((high_x - low_x) * inverse_cell + 1, 1024.0f));
    const int rows = static_cast<int>(std::min((high_y - low_y) * inverse_cell + 1, 1024.0f));

    // The silhouette by rows of cells.
    const int count = static_cast<int>(work_.silhouette.size());
    int* cells = work_.silhouette_cells.data(); // column, row; -1: outside, never hidden
    int* begins = work_.row_begins.data();
    std::fill_n(begins, rows + 2, 0);
    for (int i = 0; i < count; ++i) {
        const int vertex = work_.silhouette[i];
        const int column = static_cast<int>(std::floor((x[vertex] - low_x) * inverse_cell));
        const int row = static_cast<int>(std::floor((y[vertex] - low_y) * inverse_cell));
        const bool is_inside = column >= 0 && column < columns && row >= 0 && row < rows;
        cells[2 * i] = column;
        cells[2 * i + 1] = is_inside ? row : -1;
        if (is_inside) {
            ++begins[row + 2];
        }
    }
    for (int row = 2; row < rows + 2; ++row) {
        begins[row] += begins[row - 1];
    }
    for (int i = 0; i < count; ++i) {
        if (cells[2 * i + 1] >= 0) {
            work_.by_row[begins[cells[2 * i + 1] + 1]++] = i;
        }
    }
    std::fill_n(work_.is_marked.begin(), count, static_cast<unsigned char>(0)); // now: hidden

    // A triangle wholly beyond one border of the box, or nowhere near enough in front, hides nothing.
    const int num_occluders = pack_.occluders.num_points;
    const float margin = 0.01f; // mm, more than the rounding of an interpolated depth
    const float nearest = farthest - depth_mm + margin;
    for (int i = 0; i < num_occluders; ++i) {
        work_.outcodes[i] = static_cast<unsigned char>((x[i] < low_x) | (x[i] > high_x + 2) << 1 | (y[i] < low_y) << 2 |
                                                       (y[i] > high_y + 2) << 3 | (z[i] > nearest) << 4);
    }
    const auto to_cell = [](float value, int limit) {
        return static_cast<int>(std::clamp(value + 0.5f, 0.0f, static_cast<float>(limit)));
    };
    for (const auto& [a, b, c] : pack_.occluder_triangles) {
        if ((work_.outcodes[a] & work_.outcodes[b] & work_.outcodes[c]) != 0) {
            continue;
        }
        const float ax = (x[a] - low_x) * inverse_cell, ay = (y[a] - low_y) * inverse_cell;
        const float bx = (x[b] - low_x) * inverse_cell, by = (y[b] - low_y) * inverse_cell;
        const float cx = (x[c] - low_x) * inverse_cell, cy = (y[c] - low_y) * inverse_cell;
        const float area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
        if (area == 0) {
            continue;
        }
        const int left = to_cell(std::min({ax, bx, cx}), columns);
        const int right = to_cell(std::max({ax, bx, cx}), columns);
        const int top = to_cell(std::min({ay, by, cy}), rows);
        const int bottom = to_cell(std::max({ay, by, cy}), rows);
        const float inverse_area = 1.0f / area;
        for (int at = begins[top]; at < begins[bottom]; ++at) {
            const int i = work_.by_row[at];
            const int column = cells[2 * i];
            if (column < left || column >= right || work_.is_marked[i]) {
                continue;
            }
            const float px = static_cast<float>(column) + 0.5f;
            const float py = static_cast<float>(cells[2 * i + 1]) + 0.5f;
            const float of_b = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) * inverse_area;
            const float of_c = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) * inverse_area;
            if (of_b >= 0 && of_c >= 0 && of_b + of_c <= 1) {
                const float depth = z[a] + of_b * (z[b] - z[a]) + of_c * (z[c] - z[a]);
                work_.is_marked[i] = depth < z[work_.silhouette[i]] - depth_mm;
            }
        }
    }
    int kept = 0;
    for (int i = 0; i < count; ++i) {
        if (!work_.is_marked[i]) {
            work_.silhouette[kept++] = work_.silhouette[i];
        }
    }
    work_.silhouette.resize(kept);
}

} // namespace lineament::detail

#endif
