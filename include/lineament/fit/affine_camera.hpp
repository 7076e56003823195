// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/fit_result.hpp"

#include <Eigen/Core>

#include <string>

namespace lineament {

struct AffineCameraResult
{
    FitStatus status = FitStatus::degenerate;
    std::string reason = {};
    Eigen::Matrix<double, 2, 4> image_from_model = Eigen::Matrix<double, 2, 4>::Zero(); ///< px/mm, last column px.
};

/// The affine camera P that minimises sum_i |P (X_i, 1) - y_i|^2, by the Gold Standard algorithm with its
/// normalisation.
///
/// For comparison only: an affine camera may scale the axes apart and shear, and so takes up the width of a face that
/// belongs to its shape. Prefer estimate_pose.
///
/// @param points_in_model  3 x N, mm, N >= 4, not in one plane.
/// @param image_points     2 x N, px.
/// @throws InvalidArgument on sizes that disagree or non-finite input.
/// @par Reference  Hartley and Zisserman, Multiple View Geometry in Computer Vision, 2nd edition 2004, algorithm 7.1.
[[nodiscard]] AffineCameraResult estimate_affine_camera(const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model,
                                                        const Eigen::Ref<const Eigen::Matrix2Xd>& image_points);

} // namespace lineament

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/affine_camera_impl.hpp"
#endif
