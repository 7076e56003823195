// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/procrustes.hpp"

#include <Eigen/Core>

#include <array>
#include <vector>

namespace lineament {

/// The seven points of the NoW protocol [mm]: outer and inner corner of the subject's right eye, inner and outer corner
/// of the left eye, nose bottom, right and left mouth corner (ibug 37, 40, 43, 46, 34, 49, 55).
using NowPoints = Eigen::Matrix<double, 3, 7>;

/// The ibug68 names of the seven points, in the order of NowPoints.
inline constexpr std::array<const char*, 7> now_point_names = {"37", "40", "43", "46", "34", "49", "55"};

struct NowResult
{
    std::vector<double> distances_mm = {}; ///< One for each scan vertex inside the crop.
    Similarity scan_from_prediction = {};  ///< Of the final alignment.
};

/// Distances of a scan to a predicted neutral face, by the protocol of the NoW benchmark.
///
/// The scan is cropped to a sphere about c = nose_bottom + 0.3 (m - nose_bottom), m the middle of the inner eye
/// corners, of radius 1.4 (outer_eye_distance + |m - nose_bottom|) / 2. The prediction is aligned by a similarity on
/// the seven points, then by least squares of the scan-to-mesh distances over scale, rotation and translation
/// (`scale` fixed: metrical evaluation). Distances are from scan vertex to predicted surface.
///
/// @param scan_vertices          3 x N, mm.
/// @param prediction_vertices    3 x V, mm. @param prediction_triangles 3 x T.
/// @throws InvalidArgument on non-finite or empty input, or if no scan vertex lies in the crop.
/// @par Reference  Sanyal et al., Learning to Regress 3D Face Shape and Expression from an Image without 3D
/// Supervision,
///                 CVPR 2019, and the benchmark's published description.
[[nodiscard]] NowResult evaluate_now(const Eigen::Matrix3Xd& scan_vertices, const NowPoints& scan_points,
                                     const Eigen::Matrix3Xd& prediction_vertices,
                                     const Eigen::Matrix3Xi& prediction_triangles, const NowPoints& prediction_points,
                                     AlignmentScale scale = AlignmentScale::free);

} // namespace lineament
