// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/build/decimation.hpp"

#include "lineament/core/error.hpp"
#include "lineament/core/random.hpp"
#include "support/matchers.hpp"

#include <Eigen/Dense>

#include <map>
#include <numbers>
#include <set>

namespace lineament {
namespace {

using test::throws;

struct SymmetricMesh
{
    Mesh mesh = {};
    Eigen::VectorXi mirror = {};
};

/// A grid of (2n+1) x (2n+1) vertices over [-80, 80]^2 mm on a smooth symmetric height field with a sharp nose; the
/// diagonals of the squares mirror each other. The square in the middle belongs to group 1.
SymmetricMesh make_hill(int n)
{
    const int side = 2 * n + 1;
    SymmetricMesh result;
    Mesh& mesh = result.mesh;
    mesh.vertices.resize(3, side * side);
    result.mirror.resize(side * side);
    const auto index = [side](int i, int j) { return j * side + i; };
    for (int j = 0; j < side; ++j) {
        for (int i = 0; i < side; ++i) {
            const float x = 80.0F * static_cast<float>(i - n) / static_cast<float>(n);
            const float y = 80.0F * static_cast<float>(j - n) / static_cast<float>(n);
            const float height = 60.0F - (x * x + y * y) / 400.0F + 25.0F * std::exp(-(x * x + y * y) / 200.0F);
            mesh.vertices.col(index(i, j)) = Eigen::Vector3f(x, y, height);
            result.mirror(index(i, j)) = index(side - 1 - i, j);
        }
    }
    mesh.triangles.resize(3, 2 * (side - 1) * (side - 1));
    mesh.triangle_groups.resize(mesh.num_triangles());
    mesh.group_names = {"skin", "eyes"};
    Eigen::Index t = 0;
    for (int j = 0; j + 1 < side; ++j) {
        for (int i = 0; i + 1 < side; ++i) {
            const int a = index(i, j);
            const int b = index(i + 1, j);
            const int c = index(i + 1, j + 1);
            const int d = index(i, j + 1);
            const bool is_inner = std::max(std::abs(2 * i + 1 - 2 * n), std::abs(2 * j + 1 - 2 * n)) < n;
            mesh.triangle_groups.segment(t, 2).setConstant(is_inner ? 1 : 0);
            if (i < n) {
                mesh.triangles.col(t++) << a, b, c;
                mesh.triangles.col(t++) << a, c, d;
            } else {
                mesh.triangles.col(t++) << a, b, d;
                mesh.triangles.col(t++) << b, c, d;
            }
        }
    }
    return result;
}

using Edge = std::pair<int, int>;

/// Directed edge -> number of triangles that walk it.
std::map<Edge, int> directed_edges(const Eigen::Matrix3Xi& triangles)
{
    std::map<Edge, int> edges;
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            ++edges[{triangles(corner, t), triangles((corner + 1) % 3, t)}];
        }
    }
    return edges;
}

std::set<Edge> undirected_edges(const Eigen::Matrix3Xi& triangles)
{
    std::set<Edge> edges;
    for (const auto& [edge, count] : directed_edges(triangles)) {
        edges.insert(std::minmax(edge.first, edge.second));
    }
    return edges;
}

int euler_characteristic(const MeshLevel& level)
{
    return level.num_vertices - static_cast<int>(undirected_edges(level.triangles).size()) +
           static_cast<int>(level.triangles.cols());
}

/// Distance of a point to a triangle (Ericson, Real-Time Collision Detection, 2004, by regions): here by clamping to
/// the plane and to the three edges.
double distance_to_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                            const Eigen::Vector3d& c)
{
    double best = std::min({(p - a).norm(), (p - b).norm(), (p - c).norm()});
    const auto to_edge = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
        const double s = (p - from).dot(to - from) / (to - from).squaredNorm();
        if (s > 0.0 && s < 1.0) {
            best = std::min(best, (p - from - s * (to - from)).norm());
        }
    };
    to_edge(a, b);
    to_edge(b, c);
    to_edge(c, a);
    const Eigen::Vector3d n = (b - a).cross(c - a);
    if ((b - a).cross(p - a).dot(n) >= 0 && (c - b).cross(p - b).dot(n) >= 0 && (a - c).cross(p - c).dot(n) >= 0) {
        best = std::min(best, std::abs((p - a).dot(n)) / n.norm());
    }
    return best;
}

