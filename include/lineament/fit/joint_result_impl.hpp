// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What a joint fit says.
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_RESULT_IMPL_HPP
#define LINEAMENT_FIT_JOINT_RESULT_IMPL_HPP

#include "lineament/fit/fit_summary_impl.hpp"
#include "lineament/fit/joint_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <utility>

namespace lineament::detail {

inline void JointFit::set_unfitted(const Image& image, FitResult& result) const
{
    result.method = "joint";
    result.status = image.status;
    result.reason = image.reason;
    result.camera = image.camera;
    result.shape_coefficients.setZero(base().num_shape_coefficients());
    result.expression_coefficients.setZero(num_expressions());
    if (const Blendshapes* expressions = base().expressions()) {
        result.expression_set = expressions->name;
        result.expression_names = expressions->names;
    } else {
        result.expression_set.clear();
        result.expression_names.clear();
    }
    result.rms_px = 0.0;
    result.chi_square = 0.0;
    result.degrees_of_freedom = 0;
    result.iterations = progress_.iterations;
    result.contour_view = image.matcher.view();
    result.timing = FitTiming{};
    result.timing.total_us = total_us_;
    result.timing.contour_us = contour_us_;
    const std::vector<Landmark>& landmarks = image.landmarks->landmarks;
    result.landmarks.resize(landmarks.size());
    for (std::size_t l = 0; l < landmarks.size(); ++l) {
        FittedLandmark& landmark = result.landmarks[l];
        if (!is_same_name(landmark.name, landmarks[l].name)) {
            landmark.name = landmarks[l].name;
        }
        landmark.point_px = landmarks[l].point_px;
        landmark.fitted_px = landmarks[l].point_px;
        landmark.weight = 0.0;
    }
}

inline void forget_certainty(JointFitResult& frame)
{
    frame.covariance.resize(0, 0);
    frame.expression_deviations.resize(0);
    frame.unobservable_expressions.clear();
}

/// Of a frame without a usable pose.
inline void forget_minimum(JointFitResult& frame)
{
    forget_certainty(frame);
    frame.minimum_camera = Camera{};
    frame.minimum_expression.resize(0);
    frame.matched_scale_px_per_mm = 1.0;
    frame.scale_strength = 0.0;
    frame.energies.clear();
}

/// What of an unfitted result the fit has changed.
inline void JointFit::set_fit(std::size_t f, FitResult& result)
{
    const Image& image = images_[used_[f]];
    const JointImage& seen = problem_.images[f];
    result.camera = shown_.cameras[f];
    result.shape_coefficients = context_->identity(state_.alpha);
    result.expression_coefficients = shown_.psi[f];
    const std::vector<int>& map_indices = image.matcher.map_indices();
    is_used_.assign(map_indices.size(), 0);
    for (const JointPoint& used : seen.used) {
        is_used_[static_cast<std::size_t>(used.landmark_index)] = 1;
    }
    for (std::size_t l = 0; l < map_indices.size(); ++l) {
        if (is_used_[l] == 0 && map_indices[l] >= 0) { // its point of the landmark map
            result.landmarks[l].fitted_px = result.camera.project(
                context_->points.landmarks.at(map_indices[l], state_.alpha, result.expression_coefficients));
        }
    }
    const double own_scale = matched_scales_[f] / state_.cameras[f].scale_px_per_mm;
    const bool is_placed = // already
        state_.bias.size() == 0 && !is_turned_[f] && shown_.psi[f] == own_scale * state_.psi[f];
    if (!is_placed) {
        seen.points.evaluate(context_->kernels, state_.alpha, shown_.psi[f], products_, points_);
    }
    set_unit_roots(seen.points.num_points, unit_roots_);
    set_residuals(context_->kernels, result.camera, is_placed ? scratch_.placed[f].points : points_, seen.image_points,
                  unit_roots_, distances_);
    const std::array<double, 2> unit_weights{1 / robust_weight(options().loss, 0.0, 1), // of one and of two dimensions
                                             1 / robust_weight(options().loss, 0.0, 2)};
    for (std::size_t i = 0; i < seen.used.size(); ++i) {
        const JointPoint& used = seen.used[i];
        const Eigen::Index column = static_cast<Eigen::Index>(i);
        FittedLandmark& landmark = result.landmarks[static_cast<std::size_t>(used.landmark_index)];
        const double squared = scratch_.placed[f].squared_residual(column);
        landmark.fitted_px = landmark.point_px + distances_.row(column).transpose();
        landmark.weight = image.landmarks->landmarks[static_cast<std::size_t>(used.landmark_index)].confidence *
                          robust_weight(options().loss, squared, used.num_dimensions) *
                          unit_weights[static_cast<std::size_t>(used.num_dimensions - 1)];
        result.chi_square += squared;
    }
    result.rms_px = std::sqrt(distances_.squaredNorm() / static_cast<double>(seen.used.size()));
    result.chi_square +=
        problem_.prior_squares(state_.alpha) + (state_.psi[f] / options().expression_sigma).squaredNorm();
    result.degrees_of_freedom = 2 * static_cast<int>(seen.used.size()) - 6;
}

inline void JointFit::judge(JointFramesResult& result)
{
    const auto num_at_bound = (state_.alpha.array().abs() >= options().max_coefficient).count();
    result.status = FitStatus::success;
    result.reason.clear();
    if (!progress_.has_settled) {
        result.status = FitStatus::not_converged;
        char text[64]; // a fit of few steps says so each time, without allocation
        std::snprintf(text, sizeof text, "the joint fit did not settle in %d steps", progress_.iterations);
        result.reason = text;
    }
    if (num_at_bound > 0) {
        result.status = FitStatus::implausible;
        result.reason = std::to_string(num_at_bound) + " shape coefficients were held at " +
                        to_text(options().max_coefficient) + " standard deviations";
    }
    const FitStatus shared_status = result.status;
    shared_reason_ = result.reason; // that of one image may take its place
    for (std::size_t f = 0; f < used_.size(); ++f) {
        FitResult& fit = result.frames[used_[f]].fit;
        fit.status = shared_status;
        fit.reason = shared_reason_;
        judge_image(f, fit);
        if (fit.status == FitStatus::implausible && result.status != FitStatus::implausible) {
            result.status = fit.status;
            result.reason = num_images_ > 1 ? "image " + std::to_string(used_[f] + 1) + " of " +
                                                  std::to_string(num_images_) + ": " + fit.reason
                                            : fit.reason;
        }
    }
}

/// What of one image alone makes its fit implausible.
inline void JointFit::judge_image(std::size_t f, FitResult& fit) const
{
    const std::vector<Landmark>& landmarks = images_[used_[f]].landmarks->landmarks;
    const double change = std::abs(std::log(state_.cameras[f].scale_px_per_mm / matched_scales_[f]));
    if (looks_away(fit.camera.camera_from_model)) {
        fit.status = FitStatus::implausible;
        fit.reason = looks_away_reason;
    } else if (fit.status == FitStatus::success && change > 0.999 * std::log(max_scale_change)) {
        fit.status = FitStatus::implausible;
        fit.reason = "the scale was held at its bound; no face explains these landmarks";
    } else {
        DistanceJudge distances(fit.camera.scale_px_per_mm);
        for (const JointPoint& used : problem_.images[f].used) {
            const std::size_t l = static_cast<std::size_t>(used.landmark_index);
            distances.add(landmarks[l].confidence,
                          (fit.landmarks[l].fitted_px - fit.landmarks[l].point_px).squaredNorm());
        }
        distances.judge(fit);
    }
}

/// Takes back the fits of a result with a number that is not finite: no unflagged and no unusable number gets out.
inline void JointFit::withhold_unless_finite(JointFramesResult& result) const
{
    bool is_finite =
        std::isfinite(result.chi_square) && state_.alpha.allFinite() && result.landmark_bias_mm.allFinite();
    for (const std::size_t f : used_) {
        const JointFitResult& frame = result.frames[f];
        const Camera& camera = frame.fit.camera;
        is_finite = is_finite && frame.covariance.diagonal().allFinite() && frame.expression_deviations.allFinite() &&
                    camera.camera_from_model.allFinite() && camera.translation_mm.allFinite() &&
                    std::isfinite(camera.scale_px_per_mm) && std::isfinite(frame.fit.rms_px) &&
                    std::isfinite(frame.fit.chi_square) && frame.fit.expression_coefficients.allFinite();
    }
    if (is_finite) {
        return;
    }
    JointFramesResult neutral;
    neutral.status = FitStatus::degenerate;
    neutral.reason = "landmarks or noise of such sizes give no finite fit";
    neutral.shape_coefficients = Eigen::VectorXd::Zero(base().num_shape_coefficients());
    neutral.landmark_bias_mm = Eigen::Matrix3Xd::Zero(3, result.landmark_bias_mm.cols());
    for (std::size_t f = 0; f < num_images_; ++f) {
        const Image& image = images_[f];
        FitResult& fit = neutral.frames.emplace_back().fit;
        set_unfitted(image, fit);
        if (image.status == FitStatus::success) {
            fit.status = neutral.status;
            fit.reason = neutral.reason;
            fit.camera = Camera{};
            fit.camera.principal_point_px = image.camera.principal_point_px;
        }
    }
    result = std::move(neutral);
}

/// Sets the names of the expressions whose deviations are above 0.9 of the prior's.
inline void set_unobservable_names(const Eigen::VectorXd& deviations, const std::vector<std::string>& names,
                                   double sigma, std::vector<std::string>& unobservable)
{
    std::size_t count = 0;
    for (std::size_t k = 0; k < names.size(); ++k) {
        if (deviations[static_cast<Eigen::Index>(k)] > 0.9 * sigma) {
            if (unobservable.size() <= count) {
                unobservable.emplace_back();
            }
            unobservable[count++] = names[k];
        }
    }
    unobservable.resize(count);
}

inline void JointFit::linearize()
{
    problem_.place(state_, scratch_.placed);
    problem_.linearize(state_, scratch_.placed, scratch_.system);
}

inline void JointFit::find_certainty()
{
    problem_.linearize(state_, scratch_.placed, scratch_.system);
    certainty_.find(problem_, state_, scratch_.system, scratch_.factor);
    if (problem_.kernels == nullptr || certainty_.is_finite()) {
        return;
    }
    // The matrix is not positive definite to single precision.
    const kernels::Kernels* const kernels = std::exchange(problem_.kernels, nullptr);
    linearize();
    problem_.kernels = kernels;
    certainty_.find(problem_, state_, scratch_.system, scratch_.factor);
}

inline void JointFit::set_certainty(JointFramesResult& result)
{
    find_certainty();
    const Eigen::Index num_shape = problem_.num_shape();
    const Eigen::Index num_all = base().num_shape_coefficients(); // known or not
    const Eigen::Index num_face = num_shape + num_expressions();
    face_.resize(static_cast<std::size_t>(num_face)); // alpha and one image's psi
    std::iota(face_.begin(), face_.begin() + num_shape, 0);
    for (std::size_t f = 0; f < used_.size(); ++f) {
        JointFitResult& frame = result.frames[used_[f]];
        const Eigen::Index begin = problem_.own_begin(f);
        std::iota(face_.begin() + num_shape, face_.end(), static_cast<int>(begin));
        frame.covariance.resize(num_all + num_expressions(), num_all + num_expressions());
        if (num_shape < num_all) {
            frame.covariance.setZero();
        }
        certainty_.set_covariance(f, face_, frame.covariance.bottomRightCorner(num_face, num_face));
        frame.expression_deviations = certainty_.deviations().segment(begin, num_expressions());
        set_unobservable_names(frame.expression_deviations, frame.fit.expression_names, options().expression_sigma,
                               frame.unobservable_expressions);
    }
}

inline void JointFit::write(JointFramesResult& result)
{
    result.status = FitStatus::too_few_correspondences;
    result.reason.clear();
    result.shape_coefficients.setZero(base().num_shape_coefficients());
    result.frames.resize(num_images_);
    result.num_used_frames = static_cast<int>(used_.size());
    result.landmark_bias_mm.setZero(3, base().landmark_map().num_landmarks());
    result.chi_square = 0.0;
    result.degrees_of_freedom = 0;
    for (std::size_t f = 0; f < num_images_; ++f) {
        set_unfitted(images_[f], result.frames[f].fit);
        if (images_[f].status != FitStatus::success) {
            forget_minimum(result.frames[f]);
        }
    }
    if (used_.empty()) {
        result.reason = "no image has a usable pose";
        return;
    }
    result.shape_coefficients = context_->identity(state_.alpha);
    if (state_.bias.size() > 0) {
        result.landmark_bias_mm = state_.bias;
    }
    result.chi_square = problem_.chi_square(state_, scratch_.placed);
    for (std::size_t f = 0; f < used_.size(); ++f) {
        JointFitResult& frame = result.frames[used_[f]];
        set_fit(f, frame.fit);
        result.degrees_of_freedom += frame.fit.degrees_of_freedom;
        frame.minimum_camera = state_.cameras[f];
        frame.minimum_expression = state_.psi[f];
        frame.matched_scale_px_per_mm = matched_scales_[f];
        frame.scale_strength = problem_.images[f].scale_strength;
        frame.energies = progress_.energies;
    }
    if (options().with_covariance) {
        set_certainty(result);
    } else {
        for (JointFitResult& frame : result.frames) {
            forget_certainty(frame);
        }
    }
    judge(result);
    withhold_unless_finite(result);
}

inline void JointFit::write(JointFitResult& result)
{
    write(result_);
    std::swap(result, result_.frames.front());
}

} // namespace lineament::detail

#endif
