// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/model/morphable_model.hpp"

#include <Eigen/Core>

#include <span>

namespace lineament {

/// Equation (1) at N points of a model, packed in double precision.
///
///   S_i(a, psi) = mean_i + B_i a + D_i psi                                                 docs/maths.md, Eq. (1)
///
/// The rows of B and D are kept as columns, so that one point's numbers lie together: columns 3i, 3i + 1, 3i + 2 of
/// `identity` are B_i^T.
struct ModelPoints
{
    Eigen::Matrix3Xd mean = {};      ///< 3 x N, mm.
    Eigen::MatrixXd identity = {};   ///< m x 3N, mm.
    Eigen::MatrixXd expression = {}; ///< k x 3N, mm.

    [[nodiscard]] Eigen::Index num_points() const { return mean.cols(); }
    [[nodiscard]] Eigen::Index num_shape_coefficients() const { return identity.rows(); }
    [[nodiscard]] Eigen::Index num_expression_coefficients() const { return expression.rows(); }

    /// S_i for every point (3 x N). Missing trailing coefficients are 0.
    [[nodiscard]] Eigen::Matrix3Xd at(const Eigen::VectorXd& shape_coefficients,
                                      const Eigen::VectorXd& expression_coefficients) const;

    /// S_i of one point.
    [[nodiscard]] Eigen::Vector3d at(Eigen::Index point, const Eigen::VectorXd& shape_coefficients,
                                     const Eigen::VectorXd& expression_coefficients) const;

    /// Room for `count` points of as many coefficients, unset.
    [[nodiscard]] static ModelPoints sized(Eigen::Index count, Eigen::Index num_shape, Eigen::Index num_expression);

    /// Sets point `to` to point `from` of `other`, which has the same numbers of coefficients.
    void assign(Eigen::Index to, const ModelPoints& other, Eigen::Index from);
};

/// The points of a landmark map, in its order.
/// @param expressions  nullptr: no expressions.
/// @param num_shape_coefficients  Leading components to keep, at most m.
[[nodiscard]] ModelPoints landmark_points(const MorphableModel& model, const LandmarkMap& map,
                                          const Blendshapes* expressions, Eigen::Index num_shape_coefficients);

/// The points of single vertices.
[[nodiscard]] ModelPoints vertex_points(const MorphableModel& model, std::span<const int> vertices,
                                        const Blendshapes* expressions, Eigen::Index num_shape_coefficients);

// Definitions

inline Eigen::Matrix3Xd ModelPoints::at(const Eigen::VectorXd& shape_coefficients,
                                        const Eigen::VectorXd& expression_coefficients) const
{
    Eigen::Matrix3Xd points = mean;
    Eigen::Map<Eigen::VectorXd> stacked(points.data(), points.size());
    stacked.noalias() += identity.topRows(shape_coefficients.size()).transpose() * shape_coefficients;
    stacked.noalias() += expression.topRows(expression_coefficients.size()).transpose() * expression_coefficients;
    return points;
}

inline Eigen::Vector3d ModelPoints::at(Eigen::Index point, const Eigen::VectorXd& shape_coefficients,
                                       const Eigen::VectorXd& expression_coefficients) const
{
    return mean.col(point) +
           identity.middleCols<3>(3 * point).topRows(shape_coefficients.size()).transpose() * shape_coefficients +
           expression.middleCols<3>(3 * point).topRows(expression_coefficients.size()).transpose() *
               expression_coefficients;
}

inline ModelPoints ModelPoints::sized(Eigen::Index count, Eigen::Index num_shape, Eigen::Index num_expression)
{
    ModelPoints points;
    points.mean.resize(3, count);
    points.identity.resize(num_shape, 3 * count);
    points.expression.resize(num_expression, 3 * count);
    return points;
}

inline void ModelPoints::assign(Eigen::Index to, const ModelPoints& other, Eigen::Index from)
{
    mean.col(to) = other.mean.col(from);
    identity.middleCols<3>(3 * to) = other.identity.middleCols<3>(3 * from);
    expression.middleCols<3>(3 * to) = other.expression.middleCols<3>(3 * from);
}

inline ModelPoints landmark_points(const MorphableModel& model, const LandmarkMap& map, const Blendshapes* expressions,
                                   Eigen::Index num_shape_coefficients)
{
    const Eigen::Index num_expressions = expressions ? expressions->num_coefficients() : 0;
    ModelPoints points = ModelPoints::sized(map.num_landmarks(), num_shape_coefficients, num_expressions);
    points.mean.setZero();
    points.identity.setZero();
    points.expression.setZero();
    const Eigen::VectorXd sigma = model.shape.standard_deviations.head(num_shape_coefficients).cast<double>();
    for (Eigen::Index l = 0; l < map.num_landmarks(); ++l) {
        for (int corner = 0; corner < 3; ++corner) {
            const double weight = map.weights(corner, l);
            const Eigen::Index row = 3 * static_cast<Eigen::Index>(map.vertices(corner, l));
            points.mean.col(l) += weight * model.shape.mean.segment<3>(row).cast<double>();
            points.identity.middleCols<3>(3 * l) +=
                weight * sigma.asDiagonal() *
                model.shape.basis.middleRows<3>(row).leftCols(num_shape_coefficients).transpose().cast<double>();
            if (expressions) {
                points.expression.middleCols<3>(3 * l) +=
                    weight * expressions->offsets.middleRows<3>(row).transpose().cast<double>();
            }
        }
    }
    return points;
}

inline ModelPoints vertex_points(const MorphableModel& model, std::span<const int> vertices,
                                 const Blendshapes* expressions, Eigen::Index num_shape_coefficients)
{
    LandmarkMap map;
    map.vertices.resize(3, static_cast<Eigen::Index>(vertices.size()));
    map.weights.resize(3, static_cast<Eigen::Index>(vertices.size()));
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        map.vertices.col(static_cast<Eigen::Index>(i)).setConstant(vertices[i]);
        map.weights.col(static_cast<Eigen::Index>(i)) = Eigen::Vector3f::UnitX();
    }
    return landmark_points(model, map, expressions, num_shape_coefficients);
}

} // namespace lineament
