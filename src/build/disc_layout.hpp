// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Sparse>

#include <vector>

/// Layouts of a mesh disc in the plane that have no folds; not a public header. Positive area: counter-clockwise.
namespace lineament::detail {

/// The vertices of `border` at the given angles of the unit circle and every other vertex in a positive weighted mean
/// (mean value coordinates) of its neighbours: no triangle is folded (Tutte 1963, Floater 2003).
[[nodiscard]] Eigen::Matrix2Xd tutte_embedding(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xi& triangles,
                                               const std::vector<int>& border, const Eigen::VectorXd& angles);

/// Twice the signed area of a triangle of the layout.
[[nodiscard]] double doubled_area(const Eigen::Matrix2Xd& layout, const Eigen::Vector3i& triangle);

/// The mean over the surface of (|J|^2 + |J^-1|^2) / 4 - 1: 0 for an isometry, infinite for a folded triangle.
class FoldBarrier
{
public:
    /// @param importances  n, weight of each vertex's share of the area.
    FoldBarrier(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xi& triangles,
                const Eigen::VectorXd& importances);

    [[nodiscard]] double value(const Eigen::Matrix2Xd& layout) const;

    /// Adds `weight` times the gradient (2n) and the Hessian, each triangle's made positive semidefinite.
    void add_derivatives(const Eigen::Matrix2Xd& layout, double weight, Eigen::VectorXd& gradient,
                         std::vector<Eigen::Triplet<double>>& hessian) const;

    /// The largest t <= 1 for which layout + t step stays a fixed fraction away from the first fold.
    [[nodiscard]] double longest_step(const Eigen::Matrix2Xd& layout, const Eigen::Matrix2Xd& step) const;

private:
    [[nodiscard]] Eigen::Matrix2d jacobian(const Eigen::Matrix2Xd& layout, Eigen::Index t) const;

    Eigen::Matrix3Xi triangles_;
    std::vector<Eigen::Matrix2d> rest_inverses_; // T: (edges in the triangle's own plane)^-1
    Eigen::VectorXd weights_;                    // T, sum 1
};

} // namespace lineament::detail
