// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/joint_image.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/fit/contour_support_impl.hpp"
#include "lineament/fit/inline.hpp"
#include "lineament/kernels/scalar_kernels.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace lineament::detail {

LINEAMENT_FIT_INLINE void Polyline::set_points(const Eigen::Ref<const Eigen::Matrix2Xd>& projected)
{
    points_ = projected;
    segments_.resize(points_.cols() - 1, 5);
    for (Eigen::Index i = 0; i < segments_.rows(); ++i) {
        const Eigen::Vector2d along = points_.col(i + 1) - points_.col(i);
        const double square = along.squaredNorm();
        segments_.row(i) << points_(0, i), points_(1, i), along.x(), along.y(), square > 0 ? 1 / square : 0.0;
    }
}

LINEAMENT_FIT_INLINE void Polyline::find_nearest(const kernels::Kernels& kernels, const AlignedBuffer<double>& u,
                                                 const AlignedBuffer<double>& v, std::vector<int>& segments) const
{
    const int count = static_cast<int>(segments_.rows());
    kernels.nearest_segments(segments_.data(), count, count, u.data(), v.data(), static_cast<int>(segments.size()),
                             segments.data());
}

LINEAMENT_FIT_INLINE OutlineMatch Polyline::match(int segment, const Eigen::Vector2d& landmark) const
{
    const Eigen::Vector2d from = points_.col(segment), along = segments_.block<1, 2>(segment, 2).transpose();
    OutlineMatch match;
    match.position = segment;
    match.fraction = std::clamp(along.dot(landmark - from) * segments_(segment, 4), 0.0, 1.0);
    const Eigen::Index before = std::max(segment - 1, 0); // the direction over three segments
    const Eigen::Index after = std::min<Eigen::Index>(segment + 2, points_.cols() - 1);
    const Eigen::Vector2d tangent = (points_.col(after) - points_.col(before)).normalized();
    match.normal = {-tangent.y(), tangent.x()};
    match.distance_px = std::abs(match.normal.dot(landmark - from - match.fraction * along));
    return match;
}

LINEAMENT_FIT_INLINE std::optional<OutlineMatch> match_silhouette(const Eigen::Matrix2Xd& projected,
                                                                  const Eigen::Vector2d& landmark, double radius_px,
                                                                  double max_distance_px)
{
    OutlineMatch best;
    const auto [nearest, distance_px] = nearest_column(projected, landmark);
    if (distance_px > max_distance_px) {
        return std::nullopt;
    }
    best.is_silhouette = true;
    best.position = nearest;
    best.distance_px = distance_px;
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
    int count = 0;
    for (Eigen::Index i = 0; i < projected.cols(); ++i) {
        const Eigen::Vector2d offset = projected.col(i) - projected.col(nearest);
        if (offset.squaredNorm() <= radius_px * radius_px) {
            mean += offset;
            moments += offset * offset.transpose();
            ++count;
        }
    }
    moments -= mean * mean.transpose() / count;
    // Direction of the larger eigenvalue of a symmetric 2 x 2 matrix; a round cluster has none.
    const double difference = moments(0, 0) - moments(1, 1);
    const double spread = std::hypot(difference, 2 * moments(0, 1));
    if (count >= 3 && spread > 0.5 * moments.trace()) {
        const double angle = 0.5 * std::atan2(2 * moments(0, 1), difference);
        best.normal = {-std::sin(angle), std::cos(angle)};
        best.distance_px = std::abs(best.normal.dot(landmark - projected.col(nearest)));
    }
    return best;
}

LINEAMENT_FIT_INLINE Eigen::Vector3d bias_variances_mm(const JointOptions& options, const Eigen::VectorXf* stated,
                                                       int map_index)
{
    const double bias = options.bias_sigma_mm * options.bias_sigma_mm;
    const double noise = options.landmark_sigma_mm * options.landmark_sigma_mm;
    if (stated == nullptr || !std::isfinite((*stated)[map_index])) {
        return Eigen::Vector3d::Constant(bias);
    }
    const double across = bias / (bias + noise) * (*stated)[map_index] * (*stated)[map_index];
    return {across, across, options.bias_depth_ratio * options.bias_depth_ratio * across};
}

