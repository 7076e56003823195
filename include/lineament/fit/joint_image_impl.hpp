// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/joint_image.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/fit/contour_support_impl.hpp"
#include "lineament/fit/inline.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace lineament::detail {

LINEAMENT_FIT_INLINE OutlineMatch match_polyline(const std::vector<int>& vertices, const Eigen::Matrix2Xd& projected,
                                                 const Eigen::Vector2d& landmark)
{
    OutlineMatch best;
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index i = 0; i + 1 < projected.cols(); ++i) {
        const Eigen::Vector2d along = projected.col(i + 1) - projected.col(i);
        const double length = along.squaredNorm();
        const double fraction =
            length > 0 ? std::clamp(along.dot(landmark - projected.col(i)) / length, 0.0, 1.0) : 0.0;
        const double distance = (projected.col(i) + fraction * along - landmark).squaredNorm();
        if (distance < least) {
            least = distance;
            const Eigen::Index before = std::max<Eigen::Index>(i - 1, 0); // the direction over three segments
            const Eigen::Index after = std::min<Eigen::Index>(i + 2, projected.cols() - 1);
            const Eigen::Vector2d tangent = (projected.col(after) - projected.col(before)).normalized();
            best.vertex = vertices[static_cast<std::size_t>(i)];
            best.next_vertex = vertices[static_cast<std::size_t>(i + 1)];
            best.fraction = fraction;
            best.normal = {-tangent.y(), tangent.x()};
            best.distance_px = std::abs(best.normal.dot(landmark - projected.col(i) - fraction * along));
        }
    }
    return best;
}

