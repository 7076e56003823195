// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>

namespace lineament::kernels {

/// For a buffer whose numbers are written before they are read.
struct Unset
{};
inline constexpr Unset unset = {};

/// Numbers, zeroed unless that is left out, at a multiple of 64 bytes (a cache line, the widest vector).
template <typename T>
class AlignedBuffer
{
    static_assert(std::is_trivial_v<T>);

public:
    AlignedBuffer() = default;
    explicit AlignedBuffer(std::size_t size) : AlignedBuffer(size, unset) { std::fill_n(data_.get(), size, T{}); }
    AlignedBuffer(std::size_t size, Unset)
        : data_(static_cast<T*>(::operator new(std::max<std::size_t>(size, 1) * sizeof(T), std::align_val_t(64)))),
          size_(size)
    {}
    AlignedBuffer(const AlignedBuffer& other) : AlignedBuffer(other.size_, unset)
    {
        std::copy_n(other.data(), other.size_, data());
    }
    AlignedBuffer(AlignedBuffer&& other) noexcept : data_(std::move(other.data_)), size_(std::exchange(other.size_, 0))
    {}
    AlignedBuffer& operator=(AlignedBuffer other) noexcept
    {
        std::swap(data_, other.data_);
        std::swap(size_, other.size_);
        return *this;
    }
    ~AlignedBuffer() = default;

    [[nodiscard]] T* data() { return data_.get(); }
    [[nodiscard]] const T* data() const { return data_.get(); }
    [[nodiscard]] std::size_t size() const { return size_; }
    [[nodiscard]] T& operator[](std::size_t i) { return data_.get()[i]; }
    [[nodiscard]] const T& operator[](std::size_t i) const { return data_.get()[i]; }

private:
    struct Delete
    {
        void operator()(T* data) const { ::operator delete(data, std::align_val_t(64)); }
    };
    std::unique_ptr<T, Delete> data_ = nullptr;
    std::size_t size_ = 0;
};

} // namespace lineament::kernels