/// Mean and largest distance of the full mesh's vertices to a level's surface.
std::pair<double, double> distances_to_level(const Mesh& mesh, const NestedLevels& nested, const MeshLevel& level)
{
    double sum = 0.0;
    double largest = 0.0;
    for (Eigen::Index v = 0; v < mesh.num_vertices(); ++v) {
        double best = 1e30;
        for (Eigen::Index t = 0; t < level.triangles.cols(); ++t) {
            Eigen::Matrix3d corners;
            for (int corner = 0; corner < 3; ++corner) {
                corners.col(corner) = mesh.vertices.col(nested.vertex_order(level.triangles(corner, t))).cast<double>();
            }
            best = std::min(best, distance_to_triangle(mesh.vertices.col(v).cast<double>(), corners.col(0),
                                                       corners.col(1), corners.col(2)));
        }
        sum += best;
        largest = std::max(largest, best);
    }
    return {sum / static_cast<double>(mesh.num_vertices()), largest};
}

const DecimationOptions hill_options = {.vertex_counts = {120, 301}, .locked_vertices = {0, 200}};

TEST(NestedLevels, CountsAreMetAndEachLevelUsesExactlyItsPrefix)
{
    const SymmetricMesh hill = make_hill(12);
    const NestedLevels nested = compute_nested_levels(hill.mesh, hill.mirror, hill_options);
    ASSERT_EQ(nested.status, DecimationStatus::success);
    ASSERT_EQ(nested.levels.size(), 3U);
    const std::vector<int> counts = {120, 301, 625};
    for (std::size_t i = 0; i < counts.size(); ++i) {
        const MeshLevel& level = nested.levels[i];
        EXPECT_EQ(level.num_vertices, counts[i]);
        EXPECT_EQ(level.triangles.cols(), level.triangle_groups.size());
        const std::set<int> used(level.triangles.data(), level.triangles.data() + level.triangles.size());
        EXPECT_EQ(static_cast<int>(used.size()), counts[i]);
        EXPECT_EQ(*used.begin(), 0);
        EXPECT_EQ(*used.rbegin(), counts[i] - 1);
    }
    const std::set<int> order(nested.vertex_order.begin(), nested.vertex_order.end());
    EXPECT_EQ(order.size(), 625U);
}

TEST(NestedLevels, TheFullLevelIsTheInputRenumbered)
{
    const SymmetricMesh hill = make_hill(6);
    const NestedLevels nested = compute_nested_levels(hill.mesh, hill.mirror, {.vertex_counts = {60}});
    const MeshLevel& full = nested.levels.back();
    ASSERT_EQ(full.triangles.cols(), hill.mesh.num_triangles());
    for (Eigen::Index t = 0; t < full.triangles.cols(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            EXPECT_EQ(nested.vertex_order(full.triangles(corner, t)), hill.mesh.triangles(corner, t));
        }
    }
    EXPECT_EQ(full.triangle_groups, hill.mesh.triangle_groups);
}

TEST(NestedLevels, EveryLevelIsManifoldOfTheSameTopologyAndOrientation)
{
    const SymmetricMesh hill = make_hill(12);
    const NestedLevels nested = compute_nested_levels(hill.mesh, hill.mirror, hill_options);
    for (const MeshLevel& level : nested.levels) {
        EXPECT_EQ(euler_characteristic(level), 1);
        for (const auto& [edge, count] : directed_edges(level.triangles)) {
            EXPECT_EQ(count, 1) << edge.first << "-" << edge.second;
        }
        for (Eigen::Index t = 0; t < level.triangles.cols(); ++t) {
            Eigen::Matrix3f corners;
            for (int corner = 0; corner < 3; ++corner) {
                corners.col(corner) = hill.mesh.vertices.col(nested.vertex_order(level.triangles(corner, t)));
            }
            const float z = (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0)).z();
            EXPECT_GT(z, 0.0F) << "triangle " << t; // a height field: nothing may fold over
        }
    }
}

