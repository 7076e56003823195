// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/affine_camera.hpp"

#include "lineament/core/checks.hpp"
#include "lineament/fit/inline.hpp"

#include <Eigen/QR>

#include <cmath>

namespace lineament {

LINEAMENT_FIT_INLINE AffineCameraResult estimate_affine_camera(
    const Eigen::Ref<const Eigen::Matrix3Xd>& points_in_model, const Eigen::Ref<const Eigen::Matrix2Xd>& image_points)
{
    require_size(image_points.cols(), points_in_model.cols(), "estimate_affine_camera", "image_points");
    require_finite(points_in_model, "estimate_affine_camera", "points_in_model");
    require_finite(image_points, "estimate_affine_camera", "image_points");
    AffineCameraResult result;
    if (points_in_model.cols() < 4) {
        result.status = FitStatus::too_few_correspondences;
        result.reason =
            "an affine camera needs 4 points, got " + std::to_string(static_cast<int>(points_in_model.cols()));
        return result;
    }

    // Normalise: centroid at the origin, mean distance sqrt(3) in the model and sqrt(2) in the image.
    const Eigen::Vector3d model_centre = points_in_model.rowwise().mean();
    const Eigen::Vector2d image_centre = image_points.rowwise().mean();
    const Eigen::Matrix3Xd model_centred = points_in_model.colwise() - model_centre;
    const Eigen::Matrix2Xd image_centred = image_points.colwise() - image_centre;
    const double model_distance = model_centred.colwise().norm().mean();
    const double image_distance = image_centred.colwise().norm().mean();
    if (!(model_distance > 0) || !(image_distance > 0)) {
        result.reason = "the points coincide";
        return result;
    }
    const double model_scale = std::sqrt(3.0) / model_distance;
    const double image_scale = std::sqrt(2.0) / image_distance;

    Eigen::MatrixXd design(points_in_model.cols(), 4); // both image coordinates share it
    design.leftCols<3>() = model_scale * model_centred.transpose();
    design.col(3).setOnes();
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(design);
    qr.setThreshold(1e-4);
    if (qr.rank() < 4) {
        result.reason = "the model points lie in a plane";
        return result;
    }
    const Eigen::Matrix<double, 4, 2> solution = qr.solve(Eigen::MatrixXd(image_scale * image_centred.transpose()));

    const Eigen::Matrix<double, 2, 3> linear = solution.topRows<3>().transpose() * (model_scale / image_scale);
    result.image_from_model.leftCols<3>() = linear;
    result.image_from_model.col(3) = solution.row(3).transpose() / image_scale + image_centre - linear * model_centre;
    result.status = FitStatus::success;
    return result;
}

} // namespace lineament