LINEAMENT_FIT_INLINE std::optional<OutlineMatch> match_silhouette(const std::vector<int>& vertices,
                                                                  const Eigen::Matrix2Xd& projected,
                                                                  const Eigen::Vector2d& landmark, double radius_px,
                                                                  double max_distance_px)
{
    OutlineMatch best;
    const auto [nearest, distance_px] = nearest_column(projected, landmark);
    if (distance_px > max_distance_px) {
        return std::nullopt;
    }
    best.vertex = best.next_vertex = vertices[static_cast<std::size_t>(nearest)];
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

LINEAMENT_FIT_INLINE Eigen::Vector3d bias_variances_mm(const FaceFitter& base, const JointOptions& options,
                                                       int map_index)
{
    const double bias = options.bias_sigma_mm * options.bias_sigma_mm;
    const double noise = options.landmark_sigma_mm * options.landmark_sigma_mm;
    const Eigen::VectorXf* stated = base.landmark_noise_mm();
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

LINEAMENT_FIT_INLINE JointImageMatcher::JointImageMatcher(const FaceFitter& base, const JointPoints& points,
                                                          const JointOptions& options, const kernels::Kernels* kernels,
                                                          const LandmarkSet& landmarks,
                                                          std::span<const Eigen::Matrix2d> covariances_px)
    : base_(base), points_(points), options_(options), kernels_(kernels), landmarks_(landmarks),
      covariances_px_(covariances_px)
{
    const char* const function = "JointFitter::fit";
    use_ = use_of_landmarks(base, landmarks, function);
    require(covariances_px.empty() || covariances_px.size() == landmarks.landmarks.size(), function, "covariances_px",
            "none, or one for each landmark", std::to_string(covariances_px.size()));
    for (std::size_t l = 0; l < covariances_px.size(); ++l) {
        require_covariance(covariances_px[l], function,
                           "landmark \"" + landmarks.landmarks[l].name + "\".covariance_px");
    }
    for (const int l : use_.outline) {
        outline_sides_.push_back(*outline_side(landmarks.scheme, landmarks.landmarks[l].name));
    }
    if (!use_.outline.empty()) {
        shape_vertices_.resize(3, base.model().num_vertices());
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
    const auto named = options_.covariances_mm.find(landmarks_.landmarks[landmark_index].name);
    if (!covariances_px_.empty()) {
        own = covariances_px_[landmark_index];
    } else if (named != options_.covariances_mm.end()) {
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

LINEAMENT_FIT_INLINE JointImage JointImageMatcher::fixed_image() const
{
    JointImage image;
    const Eigen::Index room = static_cast<Eigen::Index>(use_.fixed.size() + use_.outline.size());
    image.image_points.resize(2, room);
    std::vector<int> map_indices;
    for (const int l : use_.fixed) {
        image.image_points.col(static_cast<Eigen::Index>(map_indices.size())) = landmarks_.landmarks[l].point_px;
        map_indices.push_back(use_.map_indices[l]);
        image.used.push_back({l, -1, 2});
    }
    image.points = PackedPoints(points_.landmarks, map_indices, room);
    image.roots = Eigen::RowVector3d(1, 0, 1).replicate(image.points.num_points, 1);
    return image;
}

LINEAMENT_FIT_INLINE Eigen::VectorXd JointImageMatcher::start_weights() const
{
    const Eigen::VectorXf* stated = base_.landmark_noise_mm();
    Eigen::VectorXd weights(static_cast<Eigen::Index>(use_.fixed.size()));
    for (std::size_t i = 0; i < use_.fixed.size(); ++i) {
        const int l = use_.fixed[i];
        const Landmark& landmark = landmarks_.landmarks[l];
        const auto named = options_.covariances_mm.find(landmark.name);
        double variance = std::pow(options_.landmark_sigma_mm, 2) + std::pow(options_.bias_sigma_mm, 2);
        if (!covariances_px_.empty()) {
            variance = covariances_px_[l].trace() / 2;
        } else if (named != options_.covariances_mm.end()) {
            variance = named->second.trace() / 2;
        } else if (stated != nullptr) {
            variance = std::pow((*stated)[use_.map_indices[l]], 2);
        }
        weights[static_cast<Eigen::Index>(i)] = landmark.confidence / variance;
    }
    if (weights.size() == 0 || weights.minCoeff() == weights.maxCoeff()) {
        return {};
    }
    return weights / weights.maxCoeff();
}

LINEAMENT_FIT_INLINE std::vector<OutlineMatch>
JointImageMatcher::match_outline(const Camera& camera, const Eigen::VectorXd& alpha, const Eigen::VectorXd& psi)
{
    std::vector<OutlineMatch> matches;
    const ContourOptions& options = options_.contour_matching;
    const bool is_both = options_.contour == ContourMode::both && options.occluding_match != OccludingMatch::none;
    view_ = contour_view(angles_from_rotation(camera.camera_from_model).yaw, view_, options);
    if (is_both && view_ != ContourView::frontal) {
        base_.update_shape(alpha, psi, view_, shape_vertices_);
    }
    const Eigen::Matrix3Xd candidate_points = points_.candidates.at(kernels_, alpha, psi);
    const Eigen::Matrix2Xd candidates = camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(candidate_points));
    const Eigen::Index num_left = static_cast<Eigen::Index>(base_.contour()->candidates(FaceSide::left).size());
    for (const FaceSide side : {FaceSide::right, FaceSide::left}) {
        const bool is_occluding =
            view_ == (side == FaceSide::left ? ContourView::shows_right : ContourView::shows_left);
        if (is_occluding && !is_both) {
            continue;
        }
        const std::vector<int> vertices =
            is_occluding
                ? base_.contour()->silhouette_vertices(shape_vertices_, camera, side, options.occlusion_depth_mm)
                : base_.contour()->candidates(side);
        if (vertices.size() < 2) {
            continue;
        }
        const Eigen::Index count = static_cast<Eigen::Index>(vertices.size());
        const Eigen::Matrix2Xd projected =
            is_occluding ? project_vertices(shape_vertices_, vertices, camera)
                         : Eigen::Matrix2Xd(candidates.middleCols(side == FaceSide::left ? 0 : num_left, count));
        for (std::size_t o = 0; o < use_.outline.size(); ++o) {
            if (outline_sides_[o] != side) {
                continue;
            }
            const int l = use_.outline[o];
            const Landmark& landmark = landmarks_.landmarks[l];
            const double scale = camera.scale_px_per_mm;
            const std::optional<OutlineMatch> match =
                is_occluding ? match_silhouette(vertices, projected, landmark.point_px, 15 * scale,
                                                options.max_distance_mm * scale)
                             : match_polyline(vertices, projected, landmark.point_px);
            if (match) {
                matches.push_back(*match);
                matches.back().landmark_index = l;
            }
        }
    }
    const auto num_trimmed = std::lround(options_.contour_trim * static_cast<double>(matches.size()));
    std::stable_sort(matches.begin(), matches.end(),
                     [](const OutlineMatch& a, const OutlineMatch& b) { return a.distance_px < b.distance_px; });
    matches.resize(matches.size() - static_cast<std::size_t>(num_trimmed));
    return matches;
}

/// U00, U01, U11 of the upper triangular U with weight C^-1 = U^T U.
[[nodiscard]] inline Eigen::RowVector3d root_of_inverse(double weight, const Eigen::Matrix2d& covariance)
{
    const double scale = std::sqrt(weight / (covariance(1, 1) * covariance.determinant()));
    return {scale * covariance(1, 1), -scale * covariance(0, 1), std::sqrt(weight / covariance(1, 1))};
}

LINEAMENT_FIT_INLINE void JointImageMatcher::match(const Camera& camera, const Eigen::VectorXd& alpha,
                                                   const Eigen::VectorXd& psi, const NoiseSharing& noise,
                                                   JointImage& image)
{
    const std::vector<OutlineMatch> matches =
        use_.outline.empty() ? std::vector<OutlineMatch>() : match_outline(camera, alpha, psi);
    const Eigen::Index num_fixed = static_cast<Eigen::Index>(use_.fixed.size());
    image.points.num_points = num_fixed + static_cast<Eigen::Index>(matches.size());
    image.used.clear();
    image.roots.resize(image.points.num_points, 3);
    image.matched_scale = noise.scale_px_per_mm;
    const auto add = [&](int l, int bias_index, int num_dimensions, const Eigen::Matrix2d& covariance) {
        image.roots.row(static_cast<Eigen::Index>(image.used.size())) =
            root_of_inverse(landmarks_.landmarks[l].confidence, covariance);
        image.used.push_back({l, bias_index, num_dimensions});
    };
    const Eigen::VectorXf* stated = base_.landmark_noise_mm();
    for (const int l : use_.fixed) {
        const int map_index = use_.map_indices[l];
        const bool is_outline = // others are matched
            options_.contour == ContourMode::fixed && is_outline_landmark(base_, landmarks_.landmarks[l]);
        const double sigma_mm = is_outline ? options_.contour_sigma_mm : options_.landmark_sigma_mm;
        const Eigen::Vector3d bias_variances = bias_variances_mm(base_, options_, map_index);
        const double variance =
            stated != nullptr ? std::pow((*stated)[map_index], 2) - bias_variances.x() : sigma_mm * sigma_mm;
        add(l, noise.has_bias ? map_index : -1, 2,
            covariance_px(l, variance, bias_variances, camera, noise, noise.has_bias));
    }
    for (std::size_t m = 0; m < matches.size(); ++m) {
        const OutlineMatch& match = matches[m];
        const Eigen::Index i = num_fixed + static_cast<Eigen::Index>(m);
        base_.point_between(match.vertex, match.next_vertex, match.fraction, image.points.mean.col(i),
                            image.points.identity.of_point(i), image.points.expression.of_point(i));
        image.image_points.col(i) = landmarks_.landmarks[match.landmark_index].point_px;
        const Eigen::Vector2d tangent(-match.normal.y(), match.normal.x());
        const double along_px = noise.scale_px_per_mm * options_.contour_along_sigma_mm;
        add(match.landmark_index, -1, match.normal.isZero() ? 2 : 1,
            covariance_px(match.landmark_index, options_.contour_sigma_mm * options_.contour_sigma_mm,
                          Eigen::Vector3d::Constant(options_.bias_sigma_mm * options_.bias_sigma_mm), camera, noise,
                          false) +
                along_px * along_px * tangent * tangent.transpose());
    }
}

} // namespace lineament::detail
