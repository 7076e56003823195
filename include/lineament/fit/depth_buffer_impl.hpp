// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>

namespace lineament::detail {

/// The nearest depth of a mesh over square cells of the image plane, sampled at the cells' centres.
class DepthBuffer
{
public:
    /// @param seen       3 x V: x, y and depth (larger is farther), of which only vertices of triangles are read.
    /// @param triangles  3 x T; those that face away are drawn too, so orientation does not matter.
    /// @param low, high  The box of the image plane that is kept.
    /// @param farthest   Depths that are asked for; a triangle behind all of them need not be drawn.
    DepthBuffer(const Eigen::Matrix3Xf& seen, const Eigen::Matrix3Xi& triangles, const Eigen::Vector2f& low,
                const Eigen::Vector2f& high, float farthest, float cell_size)
        : inverse_cell_(1.0f / cell_size), origin_(low)
    {
        // A face is some 250 mm wide; the limit keeps the buffer small whatever the shape.
        columns_ = static_cast<int>(std::min((high.x() - low.x()) * inverse_cell_ + 1, 1024.0f));
        rows_ = static_cast<int>(std::min((high.y() - low.y()) * inverse_cell_ + 1, 1024.0f));
        depths_ = Eigen::MatrixXf::Constant(columns_, rows_, std::numeric_limits<float>::infinity());
        for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
            const auto a = seen.col(triangles(0, t)), b = seen.col(triangles(1, t)), c = seen.col(triangles(2, t));
            if (std::min({a.z(), b.z(), c.z()}) < farthest) {
                draw(to_cells(a), to_cells(b), to_cells(c));
            }
        }
    }

    /// Infinite where nothing was drawn.
    [[nodiscard]] float depth_at(float x, float y) const
    {
        const int column = static_cast<int>(std::floor((x - origin_.x()) * inverse_cell_));
        const int row = static_cast<int>(std::floor((y - origin_.y()) * inverse_cell_));
        return column >= 0 && column < columns_ && row >= 0 && row < rows_ ? depths_(column, row)
                                                                           : std::numeric_limits<float>::infinity();
    }

private:
    [[nodiscard]] Eigen::Vector3f to_cells(const Eigen::Vector3f& seen) const
    {
        return {(seen.x() - origin_.x()) * inverse_cell_, (seen.y() - origin_.y()) * inverse_cell_, seen.z()};
    }

    void draw(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c)
    {
        const float area = (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
        if (area == 0) {
            return;
        }
        const auto to_cell = [](float value, int count) { // clipped before it becomes an int
            return static_cast<int>(std::clamp(value + 0.5f, 0.0f, static_cast<float>(count)));
        };
        const int left = to_cell(std::min({a.x(), b.x(), c.x()}), columns_);
        const int right = to_cell(std::max({a.x(), b.x(), c.x()}), columns_);
        const int top = to_cell(std::min({a.y(), b.y(), c.y()}), rows_);
        const int bottom = to_cell(std::max({a.y(), b.y(), c.y()}), rows_);
        const float inverse_area = 1.0f / area;
        const Eigen::Vector3f to_b = b - a, to_c = c - a;
        for (int row = top; row < bottom; ++row) {
            const float y = static_cast<float>(row) + 0.5f - a.y();
            const float y_of_b = y * to_c.x(), y_of_c = to_b.x() * y;
            for (int column = left; column < right; ++column) {
                const float x = static_cast<float>(column) + 0.5f - a.x();
                const float of_b = (x * to_c.y() - y_of_b) * inverse_area;
                const float of_c = (y_of_c - to_b.y() * x) * inverse_area;
                if (of_b >= 0 && of_c >= 0 && of_b + of_c <= 1) {
                    const float depth = a.z() + of_b * to_b.z() + of_c * to_c.z();
                    depths_(column, row) = std::min(depths_(column, row), depth);
                }
            }
        }
    }

    float inverse_cell_;
    Eigen::Vector2f origin_;
    int columns_ = 0;
    int rows_ = 0;
    Eigen::MatrixXf depths_ = {};
};

} // namespace lineament::detail
