// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Based on: Grishchenko et al., Attention Mesh: High-fidelity Face Mesh Prediction in Real-time, CVPR Workshop on
// Computer Vision for Augmented and Virtual Reality 2020 (operations on regions).
#include "engine.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace lineament::network {
namespace {

/// points_from_grid (4 x 4, row-major) of the region: the grid of width x height cells, its centre at the middle of
/// the rectangle that encloses the points in axes turned along left -> right point.
void compute_region_matrix(const Region& region, const float* points, float* matrix)
{
    const auto point = [&](int i) { return Eigen::Vector2f(points[3 * i], points[3 * i + 1]); };
    const Eigen::Vector2f axis = point(region.right_point) - point(region.left_point);
    const float angle = std::atan2(axis.y(), axis.x()) - static_cast<float>(region.target_rotation);
    const Eigen::Matrix2f points_from_axes = Eigen::Rotation2Df(angle).toRotationMatrix();
    Eigen::AlignedBox2f box;
    for (const int i : region.points) {
        box.extend(points_from_axes.transpose() * point(i));
    }
    const Eigen::Vector2f cells(static_cast<float>(region.width), static_cast<float>(region.height));
    const Eigen::Vector2f scale =
        Eigen::Vector2d(region.scale_x, region.scale_y).cast<float>().cwiseProduct(box.sizes()).cwiseQuotient(cells);
    const Eigen::Matrix2f linear = points_from_axes * scale.asDiagonal();
    Eigen::Map<Eigen::Matrix<float, 4, 4, Eigen::RowMajor>> result(matrix);
    result.setIdentity();
    result.topLeftCorner<2, 2>() = linear;
    result.topRightCorner<2, 1>() = points_from_axes * box.center() - linear * (0.5f * cells);
}

/// The map at matrix * (centre of each grid cell), bilinear between the centres of its cells, 0 beyond the outermost.
void sample_region(const Tensor& map_tensor, const float* map, const float* matrix, const std::vector<int>& out_shape,
                   float* out)
{
    const int rows = map_tensor.shape[1];
    const int columns = map_tensor.shape[2];
    const int channels = map_tensor.shape[3];
    const Eigen::Map<const Eigen::Matrix<float, 4, 4, Eigen::RowMajor>> map_from_grid(matrix);
    for (int i = 0; i < out_shape[1]; ++i) {
        for (int j = 0; j < out_shape[2]; ++j, out += channels) {
            const Eigen::Vector4f cell(static_cast<float>(j) + 0.5f, static_cast<float>(i) + 0.5f, 0.0f, 1.0f);
            const float x = map_from_grid.row(0).dot(cell) - 0.5f;
            const float y = map_from_grid.row(1).dot(cell) - 0.5f;
            Eigen::Map<Eigen::ArrayXf> value(out, channels);
            if (!(x >= 0.0f && y >= 0.0f && x <= static_cast<float>(columns - 1) &&
                  y <= static_cast<float>(rows - 1))) {
                value.setZero();
                continue;
            }
            const int left = static_cast<int>(x);
            const int top = static_cast<int>(y);
            const int right = std::min(left + 1, columns - 1);
            const int bottom = std::min(top + 1, rows - 1);
            const float a = x - static_cast<float>(left);
            const float b = y - static_cast<float>(top);
            const auto at = [&](int row, int column) {
                return Eigen::Map<const Eigen::ArrayXf>(
                    map + (static_cast<std::ptrdiff_t>(row) * columns + column) * channels, channels);
            };
            value = (1 - b) * ((1 - a) * at(top, left) + a * at(top, right)) +
                    b * ((1 - a) * at(bottom, left) + a * at(bottom, right));
        }
    }
}

} // namespace

bool Engine::is_small(Operation operation)
{
    switch (operation) {
    case Operation::multiply:
    case Operation::reshape:
    case Operation::concatenate:
    case Operation::region_matrix:
    case Operation::sample_region:
    case Operation::transform_points:
        return true;
    default:
        return false;
    }
}

void Engine::run_small(const Step& step)
{
    float* const out = buffers_[step.output].data();
    const float* const first = data(step.inputs[0]);
    switch (step.operation) {
    case Operation::multiply: {
        const std::size_t repeat = size_of(step.inputs[1]) == 1 ? 0 : 1;
        const float* const factor = data(step.inputs[1]);
        for (std::size_t i = 0; i < size_of(step.output); ++i) {
            out[i] = first[i] * factor[repeat * i];
        }
        break;
    }
    case Operation::reshape:
        std::copy_n(first, size_of(step.output), out);
        break;
    case Operation::concatenate: {
        float* to = out;
        for (const int input : step.inputs) {
            to = std::copy_n(data(input), size_of(input), to);
        }
        break;
    }
    case Operation::region_matrix:
        compute_region_matrix(step.region, first, out);
        break;
    case Operation::sample_region:
        sample_region(network_.tensors[step.inputs[0]], first, data(step.inputs[1]),
                      network_.tensors[step.output].shape, out);
        break;
    case Operation::transform_points: {
        const float* const m = data(step.inputs[1]);
        for (std::size_t i = 0; i + 1 < size_of(step.output); i += 2) {
            out[i] = m[0] * first[i] + m[1] * first[i + 1] + m[3];
            out[i + 1] = m[4] * first[i] + m[5] * first[i + 1] + m[7];
        }
        break;
    }
    default:
        break;
    }
}

std::unique_ptr<Engine> make_engine(Network network)
{
    return xnnpack_starts() ? make_xnnpack_engine(std::move(network)) : make_plain_engine(std::move(network));
}

} // namespace lineament::network
