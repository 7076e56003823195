// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Based on: Tutte, How to Draw a Graph, Proc. London Math. Soc. 1963; Floater, Mean Value Coordinates, CAGD 2003;
// Smith and Schaefer, Bijective Parameterization with Free Boundaries, SIGGRAPH 2015 (symmetric Dirichlet energy, step
// to the first fold); Teran et al., Robust Quasistatic Finite Elements and Flesh Simulation, SCA 2005 (projected
// Newton).
#include "disc_layout.hpp"

#include <Eigen/Dense>
#include <Eigen/SparseLU>

#include <algorithm>
#include <cmath>
#include <limits>

namespace lineament::detail {

namespace {

constexpr double fraction_of_first_fold = 0.9;

/// tan(angle / 2) at `apex` between the directions to `a` and `b`.
double half_angle_tangent(const Eigen::Vector3d& apex, const Eigen::Vector3d& a, const Eigen::Vector3d& b)
{
    const double cosine = (a - apex).dot(b - apex);
    const double sine = (a - apex).cross(b - apex).norm();
    return sine / (std::hypot(sine, cosine) + cosine);
}

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b)
{
    return a.x() * b.y() - a.y() * b.x();
}

/// Smallest t > 0 with c + b t + a t^2 <= 0, given c > 0; infinite if there is none.
double first_root(double a, double b, double c)
{
    const double discriminant = b * b - 4.0 * a * c;
    if (discriminant < 0.0 || (a >= 0.0 && b >= 0.0)) {
        return std::numeric_limits<double>::infinity();
    }
    return 2.0 * c / (-b + std::sqrt(discriminant)); // the stable form; also for a = 0
}

} // namespace

Eigen::Matrix2Xd tutte_embedding(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xi& triangles,
                                 const std::vector<int>& border, const Eigen::VectorXd& angles)
{
    const Eigen::Index n = vertices.cols();
    Eigen::VectorXd sums = Eigen::VectorXd::Zero(n);
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::MatrixX2d right_side = Eigen::MatrixX2d::Zero(n, 2);
    std::vector<char> is_border(static_cast<std::size_t>(n), 0);
    for (std::size_t i = 0; i < border.size(); ++i) {
        const double angle = angles(static_cast<Eigen::Index>(i));
        is_border[border[i]] = 1;
        right_side.row(border[i]) << std::cos(angle), std::sin(angle);
        entries.emplace_back(border[i], border[i], 1.0);
    }
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            const int v = triangles(corner, t);
            if (is_border[v] != 0) {
                continue;
            }
            const int a = triangles((corner + 1) % 3, t);
            const int b = triangles((corner + 2) % 3, t);
            const double tangent = half_angle_tangent(vertices.col(v), vertices.col(a), vertices.col(b));
            for (const int neighbor : {a, b}) {
                const double weight = tangent / (vertices.col(neighbor) - vertices.col(v)).norm();
                entries.emplace_back(v, neighbor, -weight);
                sums(v) += weight;
            }
        }
    }
    for (int v = 0; v < n; ++v) {
        if (is_border[v] == 0) {
            entries.emplace_back(v, v, sums(v));
        }
    }
    Eigen::SparseMatrix<double> system(n, n);
    system.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SparseLU<Eigen::SparseMatrix<double>> solver(system);
    const Eigen::MatrixX2d solution = solver.solve(right_side);
    return solution.transpose();
}

double doubled_area(const Eigen::Matrix2Xd& layout, const Eigen::Vector3i& triangle)
{
    return cross(layout.col(triangle(1)) - layout.col(triangle(0)), layout.col(triangle(2)) - layout.col(triangle(0)));
}

FoldBarrier::FoldBarrier(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xi& triangles,
                         const Eigen::VectorXd& importances)
    : triangles_(triangles), weights_(triangles.cols())
{
    rest_inverses_.reserve(static_cast<std::size_t>(triangles.cols()));
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        const Eigen::Vector3d first = vertices.col(triangles(1, t)) - vertices.col(triangles(0, t));
        const Eigen::Vector3d second = vertices.col(triangles(2, t)) - vertices.col(triangles(0, t));
        const double doubled = first.cross(second).norm();
        Eigen::Matrix2d rest;
        rest << first.norm(), first.dot(second) / first.norm(), 0.0, doubled / first.norm();
        rest_inverses_.emplace_back(rest.inverse());
        weights_(t) =
            doubled * (importances(triangles(0, t)) + importances(triangles(1, t)) + importances(triangles(2, t)));
    }
    weights_ /= weights_.sum();
}

Eigen::Matrix2d FoldBarrier::jacobian(const Eigen::Matrix2Xd& layout, Eigen::Index t) const
{
    Eigen::Matrix2d edges;
    edges.col(0) = layout.col(triangles_(1, t)) - layout.col(triangles_(0, t));
    edges.col(1) = layout.col(triangles_(2, t)) - layout.col(triangles_(0, t));
    return edges * rest_inverses_[static_cast<std::size_t>(t)];
}

