// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/model/pca_model.hpp"

#include <Eigen/Core>

#include <functional>

namespace lineament::build {

/// The columns and their mirror images with half of the variance each: (d + Md) / 2 and (d - Md) / 2 for each d, since
/// (d d^T + Md (Md)^T) / 2 is the sum of their outer products.
[[nodiscard]] Eigen::MatrixXd split_by_symmetry(const Eigen::MatrixXd& columns, const Eigen::VectorXi& mirror,
                                                double mirrored_x_sign);

/// Takes out of each column (3V x n) the infinitesimal rigid motion of `mean` that explains it best on the vertices
/// with weight (V, >= 0).
void remove_rigid_motion(Eigen::MatrixXd& columns, const Eigen::Matrix3Xd& mean, const Eigen::VectorXd& weights);

/// The model with covariance D D^T: eigenvectors by way of the n x n Gram matrix D^T D, the largest entry of each mode
/// positive.
/// @par Reference  Turk and Pentland, Eigenfaces for Recognition, Journal of Cognitive Neuroscience 1991 (Gram matrix).
[[nodiscard]] PcaModel compute_pca_of_displacements(const Eigen::VectorXd& mean, const Eigen::MatrixXd& columns,
                                                    int num_coefficients);

} // namespace lineament::build
