// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/kernels/kernels.hpp"
#include "lineament/kernels/scalar_factor_kernels.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

/// The readable twins of the vector kernels: plain loops, which the compiler may turn into vectors itself.
namespace lineament::kernels::scalar {

template <typename T>
void combine_panels(const float* base, const T* panels, int num_panels, int num_columns, const float* coefficients,
                    float* out)
{
    for (int p = 0; p < num_panels; ++p) {
        float sums[panel_size];
        std::copy_n(base + p * panel_size, panel_size, sums);
        for (int j = 0; j < num_columns; ++j, panels += panel_size) {
            for (int c = 0; c < panel_size; ++c) {
                sums[c] += coefficients[j] * static_cast<float>(panels[c]);
            }
        }
        std::copy_n(sums, panel_size, out + p * panel_size);
    }
}

inline void widen(const std::int16_t* from, int count, float* out)
{
    std::copy_n(from, count, out);
}

inline void add_columns(const float* columns, std::ptrdiff_t step, int num_rows, int num_columns,
                        const float* coefficients, float* out)
{
    for (int j = 0; j < num_columns; ++j, columns += step) {
        for (int r = 0; r < num_rows && coefficients[j] != 0; ++r) {
            out[r] += coefficients[j] * columns[r];
        }
    }
}

inline void combine_blocks(const float* base, const SparseColumns& columns, const float* coefficients, float* out)
{
    const int* offset = columns.offsets;
    const std::uint16_t* column = columns.columns;
    const float* values = columns.values;
    for (int r = 0; r < columns.num_runs; ++r) {
        for (int b = 0; b < columns.runs[r].num_blocks; ++b, ++offset) {
            std::copy_n(base + *offset, block_size, out + *offset);
            for (int j = 0; j < columns.runs[r].num_columns; ++j, values += block_size) {
                const float coefficient = coefficients[*column++];
                for (int c = 0; c < block_size; ++c) {
                    out[*offset + c] += coefficient * values[c];
                }
            }
        }
    }
}

inline void multiply_panels(const float* panels, int num_panels, int num_columns, const float* x, float* out)
{
    for (int j = 0; j < num_columns; ++j) {
        out[j] = 0;
        for (int i = 0; i < num_panels * panel_size; ++i) {
            const int p = i / panel_size;
            out[j] += panels[(p * num_columns + j) * panel_size + i % panel_size] * x[i];
        }
    }
}

inline void combine_grams(const float* grams, int num_columns, int width, const float* scales, float* gram)
{
    const int size = width * width;
    for (int i = 0; i < num_columns * width; ++i) {
        float sum = 0;
        for (int g = 0; g < 6; ++g) {
            sum += scales[g] * grams[g * size + i];
        }
        gram[i] = sum;
    }
}

inline void project_rows(const float* point_rows, int width, const int* indices, int count, const float* jacobian,
                         const float* roots, float* out)
{
    for (int i = 0; i < count; ++i) {
        const float* rows = point_rows + static_cast<std::ptrdiff_t>(3 * width) * indices[i];
        for (int axis = 0; axis < 2; ++axis, out += width) {
            const float x = roots[i] * jacobian[3 * axis];
            const float y = roots[i] * jacobian[3 * axis + 1];
            const float z = roots[i] * jacobian[3 * axis + 2];
            for (int c = 0; c < width; ++c) {
                out[c] = x * rows[c] + y * rows[width + c] + z * rows[2 * width + c];
            }
        }
    }
}

inline void multiply_rows(const float* point_rows, int width, const int* indices, int count, const float* x, float* out)
{
    for (int i = 0; i < count; ++i) {
        const float* row = point_rows + static_cast<std::ptrdiff_t>(3 * width) * indices[i];
        for (int axis = 0; axis < 3; ++axis, row += width) {
            float sum = 0;
            for (int c = 0; c < width; ++c) {
                sum += row[c] * x[c];
            }
            out[3 * i + axis] = sum;
        }
    }
}

template <typename T>
void add_gram(const T* rows, int num_rows, int begin, int end, int width, T* gram)
{
    for (int i = begin; i < end; ++i) {
        for (int r = 0; r < num_rows; ++r) {
            const T* row = rows + r * width;
            for (int c = i; c < width; ++c) {
                gram[i * width + c] += row[i] * row[c];
            }
        }
    }
}

inline void set_gram(const float* rows, int num_rows, int begin, int end, int width, float* gram)
{
    for (int i = begin; i < end; ++i) {
        std::fill(gram + i * width + i, gram + (i + 1) * width, 0.0f);
    }
    add_gram(rows, num_rows, begin, end, width, gram);
}

inline void add_rows(const float* rows, int num_rows, int width, const float* factors, float* sums)
{
    for (int r = 0; r < num_rows; ++r) {
        for (int c = 0; c < width; ++c) {
            sums[c] += factors[r] * rows[r * width + c];
        }
    }
}

inline void add_point_rows(const float* point_rows, int width, const int* indices, int count, const float* factors,
                           float* sums)
{
    for (int i = 0; i < count; ++i) {
        add_rows(point_rows + static_cast<std::ptrdiff_t>(3 * width) * indices[i], 3, width, factors + 3 * i, sums);
    }
}

inline float solve_positive(float* system, int n, int width, float* x)
{
    float least = 1;
    for (int i = 0; i < n; ++i) { // rows of U, A = U^T U; column n becomes U^-T b
        float* row = system + i * width;
        const float diagonal = row[i];
        for (int k = 0; k < i; ++k) {
            const float* above = system + k * width;
            const float factor = above[i];
            for (int c = i; c <= n; ++c) {
                row[c] -= factor * above[c];
            }
        }
        if (!(row[i] > 0)) {
            return 0;
        }
        least = std::min(least, row[i] / diagonal);
        const float inverse = 1 / std::sqrt(row[i]);
        for (int c = i; c <= n; ++c) {
            row[c] *= inverse;
        }
    }
    std::fill_n(x, width, 0.0f);
    for (int i = n - 1; i >= 0; --i) {
        const float* row = system + i * width;
        float sum = row[n];
        for (int c = i + 1; c < n; ++c) {
            sum -= row[c] * x[c];
        }
        x[i] = sum / row[i];
    }
    return least;
}

/// Gauss and Jordan's elimination; a row that is not free says x_i = x_i.
inline float solve_few(const float* matrix, int n, int width, const float* right_side, const float* is_free, float* x,
                       float* residual)
{
    float rows[max_few][max_few + 1] = {};
    for (int i = 0; i < n; ++i) {
        if (is_free[i] != 0) {
            std::copy_n(matrix + i * width, n, rows[i]);
            rows[i][n] = right_side[i];
        } else {
            rows[i][i] = 1;
            rows[i][n] = x[i];
        }
    }
    float least = 1;
    for (int p = 0; p < n; ++p) {
        const float pivot = rows[p][p];
        if (is_free[p] != 0) {
            least = std::min(pivot / std::abs(matrix[p * width + p]), least); // NaN, if the pivot is
        }
        for (int c = 0; c <= n; ++c) {
            rows[p][c] /= pivot;
        }
        for (int i = 0; i < n; ++i) {
            const float factor = rows[i][p];
            for (int c = 0; c <= n && i != p; ++c) {
                rows[i][c] -= factor * rows[p][c];
            }
        }
    }
    for (int i = 0; i < n; ++i) {
        x[i] = rows[i][n];
    }
    for (int i = 0; i < n; ++i) {
        residual[i] = right_side[i];
        for (int j = 0; j < n; ++j) {
            residual[i] -= matrix[i * width + j] * x[j];
        }
    }
    return least;
}

inline void transform_points(const float* points, int step, int count, const float* m, float* out, int out_step)
{
    const float* y = points + step;
    const float* z = points + 2 * step;
    for (int a = 0; a < 3; ++a, m += 4, out += out_step) {
        for (int i = 0; i < count; ++i) {
            out[i] = m[0] * points[i] + m[1] * y[i] + m[2] * z[i] + m[3];
        }
    }
}

inline void add_pose_moments(const float* points, const double* seen_u, const double* seen_v, const double* weights,
                             int count, double* moments)
{
    for (int i = 0; i < count; ++i) {
        const double x = points[3 * i], y = points[3 * i + 1], z = points[3 * i + 2];
        const double w = weights[i];
        const double u = w * seen_u[i];
        const double v = w * seen_v[i];
        const double terms[num_pose_moments] = {w,         w * x,     w * y,     w * z,     u,         v,
                                                w * x * x, w * x * y, w * x * z, w * y * y, w * y * z, w * z * z,
                                                u * x,     u * y,     u * z,     v * x,     v * y,     v * z};
        for (int t = 0; t < num_pose_moments; ++t) {
            moments[t] += terms[t];
        }
    }
}

inline void residual_factors(const float* points, const double* u, const double* v, const double* w, double scale,
                             int count, const double* m, float* factors)
{
    for (int i = 0; i < count; ++i) {
        const double x = points[3 * i], y = points[3 * i + 1], z = points[3 * i + 2];
        const double du = scale * w[i] * (u[i] - (m[0] * x + m[1] * y + m[2] * z + m[3]));
        const double dv = scale * w[i] * (v[i] - (m[4] * x + m[5] * y + m[6] * z + m[7]));
        for (int a = 0; a < 3; ++a) {
            factors[3 * i + a] = static_cast<float>(m[a] * du + m[4 + a] * dv);
        }
    }
}

inline int nearest_point(const double* u, const double* v, int count, double to_u, double to_v, double* squared)
{
    int nearest = 0;
    for (int i = 0; i < count; ++i) {
        const double du = u[i] - to_u;
        const double dv = v[i] - to_v;
        squared[i] = du * du + dv * dv;
        nearest = squared[i] < squared[nearest] ? i : nearest;
    }
    return nearest;
}

inline void nearest_points(const double* u, const double* v, int count, const double* to_u, const double* to_v,
                           int num_to, int* nearest)
{
    for (int j = 0; j < num_to; ++j) {
        double least = std::numeric_limits<double>::infinity();
        nearest[j] = 0;
        for (int i = 0; i < count; ++i) {
            const double du = u[i] - to_u[j];
            const double dv = v[i] - to_v[j];
            const double squared = du * du + dv * dv;
            nearest[j] = squared < least ? i : nearest[j];
            least = std::min(squared, least);
        }
    }
}

inline void nearest_segments(const double* segments, int step, int count, const double* to_u, const double* to_v,
                             int num_to, int* nearest)
{
    for (int j = 0; j < num_to; ++j) {
        double least = std::numeric_limits<double>::infinity();
        nearest[j] = 0;
        for (int i = 0; i < count; ++i) {
            const double* segment = segments + i;
            const double u = to_u[j] - segment[0], v = to_v[j] - segment[step];
            const double along_u = segment[2 * step], along_v = segment[3 * step];
            const double fraction = std::clamp((u * along_u + v * along_v) * segment[4 * step], 0.0, 1.0);
            const double du = fraction * along_u - u, dv = fraction * along_v - v;
            const double squared = du * du + dv * dv;
            nearest[j] = squared < least ? i : nearest[j];
            least = std::min(squared, least);
        }
    }
}

inline void see_points(const float* points, int count, const double* m, double* u, double* v)
{
    for (int i = 0; i < count; ++i) {
        const double x = points[3 * i], y = points[3 * i + 1], z = points[3 * i + 2];
        u[i] = m[0] * x + m[1] * y + m[2] * z + m[3];
        v[i] = m[4] * x + m[5] * y + m[6] * z + m[7];
    }
}

inline void multiply_wide(const float* rows, int num_rows, int width, const double* x, double* out)
{
    for (int r = 0; r < num_rows; ++r, rows += width) {
        out[r] = 0;
        for (int c = 0; c < width; ++c) {
            out[r] += rows[c] * x[c];
        }
    }
}

inline void add_wide(const float* rows, int num_rows, int width, const double* factors, double* sums)
{
    for (int r = 0; r < num_rows; ++r, rows += width) {
        for (int c = 0; c < width; ++c) {
            sums[c] += factors[r] * rows[c];
        }
    }
}

inline void pull_points(const double* residuals, const double* jacobians, int count, double* pulls)
{
    for (int i = 0; i < count; ++i) {
        for (int axis = 0; axis < 3; ++axis) {
            pulls[3 * i + axis] =
                residuals[i] * jacobians[axis * count + i] + residuals[count + i] * jacobians[(3 + axis) * count + i];
        }
    }
}

inline void project_points(const float* point_rows, int width, int num_points, const double* jacobians, double scale,
                           float* out, int out_width)
{
    for (int i = 0; i < num_points; ++i, point_rows += 3 * width) {
        for (int axis = 0; axis < 2; ++axis, out += out_width) {
            const double* by_axis = jacobians + 3 * axis * num_points + i;
            const double x = scale * by_axis[0], y = scale * by_axis[num_points], z = scale * by_axis[2 * num_points];
            for (int c = 0; c < width; ++c) {
                out[c] =
                    static_cast<float>(x * point_rows[c] + y * point_rows[width + c] + z * point_rows[2 * width + c]);
            }
        }
    }
}

inline void blend_rows(const float* first, const float* second, float fraction, int count, float* out)
{
    for (int i = 0; i < count; ++i) {
        out[i] = (1 - fraction) * first[i] + fraction * second[i];
    }
}

inline void turn_columns(const double* columns, int count, int num_columns, float* out, int out_step)
{
    for (int i = 0; i < count; ++i) {
        for (int k = 0; k < num_columns; ++k) {
            out[i * out_step + k] = static_cast<float>(columns[k * count + i]);
        }
    }
}

inline void add_turned_points(const float* point_rows, int width, int num_points, const double* matrices,
                              const int* targets, float* out, int out_width)
{
    for (int i = 0; i < num_points; ++i, point_rows += 3 * width, matrices += 9) {
        for (int axis = 0; axis < 3 && targets[i] >= 0; ++axis) {
            const double* row = matrices + 3 * axis;
            float* to = out + (3 * targets[i] + axis) * out_width;
            for (int c = 0; c < width; ++c) {
                to[c] += static_cast<float>(row[0] * point_rows[c] + row[1] * point_rows[width + c] +
                                            row[2] * point_rows[2 * width + c]);
            }
        }
    }
}

inline void camera_residuals(const PerspectiveCamera& camera, const double* points, const double* landmarks,
                             const double* roots, int count, double* residuals)
{
    const double* r = camera.turn;
    for (int i = 0; i < count; ++i, points += 3, landmarks += 2) {
        double p[3];
        for (int axis = 0; axis < 3; ++axis) {
            p[axis] = r[3 * axis] * points[0] + r[3 * axis + 1] * points[1] + r[3 * axis + 2] * points[2];
        }
        const double scale = camera.scale / (1 + camera.phi * p[2]);
        const double du = camera.centre[0] + scale * (p[0] + camera.translation[0]) - landmarks[0];
        const double dv = camera.centre[1] + scale * (p[1] + camera.translation[1]) - landmarks[1];
        residuals[i] = roots[i] * du + roots[count + i] * dv;
        residuals[count + i] = roots[2 * count + i] * dv;
    }
}

inline void weigh_by_student_t(const double* residuals, const double* dimensions, double nu, double least, int count,
                               double* roots, double* weighted)
{
    for (int i = 0; i < count; ++i) {
        const double x = residuals[i], y = residuals[count + i];
        const double squared = x * x + y * y;
        const double inverse = 1 / (nu + squared);
        const double weight = (nu + dimensions[i]) * inverse;
        roots[i] = std::sqrt(weight * std::max(least, 1 - 2 / dimensions[i] * squared * inverse));
        const double factor = weight / roots[i];
        weighted[i] = factor * x;
        weighted[count + i] = factor * y;
    }
}

inline void camera_derivatives(const PerspectiveCamera& camera, const double* points, const double* offsets,
                               const double* roots, const double* factors, int count, double* derivatives)
{
    const double* r = camera.turn;
    for (int i = 0; i < count; ++i, points += 3, offsets += 3) {
        double p[3];
        for (int axis = 0; axis < 3; ++axis) {
            p[axis] = r[3 * axis] * points[0] + r[3 * axis + 1] * points[1] + r[3 * axis + 2] * points[2];
        }
        const double inverse_depth = 1 / (1 + camera.phi * p[2]);
        const double scale = camera.scale * inverse_depth; // d x / d P = scale (1 0 a; 0 1 b)
        const double u = inverse_depth * (p[0] + camera.translation[0]);
        const double v = inverse_depth * (p[1] + camera.translation[1]);
        const double a = -camera.phi * u, b = -camera.phi * v;
        double by_point[2][3];
        double by_offset[2] = {0, 0};
        for (int c = 0; c < 3; ++c) {
            by_point[0][c] = r[c] + a * r[6 + c];
            by_point[1][c] = r[3 + c] + b * r[6 + c];
            by_offset[0] += by_point[0][c] * offsets[c];
            by_offset[1] += by_point[1][c] * offsets[c];
        }
        const double by_camera[2][6] = {{a * p[1], p[2] - a * p[0], -p[1], u - by_offset[0], 1, 0},
                                        {b * p[1] - p[2], -b * p[0], p[0], v - by_offset[1], 0, 1}};
        const double by_phi[2] = {-p[2] * u, -p[2] * v};
        const double g = factors[i] * scale;
        const auto store_pair = [&](double first, double second, int row, int next_row) {
            derivatives[row * count + i] = g * (roots[i] * first + roots[count + i] * second);
            derivatives[next_row * count + i] = g * roots[2 * count + i] * second;
        };
        for (int c = 0; c < 3; ++c) {
            store_pair(by_point[0][c], by_point[1][c], c, 3 + c);
        }
        for (int c = 0; c < 6; ++c) {
            store_pair(by_camera[0][c], by_camera[1][c], 6 + c, 12 + c);
        }
        store_pair(by_phi[0], by_phi[1], 18, 19);
    }
}

} // namespace lineament::kernels::scalar

