// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

namespace lineament::detail {

/// The nearest depth of a mesh at some points of the image plane, sampled at the centres of square cells.
class DepthBuffer
{
public:
    /// @param seen       3 x V: x, y and depth (larger is farther), of which only vertices named below are read.
    /// @param triangles  3 x T, of the leading `num_vertices`; those that face away are drawn too, so orientation does
    ///                   not matter.
    /// @param asked      Vertices at whose places depths are asked for; not empty. A line of cells is drawn only as
    ///                   far as these reach: an outline takes a few cells of each.
    /// @param farthest   Depths that are asked for; a triangle behind all of them need not be drawn.
    DepthBuffer(const Eigen::Matrix3Xf& seen, const Eigen::Matrix3Xi& triangles, Eigen::Index num_vertices,
                const std::vector<int>& asked, float farthest, float cell_size)
        : inverse_cell_(1.0f / cell_size)
    {
        origin_ = seen.col(asked.front()).head<2>();
        Eigen::Vector2f high = origin_;
        for (const int vertex : asked) {
            origin_ = origin_.cwiseMin(seen.col(vertex).head<2>());
            high = high.cwiseMax(seen.col(vertex).head<2>());
        }
        columns_ = static_cast<int>(std::min(max_cells, (high.x() - origin_.x()) * inverse_cell_ + 1));
        rows_ = static_cast<int>(std::min(max_cells, (high.y() - origin_.y()) * inverse_cell_ + 1));
        depths_ = Eigen::MatrixXf::Constant(columns_, rows_, std::numeric_limits<float>::infinity());
        asked_columns_.assign(static_cast<std::size_t>(rows_), {columns_, 0});
        for (const int vertex : asked) {
            const auto [column, row] = cell_at(seen(0, vertex), seen(1, vertex));
            if (row < rows_) {
                ColumnRange& range = asked_columns_[static_cast<std::size_t>(row)];
                range = {std::min(range.begin, column), std::max(range.end, std::min(column + 1, columns_))};
            }
        }
        // On which sides of all that is asked for each vertex lies: a triangle with a side in common is not drawn.
        std::vector<unsigned char> outside(static_cast<std::size_t>(num_vertices));
        for (std::size_t v = 0; v < outside.size(); ++v) {
            const auto point = seen.col(static_cast<Eigen::Index>(v));
            outside[v] = static_cast<unsigned char>(
                (point.x() < origin_.x()) | (point.x() > high.x() + cell_size) << 1 | (point.y() < origin_.y()) << 2 |
                (point.y() > high.y() + cell_size) << 3 | (point.z() >= farthest) << 4);
        }
        for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
            const int a = triangles(0, t), b = triangles(1, t), c = triangles(2, t);
            if ((outside[a] & outside[b] & outside[c]) == 0) {
                draw(to_cells(seen.col(a)), to_cells(seen.col(b)), to_cells(seen.col(c)));
            }
        }
    }

    /// At a place that was asked for; infinite where no triangle is.
    [[nodiscard]] float depth_at(float x, float y) const
    {
        const auto [column, row] = cell_at(x, y);
        return column < columns_ && row < rows_ ? depths_(column, row) : std::numeric_limits<float>::infinity();
    }

private:
    /// A face is some 250 mm wide; the limit keeps the buffer small whatever the shape.
    static constexpr float max_cells = 1024.0f;

    struct ColumnRange
    {
        int begin, end;
    };

    /// Column and row of a place that was asked for, which is never left of or above the buffer.
    [[nodiscard]] std::pair<int, int> cell_at(float x, float y) const
    {
        const auto to_cell = [&](float offset) {
            return static_cast<int>(std::max(0.0f, std::min(max_cells, offset * inverse_cell_)));
        };
        return {to_cell(x - origin_.x()), to_cell(y - origin_.y())};
    }

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
        const int first = to_cell(std::min({a.x(), b.x(), c.x()}), columns_);
        const int last = to_cell(std::max({a.x(), b.x(), c.x()}), columns_);
        const int top = to_cell(std::min({a.y(), b.y(), c.y()}), rows_);
        const int bottom = to_cell(std::max({a.y(), b.y(), c.y()}), rows_);
        const float inverse_area = 1.0f / area;
        const Eigen::Vector3f to_b = b - a, to_c = c - a;
        for (int row = top; row < bottom; ++row) {
            const float y = static_cast<float>(row) + 0.5f - a.y();
            const float y_of_b = y * to_c.x(), y_of_c = to_b.x() * y;
            const ColumnRange asked = asked_columns_[static_cast<std::size_t>(row)];
            for (int column = std::max(first, asked.begin); column < std::min(last, asked.end); ++column) {
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
    Eigen::Vector2f origin_ = Eigen::Vector2f::Zero();
    int columns_ = 0;
    int rows_ = 0;
    std::vector<ColumnRange> asked_columns_ = {}; ///< Of each row.
    Eigen::MatrixXf depths_ = {};
};

} // namespace lineament::detail
