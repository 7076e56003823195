// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "symmetric_pca.hpp"

#include "lineament/core/checks.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace lineament::build {

Eigen::MatrixXd split_by_symmetry(const Eigen::MatrixXd& columns, const Eigen::VectorXi& mirror, double mirrored_x_sign)
{
    Eigen::MatrixXd result(columns.rows(), 2 * columns.cols());
    for (Eigen::Index v = 0; v < mirror.size(); ++v) {
        for (int axis = 0; axis < 3; ++axis) {
            const double sign = axis == 0 ? mirrored_x_sign : 1.0;
            const auto own = columns.row(3 * v + axis);
            const auto partner = columns.row(3 * mirror[v] + axis);
            result.row(3 * v + axis).head(columns.cols()) = 0.5 * (own + sign * partner);
            result.row(3 * v + axis).tail(columns.cols()) = 0.5 * (own - sign * partner);
        }
    }
    return result;
}

void remove_rigid_motion(Eigen::MatrixXd& columns, const Eigen::Matrix3Xd& mean, const Eigen::VectorXd& weights)
{
    const Eigen::Vector3d center = mean * weights / weights.sum();
    Eigen::MatrixXd motions(columns.rows(), 6);
    Eigen::VectorXd row_weights(columns.rows());
    for (Eigen::Index v = 0; v < mean.cols(); ++v) {
        const Eigen::Vector3d x = (mean.col(v) - center) / 100.0; // all columns of about the same size
        motions.block<3, 3>(3 * v, 0) = Eigen::Matrix3d::Identity();
        motions.block<3, 3>(3 * v, 3) << 0, x.z(), -x.y(), -x.z(), 0, x.x(), x.y(), -x.x(), 0;
        row_weights.segment<3>(3 * v).setConstant(weights[v]);
    }
    const Eigen::MatrixXd weighted = row_weights.asDiagonal() * motions;
    const Eigen::MatrixXd normal = weighted.transpose() * motions;
    columns -= motions * normal.ldlt().solve(weighted.transpose() * columns);
}

PcaModel compute_pca_of_displacements(const Eigen::VectorXd& mean, const Eigen::MatrixXd& columns, int num_coefficients)
{
    require(num_coefficients <= columns.cols(), "compute_pca_of_displacements", "num_coefficients",
            "at most " + std::to_string(columns.cols()), std::to_string(num_coefficients));
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(columns.transpose() * columns);
    PcaModel model;
    model.mean = mean.cast<float>();
    model.basis.resize(columns.rows(), num_coefficients);
    model.standard_deviations.resize(num_coefficients);
    for (int i = 0; i < num_coefficients; ++i) {
        const Eigen::Index from_last = columns.cols() - 1 - i; // eigenvalues rise
        Eigen::VectorXd mode = columns * eigen.eigenvectors().col(from_last);
        const double sigma = mode.norm();
        Eigen::Index largest = 0;
        mode.cwiseAbs().maxCoeff(&largest);
        // Modes are symmetric or antisymmetric: two entries tie for the largest, the first decides.
        for (Eigen::Index k = 0; k < mode.size(); ++k) {
            if (std::abs(mode[k]) > (1.0 - 1e-6) * std::abs(mode[largest])) {
                largest = k;
                break;
            }
        }
        model.basis.col(i) = (mode / (mode[largest] < 0 ? -sigma : sigma)).cast<float>();
        model.standard_deviations[i] = static_cast<float>(sigma);
    }
    return model;
}

} // namespace lineament::build