namespace lineament::kernels {

/// Kernels in plain C++, for any machine.
[[nodiscard]] inline const Kernels& scalar_kernels()
{
    static constexpr Kernels table = {"scalar",
                                      false,
                                      scalar::combine_panels<float>,
                                      scalar::combine_panels<std::int16_t>,
                                      scalar::widen,
                                      scalar::add_columns,
                                      scalar::combine_blocks,
                                      scalar::multiply_panels,
                                      scalar::combine_grams,
                                      scalar::project_rows,
                                      scalar::multiply_rows,
                                      scalar::add_gram<float>,
                                      scalar::set_gram,
                                      scalar::add_rows,
                                      scalar::add_point_rows,
                                      scalar::solve_positive,
                                      scalar::solve_few,
                                      scalar::transform_points,
                                      scalar::add_pose_moments,
                                      scalar::residual_factors,
                                      scalar::nearest_point,
                                      scalar::nearest_points,
                                      scalar::nearest_segments,
                                      scalar::see_points,
                                      scalar::multiply_wide,
                                      scalar::add_wide,
                                      scalar::pull_points,
                                      scalar::project_points,
                                      scalar::blend_rows,
                                      scalar::turn_columns,
                                      scalar::add_turned_points,
                                      scalar::camera_residuals,
                                      scalar::weigh_by_student_t,
                                      scalar::camera_derivatives,
                                      scalar::add_gram<double>,
                                      scalar::add_lower_gram,
                                      scalar::factor_positive<double>,
                                      scalar::solve_factored<double>,
                                      scalar::invert_factor<double>,
                                      scalar::factor_positive<float>,
                                      scalar::factor_and_invert,
                                      scalar::solve_factored<float>,
                                      scalar::solve_for_one,
                                      scalar::solve_lower<float>,
                                      scalar::invert_factor<float>,
                                      scalar::sum_squares};
    return table;
}

} // namespace lineament::kernels