LINEAMENT_FIT_INLINE void require_covariance(const Eigen::Matrix2d& covariance, const char* function,
                                             const std::string& place)
{
    require_finite(covariance, function, place.c_str());
    require(covariance(0, 1) == covariance(1, 0) && covariance(0, 0) > 0 && covariance.determinant() > 0, function,
            place.c_str(), "a symmetric positive definite matrix", "another");
}

LINEAMENT_FIT_INLINE JointPoints joint_points(const FaceFitter& base)
{
    std::vector<int> candidates;
    if (base.contour()) {
        for (const FaceSide side : {FaceSide::left, FaceSide::right}) {
            const std::vector<int>& of_side = base.contour()->candidates(side);
            candidates.insert(candidates.end(), of_side.begin(), of_side.end());
        }
    }
    const ModelPoints& landmarks = base.landmark_points();
    ModelPoints points =
        ModelPoints::sized(static_cast<Eigen::Index>(candidates.size()), landmarks.num_shape_coefficients(),
                           landmarks.num_expression_coefficients());
    for (std::size_t i = 0; i < candidates.size(); ++i) {
        base.assign_vertex(points, static_cast<Eigen::Index>(i), candidates[i]);
    }
    return {PackedPoints(landmarks), PackedPoints(points)};
}

LINEAMENT_FIT_INLINE void JointImageMatcher::begin(const JointContext& context, const LandmarkSet& landmarks,
                                                   std::span<const Eigen::Matrix2d> covariances_px)
{
    const char* const function = "JointFitter::fit";
    context_.emplace(context);
    landmarks_ = &landmarks;
    covariances_px_ = covariances_px;
    view_ = ContourView::frontal;
    set_use_of_landmarks(base(), landmarks, function, use_);
    if (!covariances_px.empty() && covariances_px.size() != landmarks.landmarks.size()) {
        throw InvalidArgument(function, "covariances_px", "none, or one for each landmark",
                              std::to_string(covariances_px.size()));
    }
    for (std::size_t l = 0; l < covariances_px.size(); ++l) {
        require_covariance(covariances_px[l], function,
                           "landmark \"" + landmarks.landmarks[l].name + "\".covariance_px");
    }
    set_outline();
}

LINEAMENT_FIT_INLINE void JointImageMatcher::set_outline()
{
    for (OutlineLandmarks& side : outline_) {
        side.indices.clear();
    }
    for (const int l : use_.outline) {
        const FaceSide side = *outline_side(landmarks_->scheme, landmark(l).name);
        outline_[static_cast<std::size_t>(side)].indices.push_back(l);
    }
    for (OutlineLandmarks& side : outline_) {
        const int count = static_cast<int>(side.indices.size()), room = kernels::round_up(count, 8);
        double* u = room_for(side.u, room);
        double* v = room_for(side.v, room);
        for (int i = 0; i < count; ++i) {
            u[i] = landmark(side.indices[static_cast<std::size_t>(i)]).point_px.x();
            v[i] = landmark(side.indices[static_cast<std::size_t>(i)]).point_px.y();
        }
        std::fill(u + count, u + room, 0.0);
        std::fill(v + count, v + room, 0.0);
    }
}

