// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine.hpp"
#include "square_window.hpp"

#include <Eigen/Core>

#include <memory>
#include <vector>

namespace lineament {

inline constexpr int num_surface_points = 468;
inline constexpr int num_mesh_points = 478;

/// 478 points and how sure the network is that they lie on a face.
struct MeshEstimate
{
    Eigen::Matrix<float, 3, num_mesh_points> points; ///< In the picture [px]; z in the same unit.
    double presence = 0.0;
};

/// MediaPipe's landmark network with attention to lips, eyes and irises.
class MeshNetwork
{
public:
    /// @throws IoError if the network has another input, other outputs or other regions.
    explicit MeshNetwork(network::Network network);

    /// The points of the face in the window; allocates nothing.
    void estimate(const ImageU8& picture, const SquareWindow& window, MeshEstimate& estimate);

private:
    static constexpr int size = 192; ///< Of the input [px].
    std::unique_ptr<network::Engine> engine_;
    std::vector<std::vector<int>> refined_ = {}; ///< Surface points that lips, right and left eye give anew.
};

/// The window in which the network expects the face that had these points in the previous frame.
[[nodiscard]] SquareWindow window_of(const Eigen::Matrix3Xf& points);

} // namespace lineament
