// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Based on: Garland and Heckbert, Surface Simplification Using Quadric Error Metrics, SIGGRAPH 1997; link condition
// after Dey, Edelsbrunner, Guha and Nekhayev, Topology Preserving Edge Contraction, 1999.
// Departures: vertices stay where they are (half-edge collapse), so that levels are nested; mirrored pairs go together.
#include "decimator.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

namespace lineament::detail {

namespace {

/// cos of the largest angle between a new triangle and the input's normals at its corners: about 80 degrees.
constexpr double min_cosine_against_input = 0.17;

const Spoke* find_spoke(const std::vector<Spoke>& spokes, int vertex)
{
    const auto found = std::ranges::find(spokes, vertex, &Spoke::vertex);
    return found == spokes.end() ? nullptr : &*found;
}

double quality(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c)
{
    const double area = 0.5 * (b - a).cross(c - a).norm();
    const double squared_edges = (b - a).squaredNorm() + (c - b).squaredNorm() + (a - c).squaredNorm();
    return squared_edges > 0.0 ? 4.0 * std::numbers::sqrt3 * area / squared_edges : 0.0;
}

} // namespace

Decimator::Decimator(const Mesh& mesh, const Eigen::VectorXi& mirror, const DecimationOptions& options)
    : vertices_(mesh.vertices.cast<double>()), triangles_(mesh.triangles), groups_(mesh.triangle_groups),
      mirror_(mirror), num_left_(static_cast<int>(mesh.num_vertices())),
      min_cosine_(std::cos(options.max_normal_turn_deg * std::numbers::pi / 180.0)),
      min_quality_(options.min_triangle_quality)
{
    normals_ = compute_vertex_normals(mesh.vertices, mesh.triangles).cast<double>();
    const auto num_vertices = static_cast<std::size_t>(mesh.num_vertices());
    vertices_.colwise() -= vertices_.rowwise().mean().eval();
    if (groups_.size() == 0) {
        groups_ = Eigen::VectorXi::Zero(mesh.num_triangles());
    }
    if (mirror_.size() == 0) { // every vertex its own partner: all collapses are single ones
        mirror_ = Eigen::VectorXi::LinSpaced(mesh.num_vertices(), 0, static_cast<int>(mesh.num_vertices()) - 1);
    }
    is_alive_.assign(static_cast<std::size_t>(mesh.num_triangles()), 1);
    is_locked_.assign(num_vertices, 0);
    for (const int v : options.locked_vertices) {
        is_locked_[v] = 1;
        is_locked_[mirror_(v)] = 1;
    }
    triangles_at_.resize(num_vertices);
    for (int t = 0; t < triangles_.cols(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            triangles_at_[triangles_(corner, t)].push_back(t);
        }
    }
    stamps_.assign(num_vertices, 0);
    add_quadrics(options);
    for (int v = 0; v < static_cast<int>(num_vertices); ++v) {
        for (const Spoke& spoke : spokes(v)) {
            push(v, spoke.vertex);
        }
    }
}

void Decimator::add_quadrics(const DecimationOptions& options)
{
    quadrics_.assign(triangles_at_.size(), Eigen::Matrix4d::Zero());
    for (int t = 0; t < triangles_.cols(); ++t) {
        const Eigen::Vector3i corners = triangles_.col(t);
        const Eigen::Vector3d normal = (vertices_.col(corners(1)) - vertices_.col(corners(0)))
                                           .cross(vertices_.col(corners(2)) - vertices_.col(corners(0)));
        const double area = 0.5 * normal.norm();
        if (!(area > 0.0)) {
            continue;
        }
        const auto add_plane = [&](int v, const Eigen::Vector3d& unit_normal, const Eigen::Vector3d& point,
                                   double weight) {
            const Eigen::Vector4d plane(unit_normal.x(), unit_normal.y(), unit_normal.z(), -unit_normal.dot(point));
            quadrics_[v] += weight * plane * plane.transpose();
        };
        for (int corner = 0; corner < 3; ++corner) {
            const int a = corners(corner);
            const int b = corners((corner + 1) % 3);
            add_plane(a, normal.normalized(), vertices_.col(a), area / 3.0);
            // squared distance to the vertex itself
            const Eigen::Vector3d point = vertices_.col(a);
            Eigen::Matrix4d distance = Eigen::Matrix4d::Identity();
            distance.topRightCorner<3, 1>() = -point;
            distance.bottomLeftCorner<1, 3>() = -point.transpose();
            distance(3, 3) = point.squaredNorm();
            quadrics_[a] += options.length_weight * area / 3.0 * distance;
            // the plane through a border edge that stands on the triangle
            const std::vector<Spoke> ring = spokes(a);
            if (find_spoke(ring, b)->num_triangles == 1) {
                const Eigen::Vector3d edge = vertices_.col(b) - vertices_.col(a);
                const Eigen::Vector3d side = edge.cross(normal).normalized();
                const double weight = options.border_weight * edge.squaredNorm();
                add_plane(a, side, point, weight);
                add_plane(b, side, point, weight);
            }
        }
    }
    if (options.importances.size() > 0) {
        for (std::size_t v = 0; v < quadrics_.size(); ++v) {
            quadrics_[v] *= options.importances(static_cast<Eigen::Index>(v));
        }
    }
}

bool Decimator::has_corner(int triangle, int vertex) const
{
    return (triangles_.col(triangle).array() == vertex).any();
}

std::vector<Spoke> Decimator::spokes(int vertex) const
{
    std::vector<Spoke> result;
    for (const int t : triangles_at_[vertex]) {
        if (is_alive_[t] == 0) {
            continue;
        }
        for (int corner = 0; corner < 3; ++corner) {
            const int other = triangles_(corner, t);
            if (other == vertex) {
                continue;
            }
            const auto known = std::ranges::find(result, other, &Spoke::vertex);
            if (known == result.end()) {
                result.push_back(
                    {.vertex = other, .num_triangles = 1, .group = groups_(t), .is_group_boundary = false});
            } else {
                ++known->num_triangles;
                known->is_group_boundary = known->is_group_boundary || known->group != groups_(t);
            }
        }
    }
    return result;
}

double Decimator::cost(int removed, int kept) const
{
    const Eigen::Vector4d point = vertices_.col(kept).homogeneous();
    return point.dot((quadrics_[removed] + quadrics_[kept]) * point);
}

bool Decimator::keeps_topology(int removed, int kept) const
{
    const std::vector<Spoke> around_removed = spokes(removed);
    const std::vector<Spoke> around_kept = spokes(kept);
    const Spoke* edge = find_spoke(around_removed, kept);
    if (edge == nullptr) {
        return false;
    }
    // A line collapses along itself, and never a loop of three edges to nothing.
    const auto num_features = std::ranges::count_if(around_removed, &Spoke::is_feature);
    if (num_features != 0 && (num_features != 2 || !edge->is_feature())) {
        return false;
    }
    // Link condition, vertices: the common neighbours are the third corners of the edge's triangles ...
    int num_common = 0;
    for (const Spoke& spoke : around_removed) {
        if (const Spoke* other = find_spoke(around_kept, spoke.vertex)) {
            ++num_common;
            if (spoke.is_feature() && other->is_feature()) {
                return false;
            }
        }
    }
    if (num_common != edge->num_triangles) {
        return false;
    }
    // ... and edges: no edge is seen from both ends.
    std::set<std::pair<int, int>> link;
    for (const int end : {removed, kept}) {
        for (const int t : triangles_at_[end]) {
            if (is_alive_[t] == 0 || has_corner(t, end == removed ? kept : removed)) {
                continue;
            }
            int corner = 0;
            while (triangles_(corner, t) != end) {
                ++corner;
            }
            if (!link.insert(std::minmax({triangles_((corner + 1) % 3, t), triangles_((corner + 2) % 3, t)})).second) {
                return false;
            }
        }
    }
    return true;
}

bool Decimator::keeps_geometry(int removed, int kept) const
{
    double worst_before = 1.0;
    double worst_after = 1.0;
    for (const int t : triangles_at_[removed]) {
        if (is_alive_[t] == 0) {
            continue;
        }
        Eigen::Matrix3d corners;
        Eigen::Matrix3d moved;
        for (int corner = 0; corner < 3; ++corner) {
            const int v = triangles_(corner, t);
            corners.col(corner) = vertices_.col(v);
            moved.col(corner) = vertices_.col(v == removed ? kept : v);
        }
        worst_before = std::min(worst_before, quality(corners.col(0), corners.col(1), corners.col(2)));
        if (has_corner(t, kept)) {
            continue;
        }
        worst_after = std::min(worst_after, quality(moved.col(0), moved.col(1), moved.col(2)));
        const Eigen::Vector3d before = (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0));
        const Eigen::Vector3d after = (moved.col(1) - moved.col(0)).cross(moved.col(2) - moved.col(0));
        if (!(after.norm() > 0.0) || !(before.dot(after) >= min_cosine_ * before.norm() * after.norm())) {
            return false;
        }
        // Small turns add up: nor may the triangle stand across the input's surface at its corners.
        for (int corner = 0; corner < 3; ++corner) {
            const int v = triangles_(corner, t);
            const double cosine_before = before.dot(normals_.col(v)) / std::max(before.norm(), 1e-300);
            const double cosine_after = after.dot(normals_.col(v == removed ? kept : v)) / after.norm();
            if (!(cosine_after >= std::min(min_cosine_against_input, cosine_before))) {
                return false;
            }
        }
    }
    return worst_after >= std::min(min_quality_, worst_before);
}