LINEAMENT_FIT_INLINE Eigen::Matrix2d JointImageMatcher::covariance_px(int landmark_index, double default_variance_mm,
                                                                      const Eigen::Vector3d& bias_variances,
                                                                      const Camera& camera, const NoiseSharing& noise,
                                                                      bool has_bias) const
{
    const double mm_sq = noise.scale_px_per_mm * noise.scale_px_per_mm; // [px^2/mm^2]
    const Eigen::Matrix2d unit = Eigen::Matrix2d::Identity();
    Eigen::Matrix2d own = mm_sq * default_variance_mm * unit;
    const auto named = options().covariances_mm.find(landmark(landmark_index).name);
    if (!covariances_px_.empty()) {
        own = covariances_px_[landmark_index];
    } else if (named != options().covariances_mm.end()) {
        own = mm_sq * named->second;
    }
    if (has_bias) {
        return own;
    }
    // What F images say of a point with noise C and common offset T is (C / F + T)^-1. Shared out evenly that is C + F
    // T for each; one by one, image n adds what n have over n - 1.                        docs/joint-fit.md, Eq. (18)
    const Eigen::Matrix<double, 2, 3> rows = camera.camera_from_model.topRows<2>();
    const Eigen::Matrix2d common = mm_sq * rows * bias_variances.asDiagonal() * rows.transpose();
    if (noise.num_images > 1) {
        return own + noise.num_images * common;
    }
    if (noise.num_before == 0) {
        return own + common;
    }
    return (own + (noise.num_before + 1) * common) * own.inverse() * (own + noise.num_before * common);
}

LINEAMENT_FIT_INLINE void JointImageMatcher::set_fixed_points(JointImage& image) const
{
    const Eigen::Index room = static_cast<Eigen::Index>(use_.fixed.size() + use_.outline.size());
    image.image_points.resize(2, room);
    image.used.clear();
    image.map_indices.clear();
    for (const int l : use_.fixed) {
        image.image_points.col(static_cast<Eigen::Index>(image.used.size())) = landmark(l).point_px;
        image.map_indices.push_back(use_.map_indices[l]);
        image.used.push_back({l, -1, 2});
    }
    image.points.assign(context_->points.landmarks, image.map_indices, room);
    set_unit_roots(image.points.num_points, image.roots);
    image.matched_scale = 1.0;
    image.scale_strength = 0.0;
}

LINEAMENT_FIT_INLINE void JointImageMatcher::set_start_weights(Eigen::VectorXd& weights) const
{
    const Eigen::VectorXf* stated = base().landmark_noise_mm();
    const double own_variance =
        options().landmark_sigma_mm * options().landmark_sigma_mm + options().bias_sigma_mm * options().bias_sigma_mm;
    const bool has_names = !options().covariances_mm.empty();
    const bool is_alike = stated == nullptr && covariances_px_.empty() && !has_names;
    weights.resize(static_cast<Eigen::Index>(use_.fixed.size()));
    for (std::size_t i = 0; i < use_.fixed.size(); ++i) {
        const int l = use_.fixed[i];
        if (is_alike) {
            weights[static_cast<Eigen::Index>(i)] = landmark(l).confidence;
            continue;
        }
        const double sigma = stated != nullptr ? (*stated)[use_.map_indices[l]] : 0.0;
        double variance = stated != nullptr ? sigma * sigma : own_variance;
        if (!covariances_px_.empty()) {
            variance = covariances_px_[l].trace() / 2;
        } else if (has_names) {
            const auto named = options().covariances_mm.find(landmark(l).name);
            variance = named != options().covariances_mm.end() ? named->second.trace() / 2 : variance;
        }
        weights[static_cast<Eigen::Index>(i)] = landmark(l).confidence / variance;
    }
    const double largest = weights.size() > 0 ? weights.maxCoeff() : 1.0;
    if (largest > 0 && std::isfinite(largest)) {
        weights /= largest;
    } else {
        weights.setOnes(); // of such noise none says more than another
    }
}

LINEAMENT_FIT_INLINE void JointImageMatcher::match_outline(const Camera& camera, const Eigen::VectorXd& alpha,
                                                           const Eigen::VectorXd& psi)
{
    matches_.clear();
    const ContourOptions& contour = options().contour_matching;
    const bool is_both = options().contour == ContourMode::both && contour.occluding_match != OccludingMatch::none;
    view_ = contour_view(yaw_from_rotation(camera.camera_from_model), view_, contour);
    if (is_both && view_ != ContourView::frontal) {
        shape_vertices_.resize(3, base().model().num_vertices());
        base().update_shape(context_->identity(alpha), psi, view_, shape_vertices_);
    }
    context_->points.candidates.evaluate(context_->kernels, alpha, psi, products_, candidates_);
    for (const FaceSide side : {FaceSide::right, FaceSide::left}) {
        if (view_ != (side == FaceSide::left ? ContourView::shows_right : ContourView::shows_left)) {
            match_candidates(side, camera);
        } else if (is_both) {
            match_silhouette_of(side, camera);
        }
    }
    trim_matches();
}

