// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/realtime_fitter.hpp"

#include "lineament/fit/inline.hpp"
#include "lineament/fit/realtime_fit_impl.hpp"
#include "lineament/fit/realtime_frames_impl.hpp"
#include "lineament/fit/realtime_pack_impl.hpp"

#include <utility>

namespace lineament {

namespace detail {

/// base + columns times coefficients, which include the columns' scales where those are 16-bit integers.
inline void combine_mesh(const kernels::Kernels& kernels, const AlignedBuffer<float>& columns,
                         const ShortPanels& short_columns, int num_columns, int num_panels, const float* base,
                         const float* coefficients, float* out)
{
    if (short_columns.integers.size() == 0) {
        kernels.combine_panels(base, columns.data(), num_panels, num_columns, coefficients, out);
    } else {
        kernels.combine_panels_int16(base, short_columns.integers.data(), num_panels, num_columns, coefficients, out);
    }
}

/// The columns of one panel in single precision, in `widened` if they are shorter.
[[nodiscard]] inline const float* columns_of_panel(const kernels::Kernels& kernels, const AlignedBuffer<float>& columns,
                                                   const ShortPanels& short_columns, int num_columns, int panel,
                                                   float* widened)
{
    const int size = num_columns * kernels::panel_size;
    const std::size_t offset = static_cast<std::size_t>(panel) * size;
    if (short_columns.integers.size() == 0) {
        return columns.data() + offset;
    }
    kernels.widen(short_columns.integers.data() + offset, size, widened);
    return widened;
}

/// Coefficients as combine_mesh takes them; no scales: as they are.
inline void scale_coefficients(const Eigen::VectorXd& coefficients, const std::vector<float>& scales, float* scaled)
{
    for (Eigen::Index j = 0; j < coefficients.size(); ++j) {
        const float value = static_cast<float>(coefficients[j]);
        scaled[j] = scales.empty() ? value : value * scales[static_cast<std::size_t>(j)];
    }
}

} // namespace detail

LINEAMENT_FIT_INLINE RealtimeFitter::RealtimeFitter(MorphableModel model, std::string scheme, FitOptions options,
                                                    const kernels::Kernels& kernels, MeshStorage mesh_storage)
    : reference_(std::move(model), std::move(scheme), std::move(options)), kernels_(&kernels)
{
    const std::optional<double>& focal_length_px = reference_.options().focal_length_px;
    require(!focal_length_px.has_value(), "RealtimeFitter", "options.focal_length_px",
            "none: perspective fits are FaceFitter's", to_text(focal_length_px.value_or(0)));
    pack_ = detail::make_pack(reference_, mesh_storage, kernels.prefers_int16);
}

LINEAMENT_FIT_INLINE RealtimeWorkspace RealtimeFitter::make_workspace() const
{
    RealtimeWorkspace workspace;
    workspace.buffers_ = detail::make_buffers(pack_);
    return workspace;
}

LINEAMENT_FIT_INLINE void RealtimeFitter::fit(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                                              RealtimeWorkspace& workspace, FitResult& result,
                                              const FitResult* start) const
{
    double total_us = 0;
    {
        const detail::Stopwatch total(total_us);
        detail::RealtimeFit run(*this, landmarks, workspace, 0, nullptr);
        if (!run.fit(principal_point_px, start, result)) {
            ++workspace.num_reference_fits_;
            result = reference_.fit(landmarks, principal_point_px, start);
        }
    }
    result.timing = {};
    result.timing.total_us = total_us;
}

LINEAMENT_FIT_INLINE void RealtimeFitter::fit_pose_and_expression(const LandmarkSet& landmarks,
                                                                  const Eigen::Vector2d& principal_point_px,
                                                                  const FrozenIdentity& identity,
                                                                  RealtimeWorkspace& workspace, FitResult& result,
                                                                  const FitResult* start) const
{
    require_size(static_cast<Eigen::Index>(identity.neutral_.mesh.size()), static_cast<Eigen::Index>(pack_.mesh.size()),
                 "RealtimeFitter::fit_pose_and_expression", "identity");
    double total_us = 0;
    {
        const detail::Stopwatch total(total_us);
        detail::RealtimeFit run(*this, landmarks, workspace, 0, &identity);
        if (!run.fit(principal_point_px, start, result)) {
            ++workspace.num_reference_fits_;
            result =
                reference_.fit_pose_and_expression(landmarks, principal_point_px, identity.shape_coefficients_, start);
        }
    }
    result.timing = {};
    result.timing.total_us = total_us;
}

LINEAMENT_FIT_INLINE void RealtimeFitter::fit_frames(std::span<const LandmarkSet> frames,
                                                     const Eigen::Vector2d& principal_point_px,
                                                     RealtimeWorkspace& workspace, MultiFrameResult& result,
                                                     PriorCount prior_count) const
{
    detail::RealtimeFramesFit run(*this, frames, workspace);
    if (!run.fit(principal_point_px, prior_count, result)) {
        ++workspace.num_reference_fits_;
        result = lineament::fit_frames(reference_, frames, principal_point_px, prior_count);
    }
}

LINEAMENT_FIT_INLINE FrozenIdentity RealtimeFitter::freeze(const Eigen::VectorXd& shape_coefficients) const
{
    require(shape_coefficients.size() <= pack_.num_shape, "RealtimeFitter::freeze", "shape_coefficients",
            "at most " + std::to_string(pack_.num_shape), std::to_string(shape_coefficients.size()));
    require_finite(shape_coefficients, "RealtimeFitter::freeze", "shape_coefficients");
    FrozenIdentity frozen;
    frozen.shape_coefficients_ = Eigen::VectorXd::Zero(pack_.num_shape);
    frozen.shape_coefficients_.head(shape_coefficients.size()) = shape_coefficients;
    frozen.is_moderate_ = detail::is_moderate(shape_coefficients);
    frozen.neutral_ = detail::make_neutral(pack_);
    detail::NeutralShape& neutral = frozen.neutral_;
    float* alpha = neutral.alpha_row.data();
    detail::scale_coefficients(frozen.shape_coefficients_, {}, alpha);
    for (int set = 0; set < detail::num_point_sets; ++set) {
        const detail::PointPanels& panels = pack_.panels(static_cast<detail::PointSet>(set));
        kernels_->combine_panels(panels.mean.data(), panels.identity.data(), panels.num_panels, pack_.num_shape, alpha,
                                 neutral.points[set].data());
    }
    for (int row = 0; 3 * row < static_cast<int>(neutral.contour.size()); ++row) {
        float* point = neutral.contour.data() + 3 * row;
        kernels_->multiply_rows(pack_.contour_rows.identity.data(), pack_.shape_width, &row, 1, alpha, point);
        for (int axis = 0; axis < 3; ++axis) {
            point[axis] += pack_.contour_rows.mean[3 * row + axis];
        }
    }
    detail::AlignedBuffer<float> scaled(pack_.shape_width);
    evaluate_neutral_mesh(frozen.shape_coefficients_, scaled.data(), neutral.mesh.data());
    return frozen;
}

LINEAMENT_FIT_INLINE void RealtimeFitter::evaluate_neutral_mesh(const Eigen::VectorXd& coefficients, float* scaled,
                                                                float* out) const
{
    detail::scale_coefficients(coefficients, pack_.short_identity.scales, scaled);
    detail::combine_mesh(*kernels_, pack_.mesh.identity, pack_.short_identity, pack_.num_shape, pack_.mesh.num_panels,
                         pack_.mesh.mean.data(), scaled, out);
}

LINEAMENT_FIT_INLINE Eigen::Map<const Eigen::Matrix3Xf>
RealtimeFitter::add_expression(const float* neutral, const FitResult& fit, RealtimeWorkspace& workspace) const
{
    detail::RealtimeBuffers& buffers = workspace.buffers_;
    float* scaled = buffers.mesh_coefficients.data();
    if (pack_.mesh_expression_blocks.runs.empty()) {
        detail::scale_coefficients(fit.expression_coefficients, pack_.short_expression.scales, scaled);
        detail::combine_mesh(*kernels_, pack_.mesh.expression, pack_.short_expression, pack_.num_expressions,
                             pack_.mesh.num_panels, neutral, scaled, buffers.mesh.data());
    } else {
        detail::scale_coefficients(fit.expression_coefficients, {}, scaled);
        kernels_->combine_blocks(neutral, pack_.mesh_expression_blocks.view(), scaled, buffers.mesh.data());
    }
    return {buffers.mesh.data(), 3, pack_.mesh.num_points};
}

LINEAMENT_FIT_INLINE MeshBytes RealtimeFitter::mesh_bytes() const
{
    const auto bytes = [](const detail::AlignedBuffer<float>& columns, const detail::ShortPanels& short_columns) {
        return sizeof(float) * columns.size() + sizeof(std::int16_t) * short_columns.integers.size();
    };
    const detail::ColumnBlocks& blocks = pack_.mesh_expression_blocks;
    return {bytes(pack_.mesh.identity, pack_.short_identity), blocks.runs.empty()
                                                                  ? bytes(pack_.mesh.expression, pack_.short_expression)
                                                                  : sizeof(float) * blocks.values.size()};
}

LINEAMENT_FIT_INLINE void RealtimeFitter::check_coefficients(const FitResult& fit, const char* function) const
{
    require_size(fit.shape_coefficients.size(), pack_.num_shape, function, "fit.shape_coefficients");
    require_size(fit.expression_coefficients.size(), pack_.num_expressions, function, "fit.expression_coefficients");
}

LINEAMENT_FIT_INLINE Eigen::Map<const Eigen::Matrix3Xf> RealtimeFitter::shape_of(const FitResult& fit,
                                                                                 RealtimeWorkspace& workspace) const
{
    check_coefficients(fit, "RealtimeFitter::shape_of");
    detail::RealtimeBuffers& buffers = workspace.buffers_;
    evaluate_neutral_mesh(fit.shape_coefficients, buffers.mesh_coefficients.data(), buffers.neutral.mesh.data());
    return add_expression(buffers.neutral.mesh.data(), fit, workspace);
}

LINEAMENT_FIT_INLINE Eigen::Map<const Eigen::Matrix3Xf>
RealtimeFitter::shape_of(const FrozenIdentity& identity, const FitResult& fit, RealtimeWorkspace& workspace) const
{
    const char* const function = "RealtimeFitter::shape_of";
    require_size(static_cast<Eigen::Index>(identity.neutral_.mesh.size()), static_cast<Eigen::Index>(pack_.mesh.size()),
                 function, "identity");
    require_size(fit.expression_coefficients.size(), pack_.num_expressions, function, "fit.expression_coefficients");
    return add_expression(identity.neutral_.mesh.data(), fit, workspace);
}

LINEAMENT_FIT_INLINE void RealtimeFitter::shapes_of(std::span<const FitResult> fits, RealtimeWorkspace& workspace,
                                                    Eigen::MatrixXf& shapes) const
{
    for (const FitResult& fit : fits) {
        check_coefficients(fit, "RealtimeFitter::shapes_of");
    }
    const Eigen::Index num_rows = 3 * static_cast<Eigen::Index>(pack_.mesh.num_points);
    shapes.resize(num_rows, static_cast<Eigen::Index>(fits.size()));
    const int stride = pack_.shape_width + pack_.expression_width;
    float* coefficients = workspace.buffers_.batch_coefficients.data();
    float* panel = workspace.buffers_.batch_panel.data();
    float* columns = workspace.buffers_.batch_columns.data();
    for (std::size_t begin = 0; begin < fits.size(); begin += detail::batch_size) {
        const std::size_t count = std::min<std::size_t>(detail::batch_size, fits.size() - begin);
        for (std::size_t f = 0; f < count; ++f) {
            const FitResult& fit = fits[begin + f];
            float* alpha = coefficients + f * stride;
            detail::scale_coefficients(fit.shape_coefficients, pack_.short_identity.scales, alpha);
            detail::scale_coefficients(fit.expression_coefficients, pack_.short_expression.scales,
                                       alpha + pack_.shape_width);
        }
        for (int p = 0; p < pack_.mesh.num_panels; ++p) {
            const Eigen::Index first_row = static_cast<Eigen::Index>(p) * kernels::panel_size;
            const Eigen::Index rows = std::min<Eigen::Index>(kernels::panel_size, num_rows - first_row);
            const float* identity = detail::columns_of_panel(*kernels_, pack_.mesh.identity, pack_.short_identity,
                                                             pack_.num_shape, p, columns);
            const float* expression =
                detail::columns_of_panel(*kernels_, pack_.mesh.expression, pack_.short_expression,
                                         pack_.num_expressions, p, columns + pack_.num_shape * kernels::panel_size);
            for (std::size_t f = 0; f < count; ++f) { // the panel's columns stay in the nearest cache
                const float* alpha = coefficients + f * stride;
                kernels_->combine_panels(pack_.mesh.mean.data() + first_row, identity, 1, pack_.num_shape, alpha,
                                         panel);
                kernels_->combine_panels(panel, expression, 1, pack_.num_expressions, alpha + pack_.shape_width, panel);
                std::copy_n(panel, rows, shapes.col(static_cast<Eigen::Index>(begin + f)).data() + first_row);
            }
        }
    }
}

} // namespace lineament
