// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/kernels/aligned_buffer.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <new>
#include <utility>

namespace lineament::detail {

using kernels::AlignedBuffer;

/// Room for `size` numbers, which are to be written before they are read; what was there is lost where it is not
/// enough.
template <typename T>
T* room_for(AlignedBuffer<T>& buffer, Eigen::Index size)
{
    if (static_cast<Eigen::Index>(buffer.size()) < size) {
        buffer = AlignedBuffer<T>(static_cast<std::size_t>(size), kernels::unset);
    }
    return buffer.data();
}

/// A matrix or vector whose memory only grows: to be as large again allocates nothing.
template <typename Matrix>
class RoomyMatrix : public Eigen::Map<Matrix, Eigen::AlignedMax>
{
    using Map = Eigen::Map<Matrix, Eigen::AlignedMax>;
    using Number = typename Matrix::Scalar;

public:
    RoomyMatrix() : Map(nullptr, fixed_or_none(Matrix::RowsAtCompileTime), fixed_or_none(Matrix::ColsAtCompileTime)) {}
    RoomyMatrix(const RoomyMatrix& other) : RoomyMatrix() { *this = other; }
    RoomyMatrix(RoomyMatrix&& other) noexcept : RoomyMatrix() { swap(other); }
    ~RoomyMatrix() = default;

    RoomyMatrix& operator=(const RoomyMatrix& other)
    {
        return *this = static_cast<const Eigen::MatrixBase<Map>&>(other);
    }
    RoomyMatrix& operator=(RoomyMatrix&& other) noexcept
    {
        swap(other);
        return *this;
    }
    template <typename Other>
    RoomyMatrix& operator=(const Eigen::DenseBase<Other>& other)
    {
        resize(other.rows(), other.cols());
        Map::operator=(other.derived());
        return *this;
    }

    /// What is in it is unset.
    void resize(Eigen::Index rows, Eigen::Index columns) { place(room_for(numbers_, rows * columns), rows, columns); }
    void resize(Eigen::Index size)
    {
        static_assert(Matrix::IsVectorAtCompileTime);
        resize(Matrix::RowsAtCompileTime == 1 ? 1 : size, Matrix::RowsAtCompileTime == 1 ? size : 1);
    }

    using Map::setZero;
    void setZero(Eigen::Index rows, Eigen::Index columns)
    {
        resize(rows, columns);
        Map::setZero();
    }
    void setZero(Eigen::Index size)
    {
        resize(size);
        Map::setZero();
    }

    void swap(RoomyMatrix& other) noexcept
    {
        std::swap(numbers_, other.numbers_);
        const Eigen::Index rows = this->rows(), columns = this->cols();
        place(numbers_.data(), other.rows(), other.cols());
        other.place(other.numbers_.data(), rows, columns);
    }

private:
    static constexpr int fixed_or_none(int size) { return size == Eigen::Dynamic ? 0 : size; }

    void place(Number* numbers, Eigen::Index rows, Eigen::Index columns)
    {
        new (static_cast<Map*>(this)) Map(numbers, rows, columns);
    }

    AlignedBuffer<Number> numbers_ = {};
};

} // namespace lineament::detail