void Decimator::push(int removed, int kept)
{
    const int mirrored_removed = mirror_(removed);
    const int mirrored_kept = mirror_(kept);
    const bool is_on_plane = mirrored_removed == removed;
    // A pair is pushed once; a vertex of the plane stays on it; a pair never collapses into itself.
    if (is_locked_[removed] != 0 || mirrored_removed < removed || kept == mirrored_removed ||
        (is_on_plane && mirrored_kept != kept)) {
        return;
    }
    const double mean_cost = 0.5 * (cost(removed, kept) + cost(mirrored_removed, mirrored_kept));
    queue_.push({mean_cost, removed, kept, stamps_[removed] + stamps_[kept]});
}

/// Queues again every collapse that a change at the vertex may have made cheaper, dearer or allowed.
void Decimator::push_around(int vertex)
{
    ++stamps_[vertex];
    std::vector<int> changed = {vertex};
    for (const Spoke& spoke : spokes(vertex)) {
        changed.push_back(spoke.vertex);
    }
    for (const int a : changed) {
        for (const Spoke& spoke : spokes(a)) {
            push(a, spoke.vertex);
            push(spoke.vertex, a);
            if (mirror_(a) != a) { // only the first of a pair is queued
                push(mirror_(a), mirror_(spoke.vertex));
                push(mirror_(spoke.vertex), mirror_(a));
            }
        }
    }
}