LINEAMENT_FIT_INLINE void JointImageMatcher::match_candidates(FaceSide side, const Camera& camera)
{
    const Eigen::Index count = static_cast<Eigen::Index>(base().contour()->candidates(side).size());
    const Eigen::Index first = side == FaceSide::left ? 0 : candidates_.cols() - count;
    if (count < 2) {
        return;
    }
    projected_.resize(2, count);
    for (Eigen::Index i = 0; i < count; ++i) {
        projected_.col(i) = camera.project(Eigen::Vector3d(candidates_.col(first + i)));
    }
    line_.set_points(projected_);
    const OutlineLandmarks& outline = outline_[static_cast<std::size_t>(side)];
    segments_.resize(outline.indices.size());
    line_.find_nearest(context_->kernels != nullptr ? *context_->kernels : kernels::scalar_kernels(), outline.u,
                       outline.v, segments_);
    for (std::size_t i = 0; i < segments_.size(); ++i) {
        OutlineMatch& match = matches_.emplace_back(line_.match(segments_[i], landmark(outline.indices[i]).point_px));
        match.landmark_index = outline.indices[i];
        match.position += static_cast<int>(first);
    }
}

LINEAMENT_FIT_INLINE void JointImageMatcher::match_silhouette_of(FaceSide side, const Camera& camera)
{
    const ContourOptions& contour = options().contour_matching;
    silhouette_vertices_ =
        base().contour()->silhouette_vertices(shape_vertices_, camera, side, contour.occlusion_depth_mm);
    if (silhouette_vertices_.size() < 2) {
        return;
    }
    const Eigen::Matrix2Xd projected = project_vertices(shape_vertices_, silhouette_vertices_, camera);
    const double scale = camera.scale_px_per_mm;
    for (const int l : outline_[static_cast<std::size_t>(side)].indices) {
        if (const std::optional<OutlineMatch> match =
                match_silhouette(projected, landmark(l).point_px, 15 * scale, contour.max_distance_mm * scale)) {
            matches_.push_back(*match);
            matches_.back().landmark_index = l;
        }
    }
}

/// The farthest are left out.
LINEAMENT_FIT_INLINE void JointImageMatcher::trim_matches()
{
    const auto is_nearer = [](const OutlineMatch& a, const OutlineMatch& b) { return a.distance_px < b.distance_px; };
    for (auto left = std::lround(options().contour_trim * static_cast<double>(matches_.size())); left > 0; --left) {
        matches_.erase(std::max_element(matches_.begin(), matches_.end(), is_nearer));
    }
}

LINEAMENT_FIT_INLINE void JointImageMatcher::set_point_of_match(const OutlineMatch& match, Eigen::Index to,
                                                                PackedPoints& points)
{
    if (!match.is_silhouette) {
        points.set_between(context_->kernels, to, context_->points.candidates, match.position, match.position + 1,
                           match.fraction);
        return;
    }
    const int vertex = silhouette_vertices_[static_cast<std::size_t>(match.position)];
    if (context_->known_identity == nullptr) {
        base().get_vertex(vertex, points.mean.col(to), points.identity.of_point(to), points.expression.of_point(to));
        return;
    }
    Eigen::MatrixX3f identity(context_->known_identity->size(), 3);
    base().get_vertex(vertex, points.mean.col(to), identity, points.expression.of_point(to));
    points.mean.col(to) += identity.cast<double>().transpose() * *context_->known_identity;
}

/// U00, U01, U11 of the upper triangular U with C^-1 = U^T U.
[[nodiscard]] inline Eigen::RowVector3d root_of_inverse(const Eigen::Matrix2d& covariance)
{
    const double scale = 1 / std::sqrt(covariance(1, 1) * covariance.determinant());
    return {scale * covariance(1, 1), -scale * covariance(0, 1), 1 / std::sqrt(covariance(1, 1))};
}

