// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/realtime_fitter.hpp"

#include "lineament/fit/inline.hpp"
#include "lineament/fit/realtime_fit_impl.hpp"
#include "lineament/fit/realtime_pack_impl.hpp"

#include <utility>

namespace lineament {

LINEAMENT_FIT_INLINE RealtimeFitter::RealtimeFitter(MorphableModel model, std::string scheme, FitOptions options,
                                                    const kernels::Kernels& kernels, MeshStorage mesh_storage)
    : reference_(std::move(model), std::move(scheme), std::move(options)), kernels_(&kernels)
{
    const std::optional<double>& focal_length_px = reference_.options().focal_length_px;
    require(!focal_length_px.has_value(), "RealtimeFitter", "options.focal_length_px",
            "none: perspective fits are FaceFitter's", to_text(focal_length_px.value_or(0)));
    pack_ = detail::make_pack(reference_, mesh_storage == MeshStorage::int16);
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
        detail::RealtimeFit run(*this, landmarks, principal_point_px, workspace, nullptr);
        if (!run.fit(start, result)) {
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
        detail::RealtimeFit run(*this, landmarks, principal_point_px, workspace, &identity);
        if (!run.fit(start, result)) {
            ++workspace.num_reference_fits_;
            result =
                reference_.fit_pose_and_expression(landmarks, principal_point_px, identity.shape_coefficients_, start);
        }
    }
    result.timing = {};
    result.timing.total_us = total_us;
}

LINEAMENT_FIT_INLINE FrozenIdentity RealtimeFitter::freeze(const Eigen::VectorXd& shape_coefficients) const
{
    require(shape_coefficients.size() <= pack_.num_shape, "RealtimeFitter::freeze", "shape_coefficients",
            "at most " + std::to_string(pack_.num_shape), std::to_string(shape_coefficients.size()));
    require_finite(shape_coefficients, "RealtimeFitter::freeze", "shape_coefficients");
    FrozenIdentity frozen;
    frozen.shape_coefficients_ = Eigen::VectorXd::Zero(pack_.num_shape);
    frozen.shape_coefficients_.head(shape_coefficients.size()) = shape_coefficients;
    frozen.neutral_ = detail::make_neutral(pack_, true);
    detail::AlignedBuffer<float> coefficients(pack_.shape_width);
    detail::AlignedBuffer<float> scaled(pack_.shape_width);
    for (int j = 0; j < pack_.num_shape; ++j) {
        coefficients[j] = static_cast<float>(frozen.shape_coefficients_[j]);
    }
    const auto evaluate = [&](const detail::PointPanels& panels, detail::AlignedBuffer<float>& out) {
        kernels_->combine_panels(panels.mean.data(), panels.identity.data(), panels.num_panels, pack_.num_shape,
                                 coefficients.data(), out.data());
    };
    detail::NeutralShape& neutral = frozen.neutral_;
    evaluate(pack_.fixed, neutral.fixed);
    evaluate(pack_.rest, neutral.rest);
    evaluate(pack_.candidates, neutral.candidates);
    for (int side = 0; side < 2; ++side) {
        evaluate(pack_.regions[side].vertices, neutral.regions[side]);
    }
    for (int row = 0; 3 * row < static_cast<int>(neutral.contour.size()); ++row) {
        float* point = neutral.contour.data() + 3 * row;
        kernels_->multiply_rows(pack_.contour_rows.identity.data(), pack_.shape_width, &row, 1, coefficients.data(),
                                point);
        for (int axis = 0; axis < 3; ++axis) {
            point[axis] += pack_.contour_rows.mean[3 * row + axis];
        }
    }
    evaluate_neutral_mesh(coefficients.data(), scaled.data(), neutral.mesh.data());
    return frozen;
}

LINEAMENT_FIT_INLINE void RealtimeFitter::evaluate_neutral_mesh(const float* coefficients, float* scaled,
                                                                float* out) const
{
    if (pack_.mesh_identity.size() == 0) {
        kernels_->combine_panels(pack_.mesh.mean.data(), pack_.mesh.identity.data(), pack_.mesh.num_panels,
                                 pack_.num_shape, coefficients, out);
        return;
    }
    for (int j = 0; j < pack_.num_shape; ++j) {
        scaled[j] = coefficients[j] * pack_.mesh_identity_scales[j];
    }
    kernels_->combine_panels_int16(pack_.mesh.mean.data(), pack_.mesh_identity.data(), pack_.mesh.num_panels,
                                   pack_.num_shape, scaled, out);
}

LINEAMENT_FIT_INLINE void RealtimeFitter::set_expression(const FitResult& fit, RealtimeWorkspace& workspace) const
{
    require_size(fit.expression_coefficients.size(), pack_.num_expressions, "RealtimeFitter::shape_of",
                 "fit.expression_coefficients");
    for (int j = 0; j < pack_.num_expressions; ++j) {
        workspace.buffers_.psi_row[j] = static_cast<float>(fit.expression_coefficients[j]);
    }
}

LINEAMENT_FIT_INLINE void RealtimeFitter::add_expression(const float* neutral, RealtimeWorkspace& workspace) const
{
    detail::RealtimeBuffers& buffers = workspace.buffers_;
    if (pack_.mesh_identity.size() == 0) {
        kernels_->combine_panels(neutral, pack_.mesh.expression.data(), pack_.mesh.num_panels, pack_.num_expressions,
                                 buffers.psi_row.data(), buffers.mesh.data());
        return;
    }
    for (int j = 0; j < pack_.num_expressions; ++j) {
        buffers.mesh_coefficients[j] = buffers.psi_row[j] * pack_.mesh_expression_scales[j];
    }
    kernels_->combine_panels_int16(neutral, pack_.mesh_expression.data(), pack_.mesh.num_panels, pack_.num_expressions,
                                   buffers.mesh_coefficients.data(), buffers.mesh.data());
}

LINEAMENT_FIT_INLINE Eigen::Map<const Eigen::Matrix3Xf> RealtimeFitter::shape_of(const FitResult& fit,
                                                                                 RealtimeWorkspace& workspace) const
{
    require_size(fit.shape_coefficients.size(), pack_.num_shape, "RealtimeFitter::shape_of", "fit.shape_coefficients");
    set_expression(fit, workspace);
    detail::RealtimeBuffers& buffers = workspace.buffers_;
    for (int j = 0; j < pack_.num_shape; ++j) {
        buffers.alpha_row[j] = static_cast<float>(fit.shape_coefficients[j]);
    }
    evaluate_neutral_mesh(buffers.alpha_row.data(), buffers.mesh_coefficients.data(), buffers.neutral.mesh.data());
    add_expression(buffers.neutral.mesh.data(), workspace);
    return {buffers.mesh.data(), 3, pack_.mesh.num_points};
}

LINEAMENT_FIT_INLINE Eigen::Map<const Eigen::Matrix3Xf>
RealtimeFitter::shape_of(const FrozenIdentity& identity, const FitResult& fit, RealtimeWorkspace& workspace) const
{
    require_size(static_cast<Eigen::Index>(identity.neutral_.mesh.size()), static_cast<Eigen::Index>(pack_.mesh.size()),
                 "RealtimeFitter::shape_of", "identity");
    set_expression(fit, workspace);
    add_expression(identity.neutral_.mesh.data(), workspace);
    return {workspace.buffers_.mesh.data(), 3, pack_.mesh.num_points};
}

} // namespace lineament
