// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace lineament::kernels {

/// Numbers in one panel: 64 coordinates are 4 vectors of AVX-512, 8 of AVX2, 16 of SSE.
inline constexpr int panel_size = 64;

/// Row widths are multiples of this, so that rows hold whole vectors.
inline constexpr int width_step = 16;

/// That of rows in double precision.
inline constexpr int double_step = 8;

/// Columns that solve_factored solves for.
inline constexpr int num_right_sides = 8;

/// Up to which solve_for_one_float is by vectors.
inline constexpr int max_width_for_one = 512;

/// Unknowns that solve_few solves for; with a right side their rows are vectors of AVX2.
inline constexpr int max_few = 7;

/// Numbers in one block of SparseColumns.
inline constexpr int block_size = 16;

/// Columns in blocks of 16 numbers, each block with the columns alone that are not zero in it. Blocks with as many
/// columns follow each other, in a run.
struct SparseColumns
{
    struct Run
    {
        int num_columns;
        int num_blocks;
    };
    const Run* runs;
    int num_runs;
    const int* offsets;           ///< Of each block, where it begins.
    const std::uint16_t* columns; ///< Of each block in turn, ascending.
    const float* values;          ///< Sixteen of each of these.
};

/// Sees a point X at centre + scale (P_xy + translation) / (1 + phi P_z) with P = R X.
struct PerspectiveCamera
{
    double turn[9]; ///< R, row by row.
    double translation[2];
    double scale;
    double phi;
    double centre[2];
};

[[nodiscard]] constexpr int round_up(int count, int step)
{
    return (count + step - 1) / step * step;
}

/// The hot loops of a fit, as pointers to one instruction set's code. Each set's code lies in a namespace of its own,
/// so programs may hold several; which one a fitter uses is decided where it is made. Results differ between sets by
/// rounding only.
///
/// Matrices are row-major; a *row* has `width` floats, a multiple of width_step, zero beyond those that mean something.
/// Pointers to rows and what goes with their columns are aligned to 64 bytes. Nothing allocates, nothing throws.
struct Kernels
{
    const char* name;   ///< Of the instruction set, for reports.
    bool prefers_int16; ///< Columns of 16 bits take it less time than twice as many bytes of single precision.

    /// out[64 p + c] = base[64 p + c] + sum_j coefficients[j] panels[(p num_columns + j) 64 + c]
    /// for p < num_panels. `out` may be `base`.
    void (*combine_panels)(const float* base, const float* panels, int num_panels, int num_columns,
                           const float* coefficients, float* out);

    /// The same of panels in 16-bit integers; the columns' scales are part of the coefficients.
    void (*combine_panels_int16)(const float* base, const std::int16_t* panels, int num_panels, int num_columns,
                                 const float* coefficients, float* out);

    /// out[i] = from[i] for i < count, a multiple of panel_size.
    void (*widen)(const std::int16_t* from, int count, float* out);

    /// out[r] += sum_j coefficients[j] columns[j step + r] for r < num_rows, of any alignment. Most expressions of a
    /// face are 0: columns that count for nothing are not read.
    void (*add_columns)(const float* columns, std::ptrdiff_t step, int num_rows, int num_columns,
                        const float* coefficients, float* out);

    /// out = base + the columns times the coefficients, with the bits of combine_panels. `out` may be `base`.
    void (*combine_blocks)(const float* base, const SparseColumns& columns, const float* coefficients, float* out);

    /// out[j] = the product of column j of the panels with x, 64 numbers a panel.
    void (*multiply_panels)(const float* panels, int num_panels, int num_columns, const float* x, float* out);

    /// gram = sum of six matrices scales[g] grams[g width^2 ...], upper triangle of the leading columns (more may be
    /// written).
    void (*combine_grams)(const float* grams, int num_columns, int width, const float* scales, float* gram);

    /// Rows 2i and 2i + 1 of out = roots[i] J times the three rows of point indices[i], J 2 x 3.
    void (*project_rows)(const float* point_rows, int width, const int* indices, int count, const float* jacobian,
                         const float* roots, float* out);

    /// out[3i + a] = the product of row a of point indices[i] with x, `width` numbers.
    void (*multiply_rows)(const float* point_rows, int width, const int* indices, int count, const float* x,
                          float* out);

    /// gram += rows^T rows, rows `begin` to `end` of the upper triangle; `begin` is a multiple of four, and rows up to
    /// the next one, which `gram` has room for, may be written.
    void (*add_gram)(const float* rows, int num_rows, int begin, int end, int width, float* gram);
    /// The same in place of what there is.
    void (*set_gram)(const float* rows, int num_rows, int begin, int end, int width, float* gram);

    /// sums[c] += sum_r factors[r] rows[r width + c]
    void (*add_rows)(const float* rows, int num_rows, int width, const float* factors, float* sums);

    /// sums[c] += sum_i sum_a factors[3i + a] times column c of row a of point indices[i].
    void (*add_point_rows)(const float* point_rows, int width, const int* indices, int count, const float* factors,
                           float* sums);

