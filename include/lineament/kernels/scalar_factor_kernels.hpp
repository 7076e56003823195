// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The plain kernels that factor positive definite matrices, invert factors and solve with them; part of
// scalar_kernels.hpp.
#pragma once

#include "lineament/kernels/kernels.hpp"

#include <algorithm>
#include <cmath>

namespace lineament::kernels::scalar {

inline void add_lower_gram(const double* lower, int n, int width, double* gram)
{
    for (int r = 0; r < n; ++r, lower += width) {
        for (int i = 0; i <= r; ++i) {
            for (int c = i; c <= r; ++c) {
                gram[i * width + c] += lower[i] * lower[c];
            }
        }
    }
}

template <typename T>
T factor_positive(const T* matrix, int n, int begin, int width, T* system, T* inverse_diagonal)
{
    T least = 1;
    if (matrix != system) {
        std::copy_n(matrix, n * width, system);
    }
    system += begin;
    for (int i = 0; i < n; ++i) {
        T* row = system + i * width;
        const T diagonal = row[i];
        for (int k = 0; k < i; ++k) {
            const T* above = system + k * width;
            const T factor = above[i];
            for (int c = i; c < width - begin; ++c) {
                row[c] -= factor * above[c];
            }
        }
        if (!(row[i] > 0)) {
            return 0;
        }
        least = std::min(least, row[i] / diagonal);
        const T inverse = inverse_diagonal[i] = 1 / std::sqrt(row[i]);
        for (int c = i; c < width - begin; ++c) {
            row[c] *= inverse;
        }
    }
    return least;
}

template <typename T>
void invert_factor(const T* system, int n, int width, const T* inverse_diagonal, T* inverse, int inverse_width)
{
    for (int i = 0; i < n; ++i) {
        T* row = inverse + i * inverse_width;
        std::fill_n(row, inverse_width, T(0));
        row[i] = 1;
        for (int k = 0; k < i; ++k) {
            const T* above = inverse + k * inverse_width;
            const T factor = system[k * width + i];
            for (int c = 0; c <= k; ++c) {
                row[c] -= factor * above[c];
            }
        }
        for (int c = 0; c <= i; ++c) {
            row[c] *= inverse_diagonal[i];
        }
    }
}

inline float factor_and_invert(const float* matrix, int n, int begin, int width, float* system, float* inverse_diagonal,
                               int num_inverted, float* inverse, int inverse_width)
{
    const float least = factor_positive(matrix, n, begin, width, system, inverse_diagonal);
    if (least > 0) {
        invert_factor(system + begin, num_inverted, width, inverse_diagonal, inverse, inverse_width);
    }
    return least;
}

template <typename T>
void solve_lower(const T* system, int n, int width, const T* inverse_diagonal, T* x)
{
    for (T* const end = x + num_right_sides; x != end; ++x) {
        for (int i = 0; i < n; ++i) {
            for (int k = 0; k < i; ++k) {
                x[i * num_right_sides] -= system[k * width + i] * x[k * num_right_sides];
            }
            x[i * num_right_sides] *= inverse_diagonal[i];
        }
    }
}

inline void solve_for_one(const float* system, int n, int begin, int width, const float* inverse_diagonal, float* x)
{
    system += begin;
    for (int i = 0; i < n; ++i) { // U^T y = b
        const float value = x[begin + i] *= inverse_diagonal[i];
        for (int c = i + 1; c < n; ++c) {
            x[begin + c] -= system[i * width + c] * value;
        }
    }
    for (int i = n - 1; i >= 0; --i) { // U x = y
        for (int c = i + 1; c < n; ++c) {
            x[begin + i] -= system[i * width + c] * x[begin + c];
        }
        x[begin + i] *= inverse_diagonal[i];
    }
    std::fill_n(x, begin, 0.0f);
    std::fill(x + begin + n, x + width, 0.0f);
}

template <typename T>
void solve_factored(const T* system, int n, int width, const T* inverse_diagonal, T* x)
{
    solve_lower(system, n, width, inverse_diagonal, x);
    for (T* const end = x + num_right_sides; x != end; ++x) {
        for (int i = n - 1; i >= 0; --i) {
            for (int c = i + 1; c < n; ++c) {
                x[i * num_right_sides] -= system[i * width + c] * x[c * num_right_sides];
            }
            x[i * num_right_sides] *= inverse_diagonal[i];
        }
    }
}

inline float sum_squares(const float* numbers, int count)
{
    double sum = 0; // one after the other: in single precision many would be lost
    for (int i = 0; i < count; ++i) {
        sum += numbers[i] * numbers[i];
    }
    return static_cast<float>(sum);
}

} // namespace lineament::kernels::scalar
