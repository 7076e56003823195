// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// match_contour and ContourModel::silhouette_vertices without allocation, on points of the packed model.
#include "lineament/fit/realtime_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_REALTIME_CONTOUR_IMPL_HPP
#define LINEAMENT_FIT_REALTIME_CONTOUR_IMPL_HPP

#include "lineament/camera/angles.hpp"

namespace lineament::detail {

/// Height of the bands in which the silhouette's extent is gathered.
inline constexpr float band_mm = 4.0f;

inline void RealtimeFit::match_contour()
{
    if (frame_.has_outline) {
        const FitOptions& options = fitter_.reference_.options();
        frame_.view = contour_view(angles_from_rotation(frame_.camera.camera_from_model).yaw, frame_.view,
                                   options.contour_matching);
        frame_.matches.clear();
        frame_.match_rows.clear();
        bool has_candidates = false;
        for (const FaceSide side : {FaceSide::right, FaceSide::left}) {
            if (frame_.outline[static_cast<int>(side)].empty()) {
                continue;
            }
            if (frame_.view != (side == FaceSide::left ? ContourView::shows_right : ContourView::shows_left)) {
                if (!has_candidates) {
                    has_candidates = true;
                    evaluate(PointSet::candidates, work_.candidates);
                }
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
    frame_.matches.push_back(
        {landmark.landmark_index, landmark.u, landmark.v, landmark.confidence * pack_.contour_information});
    frame_.match_rows.push_back(row);
}

/// Position of the point nearest to (u, v) of the first `count` projected ones, the first of equals, and the squared
/// distance; -1: none.
[[nodiscard]] inline std::pair<int, double> nearest_projected(RealtimeBuffers& work, int count, double u, double v)
{
    constexpr double infinity = std::numeric_limits<double>::infinity();
    double* squared = work.squared_distances.data();
    for (int i = 0; i < count; ++i) {
        const double du = work.projected_u[i] - u;
        const double dv = work.projected_v[i] - v;
        squared[i] = du * du + dv * dv;
    }
    std::fill_n(squared + count, 3, infinity);
    double least[4] = {infinity, infinity, infinity, infinity}; // four short chains instead of a long one
    for (int i = 0; i < count; i += 4) {
        for (int q = 0; q < 4; ++q) {
            least[q] = std::min(least[q], squared[i + q]);
        }
    }
    const double smallest = std::min(std::min(least[0], least[1]), std::min(least[2], least[3]));
    const double* found = std::find(squared, squared + count, smallest);
    return {found == squared + count ? -1 : static_cast<int>(found - squared), smallest};
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
    const float* points = work_.candidates.data() + 3 * region.first_candidate;
    const int count = static_cast<int>(region.candidate_rows.size());
    for (int i = 0; i < count; ++i) {
        const Eigen::Vector2d seen = project_point(frame_.camera, points[3 * i], points[3 * i + 1], points[3 * i + 2]);
        work_.projected_u[i] = seen.x();
        work_.projected_v[i] = seen.y();
    }
    for (const OutlineLandmark& landmark : frame_.outline[side]) {
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
    evaluate(side_name == FaceSide::left ? PointSet::left_region : PointSet::right_region, work_.region);
    find_silhouette(region);

    const int step = region.vertices.axis_step;
    int count = 0;
    for (const int vertex : work_.silhouette) {
        const float* points = work_.region.data() + vertex;
        const Eigen::Vector2d seen = project_point(frame_.camera, points[0], points[step], points[2 * step]);
        work_.projected_u[count] = seen.x();
        work_.projected_v[count] = seen.y();
        work_.projected_rows[count] = region.rows[vertex];
        ++count;
    }
    const double max_distance_px = options.max_distance_mm * frame_.camera.scale_px_per_mm;
    const std::vector<OutlineLandmark>& outline = frame_.outline[side];
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

/// work_.silhouette: the region's vertices on the silhouette and not hidden, ascending.
inline void RealtimeFit::find_silhouette(const ContourRegion& region)
{
    const int step = region.vertices.axis_step;
    float transform[12];
    set_transform(frame_.camera, transform);
    kernels_.transform_points(work_.region.data(), step, region.vertices.num_points, transform, work_.seen.data(),
                              step);
    const float* x = work_.seen.data();
    const float* y = x + step;
    for (std::size_t i = 0; i < region.triangles.size(); ++i) {
        const auto& [a, b, c] = region.triangles[i];
        work_.is_facing[i] = (x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a]) < 0; // y points down
    }
    std::fill_n(work_.is_marked.begin(), region.rows.size(), static_cast<unsigned char>(0));
    for (const ContourRegion::Edge& edge : region.edges) {
        if (work_.is_facing[edge.triangles[0]] != work_.is_facing[edge.triangles[1]]) {
            work_.is_marked[edge.vertices[0]] = 1;
            work_.is_marked[edge.vertices[1]] = 1;
        }
    }
    work_.silhouette.clear();
    for (int vertex = 0; vertex < static_cast<int>(region.rows.size()); ++vertex) {
        if (work_.is_marked[vertex]) {
            work_.silhouette.push_back(vertex);
        }
    }
    if (!work_.silhouette.empty()) {
        drop_hidden(step);
    }
}

/// Brings work_.occluders within 6 mm of the present shape and returns how far any of them may be from it.
inline float RealtimeFit::update_occluders()
{
    // By the triangle inequality over the coefficients, or by Cauchy and Schwarz; whichever says less.
    double sum = 0;
    double squares = 0;
    for (int j = 0; j < pack_.num_shape; ++j) {
        const double change = work_.alpha[j] - work_.occluder_alpha[j];
        sum += std::abs(change) * pack_.shape_reach[j];
        squares += change * change;
    }
    double moved_mm = std::min(sum, std::sqrt(squares) * pack_.shape_norm);
    for (int j = 0; j < pack_.num_expressions; ++j) {
        moved_mm += std::abs(frame_.psi[j] - work_.occluder_psi[j]) * pack_.expression_reach[j];
    }
    if (!work_.has_occluders || !(moved_mm < 6)) {
        kernels_.combine_panels(pack_.occluders.mean.data(), pack_.occluders.identity.data(),
                                pack_.occluders.num_panels, pack_.num_shape, work_.alpha_row.data(),
                                work_.occluders.data());
        kernels_.combine_panels(work_.occluders.data(), pack_.occluders.expression.data(), pack_.occluders.num_panels,
                                pack_.num_expressions, work_.psi_row.data(), work_.occluders.data());
        work_.occluder_alpha = work_.alpha;
        work_.occluder_psi = frame_.psi;
        work_.has_occluders = true;
        moved_mm = 0;
    }
    return static_cast<float>(moved_mm) + 0.01f; // and more than rounding
}

/// Width of a band's cells: 64 of them hold the whole silhouette.
[[nodiscard]] inline float band_cell_mm(float low_x, float high_x)
{
    return std::max(4.0f, (high_x - low_x) / 63.0f);
}

/// work_.near_triangles: the occluders that may hide one of the silhouette's points in the box, judged from where they
/// were before they moved by at most `moved_mm`; their exact positions, x y z each, in work_.near_seen by slot.
inline void RealtimeFit::find_near_triangles(float moved_mm, const SilhouetteExtent& extent)
{
    const float low_x = extent.low_x, high_x = extent.high_x, low_y = extent.low_y, high_y = extent.high_y;

    const int step = pack_.occluders.axis_step;
    const int count = pack_.occluders.num_points;
    float transform[12];
    set_transform(frame_.camera, transform);
    const float depth_mm = static_cast<float>(fitter_.reference_.options().contour_matching.occlusion_depth_mm);
    const float nearest = extent.farthest - depth_mm;
    kernels_.transform_points(work_.occluders.data(), step, count, transform, work_.occluders_seen.data(), step);
    const float* x = work_.occluders_seen.data();
    const float* y = x + step;
    const float* z = y + step;
    int* outcodes = work_.outcodes.data();
    const float left = low_x - moved_mm, right = high_x + moved_mm, top = low_y - moved_mm, bottom = high_y + moved_mm;
    const float aslant_mm = 1.5f * moved_mm; // more than the root of two
    const float low_sum = extent.low_sum - aslant_mm, high_sum = extent.high_sum + aslant_mm;
    const float low_difference = extent.low_difference - aslant_mm;
    const float high_difference = extent.high_difference + aslant_mm;
    for (int i = 0; i < count; ++i) { // no triangle is near whose corners are all beyond one side of an octagon
        const float sum = x[i] + y[i];
        const float difference = x[i] - y[i];
        outcodes[i] = (x[i] < left ? 1 : 0) | (x[i] > right ? 2 : 0) | (y[i] < top ? 4 : 0) | (y[i] > bottom ? 8 : 0) |
                      (z[i] > nearest + moved_mm ? 16 : 0) | (sum < low_sum ? 32 : 0) | (sum > high_sum ? 64 : 0) |
                      (difference < low_difference ? 128 : 0) | (difference > high_difference ? 256 : 0);
    }
    const int num_bands = static_cast<int>((high_y - low_y) / band_mm) + 1;
    const auto to_band = [&](float distance) {
        return static_cast<int>(std::clamp(distance / band_mm, 0.0f, static_cast<float>(num_bands - 1)));
    };
    const float cell_mm = band_cell_mm(low_x, high_x);
    const auto to_cell = [&](float distance) { return static_cast<int>(std::clamp(distance / cell_mm, 0.0f, 63.0f)); };
    // Lists grow without a branch on what is in them: neighbours in the list are not neighbours on the face.
    int* near_triangles = work_.near_triangles.data();
    int num_inside = 0;
    for (int t = 0; t < static_cast<int>(pack_.occluder_triangles.size()); ++t) {
        const auto& [a, b, c] = pack_.occluder_triangles[t];
        near_triangles[num_inside] = t;
        num_inside += (outcodes[a] & outcodes[b] & outcodes[c]) == 0;
    }
    num_near_triangles_ = 0;
    for (int i = 0; i < num_inside; ++i) {
        const int t = near_triangles[i];
        const auto& [a, b, c] = pack_.occluder_triangles[t];
        const float first_x = std::min(std::min(x[a], x[b]), x[c]) - moved_mm;
        const float last_x = std::max(std::max(x[a], x[b]), x[c]) + moved_mm;
        const float least_z = std::min(std::min(z[a], z[b]), z[c]) - moved_mm + depth_mm;
        const int first_band = to_band(std::min(std::min(y[a], y[b]), y[c]) - moved_mm - low_y);
        const int last_band = to_band(std::max(std::max(y[a], y[b]), y[c]) + moved_mm - low_y);
        const std::uint64_t cells =
            (~std::uint64_t{0} << to_cell(first_x - low_x)) & (~std::uint64_t{0} >> (63 - to_cell(last_x - low_x)));
        int is_near = 0; // no branch in this loop
        for (int band = first_band; band <= last_band; ++band) {
            is_near |= int{(cells & work_.bands[band].cells) != 0} & int{least_z < work_.bands[band].farthest};
        }
        near_triangles[num_near_triangles_] = t;
        num_near_triangles_ += is_near;
    }
    for (const int vertex : work_.near_vertices) {
        work_.near_slots[vertex] = -1;
    }
    work_.near_vertices.clear();
    for (int i = 0; i < num_near_triangles_; ++i) {
        for (const int vertex : pack_.occluder_triangles[near_triangles[i]]) {
            if (work_.near_slots[vertex] < 0) {
                work_.near_slots[vertex] = static_cast<int>(work_.near_vertices.size());
                work_.near_vertices.push_back(vertex);
            }
        }
    }
    const int num_near = static_cast<int>(work_.near_vertices.size());
    kernels_.multiply_rows(pack_.occluder_rows.identity.data(), pack_.shape_width, work_.near_vertices.data(), num_near,
                           work_.alpha_row.data(), work_.near_neutral.data());
    kernels_.multiply_rows(pack_.occluder_rows.expression.data(), pack_.expression_width, work_.near_vertices.data(),
                           num_near, work_.psi_row.data(), work_.near_offset.data());
    for (int i = 0; i < num_near; ++i) {
        float point[3];
        for (int axis = 0; axis < 3; ++axis) {
            point[axis] = pack_.occluder_rows.mean[3 * work_.near_vertices[i] + axis] +
                          work_.near_neutral[3 * i + axis] + work_.near_offset[3 * i + axis];
        }
        for (int axis = 0; axis < 3; ++axis) {
            const float* row = transform + 4 * axis;
            work_.near_seen[3 * i + axis] = row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3];
        }
    }
}

/// What DepthBuffer decides, asked only at the cells of silhouette vertices: a triangle is drawn where one of these is.
inline void RealtimeFit::drop_hidden(int step)
{
    constexpr float inverse_cell = 1.0f / 2.0f;
    const float depth_mm = static_cast<float>(fitter_.reference_.options().contour_matching.occlusion_depth_mm);
    const float* x = work_.seen.data();
    const float* y = x + step;
    const float* z = y + step;
    SilhouetteExtent extent;
    for (const int vertex : work_.silhouette) {
        extent.add(x[vertex], y[vertex], z[vertex]);
    }
    const float low_x = extent.low_x, high_x = extent.high_x, low_y = extent.low_y, high_y = extent.high_y;
    const int columns = static_cast<int>(std::min((high_x - low_x) * inverse_cell + 1, static_cast<float>(max_cells)));
    const int rows = static_cast<int>(std::min((high_y - low_y) * inverse_cell + 1, static_cast<float>(max_cells)));

    // The silhouette by rows of cells, and its extent by bands.
    const int count = static_cast<int>(work_.silhouette.size());
    const int num_bands = static_cast<int>((high_y - low_y) / band_mm) + 1;
    if (num_bands > max_cells) {
        return; // 4 m: no face
    }
    std::fill_n(work_.bands.begin(), num_bands, SilhouetteBand{});
    const float cell_mm = band_cell_mm(low_x, high_x);
    int* cells = work_.silhouette_cells.data(); // column, row; -1: outside, never hidden
    int* begins = work_.row_begins.data();
    std::fill_n(begins, rows + 2, 0);
    for (int i = 0; i < count; ++i) {
        const int vertex = work_.silhouette[i];
        const int column = static_cast<int>((x[vertex] - low_x) * inverse_cell);
        const int row = static_cast<int>((y[vertex] - low_y) * inverse_cell);
        const bool is_inside = column < columns && row < rows;
        cells[2 * i] = column;
        cells[2 * i + 1] = is_inside ? row : -1;
        if (is_inside) {
            ++begins[row + 2];
        }
        SilhouetteBand& band = work_.bands[static_cast<int>((y[vertex] - low_y) / band_mm)];
        band.cells |= std::uint64_t{1} << static_cast<int>(std::min((x[vertex] - low_x) / cell_mm, 63.0f));
        band.farthest = std::max(band.farthest, z[vertex]);
    }
    // A point is judged at its cell's centre, less than a cell away.
    find_near_triangles(update_occluders() + 1 / inverse_cell, extent);
    if (num_near_triangles_ == 0) {
        return;
    }
    for (int row = 2; row < rows + 2; ++row) {
        begins[row] += begins[row - 1];
    }
    for (int i = 0; i < count; ++i) {
        if (cells[2 * i + 1] >= 0) {
            work_.by_row[begins[cells[2 * i + 1] + 1]++] = i;
        }
    }
    std::fill_n(work_.is_hidden.begin(), count, static_cast<unsigned char>(0));
    const auto to_cell = [](float value, int limit) {
        return static_cast<int>(std::clamp(value + 0.5f, 0.0f, static_cast<float>(limit)));
    };
    for (int near = 0; near < num_near_triangles_; ++near) {
        const int t = work_.near_triangles[near];
        const float* a = work_.near_seen.data() + 3 * work_.near_slots[pack_.occluder_triangles[t][0]];
        const float* b = work_.near_seen.data() + 3 * work_.near_slots[pack_.occluder_triangles[t][1]];
        const float* c = work_.near_seen.data() + 3 * work_.near_slots[pack_.occluder_triangles[t][2]];
        const float ax = (a[0] - low_x) * inverse_cell, ay = (a[1] - low_y) * inverse_cell;
        const float bx = (b[0] - low_x) * inverse_cell, by = (b[1] - low_y) * inverse_cell;
        const float cx = (c[0] - low_x) * inverse_cell, cy = (c[1] - low_y) * inverse_cell;
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
            if (column < left || column >= right || work_.is_hidden[i]) {
                continue;
            }
            const float px = static_cast<float>(column) + 0.5f;
            const float py = static_cast<float>(cells[2 * i + 1]) + 0.5f;
            const float of_b = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) * inverse_area;
            const float of_c = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) * inverse_area;
            if (of_b >= 0 && of_c >= 0 && of_b + of_c <= 1) {
                const float depth = a[2] + of_b * (b[2] - a[2]) + of_c * (c[2] - a[2]);
                work_.is_hidden[i] = depth < z[work_.silhouette[i]] - depth_mm;
            }
        }
    }
    int kept = 0;
    for (int i = 0; i < count; ++i) {
        if (!work_.is_hidden[i]) {
            work_.silhouette[kept++] = work_.silhouette[i];
        }
    }
    work_.silhouette.resize(kept);
}

} // namespace lineament::detail

#endif