    /// Solves A x = b by Cholesky's method in place: A is n x n, its upper triangle in `system` (n rows of `width`), b
    /// its column n < width. x has `width` entries, 0 beyond n. Returns the least pivot relative to A's diagonal: <= 0
    /// or NaN where A is not positive definite to rounding, and then x is not set.
    float (*solve_positive)(float* system, int n, int width, float* x);

    /// Solves the rows i of A x = b with is_free[i] = 1 for these x_i, where the others, is_free[i] = 0, are as given
    /// in x: A symmetric, 1 <= n <= max_few rows in full, b, is_free and x with a `width` of numbers. residual = b - A
    /// x. Returns the least pivot of the rows relative to A's diagonal: <= 0 or NaN where they are not positive
    /// definite to rounding, and then x and the residual are spoilt.
    float (*solve_few)(const float* matrix, int n, int width, const float* right_side, const float* is_free, float* x,
                       float* residual);

    /// Points in planar order (x, y, z of `step` floats each; `count` rounded up to width_step is read) turned:
    /// out_a[i] = m[4a] x_i + m[4a + 1] y_i + m[4a + 2] z_i + m[4a + 3] for a = 0..2, in rows of `out_step`.
    void (*transform_points)(const float* points, int step, int count, const float* m, float* out, int out_step);

    /// Weighted sums of points x0 y0 z0 x1 ..., seen at (u[i], v[i]): moments += sum w {1, x, y, z, u, v, xx, xy, xz,
    /// yy, yz, zz, ux, uy, uz, vx, vy, vz}. Points up to a multiple of 8 are read; w is 0 beyond `count`.
    void (*add_pose_moments)(const float* points, const double* u, const double* v, const double* w, int count,
                             double* moments);

    /// What weighted residuals ask of points x0 y0 z0 x1 ..., seen at (u[i], v[i]): factors[3i + a] = m[a] du + m[4 +
    /// a] dv with du = scale w[i] (u[i] - m[0] x - m[1] y - m[2] z - m[3]), and dv likewise from m[4] on. Points up to
    /// a multiple of 8 are read and written.
    void (*residual_factors)(const float* points, const double* u, const double* v, const double* w, double scale,
                             int count, const double* m, float* factors);

    /// Of the points (u[i], v[i]), i < count, the first of those nearest to (to_u, to_v); its squared distance is
    /// squared[that]. u and v have a multiple of 8 doubles, infinite beyond the points, and `squared` as many. The same
    /// of every set.
    int (*nearest_point)(const double* u, const double* v, int count, double to_u, double to_v, double* squared);

    /// For each of the points (to_u[j], to_v[j]), j < num_to, the first of those of (u[i], v[i]), i < count, that are
    /// nearest to it: nearest[j]. to_u and to_v have a multiple of 8 doubles. The same of every set.
    void (*nearest_points)(const double* u, const double* v, int count, const double* to_u, const double* to_v,
                           int num_to, int* nearest);

    /// For each of the points (to_u[j], to_v[j]), j < num_to, the first of those segments i < count that are nearest to
    /// it: nearest[j]. The segments stand in five columns of `step` doubles: where each begins, u and v, from there to
    /// its end, du and dv, and 1 over its squared length, or 0 for none. to_u and to_v have a multiple of 8 doubles.
    /// The same of every set.
    void (*nearest_segments)(const double* segments, int step, int count, const double* to_u, const double* to_v,
                             int num_to, int* nearest);

    /// Where points x0 y0 z0 x1 ... are seen: u[i] = m[0] x + m[1] y + m[2] z + m[3], and v[i] likewise from m[4] on.
    /// Points up to a multiple of 8 are read and written; they may begin anywhere.
    void (*see_points)(const float* points, int count, const double* m, double* u, double* v);

    // Rows of single precision, a multiple of double_step floats each, with sums in double precision.

    /// out[r] = the product of row r with x.
    void (*multiply_wide)(const float* rows, int num_rows, int width, const double* x, double* out);

    /// sums[c] += sum_r factors[r] rows[r width + c]
    void (*add_wide)(const float* rows, int num_rows, int width, const double* factors, double* sums);

    /// pulls[3i + a] = u_i J_i[0, a] + v_i J_i[1, a], with the residuals u_i and v_i at residuals[i] and
    /// residuals[count + i] and J_i 2 x 3, whose entry k, row by row, is jacobians[k count + i]; any alignment.
    void (*pull_points)(const double* residuals, const double* jacobians, int count, double* pulls);

    /// The first `width` columns of rows 2i and 2i + 1 of out = scale J_i times the three rows of point i, J_i 2 x 3,
    /// whose entry k, row by row, is jacobians[k num_points + i], in single precision. Rows of `out` have out_width
    /// floats; `out` may begin anywhere.
    void (*project_points)(const float* point_rows, int width, int num_points, const double* jacobians, double scale,
                           float* out, int out_width);

    /// out[i] = (1 - fraction) first[i] + fraction second[i] for i < count, a multiple of double_step.
    void (*blend_rows)(const float* first, const float* second, float fraction, int count, float* out);

