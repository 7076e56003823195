// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Points of a model in double precision, and the products with them, for the kernels.
#pragma once

#include "lineament/fit/model_points.hpp"
#include "lineament/kernels/aligned_buffer.hpp"
#include "lineament/kernels/kernels.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>

namespace lineament::detail {

using kernels::AlignedBuffer;

/// Room for `size` numbers; what was there is lost where it is not enough.
template <typename T>
T* room_for(AlignedBuffer<T>& buffer, Eigen::Index size)
{
    if (static_cast<Eigen::Index>(buffer.size()) < size) {
        buffer = AlignedBuffer<T>(static_cast<std::size_t>(size));
    }
    return buffer.data();
}

/// One matrix of rows, three a point, each filled up with zeros to a multiple of double_step.
struct PackedRows
{
    int width = 0;
    AlignedBuffer<double> rows = {};

    /// @param columns  As ModelPoints::identity: column 3i + a becomes row 3i + a.
    /// @param first    The rows before are as they were when these columns were packed last.
    void pack(const Eigen::MatrixXd& columns, Eigen::Index first)
    {
        width = kernels::round_up(static_cast<int>(columns.rows()), kernels::double_step);
        if (static_cast<Eigen::Index>(rows.size()) != width * columns.cols()) {
            rows = AlignedBuffer<double>(static_cast<std::size_t>(width * columns.cols()));
            first = 0;
        }
        Eigen::Map<Eigen::MatrixXd>(rows.data(), width, columns.cols())
            .block(0, first, columns.rows(), columns.cols() - first) = columns.rightCols(columns.cols() - first);
    }
};

/// The points of an image as kernels read them.
struct PackedPoints
{
    PackedRows identity = {};
    PackedRows expression = {};

    /// @param num_kept  Leading points that are as they were when these points were packed last.
    void pack(const ModelPoints& points, Eigen::Index num_kept)
    {
        identity.pack(points.identity, 3 * num_kept);
        expression.pack(points.expression, 3 * num_kept);
    }
};

} // namespace lineament::detail
