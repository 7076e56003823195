// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <map>
#include <string>
#include <vector>

namespace lineament {

/// Which model points the names of a landmark scheme mean: barycentric points of up to three vertices each. The
/// vertices belong to the coarsest level, so a map holds at every level.
struct LandmarkMap
{
    std::string scheme = {};             ///< "ibug68".
    std::vector<std::string> names = {}; ///< L.
    Eigen::Matrix3Xi vertices = {};      ///< 3 x L, vertex indices.
    Eigen::Matrix3Xf weights = {};       ///< 3 x L, >= 0, each column sums to 1.
    /// Detector name -> L standard deviations [mm] of a landmark's coordinates, > 0; infinite: it is no measurement.
    /// Fits take landmarks as independent: where a detector's are not, these are larger than each landmark's own.
    std::map<std::string, Eigen::VectorXf> noise_mm = {};

    [[nodiscard]] Eigen::Index num_landmarks() const { return vertices.cols(); }

    /// Position of the name in the map, or -1.
    [[nodiscard]] int index_of(const std::string& name) const
    {
        for (std::size_t i = 0; i < names.size(); ++i) {
            if (names[i] == name) {
                return static_cast<int>(i);
            }
        }
        return -1;
    }

    /// The model points (3 x L) on a shape with vertices 3 x V.
    [[nodiscard]] Eigen::Matrix3Xf points_on(const Eigen::Ref<const Eigen::Matrix3Xf>& shape_vertices) const
    {
        Eigen::Matrix3Xf points(3, num_landmarks());
        for (Eigen::Index l = 0; l < num_landmarks(); ++l) {
            points.col(l) = weights(0, l) * shape_vertices.col(vertices(0, l)) +
                            weights(1, l) * shape_vertices.col(vertices(1, l)) +
                            weights(2, l) * shape_vertices.col(vertices(2, l));
        }
        return points;
    }
};

} // namespace lineament