    /// out[i out_step + k] = columns[k count + i] for i < count, k < num_columns.
    void (*turn_columns)(const double* columns, int count, int num_columns, float* out, int out_step);

    /// The first `width` columns of rows 3t to 3t + 2 of out, t = targets[i] where that is not negative, += M_i times
    /// the three rows of point i, M_i 3 x 3 at matrices + 9i, in single precision. Rows of `out` have out_width floats;
    /// the columns begin at a multiple of double_step.
    void (*add_turned_points)(const float* point_rows, int width, int num_points, const double* matrices,
                              const int* targets, float* out, int out_width);

    // In double precision; rows have a multiple of double_step doubles.

    /// Weighted residuals: residuals[i] and residuals[count + i] are U_i (seen - landmark) of points x0 y0 z0 x1 ...
    /// and landmarks u0 v0 u1 ..., with U_i = (roots[i], roots[count + i]; 0, roots[2 count + i]). Nothing is read or
    /// written beyond `count`; any alignment.
    void (*camera_residuals)(const PerspectiveCamera& camera, const double* points, const double* landmarks,
                             const double* roots, int count, double* residuals);

    /// Residuals (x, y) at residuals[i] and residuals[count + i] under Student's t of nu degrees of freedom, squared u,
    /// D = dimensions[i]: the root of the curvature, roots[i] = sqrt(w max(least, 1 - 2 u / (D (nu + u)))) with the
    /// weight w = (nu + D) / (nu + u), and (x, y) w / roots[i] at weighted[i] and weighted[count + i]. Nothing is read
    /// or written beyond `count`; any alignment.
    void (*weigh_by_student_t)(const double* residuals, const double* dimensions, double nu, double least, int count,
                               double* roots, double* weighted);

    /// Derivatives of camera_residuals, times factors[i], in rows of `count`: by the point (2 x 3), by the camera (2 x
    /// 6: turn in its axes, log scale, translation), both row by row, by phi (2). The scale moves phi too, and takes
    /// the offsets, which are parts of the points, along: points stand for others + offset / scale.
    void (*camera_derivatives)(const PerspectiveCamera& camera, const double* points, const double* offsets,
                               const double* roots, const double* factors, int count, double* derivatives);

    /// add_gram in double precision; rows have a multiple of double_step.
    void (*add_gram_double)(const double* rows, int num_rows, int begin, int end, int width, double* gram);

    /// gram += L^T L of a lower triangular L with n rows of `width` >= n, upper triangle (more may be written).
    void (*add_lower_gram)(const double* lower, int n, int width, double* gram);

    /// Of the upper triangle of n columns of `matrix` (n rows) from `begin` on, A, `system` becomes U with A = U^T U,
    /// and of each further column b, up to the width, U^-T b; `begin` is a multiple of four. What is left of the
    /// diagonal is not read, and is spoilt. `system` may be `matrix`. inverse_diagonal[i] becomes 1 / U_ii. Returns the
    /// least pivot relative to A's diagonal: <= 0 or NaN where A is not positive definite to rounding, and then
    /// `system` is spoilt.
    double (*factor_positive)(const double* matrix, int n, int begin, int width, double* system,
                              double* inverse_diagonal);

    // What has been factored is given from its first column on, of any alignment.

    /// X = U^-1 U^-T X for U of factor_positive: solves A X = B for num_right_sides columns, n rows.
    void (*solve_factored)(const double* system, int n, int width, const double* inverse_diagonal, double* x);

    /// U^-T (n rows of inverse_width >= n, 0 above the diagonal) for U of factor_positive or its leading n rows.
    void (*invert_factor)(const double* system, int n, int width, const double* inverse_diagonal, double* inverse,
                          int inverse_width);

    // The same in single precision; rows have a multiple of width_step floats.
    float (*factor_positive_float)(const float* matrix, int n, int begin, int width, float* system,
                                   float* inverse_diagonal);
    /// Both at once: of the leading num_inverted rows of U^-T, as of invert_factor_float; rows up to the next multiple
    /// of four may be written, which inverse_width >= n has room for.
    float (*factor_and_invert_float)(const float* matrix, int n, int begin, int width, float* system,
                                     float* inverse_diagonal, int num_inverted, float* inverse, int inverse_width);
    void (*solve_factored_float)(const float* system, int n, int width, const float* inverse_diagonal, float* x);
    /// The same for one right side, x, of which what lies beside the n columns from `begin` on becomes 0; `system` and
    /// x are whole rows of `width`, and `begin` is a multiple of four. Plain C++ beyond
    /// max_width_for_one.
    void (*solve_for_one_float)(const float* system, int n, int begin, int width, const float* inverse_diagonal,
                                float* x);
    /// X = U^-T X alone; rows of zeros that X begins with cost next to nothing.
    void (*solve_lower_float)(const float* system, int n, int width, const float* inverse_diagonal, float* x);
    void (*invert_factor_float)(const float* system, int n, int width, const float* inverse_diagonal, float* inverse,
                                int inverse_width);
    float (*sum_squares_float)(const float* numbers, int count); ///< Of a multiple of width_step.
};

inline constexpr int num_pose_moments = 18;

} // namespace lineament::kernels
