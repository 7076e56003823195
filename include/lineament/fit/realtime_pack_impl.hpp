// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// How a model is packed for the kernels, and the buffers sized for it.                                docs/realtime.md
#pragma once

#include "lineament/fit/contour_support_impl.hpp"
#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/realtime_buffers.hpp"
#include "lineament/fit/realtime_mesh_columns_impl.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <optional>

namespace lineament::detail {

[[nodiscard]] inline PointPanels make_panels(const ModelPoints& points, CoordinateOrder order)
{
    PointPanels panels;
    panels.num_points = static_cast<int>(points.num_points());
    const int padded = kernels::round_up(panels.num_points, kernels::panel_size);
    panels.axis_step = order == CoordinateOrder::planar ? padded : 1;
    panels.point_step = order == CoordinateOrder::planar ? 1 : 3;
    panels.num_panels = order == CoordinateOrder::planar
                            ? 3 * padded / kernels::panel_size
                            : kernels::round_up(3 * panels.num_points, kernels::panel_size) / kernels::panel_size;
    const int num_shape = static_cast<int>(points.num_shape_coefficients());
    const int num_expressions = static_cast<int>(points.num_expression_coefficients());
    panels.mean = AlignedBuffer<float>(panels.size());
    panels.identity = AlignedBuffer<float>(panels.size() * num_shape);
    panels.expression = AlignedBuffer<float>(panels.size() * num_expressions);
    for (int i = 0; i < panels.num_points; ++i) {
        for (int axis = 0; axis < 3; ++axis) {
            const int at = axis * panels.axis_step + i * panels.point_step;
            const std::size_t panel = static_cast<std::size_t>(at / kernels::panel_size);
            const std::size_t within = static_cast<std::size_t>(at % kernels::panel_size);
            panels.mean[static_cast<std::size_t>(at)] = static_cast<float>(points.mean(axis, i));
            for (int j = 0; j < num_shape; ++j) {
                panels.identity[(panel * num_shape + j) * kernels::panel_size + within] =
                    static_cast<float>(points.identity(j, 3 * i + axis));
            }
            for (int j = 0; j < num_expressions; ++j) {
                panels.expression[(panel * num_expressions + j) * kernels::panel_size + within] =
                    static_cast<float>(points.expression(j, 3 * i + axis));
            }
        }
    }
    return panels;
}

[[nodiscard]] inline PointRows make_rows(const ModelPoints& points, int shape_width, int expression_width)
{
    const int count = 3 * static_cast<int>(points.num_points());
    PointRows rows;
    rows.mean = AlignedBuffer<float>(count);
    rows.identity = AlignedBuffer<float>(static_cast<std::size_t>(count) * shape_width);
    rows.expression = AlignedBuffer<float>(static_cast<std::size_t>(count) * expression_width);
    for (int r = 0; r < count; ++r) {
        rows.mean[r] = static_cast<float>(points.mean(r % 3, r / 3));
        for (Eigen::Index j = 0; j < points.num_shape_coefficients(); ++j) {
            rows.identity[static_cast<std::size_t>(r) * shape_width + j] = static_cast<float>(points.identity(j, r));
        }
        for (Eigen::Index j = 0; j < points.num_expression_coefficients(); ++j) {
            rows.expression[static_cast<std::size_t>(r) * expression_width + j] =
                static_cast<float>(points.expression(j, r));
        }
    }
    return rows;
}

/// G_xx, G_yy, G_zz, G_xy + G_yx, G_xz + G_zx, G_yz + G_zy of weighted points, summed in double precision.
/// @param columns  As ModelPoints::identity: 3i + a holds row a of point i.
[[nodiscard]] inline AlignedBuffer<float> make_grams(const Eigen::MatrixXd& columns,
                                                     const std::vector<double>& information, int width)
{
    constexpr int first[6] = {0, 1, 2, 0, 0, 1};
    constexpr int second[6] = {0, 1, 2, 1, 2, 2};
    const int size = static_cast<int>(columns.rows());
    AlignedBuffer<float> grams(static_cast<std::size_t>(6) * width * width);
    std::vector<double> sums(static_cast<std::size_t>(size) * size);
    for (int g = 0; g < 6; ++g) {
        sums.assign(sums.size(), 0.0);
        for (std::size_t i = 0; i < information.size(); ++i) {
            const Eigen::Index base = 3 * static_cast<Eigen::Index>(i);
            const double* a = columns.data() + (base + first[g]) * size;
            const double* b = columns.data() + (base + second[g]) * size;
            for (int row = 0; row < size; ++row) {
                const double factor_a = information[i] * a[row];
                const double factor_b = g < 3 ? 0.0 : information[i] * b[row];
                double* target = sums.data() + static_cast<std::size_t>(row) * size;
                for (int column = 0; column < size; ++column) {
                    target[column] += factor_a * b[column] + factor_b * a[column];
                }
            }
        }
        for (int row = 0; row < size; ++row) {
            for (int column = 0; column < size; ++column) {
                grams[(static_cast<std::size_t>(g) * width + row) * width + column] =
                    static_cast<float>(sums[static_cast<std::size_t>(row) * size + column]);
            }
        }
    }
    return grams;
}

/// Puts the triangles in groups of at most 16 by halves of the longest side of their centres' box, and these in order.
/// @param triangles  Of the face `vertices`; those to be grouped come in [begin, end).
inline void group_occluders(const Eigen::Matrix3Xd& vertices, std::size_t begin, std::size_t end, RealtimePack& pack)
{
    using Triangle = std::array<int, 3>;
    const auto first = pack.occluder_triangles.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto last = pack.occluder_triangles.begin() + static_cast<std::ptrdiff_t>(end);
    if (end - begin <= 16) {
        std::vector<int> corners;
        for (auto triangle = first; triangle != last; ++triangle) {
            corners.insert(corners.end(), triangle->begin(), triangle->end());
        }
        sort_unique(corners);
        const int first_vertex = static_cast<int>(pack.occluder_group_vertices.size());
        pack.occluder_group_vertices.insert(pack.occluder_group_vertices.end(), corners.begin(), corners.end());
        pack.occluder_groups.push_back({static_cast<int>(begin), static_cast<int>(end), first_vertex,
                                        static_cast<int>(pack.occluder_group_vertices.size())});
        return;
    }
    const auto centre_of = [&](const Triangle& t) -> Eigen::Vector3d {
        return (vertices.col(t[0]) + vertices.col(t[1]) + vertices.col(t[2])) / 3;
    };
    Eigen::AlignedBox3d box;
    for (auto triangle = first; triangle != last; ++triangle) {
        box.extend(centre_of(*triangle));
    }
    Eigen::Index axis = 0;
    box.sizes().maxCoeff(&axis);
    const std::size_t middle = (begin + end) / 2;
    std::nth_element(first, first + static_cast<std::ptrdiff_t>(middle - begin), last,
                     [&](const Triangle& a, const Triangle& b) { return centre_of(a)[axis] < centre_of(b)[axis]; });
    group_occluders(vertices, begin, middle, pack);
    group_occluders(vertices, middle, end, pack);
}

/// Adds the silhouette regions and candidates to a pack.
inline void pack_contour(const FaceFitter& fitter, RealtimePack& pack)
{
    const MorphableModel& model = fitter.model();
    const ContourModel& contour = *fitter.contour();
    const auto points_of = [&](const std::vector<int>& vertices) {
        return vertex_points(model, vertices, fitter.expressions(), fitter.num_shape_coefficients());
    };
    const int num_occluders = static_cast<int>(contour.num_occluder_vertices());
    std::vector<int> occluders(num_occluders);
    for (int v = 0; v < num_occluders; ++v) {
        occluders[v] = v;
    }
    pack.has_contour = true;
    const ModelPoints occluder_points = points_of(occluders);
    pack.occluders = make_panels(occluder_points, CoordinateOrder::interleaved);
    const Eigen::Matrix3Xi& drawn = contour.occluder_triangles();
    for (Eigen::Index t = 0; t < drawn.cols(); ++t) {
        pack.occluder_triangles.push_back({drawn(0, t), drawn(1, t), drawn(2, t)});
    }
    if (!pack.occluder_triangles.empty()) {
        group_occluders(occluder_points.mean, 0, pack.occluder_triangles.size(), pack);
    }
    std::vector<int> row_of_vertex(static_cast<std::size_t>(model.num_vertices()), -1);
    std::vector<int> row_vertices;
    const auto row_of = [&](int vertex) {
        if (row_of_vertex[vertex] < 0) {
            row_of_vertex[vertex] = static_cast<int>(row_vertices.size());
            row_vertices.push_back(vertex);
        }
        return row_of_vertex[vertex];
    };
    std::vector<int> candidates;
    for (const FaceSide side : {FaceSide::left, FaceSide::right}) {
        ContourRegion& region = pack.regions[static_cast<int>(side)];
        region.first_candidate = static_cast<int>(candidates.size());
        for (const int vertex : contour.candidates(side)) {
            candidates.push_back(vertex);
            region.candidate_rows.push_back(row_of(vertex));
        }
        const std::vector<int>& triangles = contour.region_triangles(side);
        std::vector<int> own;
        for (const int t : triangles) {
            own.insert(own.end(), contour.triangles().col(t).begin(), contour.triangles().col(t).end());
        }
        sort_unique(own);
        region.vertices = make_panels(points_of(own), CoordinateOrder::planar);
        const auto local = [&](int vertex) {
            return static_cast<int>(std::lower_bound(own.begin(), own.end(), vertex) - own.begin());
        };
        for (const int t : triangles) {
            region.triangles.push_back(
                {local(contour.triangles()(0, t)), local(contour.triangles()(1, t)), local(contour.triangles()(2, t))});
        }
        region.rows.assign(own.size(), -1);
        for (const ContourModel::Edge& edge : contour.edges(side)) {
            ContourRegion::Edge packed = {};
            for (int end = 0; end < 2; ++end) {
                packed.vertices[end] = local(edge.vertices[end]);
                packed.triangles[end] = static_cast<int>(
                    std::lower_bound(triangles.begin(), triangles.end(), edge.triangles[end]) - triangles.begin());
                region.rows[packed.vertices[end]] = row_of(edge.vertices[end]);
            }
            region.edges.push_back(packed);
        }
    }
    pack.candidates = make_panels(points_of(candidates), CoordinateOrder::interleaved);
    pack.contour_rows = make_rows(points_of(row_vertices), pack.shape_width, pack.expression_width);
    pack.contour_vertices = row_vertices;
    pack.max_matches = static_cast<int>(row_vertices.size()) + 16;
}

[[nodiscard]] inline RealtimePack make_pack(const FaceFitter& fitter, MeshStorage storage, bool prefers_int16)
{
    const FitOptions& options = fitter.options();
    const LandmarkMap& map = fitter.landmark_map();
    RealtimePack pack;
    pack.num_shape = static_cast<int>(fitter.num_shape_coefficients());
    pack.num_expressions = static_cast<int>(fitter.expressions() ? fitter.expressions()->num_coefficients() : 0);
    pack.shape_width = kernels::round_up(pack.num_shape + 1, kernels::width_step);
    pack.expression_width = kernels::round_up(std::max(pack.num_expressions, 1), kernels::width_step);

    const Eigen::VectorXf* noise_mm = fitter.landmark_noise_mm();
    const auto information_of = [&](double sigma_mm) {
        return options.noise_units == NoiseUnits::model ? 1 / (sigma_mm * sigma_mm) : 1 / options.pixel_variance;
    };
    std::vector<int> fixed;
    std::vector<int> rest;
    for (int l = 0; l < static_cast<int>(map.num_landmarks()); ++l) {
        MapEntry entry;
        const auto side = outline_side(fitter.scheme(), map.names[l]);
        entry.is_outline = side.has_value();
        entry.side = side.value_or(FaceSide::left);
        entry.is_measured = noise_mm == nullptr || !std::isinf((*noise_mm)[l]);
        if (entry.is_measured && (!entry.is_outline || options.contour == ContourMode::fixed)) {
            const double sigma_mm = entry.is_outline ? options.contour_sigma_mm : options.landmark_sigma_mm;
            entry.fixed_index = static_cast<int>(fixed.size());
            fixed.push_back(l);
            pack.fixed_information.push_back(information_of(noise_mm ? (*noise_mm)[l] : sigma_mm));
        } else {
            entry.rest_index = static_cast<int>(rest.size());
            rest.push_back(l);
        }
        pack.map.push_back(entry);
    }
    pack.contour_information = information_of(options.contour_sigma_mm);
    const auto points_of = [&](const std::vector<int>& landmarks) {
        ModelPoints points =
            ModelPoints::sized(static_cast<Eigen::Index>(landmarks.size()), pack.num_shape, pack.num_expressions);
        for (std::size_t i = 0; i < landmarks.size(); ++i) {
            points.assign(static_cast<Eigen::Index>(i), fitter.landmark_points(), landmarks[i]);
        }
        return points;
    };
    const ModelPoints fixed_points = points_of(fixed);
    pack.fixed = make_panels(fixed_points, CoordinateOrder::interleaved);
    pack.first_match = kernels::round_up(pack.fixed.num_points, 8);
    pack.rest = make_panels(points_of(rest), CoordinateOrder::interleaved);
    pack.fixed_rows = make_rows(fixed_points, pack.shape_width, pack.expression_width);
    pack.identity_grams = make_grams(fixed_points.identity, pack.fixed_information, pack.shape_width);
    pack.expression_grams = make_grams(fixed_points.expression, pack.fixed_information, pack.expression_width);
    if (fitter.contour()) {
        pack_contour(fitter, pack);
    }
    std::vector<int> all(static_cast<std::size_t>(fitter.model().num_vertices()));
    for (std::size_t v = 0; v < all.size(); ++v) {
        all[v] = static_cast<int>(v);
    }
    pack.mesh = make_panels(vertex_points(fitter.model(), all, fitter.expressions(), pack.num_shape),
                            CoordinateOrder::interleaved);
    if (storage == MeshStorage::float32) {
        pack.mesh_expression_blocks = make_blocks(pack.mesh.expression, pack.mesh.num_panels, pack.num_expressions);
    }
    if (storage == MeshStorage::int16 || prefers_int16) {
        const bool must_be_exact = storage != MeshStorage::int16;
        const auto shorten_columns = [&](AlignedBuffer<float>& panels, const Eigen::VectorXd& units, ShortPanels& to) {
            if (std::optional<ShortPanels> shortened = shorten(panels, units, must_be_exact)) {
                to = std::move(*shortened);
                panels = {};
            }
        };
        shorten_columns(pack.mesh.identity,
                        fitter.model().shape.standard_deviations.head(pack.num_shape).cast<double>(),
                        pack.short_identity);
        shorten_columns(pack.mesh.expression, Eigen::VectorXd::Ones(pack.num_expressions), pack.short_expression);
    }
    return pack;
}

[[nodiscard]] inline NeutralShape make_neutral(const RealtimePack& pack)
{
    NeutralShape neutral;
    neutral.alpha_row = AlignedBuffer<float>(pack.shape_width);
    for (int set = 0; set < num_point_sets; ++set) {
        neutral.points[set] = AlignedBuffer<float>(pack.panels(static_cast<PointSet>(set)).size());
    }
    neutral.contour = AlignedBuffer<float>(pack.contour_rows.mean.size());
    neutral.is_row_known.resize(pack.contour_vertices.size());
    neutral.mesh = AlignedBuffer<float>(pack.mesh.size());
    return neutral;
}

/// Of a fit, with those that whole vectors read beyond; a multiple of 8.
[[nodiscard]] inline std::size_t max_points(const RealtimePack& pack)
{
    return static_cast<std::size_t>(kernels::round_up(pack.first_match + pack.max_matches + 8, 8));
}

[[nodiscard]] inline RealtimeFrame make_frame(const RealtimePack& pack)
{
    const std::size_t num_fixed = static_cast<std::size_t>(pack.fixed.num_points);
    const std::size_t max_matches = static_cast<std::size_t>(pack.max_matches);
    RealtimeFrame frame;
    frame.landmark_of_fixed.resize(num_fixed);
    frame.map_indices.reserve(pack.map.size());
    frame.name_keys.reserve(pack.map.size());
    frame.slots.reserve(pack.map.size());
    frame.first_outline_slot = static_cast<int>(max_points(pack));
    for (int side = 0; side < 2; ++side) {
        frame.outline[side].first_slot = frame.first_outline_slot + side * OutlineLandmarks::max_count;
    }
    frame.spare_slot = frame.first_outline_slot + 2 * OutlineLandmarks::max_count;
    frame.seen_u = AlignedBuffer<double>(static_cast<std::size_t>(frame.spare_slot) + 1);
    frame.seen_v = AlignedBuffer<double>(static_cast<std::size_t>(frame.spare_slot) + 1);
    frame.information = AlignedBuffer<double>(max_points(pack));
    frame.match_landmarks.resize(max_matches);
    frame.match_rows.resize(max_matches);
    frame.match_candidates.resize(max_matches);
    frame.match_roots.resize(max_matches);
    frame.psi.resize(pack.num_expressions);
    frame.bound_state.resize(pack.num_expressions);
    return frame;
}

[[nodiscard]] inline IdentitySums make_sums(const RealtimePack& pack)
{
    const std::size_t num_fixed = static_cast<std::size_t>(pack.fixed.num_points);
    const std::size_t num_rows = pack.contour_vertices.size();
    IdentitySums sums;
    sums.fixed_information.resize(6 * num_fixed);
    sums.fixed_right_side = AlignedBuffer<double>(3 * static_cast<std::size_t>(pack.first_match));
    sums.contour_information.resize(6 * num_rows);
    sums.contour_right_side.resize(3 * num_rows);
    sums.is_touched.resize(num_rows);
    sums.touched.reserve(num_rows);
    return sums;
}

[[nodiscard]] inline RealtimeBuffers make_buffers(const RealtimePack& pack)
{
    const std::size_t num_fixed = static_cast<std::size_t>(pack.fixed.num_points);
    const std::size_t max_matches = static_cast<std::size_t>(pack.max_matches);
    const std::size_t width = static_cast<std::size_t>(std::max(pack.shape_width, pack.expression_width));
    RealtimeBuffers buffers;
    buffers.frames.push_back(make_frame(pack));
    buffers.sums = make_sums(pack);
    buffers.neutral = make_neutral(pack);
    buffers.alpha.resize(pack.num_shape);
    buffers.alpha_row = AlignedBuffer<float>(pack.shape_width);
    buffers.psi_row = AlignedBuffer<float>(pack.expression_width);
    buffers.points = AlignedBuffer<float>(std::max(pack.fixed.size(), 3 * max_points(pack)));
    buffers.fitted_u = AlignedBuffer<double>(max_points(pack));
    buffers.fitted_v = AlignedBuffer<double>(max_points(pack));
    buffers.squared_residuals = AlignedBuffer<double>(max_points(pack));
    buffers.rest = AlignedBuffer<float>(pack.rest.size());
    buffers.new_rows.reserve(max_matches);
    buffers.new_points = AlignedBuffer<float>(3 * max_matches);
    buffers.match_offset = AlignedBuffer<float>(3 * max_matches);
    buffers.present.reserve(num_fixed);
    buffers.roots.reserve(num_fixed);
    buffers.factors = AlignedBuffer<float>(std::max(pack.fixed.size(), 3 * max_points(pack)));
    // RealtimeFramesFit needs 64 rows even where there is no outline.
    buffers.rows = AlignedBuffer<float>(2 * std::max({num_fixed, max_matches, std::size_t{32}}) * width);
    // A system in all expressions needs one column more than their rows have.
    const std::size_t system_width = width + kernels::width_step;
    buffers.system = AlignedBuffer<float>(system_width * system_width);
    buffers.gram = AlignedBuffer<float>(static_cast<std::size_t>(pack.expression_width) * pack.expression_width);
    buffers.right_side = AlignedBuffer<float>(system_width);
    buffers.step = AlignedBuffer<float>(system_width);
    buffers.free_step = AlignedBuffer<float>(system_width);
    buffers.gradient = AlignedBuffer<float>(system_width);
    buffers.next_state.resize(pack.num_expressions);
    buffers.is_free = AlignedBuffer<float>(pack.expression_width);
    buffers.free.reserve(pack.num_expressions);

    std::size_t num_seen = 0;
    std::size_t num_triangles = 0;
    std::size_t region_size = 0;
    for (const ContourRegion& region : pack.regions) {
        num_seen = std::max(num_seen, region.rows.size());
        num_triangles = std::max(num_triangles, region.triangles.size());
        region_size = std::max(region_size, region.vertices.size());
    }
    const std::size_t num_projected = std::max(num_seen, static_cast<std::size_t>(pack.candidates.num_points));
    buffers.candidates = AlignedBuffer<float>(pack.candidates.size() + 24); // whole vectors are read
    buffers.region = AlignedBuffer<float>(region_size);
    buffers.seen = AlignedBuffer<float>(region_size);
    buffers.is_facing.resize(num_triangles);
    buffers.is_marked.resize(num_seen);
    buffers.silhouette.reserve(num_seen);
    buffers.projected_u = AlignedBuffer<double>(num_projected + 8); // whole vectors are read
    buffers.projected_v = AlignedBuffer<double>(num_projected + 8);
    buffers.squared_distances = AlignedBuffer<double>(num_projected + 8);
    buffers.projected_rows.resize(num_projected);
    buffers.occluders = AlignedBuffer<float>(pack.occluders.size());
    buffers.occluders_seen.resize(pack.occluders.num_points);
    buffers.group_lows.resize(pack.occluder_groups.size());
    buffers.group_highs.resize(pack.occluder_groups.size());
    buffers.mesh = AlignedBuffer<float>(pack.mesh.size());
    buffers.mesh_coefficients = AlignedBuffer<float>(width);
    buffers.batch_coefficients =
        AlignedBuffer<float>(static_cast<std::size_t>(batch_size) * (pack.shape_width + pack.expression_width));
    buffers.batch_panel = AlignedBuffer<float>(kernels::panel_size);
    buffers.batch_columns =
        AlignedBuffer<float>(static_cast<std::size_t>(kernels::panel_size) * (pack.num_shape + pack.num_expressions));
    return buffers;
}

} // namespace lineament::detail