bool Decimator::collapse(int removed, int kept)
{
    if (!keeps_topology(removed, kept) || !keeps_geometry(removed, kept)) {
        return false;
    }
    for (const int t : triangles_at_[removed]) {
        if (is_alive_[t] == 0) {
            continue;
        }
        if (has_corner(t, kept)) {
            is_alive_[t] = 0;
            continue;
        }
        for (int corner = 0; corner < 3; ++corner) {
            if (triangles_(corner, t) == removed) {
                triangles_(corner, t) = kept;
            }
        }
        triangles_at_[kept].push_back(t);
    }
    return true;
}

bool Decimator::collapse_with_mirror(int removed, int kept)
{
    const int mirrored_removed = mirror_(removed);
    const int mirrored_kept = mirror_(kept);
    if (mirrored_removed == removed) {
        return collapse(removed, kept);
    }
    // The second collapse is checked after the first, and the first is taken back if it is refused.
    const std::vector<int> at_removed = triangles_at_[removed];
    const std::vector<int> at_kept = triangles_at_[kept];
    std::vector<std::pair<Eigen::Vector3i, char>> before;
    before.reserve(at_removed.size());
    for (const int t : at_removed) {
        before.emplace_back(triangles_.col(t), is_alive_[t]);
    }
    if (!collapse(removed, kept)) {
        return false;
    }
    if (collapse(mirrored_removed, mirrored_kept)) {
        return true;
    }
    for (std::size_t i = 0; i < at_removed.size(); ++i) {
        triangles_.col(at_removed[i]) = before[i].first;
        is_alive_[at_removed[i]] = before[i].second;
    }
    triangles_at_[kept] = at_kept;
    return false;
}

void Decimator::reduce_to(int count)
{
    std::vector<Collapse> pairs_too_many; // wait for the next level
    while (num_left_ > count && !queue_.empty()) {
        const Collapse next = queue_.top();
        queue_.pop();
        const bool is_pair = mirror_(next.removed) != next.removed;
        if (next.stamp != stamps_[next.removed] + stamps_[next.kept]) {
            continue;
        }
        if (is_pair && num_left_ - count < 2) {
            pairs_too_many.push_back(next);
            continue;
        }
        if (!collapse_with_mirror(next.removed, next.kept)) {
            continue;
        }
        for (const int end : {0, 1}) {
            const int removed = end == 0 ? next.removed : mirror_(next.removed);
            const int kept = end == 0 ? next.kept : mirror_(next.kept);
            if (end == 1 && !is_pair) {
                break;
            }
            quadrics_[kept] += quadrics_[removed];
            triangles_at_[removed].clear();
            ++stamps_[removed];
            removed_.push_back(removed);
            --num_left_;
        }
        push_around(next.kept);
        if (is_pair) {
            push_around(mirror_(next.kept));
        }
    }
    for (const Collapse& pair : pairs_too_many) {
        queue_.push(pair);
    }
}

MeshLevel Decimator::level(bool with_groups) const
{
    const auto num_triangles = std::ranges::count(is_alive_, 1);
    MeshLevel result = {.num_vertices = num_left_,
                        .triangles = Eigen::Matrix3Xi(3, num_triangles),
                        .triangle_groups = Eigen::VectorXi(with_groups ? num_triangles : 0)};
    Eigen::Index next = 0;
    for (int t = 0; t < triangles_.cols(); ++t) {
        if (is_alive_[t] != 0) {
            result.triangles.col(next) = triangles_.col(t);
            if (with_groups) {
                result.triangle_groups(next) = groups_(t);
            }
            ++next;
        }
    }
    return result;
}

} // namespace lineament::detail
