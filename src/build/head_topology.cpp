// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "head_topology.hpp"

#include "head_cut.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

namespace lineament::build {

namespace {

constexpr double eyeball_radius_mm = 14.5;
constexpr std::size_t lid_loop_length = 2 * EyeCap::num_columns + 2; // with the two corners
constexpr std::size_t lip_loop_length = 38;

using Triangles = std::vector<Eigen::Vector3i>;

/// Lids of the right eye, outer to inner, and its corners: the opposite vertices of the loop that lie farthest apart.
std::pair<int, int> find_lids(const std::vector<int>& loop, const Eigen::Matrix3Xd& vertices, EyeCap& cap)
{
    constexpr std::size_t half = lid_loop_length / 2;
    std::size_t corner = 0;
    double longest = 0.0;
    for (std::size_t i = 0; i < half; ++i) {
        const double width = std::abs(vertices(0, loop[i]) - vertices(0, loop[i + half]));
        if (width > longest) {
            longest = width;
            corner = i;
        }
    }
    if (vertices(0, loop[corner]) > vertices(0, loop[corner + half])) {
        corner += half; // the outer one has the smaller x
    }
    std::array<std::array<int, EyeCap::num_columns>, 2> arcs = {};
    std::array<double, 2> height = {};
    for (std::size_t i = 0; i < EyeCap::num_columns; ++i) {
        arcs[0][i] = loop[(corner + 1 + i) % lid_loop_length];
        arcs[1][i] = loop[(corner + lid_loop_length - 1 - i) % lid_loop_length];
        height[0] += vertices(1, arcs[0][i]);
        height[1] += vertices(1, arcs[1][i]);
    }
    cap.upper = height[0] > height[1] ? arcs[0] : arcs[1];
    cap.lower = height[0] > height[1] ? arcs[1] : arcs[0];
    return {loop[corner], loop[(corner + half) % lid_loop_length]};
}

/// The triangles of the right eye's cap, counter-clockwise seen from the front.
Triangles close_eye(const EyeCap& cap, int outer, int inner)
{
    constexpr std::size_t num_points = EyeCap::num_rows + 2;
    const auto column = [&](std::size_t i) {
        return std::array<int, num_points>{cap.upper[i], cap.vertices[i][0], cap.vertices[i][1], cap.vertices[i][2],
                                           cap.lower[i]};
    };
    const auto first = column(0);
    const auto last = column(EyeCap::num_columns - 1);
    Triangles triangles;
    for (std::size_t r = 0; r + 1 < num_points; ++r) {
        triangles.emplace_back(outer, first[r + 1], first[r]);
        for (std::size_t i = 0; i + 1 < EyeCap::num_columns; ++i) {
            const auto a = column(i);
            const auto b = column(i + 1);
            triangles.emplace_back(a[r], a[r + 1], b[r + 1]);
            triangles.emplace_back(a[r], b[r + 1], b[r]);
        }
        triangles.emplace_back(last[r], last[r + 1], inner);
    }
    return triangles;
}

/// Zips the right half of the lip loop shut, from the middle to the corner, without a new vertex.
Triangles close_mouth(const std::vector<int>& loop, const Eigen::Matrix3Xd& vertices, const Eigen::VectorXi& mirror)
{
    const int n = static_cast<int>(loop.size());
    const auto at = [&](int i) { return loop[static_cast<std::size_t>(((i % n) + n) % n)]; };
    std::vector<int> middle;
    for (int i = 0; i < n; ++i) {
        if (mirror[at(i)] == at(i)) {
            middle.push_back(i);
        }
    }
    if (middle.size() != 2) {
        throw_unknown_mesh("the lips cross the symmetry plane " + std::to_string(middle.size()) + " times");
    }
    int upper = middle[0];
    int lower = middle[1];
    if (vertices(1, at(upper)) < vertices(1, at(lower))) {
        std::swap(upper, lower);
    }
    const int step = vertices(0, at(upper + 1)) < 0 ? 1 : -1;
    const auto gap = [&](int i, int j) { return (vertices.col(at(i)) - vertices.col(at(j))).norm(); };
    Triangles triangles;
    while (at(upper + step) != at(lower - step)) {
        if (gap(upper + step, lower) <= gap(upper, lower - step)) {
            triangles.emplace_back(at(upper + step), at(lower), at(upper));
            upper += step;
        } else {
            triangles.emplace_back(at(upper), at(lower - step), at(lower));
            lower -= step;
        }
    }
    triangles.emplace_back(at(upper + step), at(lower), at(upper));
    return triangles;
}

/// The loops around the right eye and the mouth; the left eye and the outer border follow.
struct Loops
{
    std::vector<int> right_eye = {};
    std::vector<int> mouth = {};
};

Loops find_openings(const Triangles& triangles, const Eigen::Matrix3Xd& vertices)
{
    Loops loops;
    const auto all = find_border_loops(triangles);
    for (const std::vector<int>& loop : all) {
        if (loop.size() == lip_loop_length) {
            loops.mouth = loop;
        } else if (loop.size() == lid_loop_length && vertices(0, loop[0]) < 0) {
            loops.right_eye = loop;
        }
    }
    if (all.size() != 4 || loops.mouth.empty() || loops.right_eye.empty()) {
        throw_unknown_mesh(std::to_string(all.size()) + " border loops");
    }
    return loops;
}

} // namespace

Eigen::Matrix3Xd HeadTopology::mirrored(const Eigen::Matrix3Xd& values) const
{
    Eigen::Matrix3Xd result(3, values.cols());
    for (Eigen::Index v = 0; v < values.cols(); ++v) {
        result.col(mirror[v]) = Eigen::Vector3d(-values(0, v), values(1, v), values(2, v));
    }
    return result;
}

HeadTopology make_head_topology(const MakeHumanBase& base, const Eigen::Matrix3Xd& reference)
{
    const HeadCut cut = cut_head(base, reference);
    HeadTopology head;
    std::set<int> used;
    for (const Eigen::Vector3i& triangle : cut.triangles) {
        used.insert(triangle.begin(), triangle.end());
    }
    constexpr int num_cap_vertices = EyeCap::num_columns * EyeCap::num_rows;
    const int num_skin = static_cast<int>(used.size());
    const int num_vertices = num_skin + 2 * num_cap_vertices;

    std::vector<Eigen::Triplet<double>> weights;
    Eigen::Matrix3Xd vertices(3, num_skin);
    head.vertex_of_base.assign(static_cast<std::size_t>(base.vertices.cols()), -1);
    head.mirror.resize(num_vertices);
    head.offsets = Eigen::Matrix3Xd::Zero(3, num_vertices);
    int count = 0;
    for (const int b : used) {
        head.vertex_of_base[static_cast<std::size_t>(b)] = count;
        const auto slide = cut.slide.find(b);
        const auto [neighbour, fraction] = slide == cut.slide.end() ? std::pair(b, 0.0) : slide->second;
        weights.emplace_back(count, b, 1 - fraction);
        weights.emplace_back(count, neighbour, fraction);
        vertices.col(count) = (1 - fraction) * reference.col(b) + fraction * reference.col(neighbour);
        head.uv_of_vertex.push_back(cut.uv_of_base[static_cast<std::size_t>(b)]);
        ++count;
    }
    for (const int b : used) {
        head.mirror[head.vertex_of_base[static_cast<std::size_t>(b)]] =
            head.vertex_of_base[static_cast<std::size_t>(cut.base_mirror[static_cast<std::size_t>(b)])];
    }
    Triangles triangles;
    for (const Eigen::Vector3i& t : cut.triangles) {
        triangles.emplace_back(head.vertex_of_base[static_cast<std::size_t>(t[0])],
                               head.vertex_of_base[static_cast<std::size_t>(t[1])],
                               head.vertex_of_base[static_cast<std::size_t>(t[2])]);
    }
    std::vector<int> groups(triangles.size(), TriangleGroup::skin);
    const auto add_with_mirror_image = [&](const Triangles& right, TriangleGroup group) {
        for (const Eigen::Vector3i& t : right) {
            triangles.push_back(t);
            triangles.emplace_back(head.mirror[t[0]], head.mirror[t[2]], head.mirror[t[1]]);
            groups.insert(groups.end(), 2, group);
        }
    };

    const Loops loops = find_openings(triangles, vertices);
    EyeCap& right = head.eyes[0];
    EyeCap& left = head.eyes[1];
    const auto [outer, inner] = find_lids(loops.right_eye, vertices, right);
    for (const int v : base.eye_vertices[0]) {
        right.eyeball_center += reference.col(v) / static_cast<double>(base.eye_vertices[0].size());
    }
    left.eyeball_center = right.eyeball_center.cwiseProduct(Eigen::Vector3d(-1, 1, 1));
    for (std::size_t i = 0; i < EyeCap::num_columns; ++i) {
        left.upper[i] = head.mirror[right.upper[i]];
        left.lower[i] = head.mirror[right.lower[i]];
        for (std::size_t r = 0; r < EyeCap::num_rows; ++r) {
            right.vertices[i][r] = num_skin + static_cast<int>(i * EyeCap::num_rows + r);
            left.vertices[i][r] = right.vertices[i][r] + num_cap_vertices;
            head.mirror[right.vertices[i][r]] = left.vertices[i][r];
            head.mirror[left.vertices[i][r]] = right.vertices[i][r];
        }
    }
    const std::size_t num_skin_weights = weights.size();
    for (const EyeCap& eye : head.eyes) {
        for (std::size_t i = 0; i < EyeCap::num_columns; ++i) {
            for (std::size_t r = 0; r < EyeCap::num_rows; ++r) {
                const int v = eye.vertices[i][r];
                const double t = static_cast<double>(r + 1) / (EyeCap::num_rows + 1);
                const Eigen::Vector3d between = (1 - t) * vertices.col(eye.upper[i]) + t * vertices.col(eye.lower[i]);
                const double sideways = (between - eye.eyeball_center).head<2>().squaredNorm();
                const double depth = std::sqrt(std::max(eyeball_radius_mm * eyeball_radius_mm - sideways, 0.0));
                head.offsets.col(v) = Eigen::Vector3d(0, 0, eye.eyeball_center.z() + depth - between.z());
                for (std::size_t w = 0; w < num_skin_weights; ++w) { // the lids are combinations of base vertices
                    const Eigen::Triplet<double> lid = weights[w];
                    if (lid.row() == eye.upper[i] || lid.row() == eye.lower[i]) {
                        weights.emplace_back(v, lid.col(), (lid.row() == eye.upper[i] ? 1 - t : t) * lid.value());
                    }
                }
            }
        }
    }
    head.uv_of_vertex.resize(static_cast<std::size_t>(num_vertices), -1);
    add_with_mirror_image(close_eye(right, outer, inner), TriangleGroup::eyes);
    add_with_mirror_image(close_mouth(loops.mouth, vertices, head.mirror), TriangleGroup::mouth_interior);
    head.lip_loop = loops.mouth;

    head.weights.resize(num_vertices, base.vertices.cols());
    head.weights.setFromTriplets(weights.begin(), weights.end()); // adds up weights of the same place
    head.triangles.resize(3, static_cast<Eigen::Index>(triangles.size()));
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        head.triangles.col(static_cast<Eigen::Index>(t)) = triangles[t];
    }
    head.triangle_groups = Eigen::Map<const Eigen::VectorXi>(groups.data(), static_cast<Eigen::Index>(groups.size()));
    return head;
}

} // namespace lineament::build
