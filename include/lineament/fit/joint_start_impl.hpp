// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// A first pose that some wild landmarks do not sway.
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_START_IMPL_HPP
#define LINEAMENT_FIT_JOINT_START_IMPL_HPP

#include "lineament/fit/pose.hpp"
#include "lineament/fit/pose_support_impl.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <algorithm>
#include <vector>

namespace lineament::detail {

/// Of a set of numbers, the upper one of the middle two.
[[nodiscard]] inline double median_of(const Eigen::VectorXd& values)
{
    std::vector<double> sorted(values.begin(), values.end());
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    return *middle;
}

inline constexpr Eigen::Index min_points_for_wild_ones = 12;

/// Whether a pose is none that can be used, or leaves a point eight times as far away as the middle one: of 20,000
/// faces of 20 to 68 landmarks with up to 3 px of noise the largest ratio was 7.3.
/// @param distances  N x 2, between where the pose has the points seen and the landmarks [px].
[[nodiscard]] inline bool has_wild_points(const PoseResult& pose, const RoomyMatrix<Eigen::MatrixX2d>& distances)
{
    if (distances.rows() < min_points_for_wild_ones) {
        return false;
    }
    if (pose.status != FitStatus::success) {
        return true;
    }
    const auto squares = distances.col(0).array().abs2() + distances.col(1).array().abs2();
    const double largest = squares.maxCoeff();
    const auto num_near = (8 * 8 * squares < largest).count();
    return 2 * num_near > squares.size(); // the middle one is among them
}

/// The weights, 0 for points that lie four times as far from an affine camera as the middle one. The camera is that of
/// the least sum of distances, which up to some fifth of wild points do not sway, by weighted least squares again and
/// again (Weiszfeld, Sur le point pour lequel la somme des distances de n points donnes est minimum, 1937).
[[nodiscard]] inline Eigen::VectorXd without_wild_points(const Eigen::Ref<const Eigen::Matrix3Xd>& points,
                                                         const Eigen::Ref<const Eigen::Matrix2Xd>& image_points,
                                                         const Eigen::VectorXd& given_weights)
{
    const Eigen::VectorXd given = weights_or_ones(given_weights, points.cols());
    Eigen::Matrix4Xd homogeneous(4, points.cols());
    homogeneous << points, Eigen::RowVectorXd::Constant(points.cols(), 100.0); // of the size of a face
    Eigen::VectorXd weights = given;
    Eigen::VectorXd distances;
    for (int iteration = 0; iteration < 30; ++iteration) {
        const Eigen::Matrix4Xd weighted = homogeneous * weights.asDiagonal();
        const Eigen::Matrix4d moments = weighted * homogeneous.transpose();
        const Eigen::Matrix<double, 4, 2> camera = moments.ldlt().solve(weighted * image_points.transpose());
        distances = (camera.transpose() * homogeneous - image_points).colwise().norm();
        const double nearest = 0.1 * median_of(distances); // keeps single points from being hit exactly
        if (!(nearest > 0)) {
            break;
        }
        weights = given.cwiseQuotient(distances.cwiseMax(nearest));
        weights /= weights.maxCoeff();
    }
    return (distances.array() <= 4 * median_of(distances)).select(given, 0.0);
}

} // namespace lineament::detail

#endif
