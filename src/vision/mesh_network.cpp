// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Based on: Grishchenko et al., Attention Mesh: High-fidelity Face Mesh Prediction in Real-time, CVPR Workshop on
// Computer Vision for Augmented and Virtual Reality 2020.
#include "mesh_network.hpp"

#include "lineament/core/error.hpp"

#include <algorithm>
#include <cmath>

namespace lineament {
namespace {

constexpr int num_lip_points = 80;
constexpr int num_eye_points = 71;
constexpr int num_lid_points = 16; // the first ones of an eye: its two lids
constexpr int num_iris_points = 5;

} // namespace

MeshNetwork::MeshNetwork(network::Network network)
{
    network::expect_shapes(network, {1, size, size, 3},
                           {3 * num_surface_points, 2 * num_lip_points, 2 * num_eye_points, 2 * num_eye_points,
                            2 * num_iris_points, 2 * num_iris_points, 1});
    // The regions' points are in the order of the outputs that replace them.
    for (const network::Step& step : network.steps) {
        if (step.operation == network::Operation::region_matrix) {
            refined_.push_back(step.region.points);
        }
    }
    const std::vector<std::size_t> expected = {num_lip_points, num_eye_points, num_eye_points};
    const bool agree = refined_.size() == expected.size() &&
                       std::equal(refined_.begin(), refined_.end(), expected.begin(),
                                  [](const std::vector<int>& points, std::size_t count) {
                                      return points.size() == count && *std::max_element(points.begin(), points.end()) <
                                                                           static_cast<int>(num_surface_points);
                                  });
    if (!agree) {
        throw IoError(IoErrorKind::content, network.path, "Landmarks2TransformMatrix",
                      "expected regions of 80, 71 and 71 of the 468 points, found others");
    }
    engine_ = network::make_engine(std::move(network));
}

void MeshNetwork::estimate(const ImageU8& picture, const SquareWindow& window, MeshEstimate& estimate)
{
    sample_window(picture, window, size, Border::repeated, 0.0f, 1.0f, engine_->input());
    engine_->run();
    const auto point = [this](std::size_t output, int i, int dimensions) {
        const std::span<const float> values = engine_->output(output);
        return Eigen::Vector2f(values[dimensions * i], values[dimensions * i + 1]);
    };
    auto& points = estimate.points;
    const std::span<const float> surface = engine_->output(0);
    points.leftCols<num_surface_points>() = Eigen::Map<const Eigen::Matrix3Xf>(surface.data(), 3, num_surface_points);
    // Outputs: 0 surface, 1 lips, 2 and 3 eyes, 4 and 5 irises, 6 presence. Depth is the surface's.
    for (std::size_t part = 0; part < refined_.size(); ++part) {
        for (std::size_t i = 0; i < refined_[part].size(); ++i) {
            points.col(refined_[part][i]).head<2>() = point(part + 1, static_cast<int>(i), 2);
        }
    }
    for (int eye = 0; eye < 2; ++eye) {
        float depth = 0.0f;
        for (int i = 0; i < num_lid_points; ++i) {
            depth += points(2, refined_[eye + 1][i]) / num_lid_points;
        }
        for (int i = 0; i < num_iris_points; ++i) {
            points.col(num_surface_points + num_iris_points * eye + i) << point(eye + 4, i, 2), depth;
        }
    }
    const SquareWindow::Affine picture_from_window = window.picture_from_window(size);
    const float scale = static_cast<float>(window.side / size);
    for (int i = 0; i < num_mesh_points; ++i) {
        points.col(i).head<2>() = picture_from_window(points.col(i).head<2>().cast<double>()).cast<float>();
        points(2, i) *= scale;
    }
    estimate.presence = 1.0 / (1.0 + std::exp(-static_cast<double>(engine_->output(6)[0])));
}

SquareWindow window_of(const Eigen::Matrix3Xf& points)
{
    const auto surface = points.topLeftCorner<2, num_surface_points>();
    const Eigen::Vector2d low = surface.rowwise().minCoeff().cast<double>();
    const Eigen::Vector2d high = surface.rowwise().maxCoeff().cast<double>();
    const Eigen::Vector2f eyes = points.col(263).head<2>() - points.col(33).head<2>(); // outer corners
    return {.center = 0.5 * (low + high),
            .side = 1.5 * (high - low).maxCoeff(),
            .angle = std::atan2(static_cast<double>(eyes.y()), static_cast<double>(eyes.x()))};
}

} // namespace lineament
