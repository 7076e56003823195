// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/build/isomap_embedding.hpp"

#include "lineament/core/error.hpp"
#include "support/matchers.hpp"

#include <Eigen/Dense>

#include <functional>
#include <numbers>

namespace lineament {
namespace {

using test::throws;

/// A square grid of side x side quads over parameters (a, b) in [-1, 1]^2, mirrored diagonals, and its mirror map
/// (a -> -a).
struct Patch
{
    Mesh mesh = {};
    Eigen::VectorXi mirror = {};
};

Patch make_patch(
    int half_side, const std::function<Eigen::Vector3d(double a, double b)>& surface,
    const std::function<bool(double a, double b)>& is_hole = [](double, double) { return false; })
{
    const int side = 2 * half_side + 1;
    Patch patch;
    patch.mesh.vertices.resize(3, side * side);
    patch.mirror.resize(side * side);
    std::vector<Eigen::Vector3i> triangles;
    const auto parameter = [&](double i) { return (i - half_side) / half_side; };
    for (int j = 0; j < side; ++j) {
        for (int i = 0; i < side; ++i) {
            patch.mesh.vertices.col(j * side + i) = surface(parameter(i), parameter(j)).cast<float>();
            patch.mirror(j * side + i) = j * side + side - 1 - i;
            if (i + 1 == side || j + 1 == side || is_hole(parameter(i + 0.5), parameter(j + 0.5))) {
                continue;
            }
            const int a = j * side + i;
            const int b = a + 1;
            const int c = a + side + 1;
            const int d = a + side;
            if (i < half_side) {
                triangles.emplace_back(a, b, c);
                triangles.emplace_back(a, c, d);
            } else {
                triangles.emplace_back(a, b, d);
                triangles.emplace_back(b, c, d);
            }
        }
    }
    patch.mesh.triangles.resize(3, std::ssize(triangles));
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        patch.mesh.triangles.col(static_cast<Eigen::Index>(t)) = triangles[t];
    }
    return patch;
}

Eigen::Vector3d flat(double a, double b)
{
    return {60.0 * a, 80.0 * b, 0.0};
}

/// Half a cylinder of radius 50 mm, axis along y.
Eigen::Vector3d half_cylinder(double a, double b)
{
    const double angle = 0.5 * std::numbers::pi * a;
    return {50.0 * std::sin(angle), 60.0 * b, 50.0 * std::cos(angle)};
}

/// Most of a hemisphere of radius 80 mm.
Eigen::Vector3d dome(double a, double b)
{
    const Eigen::Vector3d on_cube(a, b, 0.5);
    return 80.0 * on_cube.normalized();
}

/// A deep narrow bag: plain scaling folds it.
Eigen::Vector3d bag(double a, double b)
{
    const double radius = std::max(std::abs(a), std::abs(b));
    const double neck = radius < 0.5 ? 2.2 * radius : 1.1 - 0.7 * std::sin(std::numbers::pi * (radius - 0.5));
    return {40.0 * a / std::max(radius, 1e-9) * neck, 40.0 * b / std::max(radius, 1e-9) * neck, -140.0 * radius};
}

double area(const Eigen::Matrix2Xf& uv, const Eigen::Vector3i& triangle)
{
    const Eigen::Vector2d a = (uv.col(triangle(1)) - uv.col(triangle(0))).cast<double>();
    const Eigen::Vector2d b = (uv.col(triangle(2)) - uv.col(triangle(0))).cast<double>();
    return -0.5 * (a.x() * b.y() - a.y() * b.x()); // v points down: counter-clockwise is negative there
}

double smallest_area(const Patch& patch, const Eigen::Matrix2Xf& uv)
{
    double smallest = 1.0;
    for (Eigen::Index t = 0; t < patch.mesh.num_triangles(); ++t) {
        smallest = std::min(smallest, area(uv, patch.mesh.triangles.col(t)));
    }
    return smallest;
}

/// Largest relative error of the distances between all pairs against the distances in `expected` (any place and scale).
double isometry_error(const Eigen::Matrix2Xf& uv, const Eigen::Matrix2Xd& expected, double scale)
{
    double largest = 0.0;
    for (Eigen::Index i = 0; i < uv.cols(); ++i) {
        for (Eigen::Index j = 0; j < i; ++j) {
            const double distance = static_cast<double>((uv.col(i) - uv.col(j)).norm()) / scale;
            const double truth = (expected.col(i) - expected.col(j)).norm();
            const double error = std::abs(distance - truth) / truth;
            largest = error <= largest ? largest : error;
        }
    }
    return largest;
}

TEST(IsomapEmbedding, FlatSheetComesBackIsometric)
{
    const Patch sheet = make_patch(8, flat);
    const IsomapEmbedding layout = compute_isomap_embedding(sheet.mesh, sheet.mirror);
    EXPECT_EQ(layout.status, IsomapStatus::converged);
    EXPECT_LE(layout.stress, 0.005); // of the graph's distances, not of the layout
    EXPECT_GT(layout.start_stress, 0.02);
    const Eigen::Matrix2Xd truth = sheet.mesh.vertices.topRows<2>().cast<double>();
    EXPECT_LE(isometry_error(layout.uv_coordinates, truth, layout.scale_per_mm), 0.01);
}

TEST(IsomapEmbedding, CylinderPatchUnrolls)
{
    const Patch patch = make_patch(10, half_cylinder);
    const IsomapEmbedding layout = compute_isomap_embedding(patch.mesh, patch.mirror);
    EXPECT_LE(layout.stress, 0.005);
    Eigen::Matrix2Xd unrolled(2, patch.mesh.num_vertices());
    for (Eigen::Index v = 0; v < unrolled.cols(); ++v) {
        const Eigen::Vector3d p = patch.mesh.vertices.col(v).cast<double>();
        unrolled.col(v) << 50.0 * std::atan2(p.x(), p.z()), p.y();
    }
    EXPECT_LE(isometry_error(layout.uv_coordinates, unrolled, layout.scale_per_mm), 0.015); // chords are 0.1 % short
}

TEST(IsomapEmbedding, DomeHasNoFoldsAndLessStressThanItsStart)
{
    const Patch patch = make_patch(10, dome);
    const IsomapEmbedding layout = compute_isomap_embedding(patch.mesh, patch.mirror);
    EXPECT_EQ(layout.num_folds, 0);
    EXPECT_LT(layout.stress, 0.8 * layout.start_stress);
    EXPECT_LE(layout.stress, 1.1 * layout.mds_stress);
    EXPECT_GT(smallest_area(patch, layout.uv_coordinates), 0.0);
    EXPECT_NEAR(layout.min_area, smallest_area(patch, layout.uv_coordinates), 1e-12);
}

TEST(IsomapEmbedding, SurfaceThatPlainScalingFoldsStaysFoldFree)
{
    const Patch patch = make_patch(10, bag);
    const IsomapEmbedding layout = compute_isomap_embedding(patch.mesh, patch.mirror);
    EXPECT_GT(layout.num_mds_folds, 0); // the twin
    EXPECT_EQ(layout.num_folds, 0);
    EXPECT_GE(smallest_area(patch, layout.uv_coordinates), 1e-8);
}

TEST(IsomapEmbedding, MirrorSymmetryIsExact)
{
    Patch patch = make_patch(9, dome);
    patch.mesh.vertices.row(0).array() += 3.7F; // the plane need not be x = 0
    patch.mesh.vertices.col(5).y() += 1.5F;     // nor the shape symmetric
    const IsomapEmbedding layout = compute_isomap_embedding(patch.mesh, patch.mirror);
    for (Eigen::Index v = 0; v < patch.mesh.num_vertices(); ++v) {
        const Eigen::Vector2f own = layout.uv_coordinates.col(v);
        const Eigen::Vector2f partner = layout.uv_coordinates.col(patch.mirror(v));
        EXPECT_EQ(partner.x(), 1.0F - own.x()) << v;
        EXPECT_EQ(partner.y(), own.y()) << v;
    }
}

TEST(IsomapEmbedding, LayoutIsUprightInTheUnitSquareWithItsMargin)
{
    for (const bool is_symmetric : {true, false}) {
        const Patch patch = make_patch(8, dome);
        const Eigen::VectorXi mirror = is_symmetric ? patch.mirror : Eigen::VectorXi();
        const IsomapEmbedding layout = compute_isomap_embedding(patch.mesh, mirror);
        const Eigen::Vector2f low = layout.uv_coordinates.rowwise().minCoeff();
        const Eigen::Vector2f high = layout.uv_coordinates.rowwise().maxCoeff();
        EXPECT_THAT(Eigen::Vector2f(low + high), test::IsNear(Eigen::Vector2f::Ones(), 1e-5));
        EXPECT_NEAR((high - low).maxCoeff(), 1.0F - 2.0F / 64.0F, 1e-5F);
        const int side = 17;
        const int middle = side * 8 + 8;
        const auto uv = [&](int v) { return layout.uv_coordinates.col(v); };
        EXPECT_GT(uv(middle + 5).x(), uv(middle).x() + 0.1F);        // x to the subject's left: u grows
        EXPECT_GT(uv(middle - 5 * side).y(), uv(middle).y() + 0.1F); // y downwards: v grows
        EXPECT_LT(std::abs(uv(middle + 5).y() - uv(middle).y()), 0.02F);
    }
}

TEST(IsomapEmbedding, HolesAreBridgedAndTheLongestBorderIsTheOuterOne)
{
    const auto eyes = [](double a, double b) { return std::abs(std::abs(a) - 0.45) < 0.2 && std::abs(b - 0.3) < 0.1; };
    const auto mouth = [](double a, double b) { return std::abs(a) < 0.3 && std::abs(b + 0.5) < 0.1; };
    const Patch patch = make_patch(10, flat, [&](double a, double b) { return eyes(a, b) || mouth(a, b); });
    Patch used = patch; // vertices inside a hole are in no triangle: drop them
    std::vector<int> new_index(static_cast<std::size_t>(patch.mesh.num_vertices()), -1);
    for (const int v : patch.mesh.triangles.reshaped()) {
        new_index[v] = 0;
    }
    int num_used = 0;
    for (int v = 0; v < patch.mesh.num_vertices(); ++v) {
        if (new_index[v] == 0) {
            new_index[v] = num_used;
            used.mesh.vertices.col(num_used++) = patch.mesh.vertices.col(v);
        }
    }
    used.mesh.vertices.conservativeResize(3, num_used);
    used.mirror.resize(num_used);
    for (int v = 0; v < patch.mesh.num_vertices(); ++v) {
        if (new_index[v] >= 0) {
            used.mirror(new_index[v]) = new_index[patch.mirror(v)];
        }
    }
    used.mesh.triangles = patch.mesh.triangles.unaryExpr([&](int v) { return new_index[v]; });
    const IsomapEmbedding layout = compute_isomap_embedding(used.mesh, used.mirror);
    EXPECT_EQ(layout.num_folds, 0);
    const Eigen::Matrix2Xd truth = used.mesh.vertices.topRows<2>().cast<double>();
    EXPECT_LE(isometry_error(layout.uv_coordinates, truth, layout.scale_per_mm), 0.03);
}

TEST(IsomapEmbedding, ImportanceMakesItsRegionTruer)
{
    const Patch patch = make_patch(8, dome);
    const Eigen::Index n = patch.mesh.num_vertices();
    // Stretch of the central cells against the best overall scale.
    const auto central_error = [&](double importance) {
        IsomapOptions options = {.importances = Eigen::VectorXd::Constant(n, 1.0)};
        for (Eigen::Index v = 0; v < n; ++v) {
            if (patch.mesh.vertices.col(v).head<2>().norm() < 45.0F) {
                options.importances(v) = importance;
            }
        }
        const IsomapEmbedding layout = compute_isomap_embedding(patch.mesh, patch.mirror, options);
        double sum = 0.0;
        for (Eigen::Index t = 0; t < patch.mesh.num_triangles(); ++t) {
            const int a = patch.mesh.triangles(0, t);
            const int b = patch.mesh.triangles(1, t);
            const double length = static_cast<double>((patch.mesh.vertices.col(a) - patch.mesh.vertices.col(b)).norm());
            const double shown =
                static_cast<double>((layout.uv_coordinates.col(a) - layout.uv_coordinates.col(b)).norm());
            if (options.importances(a) == importance && options.importances(b) == importance) {
                sum += std::abs(shown / (length * layout.scale_per_mm) - 1.0);
            }
        }
        return sum;
    };
    EXPECT_LT(central_error(20.0), 0.9 * central_error(1.0001));
}

TEST(IsomapEmbedding, SameInputGivesTheSameBits)
{
    const Patch patch = make_patch(7, bag);
    EXPECT_EQ(compute_isomap_embedding(patch.mesh, patch.mirror).uv_coordinates,
              compute_isomap_embedding(patch.mesh, patch.mirror).uv_coordinates);
}

TEST(IsomapEmbedding, TooFewIterationsAreSaidAndStillFoldFree)
{
    const Patch patch = make_patch(8, bag);
    const IsomapEmbedding layout = compute_isomap_embedding(patch.mesh, patch.mirror, {.max_iterations = 1});
    EXPECT_EQ(layout.status, IsomapStatus::not_converged);
    EXPECT_EQ(layout.num_folds, 0);
    EXPECT_GT(smallest_area(patch, layout.uv_coordinates), 0.0);
}

TEST(IsomapEmbedding, TrianglesTooThinForFloatsAreSaidToBeFolded)
{
    const auto sheet = [](double a, double b) { // the column beside the middle is 1e-6 mm away from it
        return Eigen::Vector3d(a > 0.0 && a < 0.15 ? 1e-6 : 60.0 * a, 60.0 * b, 0.0);
    };
    const Patch patch = make_patch(8, sheet);
    const IsomapEmbedding layout = compute_isomap_embedding(patch.mesh, {});
    EXPECT_TRUE(layout.uv_coordinates.allFinite());
    EXPECT_EQ(layout.status, IsomapStatus::folded);
    EXPECT_GT(layout.num_folds, 0);
    EXPECT_LE(smallest_area(patch, layout.uv_coordinates), 0.0);
}

TEST(IsomapEmbedding, OneTriangleIsADisc)
{
    Mesh mesh;
    mesh.vertices.resize(3, 3);
    mesh.vertices << 0, 30, 0, 0, 0, 40, 0, 0, 0;
    mesh.triangles.resize(3, 1);
    mesh.triangles << 0, 1, 2;
    const IsomapEmbedding layout = compute_isomap_embedding(mesh, {});
    EXPECT_EQ(layout.num_folds, 0);
    EXPECT_LE(isometry_error(layout.uv_coordinates, mesh.vertices.topRows<2>().cast<double>(), layout.scale_per_mm),
              1e-3);
}

TEST(IsomapEmbedding, WhatIsNotADiscIsNamed)
{
    const Patch patch = make_patch(3, flat);
    const auto embed = [](const Mesh& mesh, const Eigen::VectorXi& mirror = {}) {
        return [&mesh, mirror] { (void)compute_isomap_embedding(mesh, mirror); };
    };
    Mesh closed; // a tetrahedron
    closed.vertices.resize(3, 4);
    closed.vertices << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
    closed.triangles.resize(3, 4);
    closed.triangles << 0, 0, 0, 1, 2, 1, 3, 2, 1, 3, 2, 3;
    EXPECT_TRUE(throws<InvalidArgument>(embed(closed), "triangles", "a closed one"));

    Mesh fin = patch.mesh; // a third triangle at edge 0-1
    fin.vertices.conservativeResize(3, fin.num_vertices() + 1);
    fin.vertices.rightCols(1) << 1, 1, 50;
    fin.triangles.conservativeResize(3, fin.num_triangles() + 1);
    fin.triangles.rightCols(1) << 0, 1, static_cast<int>(fin.num_vertices()) - 1;
    EXPECT_TRUE(throws<InvalidArgument>(embed(fin), "edge 0-1"));

    Mesh two = patch.mesh; // two sheets
    two.vertices.resize(3, 6);
    two.vertices << 0, 9, 0, 20, 29, 20, 0, 0, 9, 0, 0, 9, 0, 0, 0, 0, 0, 0;
    two.triangles.resize(3, 2);
    two.triangles << 0, 3, 1, 4, 2, 5;
    EXPECT_TRUE(throws<InvalidArgument>(embed(two), "connected", "vertex 3"));

    Mesh torus; // a 4 x 4 torus without one triangle: one border, one handle
    torus.vertices.resize(3, 16);
    torus.triangles.resize(3, 32);
    for (int i = 0; i < 4; ++i) {
        for (int j = 0; j < 4; ++j) {
            const double a = 0.5 * std::numbers::pi * i;
            const double b = 0.5 * std::numbers::pi * j;
            const double radius = 3.0 + std::cos(b);
            const Eigen::Vector3d point(radius * std::cos(a), radius * std::sin(a), std::sin(b));
            torus.vertices.col(4 * i + j) = point.cast<float>();
            const int right = 4 * ((i + 1) % 4) + j;
            const int up = 4 * i + (j + 1) % 4;
            const int both = 4 * ((i + 1) % 4) + (j + 1) % 4;
            torus.triangles.col(2 * (4 * i + j)) << 4 * i + j, right, both;
            torus.triangles.col(2 * (4 * i + j) + 1) << 4 * i + j, both, up;
        }
    }
    torus.triangles.conservativeResize(3, 31);
    EXPECT_TRUE(throws<InvalidArgument>(embed(torus), "Euler characteristic 1", "got -1"));

    Mesh thin = patch.mesh;
    thin.vertices.col(8) = thin.vertices.col(0);
    EXPECT_TRUE(throws<InvalidArgument>(embed(thin), "positive area", "triangle 0"));
    Mesh broken = patch.mesh;
    broken.vertices(2, 4) = NAN;
    EXPECT_TRUE(throws<InvalidArgument>(embed(broken), "vertices(2, 4)", "nan"));
    EXPECT_TRUE(throws<InvalidArgument>(embed(Mesh()), "triangles", "none"));
    EXPECT_TRUE(throws<InvalidArgument>(embed(patch.mesh, Eigen::VectorXi::LinSpaced(49, 0, 48)), "mirror"));
}

TEST(IsomapEmbedding, BadOptionsAreNamed)
{
    const Patch patch = make_patch(3, flat);
    const auto with = [&](const IsomapOptions& options, auto... texts) {
        return throws<InvalidArgument>([&] { (void)compute_isomap_embedding(patch.mesh, {}, options); }, texts...);
    };
    EXPECT_TRUE(with({.importances = Eigen::VectorXd::Ones(48)}, "importances", "48"));
    EXPECT_TRUE(with({.importances = Eigen::VectorXd::Zero(49)}, "importances", "got 0"));
    EXPECT_TRUE(with({.num_sources = 2}, "num_sources", "2"));
    EXPECT_TRUE(with({.barrier_weight = 0.0}, "barrier_weight", "0"));
    EXPECT_TRUE(with({.barrier_weight = NAN}, "barrier_weight", "nan"));
    EXPECT_TRUE(with({.max_iterations = 0}, "max_iterations", "0"));
}

} // namespace
} // namespace lineament