double FoldBarrier::value(const Eigen::Matrix2Xd& layout) const
{
    double sum = 0.0;
    for (Eigen::Index t = 0; t < triangles_.cols(); ++t) {
        const Eigen::Matrix2d j = jacobian(layout, t);
        const double determinant = j.determinant();
        if (!(determinant > 0.0)) {
            return std::numeric_limits<double>::infinity();
        }
        sum += weights_(t) * (j.squaredNorm() * (1.0 + 1.0 / (determinant * determinant)) / 4.0 - 1.0);
    }
    return sum;
}

void FoldBarrier::add_derivatives(const Eigen::Matrix2Xd& layout, double weight, Eigen::VectorXd& gradient,
                                  std::vector<Eigen::Triplet<double>>& hessian) const
{
    // With n = |J|^2, d = det J, C its cofactors (both as 4-vectors j00 j10 j01 j11), f = n (1 + d^-2):
    //   f' = 2 (1 + d^-2) J - 2 n d^-3 C,   f'' = 2 (1 + d^-2) I - 4 d^-3 (J C' + C J') + 6 n d^-4 C C' - 2 n d^-3 d''
    Eigen::Matrix4d determinant_hessian = Eigen::Matrix4d::Zero();
    determinant_hessian(0, 3) = determinant_hessian(3, 0) = 1.0;
    determinant_hessian(1, 2) = determinant_hessian(2, 1) = -1.0;
    for (Eigen::Index t = 0; t < triangles_.cols(); ++t) {
        const Eigen::Matrix2d matrix = jacobian(layout, t);
        const Eigen::Vector4d j(matrix(0, 0), matrix(1, 0), matrix(0, 1), matrix(1, 1));
        const Eigen::Vector4d c(j(3), -j(2), -j(1), j(0));
        const double n = j.squaredNorm();
        const double d = matrix.determinant();
        const double d2 = 1.0 / (d * d);
        const double d3 = d2 / d;
        const Eigen::Vector4d slope = 2.0 * (1.0 + d2) * j - 2.0 * n * d3 * c;
        Eigen::Matrix4d curvature = 2.0 * (1.0 + d2) * Eigen::Matrix4d::Identity() -
                                    4.0 * d3 * (j * c.transpose() + c * j.transpose()) +
                                    6.0 * n * d2 * d2 * c * c.transpose() - 2.0 * n * d3 * determinant_hessian;
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(curvature);
        curvature =
            eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * eigen.eigenvectors().transpose();

        // J is linear in the six corner coordinates.
        const Eigen::Matrix2d& rest = rest_inverses_[static_cast<std::size_t>(t)];
        Eigen::Matrix<double, 4, 6> chain;
        for (int column = 0; column < 2; ++column) {
            const double second = rest(0, column);
            const double third = rest(1, column);
            const Eigen::Matrix2d identity = Eigen::Matrix2d::Identity();
            chain.block<2, 2>(2 * column, 0) = -(second + third) * identity;
            chain.block<2, 2>(2 * column, 2) = second * identity;
            chain.block<2, 2>(2 * column, 4) = third * identity;
        }
        const double factor = weight * weights_(t) / 4.0;
        const Eigen::Matrix<double, 6, 1> local_gradient = factor * chain.transpose() * slope;
        const Eigen::Matrix<double, 6, 6> local_hessian = factor * chain.transpose() * curvature * chain;
        for (int row = 0; row < 6; ++row) {
            const int global_row = 2 * triangles_(row / 2, t) + row % 2;
            gradient(global_row) += local_gradient(row);
            for (int column = 0; column < 6; ++column) {
                const int global_column = 2 * triangles_(column / 2, t) + column % 2;
                if (global_row >= global_column) { // the lower half is enough for Cholesky
                    hessian.emplace_back(global_row, global_column, local_hessian(row, column));
                }
            }
        }
    }
}

double FoldBarrier::longest_step(const Eigen::Matrix2Xd& layout, const Eigen::Matrix2Xd& step) const
{
    double longest = 1.0;
    for (Eigen::Index t = 0; t < triangles_.cols(); ++t) {
        const Eigen::Vector3i triangle = triangles_.col(t);
        const Eigen::Vector2d a = layout.col(triangle(1)) - layout.col(triangle(0));
        const Eigen::Vector2d b = layout.col(triangle(2)) - layout.col(triangle(0));
        const Eigen::Vector2d da = step.col(triangle(1)) - step.col(triangle(0));
        const Eigen::Vector2d db = step.col(triangle(2)) - step.col(triangle(0));
        const double fold = first_root(cross(da, db), cross(da, b) + cross(a, db), cross(a, b));
        longest = std::min(longest, fraction_of_first_fold * fold);
    }
    return longest;
}

} // namespace lineament::detail