LINEAMENT_FIT_INLINE void JointImageMatcher::match(const Camera& camera, const Eigen::VectorXd& alpha,
                                                   const Eigen::VectorXd& psi, const NoiseSharing& noise,
                                                   JointImage& image)
{
    matches_.clear();
    if (!use_.outline.empty()) {
        match_outline(camera, alpha, psi);
    }
    const Eigen::Index num_fixed = static_cast<Eigen::Index>(use_.fixed.size());
    image.points.num_points = num_fixed + static_cast<Eigen::Index>(matches_.size());
    image.used.resize(static_cast<std::size_t>(image.points.num_points));
    image.roots.resize(image.points.num_points, 3);
    image.dimensions.resize(image.points.num_points);
    image.matched_scale = noise.scale_px_per_mm;
    const auto set = [&](Eigen::Index i, int l, int bias_index, int num_dimensions, const Eigen::RowVector3d& root) {
        const double confidence = landmark(l).confidence; // most are 1
        image.roots.row(i) = (confidence == 1 ? 1.0 : std::sqrt(confidence)) * root;
        image.dimensions[i] = num_dimensions;
        image.used[static_cast<std::size_t>(i)] = {l, bias_index, num_dimensions};
    };
    const bool is_fixed_outline = options().contour == ContourMode::fixed; // others are matched
    const bool has_own_noise = !covariances_px_.empty() || !options().covariances_mm.empty();
    double last_variance = -1;
    bool was_outline = false;
    Eigen::RowVector3d root = Eigen::RowVector3d::Zero(); // of the last one
    Eigen::Matrix2d across = Eigen::Matrix2d::Zero();     // likewise
    const Eigen::VectorXf* stated = base().landmark_noise_mm();
    for (Eigen::Index i = 0; i < num_fixed; ++i) {
        const int l = use_.fixed[static_cast<std::size_t>(i)], map_index = use_.map_indices[l];
        const bool is_outline = is_fixed_outline && base().outline_sides()[static_cast<std::size_t>(map_index)];
        if (has_own_noise || stated != nullptr || i == 0 || is_outline != was_outline) {
            const double sigma_mm = is_outline ? options().contour_sigma_mm : options().landmark_sigma_mm;
            const Eigen::Vector3d bias_variances = bias_variances_mm(options(), stated, map_index);
            const double stated_mm = stated != nullptr ? (*stated)[map_index] : sigma_mm;
            const double variance = stated_mm * stated_mm - (stated != nullptr ? bias_variances.x() : 0.0);
            if (has_own_noise || variance != last_variance) { // the variance of the bias goes with it
                root = root_of_inverse(covariance_px(l, variance, bias_variances, camera, noise, noise.has_bias));
                last_variance = variance;
            }
            was_outline = is_outline;
        }
        set(i, l, noise.has_bias ? map_index : -1, 2, root);
    }
    for (std::size_t m = 0; m < matches_.size(); ++m) {
        const OutlineMatch& match = matches_[m];
        const Eigen::Index i = num_fixed + static_cast<Eigen::Index>(m);
        set_point_of_match(match, i, image.points);
        image.image_points.col(i) = landmark(match.landmark_index).point_px;
        const Eigen::Vector2d tangent(-match.normal.y(), match.normal.x());
        const double along_px = noise.scale_px_per_mm * options().contour_along_sigma_mm;
        if (m == 0 || has_own_noise) {
            across = covariance_px(match.landmark_index, options().contour_sigma_mm * options().contour_sigma_mm,
                                   Eigen::Vector3d::Constant(options().bias_sigma_mm * options().bias_sigma_mm), camera,
                                   noise, false);
        }
        set(i, match.landmark_index, -1, match.normal.isZero() ? 2 : 1,
            root_of_inverse(across + along_px * along_px * tangent * tangent.transpose()));
    }
}

} // namespace lineament::detail