TEST(NestedLevels, EveryLevelIsSymmetric)
{
    const SymmetricMesh hill = make_hill(12);
    const NestedLevels nested = compute_nested_levels(hill.mesh, hill.mirror, hill_options);
    for (const MeshLevel& level : nested.levels) {
        std::set<std::set<int>> triangles;
        for (Eigen::Index t = 0; t < level.triangles.cols(); ++t) {
            triangles.insert({level.triangles(0, t), level.triangles(1, t), level.triangles(2, t)});
        }
        for (Eigen::Index t = 0; t < level.triangles.cols(); ++t) {
            const std::set<int> mirrored = {nested.mirror(level.triangles(0, t)), nested.mirror(level.triangles(1, t)),
                                            nested.mirror(level.triangles(2, t))};
            EXPECT_TRUE(triangles.contains(mirrored)) << "triangle " << t;
        }
        for (int v = 0; v < level.num_vertices; ++v) {
            EXPECT_LT(nested.mirror(v), level.num_vertices);
            EXPECT_EQ(nested.vertex_order(nested.mirror(v)), hill.mirror(nested.vertex_order(v)));
        }
    }
}

TEST(NestedLevels, LockedVerticesAndTheirPartnersSurvive)
{
    const SymmetricMesh hill = make_hill(12);
    DecimationOptions options = {.vertex_counts = {90}};
    for (int v = 0; v < 625; v += 29) { // where nothing else would keep them
        options.locked_vertices.push_back(v);
    }
    const NestedLevels nested = compute_nested_levels(hill.mesh, hill.mirror, options);
    ASSERT_EQ(nested.status, DecimationStatus::success);
    const std::set<int> kept(nested.vertex_order.begin(), nested.vertex_order.begin() + 90);
    for (const int v : options.locked_vertices) {
        EXPECT_TRUE(kept.contains(v)) << v;
        EXPECT_TRUE(kept.contains(hill.mirror(v))) << v;
    }
}

TEST(NestedLevels, BorderAndGroupBoundaryCollapseOnlyAlongThemselves)
{
    const SymmetricMesh hill = make_hill(12);
    const NestedLevels nested = compute_nested_levels(hill.mesh, hill.mirror, {.vertex_counts = {90}});
    const MeshLevel& level = nested.levels.front();
    std::map<Edge, std::vector<int>> groups_at;
    for (Eigen::Index t = 0; t < level.triangles.cols(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            const int a = level.triangles(corner, t);
            const int b = level.triangles((corner + 1) % 3, t);
            groups_at[std::minmax(a, b)].push_back(level.triangle_groups(t));
        }
    }
    int num_border = 0;
    int num_boundary = 0;
    for (const auto& [edge, groups] : groups_at) {
        const Eigen::Vector3f a = hill.mesh.vertices.col(nested.vertex_order(edge.first));
        const Eigen::Vector3f b = hill.mesh.vertices.col(nested.vertex_order(edge.second));
        const auto reach = [](const Eigen::Vector3f& p) { return p.head<2>().cwiseAbs().maxCoeff(); };
        if (groups.size() == 1) { // both ends were on the outer square
            ++num_border;
            EXPECT_FLOAT_EQ(reach(a), 80.0F);
            EXPECT_FLOAT_EQ(reach(b), 80.0F);
        } else if (groups[0] != groups[1]) { // both ends were on the inner square
            ++num_boundary;
            EXPECT_NEAR(reach(a), 40.0F, 1e-3F);
            EXPECT_NEAR(reach(b), 40.0F, 1e-3F);
        }
    }
    EXPECT_GE(num_border, 4);
    EXPECT_GE(num_boundary, 4);
}

TEST(NestedLevels, TheCoarseSurfaceStaysCloseAndFinerIsCloser)
{
    const SymmetricMesh hill = make_hill(12);
    const NestedLevels nested = compute_nested_levels(hill.mesh, hill.mirror, hill_options);
    const auto [coarse_mean, coarse_max] = distances_to_level(hill.mesh, nested, nested.levels[0]);
    const auto [fine_mean, fine_max] = distances_to_level(hill.mesh, nested, nested.levels[1]);
    EXPECT_LE(coarse_mean, 0.5);
    EXPECT_LE(coarse_max, 3.0);
    EXPECT_LE(fine_mean, 0.5 * coarse_mean);
    // A random subset triangulated the same way is no such thing: keeping every vertex of the rim costs more.
    DecimationOptions rim = hill_options;
    for (int i = 0; i < 25; ++i) {
        rim.locked_vertices.insert(rim.locked_vertices.end(), {i, 24 * 25 + i, i * 25, i * 25 + 24});
    }
    rim.vertex_counts = {120};
    const NestedLevels worse = compute_nested_levels(hill.mesh, hill.mirror, rim);
    EXPECT_GT(distances_to_level(hill.mesh, worse, worse.levels[0]).first, coarse_mean);
}

