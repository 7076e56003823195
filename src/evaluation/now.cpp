// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
// Based on: the published description of the NoW benchmark (Sanyal et al., CVPR 2019).
#include "lineament/evaluation/now.hpp"

#include "lineament/core/closest_point.hpp"

namespace lineament {

namespace {

/// Scan vertices inside the protocol's sphere (3 x n).
Eigen::Matrix3Xd crop(const Eigen::Matrix3Xd& vertices, const NowPoints& points)
{
    const Eigen::Vector3d nose_bottom = points.col(4);
    const Eigen::Vector3d between_eyes = 0.5 * (points.col(1) + points.col(2));
    const double outer_eye_distance = (points.col(0) - points.col(3)).norm();
    const double nose_length = (between_eyes - nose_bottom).norm();
    const Eigen::Vector3d center = nose_bottom + 0.3 * (between_eyes - nose_bottom);
    const double radius = 1.4 * (outer_eye_distance + nose_length) / 2.0;
    Eigen::Matrix3Xd kept(3, vertices.cols());
    Eigen::Index count = 0;
    for (Eigen::Index i = 0; i < vertices.cols(); ++i) {
        if ((vertices.col(i) - center).norm() <= radius) {
            kept.col(count++) = vertices.col(i);
        }
    }
    require(count > 0, "evaluate_now", "scan_vertices", "vertices within the crop", "none");
    return kept.leftCols(count);
}

} // namespace

NowResult evaluate_now(const Eigen::Matrix3Xd& scan_vertices, const NowPoints& scan_points,
                       const Eigen::Matrix3Xd& prediction_vertices, const Eigen::Matrix3Xi& prediction_triangles,
                       const NowPoints& prediction_points, AlignmentScale scale)
{
    require_finite(scan_vertices, "evaluate_now", "scan_vertices");
    require_finite(scan_points, "evaluate_now", "scan_points");
    require_finite(prediction_points, "evaluate_now", "prediction_points");
    const Eigen::Matrix3Xd scan = crop(scan_vertices, scan_points);
    const ClosestPointTree prediction(prediction_vertices, prediction_triangles);

    NowResult result;
    result.scan_from_prediction = align_points(prediction_points, scan_points, scale);
    result.distances_mm.resize(static_cast<std::size_t>(scan.cols()));
    double previous_error = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < 100; ++iteration) {
        // Nearest surface points, found in the prediction's frame: distances scale back by the similarity.
        const Similarity& pose = result.scan_from_prediction;
        const Eigen::Matrix3Xd in_prediction =
            pose.rotation.transpose() * (scan.colwise() - pose.translation) / pose.scale;
        Eigen::Matrix3Xd nearest(3, scan.cols());
        double error = 0.0;
        for (Eigen::Index i = 0; i < scan.cols(); ++i) {
            const SurfacePoint point = prediction.closest(in_prediction.col(i));
            nearest.col(i) = point.point;
            result.distances_mm[static_cast<std::size_t>(i)] = pose.scale * point.distance;
            error +=
                result.distances_mm[static_cast<std::size_t>(i)] * result.distances_mm[static_cast<std::size_t>(i)];
        }
        if (!(error < previous_error * (1.0 - 1e-6))) {
            break;
        }
        previous_error = error;
        result.scan_from_prediction = align_points(nearest, scan, scale);
    }
    return result;
}

} // namespace lineament
