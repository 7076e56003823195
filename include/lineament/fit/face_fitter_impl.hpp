// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/face_fitter.hpp"

#include "lineament/fit/frame_fit_impl.hpp"
#include "lineament/fit/inline.hpp"

#include <cmath>
#include <limits>
#include <utility>

namespace lineament {

LINEAMENT_FIT_INLINE FitOptions FitOptions::published_prior()
{
    FitOptions options;
    options.noise_units = NoiseUnits::pixels;
    options.pixel_variance = 3.0;
    options.regularization = 30.0;
    options.expression_sigma = std::numeric_limits<double>::infinity();
    return options;
}

LINEAMENT_FIT_INLINE void FitOptions::check() const
{
    const auto require_positive = [](double value, const char* member) {
        require(std::isfinite(value) && value > 0, "FitOptions", member, "a finite number > 0", to_text(value));
    };
    require(iterations >= 1, "FitOptions", "iterations", ">= 1", std::to_string(iterations));
    require(std::isfinite(regularization) && regularization >= 0, "FitOptions", "regularization",
            "a finite number >= 0", to_text(regularization));
    require_positive(landmark_sigma_mm, "landmark_sigma_mm");
    require_positive(contour_sigma_mm, "contour_sigma_mm");
    require_positive(pixel_variance, "pixel_variance");
    require_positive(contour_matching.max_distance_mm, "contour_matching.max_distance_mm");
    require(std::isfinite(contour_matching.frontal_yaw_deg) && std::isfinite(contour_matching.hysteresis_deg) &&
                contour_matching.hysteresis_deg >= 0,
            "FitOptions", "contour_matching", "finite angles, hysteresis_deg >= 0",
            to_text(contour_matching.frontal_yaw_deg) + " and " + to_text(contour_matching.hysteresis_deg));
    require(expression_sigma > 0, "FitOptions", "expression_sigma", "> 0", to_text(expression_sigma));
    require(max_expression > 0, "FitOptions", "max_expression", "> 0", to_text(max_expression));
    require(num_shape_coefficients.value_or(0) >= 0, "FitOptions", "num_shape_coefficients", ">= 0",
            std::to_string(num_shape_coefficients.value_or(0)));
    require_positive(focal_length_px.value_or(1.0), "focal_length_px");
}

LINEAMENT_FIT_INLINE FaceFitter::FaceFitter(MorphableModel model, std::string scheme, FitOptions options)
    : model_(std::move(model)), scheme_(std::move(scheme)), options_(std::move(options))
{
    options_.check();
    const LandmarkMap* map = model_.find_landmark_map(scheme_);
    require(map != nullptr, "FaceFitter", "scheme", "one of the model's landmark schemes", "\"" + scheme_ + "\"");
    require(options_.expression_set.empty() || expressions() != nullptr, "FaceFitter", "options.expression_set",
            "empty, or one of the model's expression sets", "\"" + options_.expression_set + "\"");
    const Eigen::Index all = model_.shape.num_coefficients();
    const Eigen::Index count = options_.num_shape_coefficients.value_or(static_cast<int>(all));
    require(count <= all, "FaceFitter", "options.num_shape_coefficients", "at most " + std::to_string(all),
            std::to_string(count));
    require(options_.noise_detector.empty() ? map->noise_mm.size() <= 1 : landmark_noise_mm() != nullptr, "FaceFitter",
            "options.noise_detector", "one that the landmark map states the noise of",
            "\"" + options_.noise_detector + "\"");
    if (landmark_noise_mm() != nullptr) {
        require_size(landmark_noise_mm()->size(), map->num_landmarks(), "FaceFitter", "noise_mm");
        for (Eigen::Index l = 0; l < landmark_noise_mm()->size(); ++l) {
            const double noise_mm = (*landmark_noise_mm())[l];
            require(noise_mm > 0, "FaceFitter", ("noise_mm[" + std::to_string(l) + "]").c_str(),
                    "a number > 0, infinite for a landmark that is not to be used", to_text(noise_mm));
        }
    }
    require(!options_.outline_beside_scheme || options_.contour != ContourMode::fixed, "FaceFitter", "options.contour",
            "another than fixed where the outline lies beside the scheme: the map has no points for it", "fixed");
    for (const std::string& name : map->names) {
        outline_sides_.push_back(outline_side(scheme_, name));
    }
    landmark_points_ = lineament::landmark_points(model_, *map, expressions(), count);
    if ((scheme_ == "ibug68" || options_.outline_beside_scheme) &&
        (options_.contour == ContourMode::front_facing || options_.contour == ContourMode::both)) {
        contour_.emplace(model_);
        identity_rows_ =
            model_.shape.standard_deviations.head(count).asDiagonal() * model_.shape.basis.leftCols(count).transpose();
        if (const Blendshapes* set = expressions()) {
            expression_rows_ = set->offsets.transpose();
        } else {
            expression_rows_.resize(0, model_.shape.mean.size());
        }
    }
}

LINEAMENT_FIT_INLINE const Eigen::VectorXf* FaceFitter::landmark_noise_mm() const
{
    const auto& noise_mm = landmark_map().noise_mm;
    const auto found = options_.noise_detector.empty() ? noise_mm.begin() : noise_mm.find(options_.noise_detector);
    return found == noise_mm.end() ? nullptr : &found->second;
}

LINEAMENT_FIT_INLINE void FaceFitter::update_shape(const Eigen::VectorXd& shape_coefficients,
                                                   const Eigen::VectorXd& expression_coefficients, ContourView view,
                                                   Eigen::Matrix3Xf& shape_vertices) const
{
    const Eigen::VectorXf alpha = shape_coefficients.cast<float>();
    const Eigen::VectorXf psi = expression_coefficients.cast<float>();
    const auto update_each = [&](const std::vector<int>& vertices) {
        for (const int vertex : vertices) {
            for (Eigen::Index axis = 0; axis < 3; ++axis) { // faster than a product of three rows
                const Eigen::Index entry = 3 * static_cast<Eigen::Index>(vertex) + axis;
                shape_vertices(axis, vertex) = model_.shape.mean[entry] + identity_rows_.col(entry).dot(alpha) +
                                               expression_rows_.col(entry).dot(psi);
            }
        }
    };
    if (view != ContourView::frontal) {
        const Eigen::Index size = 3 * contour_->num_occluder_vertices();
        Eigen::Map<Eigen::VectorXf> leading(shape_vertices.data(), size);
        leading = model_.shape.mean.head(size);
        leading.noalias() += identity_rows_.leftCols(size).transpose() * alpha;
        leading.noalias() += expression_rows_.leftCols(size).transpose() * psi;
        update_each(contour_->region_vertices(view == ContourView::shows_right ? FaceSide::left : FaceSide::right));
    }
    update_each(contour_->candidates(FaceSide::left));
    update_each(contour_->candidates(FaceSide::right));
}

LINEAMENT_FIT_INLINE void FaceFitter::assign_vertex(ModelPoints& points, Eigen::Index to, int vertex) const
{
    const Eigen::Index column = 3 * static_cast<Eigen::Index>(vertex);
    points.mean.col(to) = model_.shape.mean.segment<3>(column).cast<double>();
    points.identity.middleCols<3>(3 * to) = identity_rows_.middleCols<3>(column).cast<double>();
    points.expression.middleCols<3>(3 * to) = expression_rows_.middleCols<3>(column).cast<double>();
}

LINEAMENT_FIT_INLINE void FaceFitter::get_vertex(int vertex, Eigen::Ref<Eigen::Vector3d> mean,
                                                 Eigen::Ref<Eigen::MatrixX3f> identity,
                                                 Eigen::Ref<Eigen::MatrixX3f> expression) const
{
    const Eigen::Index column = 3 * static_cast<Eigen::Index>(vertex);
    mean = model_.shape.mean.segment<3>(column).cast<double>();
    identity = identity_rows_.middleCols<3>(column);
    expression = expression_rows_.middleCols<3>(column);
}

namespace detail {

/// Coefficients to start from, checked.
[[nodiscard]] inline Eigen::VectorXd start_coefficients(const FaceFitter& fitter, const FitResult* start)
{
    if (start == nullptr) {
        return Eigen::VectorXd::Zero(fitter.num_shape_coefficients());
    }
    require_size(start->shape_coefficients.size(), fitter.num_shape_coefficients(), "FaceFitter::fit",
                 "start->shape_coefficients");
    require_finite(start->shape_coefficients, "FaceFitter::fit", "start->shape_coefficients");
    return start->shape_coefficients;
}

} // namespace detail

LINEAMENT_FIT_INLINE FitResult FaceFitter::fit(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                                               const FitResult* start) const
{
    double total_us = 0;
    FitResult result;
    {
        const detail::Stopwatch total(total_us);
        Eigen::VectorXd alpha = detail::start_coefficients(*this, start);
        detail::FrameFit frame(*this, landmarks, principal_point_px, start);
        IdentityOptions identity_options;
        identity_options.regularization = options_.regularization;
        IdentityResult identity;
        bool has_pose = frame.estimate_pose(alpha);
        if (has_pose && start == nullptr) {
            frame.fit_expression(alpha);
        }
        int iteration = 0;
        while (has_pose && iteration < options_.iterations) {
            ++iteration;
            frame.match_contour(alpha);
            has_pose = frame.estimate_pose(alpha);
            if (has_pose) {
                {
                    const detail::Stopwatch stopwatch(frame.timing().identity_us);
                    IdentitySystem system(num_shape_coefficients());
                    frame.add_to(system, alpha);
                    identity = system.solve(identity_options);
                    alpha = identity.coefficients;
                }
                frame.fit_expression(alpha);
            }
        }
        if (has_pose) {
            frame.turn_by_depth(alpha);
            frame.note(identity.status, identity.reason);
        } else {
            alpha.setZero();
        }
        result = frame.result(alpha, iteration);
    }
    result.timing.total_us = total_us;
    return result;
}

LINEAMENT_FIT_INLINE FitResult FaceFitter::fit_pose_and_expression(const LandmarkSet& landmarks,
                                                                   const Eigen::Vector2d& principal_point_px,
                                                                   const Eigen::VectorXd& shape_coefficients,
                                                                   const FitResult* start) const
{
    require(shape_coefficients.size() <= num_shape_coefficients(), "FaceFitter::fit_pose_and_expression",
            "shape_coefficients", "at most " + std::to_string(num_shape_coefficients()),
            std::to_string(shape_coefficients.size()));
    require_finite(shape_coefficients, "FaceFitter::fit_pose_and_expression", "shape_coefficients");
    double total_us = 0;
    FitResult result;
    {
        const detail::Stopwatch total(total_us);
        Eigen::VectorXd alpha = Eigen::VectorXd::Zero(num_shape_coefficients());
        alpha.head(shape_coefficients.size()) = shape_coefficients;
        detail::FrameFit frame(*this, landmarks, principal_point_px, start);
        bool has_pose = frame.estimate_pose(alpha);
        int iteration = 0;
        if (has_pose && start == nullptr) {
            frame.fit_expression(alpha);
        }
        while (has_pose && iteration < options_.iterations) {
            ++iteration;
            frame.match_contour(alpha);
            has_pose = frame.estimate_pose(alpha);
            if (has_pose) {
                frame.fit_expression(alpha);
            }
        }
        if (has_pose) {
            frame.turn_by_depth(alpha);
        }
        result = frame.result(alpha, iteration);
    }
    result.timing.total_us = total_us;
    return result;
}

LINEAMENT_FIT_INLINE FitResult fit_face(const MorphableModel& model, const LandmarkSet& landmarks,
                                        const Eigen::Vector2d& principal_point_px, const FitOptions& options)
{
    return FaceFitter(model, landmarks.scheme, options).fit(landmarks, principal_point_px);
}

} // namespace lineament