TEST(NestedLevels, ImportanceKeepsVerticesWhereItIsHigh)
{
    const SymmetricMesh hill = make_hill(12);
    const auto num_upper = [&](double importance) {
        DecimationOptions options = {.vertex_counts = {150}};
        options.importances = Eigen::VectorXd::Ones(625);
        options.importances.tail(300).setConstant(importance); // y > 0
        const NestedLevels nested = compute_nested_levels(hill.mesh, hill.mirror, options);
        return (nested.vertex_order.head(150).array() >= 325).count();
    };
    EXPECT_GT(num_upper(5.0), num_upper(1.0) + 10);
    EXPECT_LT(num_upper(0.2), num_upper(1.0) - 10);
}

TEST(NestedLevels, FlatSheetStaysFlatWithItsCorners)
{
    SymmetricMesh sheet = make_hill(8);
    sheet.mesh.vertices.row(2).setZero();
    sheet.mesh.triangle_groups.resize(0);
    const NestedLevels nested = compute_nested_levels(sheet.mesh, sheet.mirror, {.vertex_counts = {24}});
    ASSERT_EQ(nested.status, DecimationStatus::success);
    double area = 0.0;
    const MeshLevel& level = nested.levels.front();
    EXPECT_EQ(level.triangle_groups.size(), 0);
    for (Eigen::Index t = 0; t < level.triangles.cols(); ++t) {
        const Eigen::Vector3f a = sheet.mesh.vertices.col(nested.vertex_order(level.triangles(0, t)));
        const Eigen::Vector3f b = sheet.mesh.vertices.col(nested.vertex_order(level.triangles(1, t)));
        const Eigen::Vector3f c = sheet.mesh.vertices.col(nested.vertex_order(level.triangles(2, t)));
        area += 0.5 * static_cast<double>((b - a).cross(c - a).z());
    }
    EXPECT_NEAR(area, 160.0 * 160.0, 1e-2);
}

TEST(NestedLevels, ClosedSurfaceWithoutMirrorStopsAtTheTetrahedron)
{
    Mesh octahedron;
    octahedron.vertices.resize(3, 6);
    octahedron.vertices << 1, -1, 0, 0, 0, 0, 0, 0, 1, -1, 0, 0, 0, 0, 0, 0, 1, -1;
    octahedron.triangles.resize(3, 8);
    octahedron.triangles << 0, 2, 1, 3, 2, 1, 3, 0, 2, 1, 3, 0, 0, 2, 1, 3, 4, 4, 4, 4, 5, 5, 5, 5;
    const NestedLevels nested =
        compute_nested_levels(octahedron, {}, {.vertex_counts = {3}, .max_normal_turn_deg = 89.9});
    EXPECT_EQ(nested.status, DecimationStatus::count_not_reached);
    EXPECT_GE(nested.levels.front().num_vertices, 4);
    EXPECT_EQ(euler_characteristic(nested.levels.front()), 2);
    EXPECT_EQ(nested.mirror.size(), 0);
}

TEST(NestedLevels, AnOddCountTakesOneVertexOfTheSymmetryPlane)
{
    const SymmetricMesh hill = make_hill(8);
    for (const int count : {150, 151}) {
        const NestedLevels nested = compute_nested_levels(hill.mesh, hill.mirror, {.vertex_counts = {count}});
        EXPECT_EQ(nested.status, DecimationStatus::success);
        EXPECT_EQ(nested.levels.front().num_vertices, count);
    }
    // Without a free vertex on the plane the parity cannot change, and the result says so.
    DecimationOptions locked = {.vertex_counts = {150}};
    for (int j = 0; j < 17; ++j) {
        locked.locked_vertices.push_back(j * 17 + 8);
    }
    const NestedLevels nested = compute_nested_levels(hill.mesh, hill.mirror, locked);
    EXPECT_EQ(nested.status, DecimationStatus::count_not_reached);
    EXPECT_EQ(nested.levels.front().num_vertices, 151);
}

TEST(NestedLevels, SameInputGivesTheSameLevels)
{
    const SymmetricMesh hill = make_hill(10);
    const NestedLevels first = compute_nested_levels(hill.mesh, hill.mirror, {.vertex_counts = {100}});
    const NestedLevels second = compute_nested_levels(hill.mesh, hill.mirror, {.vertex_counts = {100}});
    EXPECT_EQ(first.vertex_order, second.vertex_order);
    EXPECT_EQ(first.levels.front().triangles, second.levels.front().triangles);
}

