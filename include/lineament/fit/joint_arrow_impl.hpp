// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The matrix of a joint fit's step for several images, by kernels.
#pragma once

#include "lineament/fit/joint_problem.hpp"

#include "lineament/fit/inline.hpp"
#include "lineament/fit/joint_bias_impl.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

namespace lineament::detail {

/// In single precision.
LINEAMENT_FIT_INLINE void JointProblem::set_arrow(const JointState& state, JointSystem& system) const
{
    const std::vector<int>& unknowns = system.unknowns;
    const auto others = std::lower_bound(unknowns.begin(), unknowns.end(), static_cast<int>(num_shape()));
    const int num_alpha = static_cast<int>(others - unknowns.begin());
    const int num_phi = others != unknowns.end() && *others < num_shared() ? 1 : 0;
    const int num_hidden = state.bias.size() > 0 ? system.num_coupling_rows : 0;
    std::vector<std::vector<int>> of_images;
    std::vector<int> counts;
    for (std::size_t f = 0; f < images.size(); ++f) {
        of_images.push_back(unknowns_of_image(f, unknowns));
        counts.push_back(static_cast<int>(of_images.back().size()) - num_alpha - num_phi);
    }
    ArrowMatrix& arrow = system.arrow;
    system.has_hessian = false;
    arrow.set_zero(counts, num_hidden, num_alpha + num_phi);
    const int alpha_column = arrow.own_width + num_hidden, phi_column = alpha_column + num_alpha;
    const int shape_width = kernels::round_up(static_cast<int>(num_shape()), kernels::width_step);
    float* shape_gram = room_for(system.shape_gram, shape_width * shape_width);
    std::fill_n(shape_gram, shape_width * shape_width, 0.0f);
    float* own = arrow.own.data();
    double phi_squares = 0;
    Eigen::VectorXf phi_with_alpha = Eigen::VectorXf::Zero(num_alpha);
    for (std::size_t f = 0; f < images.size(); ++f) {
        const std::span<const int> others_of_image =
            std::span(of_images[f]).subspan(static_cast<std::size_t>(num_alpha));
        const int num_others = static_cast<int>(others_of_image.size());
        const int alpha_begin = kernels::round_up(num_others, kernels::width_step), width = alpha_begin + shape_width;
        float* rows = set_rows(f, own_scale(f, state), others_of_image, alpha_begin, 0, width, system);
        float* gram = room_for(system.gram, alpha_begin * width);
        kernels->set_gram(rows, 2 * static_cast<int>(images[f].used.size()), 0, num_others, width, gram);
        if (num_phi > 0) {
            phi_squares += gram[0];
        }
        for (int a = 0; a < num_alpha && num_phi > 0; ++a) {
            phi_with_alpha[a] += gram[alpha_begin + unknowns[static_cast<std::size_t>(a)]];
        }
        for (int i = num_phi; i < num_others; ++i, own += arrow.width()) {
            const float* from = gram + i * width;
            std::copy(from + i, from + num_others, own + i - num_phi);
            for (int a = 0; a < num_alpha; ++a) {
                own[alpha_column + a] = from[alpha_begin + unknowns[static_cast<std::size_t>(a)]];
            }
            if (num_phi > 0) {
                own[phi_column] = gram[i];
            }
            const int unknown = others_of_image[static_cast<std::size_t>(i)] - static_cast<int>(num_shared());
            const int coupled = coupling_column(own_begin(f)) + unknown, step = coupling_width();
            for (int h = 0; h < num_hidden; ++h) {
                own[arrow.own_width + h] = system.coupling_rows.data()[h * step + coupled];
            }
            if (unknown < num_expressions_) {
                own[i - num_phi] += static_cast<float>(inverse_square(options_->expression_sigma));
            }
        }

        // Of alpha alone the rows that are not those of biases, one behind the other.
        float* end = rows;
        int num_kept = 0;
        for (std::size_t row = 0; row < 2 * images[f].used.size(); ++row) {
            if (num_hidden == 0 || images[f].used[row / 2].bias_index < 0) {
                end = std::copy_n(rows + static_cast<int>(row) * width + alpha_begin, shape_width, end);
                ++num_kept;
            }
        }
        kernels->add_gram(rows, num_kept, 0, static_cast<int>(num_shape()), shape_width, shape_gram);
    }
    if (num_hidden > 0) {
        add_shape_gram_of_biases(system, shape_gram);
        set_arrow_of_biases(system);
    }
    for (int j = 0; j < num_alpha; ++j) {
        const int unknown = unknowns[static_cast<std::size_t>(j)];
        float* row = arrow.shared.data() + (num_hidden + j) * arrow.shared_width + num_hidden;
        for (int i = j; i < num_alpha; ++i) {
            const int other = unknowns[static_cast<std::size_t>(i)];
            row[i] = shape_gram[unknown * shape_width + other] + static_cast<float>(prior_->entry(other, unknown));
        }
        if (num_phi > 0) {
            row[num_alpha] = phi_with_alpha[j];
        }
    }
    if (num_phi > 0) {
        arrow.shared.data()[(num_hidden + num_alpha) * (arrow.shared_width + 1)] =
            static_cast<float>(phi_squares + inverse_square(*options_->phi_sigma_per_mm));
    }
}

/// The rows of the biases.
LINEAMENT_FIT_INLINE void JointProblem::set_arrow_of_biases(JointSystem& system) const
{
    ArrowMatrix& arrow = system.arrow;
    for (std::size_t b = 0; b < system.rows_of_biases.size(); ++b) {
        for (int axis = 0; axis < 3 && system.rows_of_biases[b] >= 0; ++axis) {
            const int h = 3 * system.rows_of_biases[b] + axis;
            float* row = arrow.shared.data() + h * arrow.shared_width;
            for (int other = axis; other < 3; ++other) {
                row[h - axis + other] =
                    static_cast<float>(system.bias_blocks(axis, 3 * static_cast<Eigen::Index>(b) + other));
            }
            const float* coupling = system.coupling_rows.data() + h * coupling_width();
            for (int j = 0; j < arrow.num_shared; ++j) {
                row[arrow.num_hidden + j] = coupling[system.unknowns[static_cast<std::size_t>(j)]];
            }
        }
    }
}

LINEAMENT_FIT_INLINE void JointProblem::complete_hessian_of_arrow(JointSystem& system) const
{
    set_less_biases(system);
    const ArrowMatrix& arrow = system.arrow;
    const int num_shared = arrow.num_shared, num_hidden = arrow.num_hidden;
    const Eigen::Index size = system.hessian.rows();
    const auto add = [](const float* from, int count, double* to) {
        for (int i = 0; i < count; ++i) {
            to[i] += from[i];
        }
    };
    for (int j = 0; j < num_shared; ++j) {
        const float* row = arrow.shared.data() + (num_hidden + j) * arrow.shared_width + num_hidden;
        add(row + j, num_shared - j, system.hessian.data() + j * (size + 1));
    }
    const float* row = arrow.own.data();
    int begin = num_shared;
    for (const int count : arrow.counts) {
        for (int i = 0; i < count; ++i, row += arrow.width()) {
            add(row + i, count - i, system.hessian.data() + (begin + i) * (size + 1));
            for (int j = 0; j < num_shared; ++j) {
                system.hessian(begin + i, j) += row[arrow.own_width + num_hidden + j];
            }
        }
        begin += count;
    }
}

/// The part of the matrix that eliminating the biases takes off, -C V C^T, of the coupling C and the biases' inverse
/// blocks V = L L^T.
LINEAMENT_FIT_INLINE void JointProblem::set_less_biases(JointSystem& system) const
{
    const ArrowMatrix& arrow = system.arrow;
    const int num_shared = arrow.num_shared, num_hidden = arrow.num_hidden;
    const int size = static_cast<int>(system.unknowns.size()), width = kernels::round_up(size, kernels::width_step);
    system.hessian.resize(size, size);
    if (num_hidden == 0) {
        system.hessian.setZero();
        return;
    }
    float* rows = room_for(system.rows, num_hidden * width); // L^T C^T
    for (std::size_t b = 0; b < system.rows_of_biases.size(); ++b) {
        const int h = 3 * system.rows_of_biases[b];
        if (h < 0) {
            continue;
        }
        const Eigen::Matrix3d inverse = system.bias_inverse.middleCols<3>(3 * static_cast<Eigen::Index>(b));
        const Eigen::Matrix3f root = Eigen::Matrix3d(inverse.llt().matrixL()).cast<float>();
        float* to = rows + h * width;
        const auto set = [&](int c, const float* coupling, int step) {
            const float x = coupling[0], y = coupling[step], z = coupling[2 * step];
            to[c] = root(0, 0) * x + root(1, 0) * y + root(2, 0) * z;
            to[width + c] = root(1, 1) * y + root(2, 1) * z;
            to[2 * width + c] = root(2, 2) * z;
        };
        for (int j = 0; j < num_shared; ++j) {
            set(j, arrow.shared.data() + h * arrow.shared_width + num_hidden + j, arrow.shared_width);
        }
        for (int i = num_shared; i < size; ++i) {
            set(i, arrow.own.data() + (i - num_shared) * arrow.width() + arrow.own_width + h, 1);
        }
        for (int axis = 0; axis < 3; ++axis) {
            std::fill(to + axis * width + size, to + (axis + 1) * width, 0.0f);
        }
    }
    float* gram = room_for(system.gram, width * width);
    kernels->set_gram(rows, num_hidden, 0, size, width, gram);
    for (int j = 0; j < size; ++j) {
        std::transform(gram + j * width + j, gram + j * width + size, system.hessian.data() + j * (size + 1),
                       [](float taken) { return -static_cast<double>(taken); });
    }
}

/// R with R^T R = A, positive semi-definite.
[[nodiscard]] inline Eigen::Matrix3d root_of(Eigen::Matrix3d a)
{
    Eigen::Matrix3d root = Eigen::Matrix3d::Zero();
    const double least = 1e-12 * a.trace(); // below is rounding
    for (int k = 0; k < 3; ++k) {
        if (a(k, k) > least) {
            root.row(k) = a.row(k) / std::sqrt(a(k, k));
            a.noalias() -= root.row(k).transpose() * root.row(k);
        }
    }
    return root;
}

/// Points with a bias are the same in all images, so that what images say of a point is summed first.
LINEAMENT_FIT_INLINE void JointProblem::add_shape_gram_of_biases(JointSystem& system, float* gram) const
{
    const int width = kernels::round_up(static_cast<int>(num_shape()), kernels::width_step);
    float* rows = room_for(system.rows, system.num_coupling_rows * width);
    std::fill_n(rows, system.num_coupling_rows * width, 0.0f);
    add_turned_points_of_biases([&](int b) { return root_of(system.bias_points.middleCols<3>(3 * b)); }, rows, width,
                                system);
    kernels->add_gram(rows, system.num_coupling_rows, 0, static_cast<int>(num_shape()), width, gram);
}

} // namespace lineament::detail