TEST(NestedLevels, HostileInputIsNamed)
{
    const SymmetricMesh hill = make_hill(4);
    const auto with_mesh = [&](auto change, auto... texts) {
        Mesh mesh = hill.mesh;
        change(mesh);
        return throws<InvalidArgument>([&] { (void)compute_nested_levels(mesh, hill.mirror, {.vertex_counts = {30}}); },
                                       texts...);
    };
    EXPECT_TRUE(with_mesh([](Mesh& m) { m.vertices(1, 7) = NAN; }, "vertices(1, 7)", "nan"));
    EXPECT_TRUE(with_mesh([](Mesh& m) { m.triangles(1, 3) = 81; }, "triangles(3)", "81"));
    EXPECT_TRUE(with_mesh([](Mesh& m) { m.triangles(1, 3) = -1; }, "triangles(3)", "-1"));
    EXPECT_TRUE(with_mesh([](Mesh& m) { m.triangles(1, 3) = m.triangles(0, 3); }, "triangles(3)", "twice"));
    EXPECT_TRUE(with_mesh([](Mesh& m) { m.triangles.col(1) = m.triangles.col(0); }, "edge 0-1"));
    EXPECT_TRUE(with_mesh([](Mesh& m) { m.triangles.col(0).reverseInPlace(); }, "edge", "walked twice"));
    EXPECT_TRUE(with_mesh([](Mesh& m) { m.triangle_groups.conservativeResize(5); }, "triangle_groups", "5"));
    EXPECT_TRUE(with_mesh([](Mesh& m) { m.triangles.resize(3, 0); }, "at least one triangle"));
    EXPECT_TRUE(with_mesh([](Mesh& m) { m.triangles = m.triangles.leftCols(20).eval(); }, "vertex", "in none"));

    const auto with_options = [&](const DecimationOptions& options, auto... texts) {
        return throws<InvalidArgument>([&] { (void)compute_nested_levels(hill.mesh, hill.mirror, options); }, texts...);
    };
    EXPECT_TRUE(with_options({.vertex_counts = {81}}, "vertex_counts", "81"));
    EXPECT_TRUE(with_options({.vertex_counts = {2}}, "vertex_counts", "2"));
    EXPECT_TRUE(with_options({.vertex_counts = {40, 30}}, "vertex_counts", "30"));
    EXPECT_TRUE(with_options({.vertex_counts = {3}, .locked_vertices = {0, 1, 2}}, "6 locked", "got 3"));
    EXPECT_TRUE(with_options({.locked_vertices = {81}}, "locked_vertices", "81"));
    EXPECT_TRUE(with_options({.importances = Eigen::VectorXd::Zero(81)}, "importances", "got 0"));
    EXPECT_TRUE(with_options({.importances = Eigen::VectorXd::Ones(80)}, "importances", "80"));
    EXPECT_TRUE(with_options({.border_weight = NAN}, "border_weight", "nan"));
    EXPECT_TRUE(with_options({.length_weight = -1.0}, "length_weight", "-1"));
    EXPECT_TRUE(with_options({.max_normal_turn_deg = 90.0}, "max_normal_turn_deg", "90"));
    EXPECT_TRUE(with_options({.min_triangle_quality = 1.0}, "min_triangle_quality", "1"));

    Eigen::VectorXi mirror = hill.mirror;
    mirror(0) = 1;
    EXPECT_TRUE(
        throws<InvalidArgument>([&] { (void)compute_nested_levels(hill.mesh, mirror, {}); }, "mirror", "0 -> 1"));
    mirror = hill.mirror;
    std::swap(mirror(0), mirror(8)); // both on themselves: an involution, but no symmetry
    EXPECT_TRUE(
        throws<InvalidArgument>([&] { (void)compute_nested_levels(hill.mesh, mirror, {}); }, "mirror", "triangle"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)compute_nested_levels(hill.mesh, hill.mirror.head(80), {}); },
                                        "mirror", "80"));
}

TEST(NestedLevels, TwoFansAtOneVertexAreNamed)
{
    Mesh bow_tie;
    bow_tie.vertices = Eigen::Matrix3Xf::Random(3, 5);
    bow_tie.triangles.resize(3, 2);
    bow_tie.triangles << 0, 0, 1, 3, 2, 4;
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)compute_nested_levels(bow_tie, {}, {}); }, "several at vertex 0"));
}

} // namespace
} // namespace lineament
