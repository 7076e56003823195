// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/face_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_FRAME_FIT_IMPL_HPP
#define LINEAMENT_FIT_FRAME_FIT_IMPL_HPP

#include "lineament/camera/angles.hpp"
#include "lineament/fit/expression.hpp"
#include "lineament/fit/fit_summary_impl.hpp"
#include "lineament/fit/landmark_use_impl.hpp"
#include "lineament/fit/pair_moments_impl.hpp"
#include "lineament/fit/pose.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace lineament::detail {

/// Adds the time from its making to its end.
class Stopwatch
{
public:
    explicit Stopwatch(double& total_us) : total_us_(total_us), start_(std::chrono::steady_clock::now()) {}
    ~Stopwatch()
    {
        total_us_ += std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start_).count();
    }
    Stopwatch(const Stopwatch&) = delete;
    Stopwatch& operator=(const Stopwatch&) = delete;

private:
    double& total_us_;
    std::chrono::steady_clock::time_point start_;
};

/// The fit of one image in its parts: everything but the order they run in. The identity is passed in, so that one
/// image and a stack of images share this class.
class FrameFit
{
public:
    FrameFit(const FaceFitter& fitter, const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
             const FitResult* start);

    /// Ties the outline landmarks to vertices for the present pose, and renews the weights.
    void match_contour(const Eigen::VectorXd& shape_coefficients);

    /// False, with status and neutral camera, if the points give no usable pose.
    bool estimate_pose(const Eigen::VectorXd& shape_coefficients);

    /// The pose again with the landmarks' depth, where at least four have one, and the expression that goes with it.
    /// After the identity, which depth must not touch: it is not the person's.
    void turn_by_depth(const Eigen::VectorXd& shape_coefficients);

    void add_to(IdentitySystem& system, const Eigen::VectorXd& shape_coefficients);
    void fit_expression(const Eigen::VectorXd& shape_coefficients);

    /// The result so far with these coefficients.
    [[nodiscard]] FitResult result(const Eigen::VectorXd& shape_coefficients, int iterations) const;

    /// Keeps the worse of the two statuses that leave the estimate usable.
    void note(FitStatus status, const std::string& reason);

    [[nodiscard]] FitTiming& timing() { return timing_; }
    [[nodiscard]] const Eigen::VectorXd& expression_coefficients() const { return expression_coefficients_; }

private:
    struct Point
    {
        int landmark_index;
        double sigma_mm;
    };

    void set_points(const std::vector<ContourMatch>& matches);
    void set_weights();

    const FaceFitter& fitter_;
    const LandmarkSet& landmarks_;
    LandmarkUse use_ = {};
    bool has_scale_ = false;
    ContourView view_ = ContourView::frontal;
    Eigen::Matrix3Xf shape_vertices_ = {};

    std::vector<Point> used_ = {}; ///< One per point below.
    ModelPoints points_ = {};
    Eigen::Matrix2Xd image_points_ = {};
    Eigen::VectorXd weights_ = {}; ///< [1/px^2].

    FitStatus status_ = FitStatus::success;
    std::string reason_ = {};
    Camera camera_ = {};
    Eigen::VectorXd expression_coefficients_ = {};
    int num_held_expressions_ = 0;
    FitTiming timing_ = {};
};

inline FrameFit::FrameFit(const FaceFitter& fitter, const LandmarkSet& landmarks,
                          const Eigen::Vector2d& principal_point_px, const FitResult* start)
    : fitter_(fitter), landmarks_(landmarks)
{
    const char* const function = "FaceFitter::fit";
    require_finite(principal_point_px, function, "principal_point_px");
    set_use_of_landmarks(fitter, landmarks, function, use_);
    camera_.principal_point_px = principal_point_px;
    const Blendshapes* expressions = fitter.expressions();
    expression_coefficients_ = Eigen::VectorXd::Zero(expressions ? expressions->num_coefficients() : 0);
    if (start != nullptr) {
        require_size(start->expression_coefficients.size(), expression_coefficients_.size(), function,
                     "start->expression_coefficients");
        require_finite(start->expression_coefficients, function, "start->expression_coefficients");
        expression_coefficients_ = start->expression_coefficients;
        view_ = start->contour_view;
    }
    if (!use_.outline.empty()) {
        shape_vertices_.resize(3, fitter.model().num_vertices());
    }
    points_ = ModelPoints::sized(0, fitter.num_shape_coefficients(), expression_coefficients_.size());
    set_points({});
    set_weights();
}

inline void FrameFit::set_points(const std::vector<ContourMatch>& matches)
{
    const FitOptions& options = fitter_.options();
    const Eigen::Index num_fixed = static_cast<Eigen::Index>(use_.fixed.size());
    const Eigen::Index count = num_fixed + static_cast<Eigen::Index>(matches.size());
    if (points_.num_points() != count) {
        points_ = ModelPoints::sized(count, fitter_.num_shape_coefficients(), expression_coefficients_.size());
        image_points_.resize(2, count);
        used_.clear();
    }
    if (used_.empty()) {
        for (Eigen::Index i = 0; i < num_fixed; ++i) {
            points_.assign(i, fitter_.landmark_points(), use_.map_indices[use_.fixed[i]]);
            image_points_.col(i) = landmarks_.landmarks[use_.fixed[i]].point_px;
        }
    }
    used_.clear();
    const Eigen::VectorXf* noise_mm = fitter_.landmark_noise_mm();
    for (const int landmark : use_.fixed) {
        const bool is_outline = is_outline_landmark(fitter_, landmarks_.landmarks[landmark]);
        const double sigma_mm = is_outline ? options.contour_sigma_mm : options.landmark_sigma_mm;
        used_.push_back({landmark, noise_mm != nullptr ? (*noise_mm)[use_.map_indices[landmark]] : sigma_mm});
    }
    for (std::size_t m = 0; m < matches.size(); ++m) {
        const Eigen::Index i = num_fixed + static_cast<Eigen::Index>(m);
        fitter_.assign_vertex(points_, i, matches[m].vertex);
        image_points_.col(i) = landmarks_.landmarks[matches[m].landmark_index].point_px;
        used_.push_back({matches[m].landmark_index, options.contour_sigma_mm});
    }
}

inline void FrameFit::set_weights()
{
    const FitOptions& options = fitter_.options();
    weights_.resize(static_cast<Eigen::Index>(used_.size()));
    for (std::size_t i = 0; i < used_.size(); ++i) {
        const double sigma_px = camera_.scale_px_per_mm * used_[i].sigma_mm;
        const double variance = options.noise_units == NoiseUnits::model ? sigma_px * sigma_px : options.pixel_variance;
        weights_[static_cast<Eigen::Index>(i)] = landmarks_.landmarks[used_[i].landmark_index].confidence / variance;
    }
}

inline void FrameFit::match_contour(const Eigen::VectorXd& shape_coefficients)
{
    const Stopwatch stopwatch(timing_.contour_us);
    if (!use_.outline.empty()) {
        ContourOptions options = fitter_.options().contour_matching;
        if (fitter_.options().contour == ContourMode::front_facing) {
            options.occluding_match = OccludingMatch::none;
        }
        view_ = contour_view(angles_from_rotation(camera_.camera_from_model).yaw, view_, options);
        const ContourView needed =
            options.occluding_match == OccludingMatch::none ? ContourView::frontal : view_; // candidates alone
        fitter_.update_shape(shape_coefficients, expression_coefficients_, needed, shape_vertices_);
        set_points(
            lineament::match_contour(*fitter_.contour(), shape_vertices_, camera_, landmarks_, view_, options).matches);
    }
    set_weights();
}

inline bool FrameFit::estimate_pose(const Eigen::VectorXd& shape_coefficients)
{
    const Stopwatch stopwatch(timing_.pose_us);
    const Eigen::Vector2d principal_point_px = camera_.principal_point_px;
    const Eigen::Matrix3Xd shape = points_.at(shape_coefficients, expression_coefficients_);
    const std::optional<double> focal_length_px = fitter_.options().focal_length_px;
    const PoseResult pose =
        focal_length_px
            ? estimate_pose_perspective(shape, image_points_, *focal_length_px, weights_, principal_point_px)
            : lineament::estimate_pose(shape, image_points_, weights_, principal_point_px);
    camera_ = pose.camera;
    if (pose.status != FitStatus::success && pose.status != FitStatus::not_converged) {
        status_ = pose.status;
        reason_ = pose.reason;
        expression_coefficients_.setZero();
        return false;
    }
    note(pose.status, pose.reason);
    if (!has_scale_) { // the first pose gives the scale of the first weights
        has_scale_ = true;
        set_weights();
    }
    return true;
}

inline void FrameFit::turn_by_depth(const Eigen::VectorXd& shape_coefficients)
{
    const auto has_depth = [](const Landmark& landmark) { return landmark.depth_px.has_value(); };
    if (fitter_.options().focal_length_px ||
        std::none_of(landmarks_.landmarks.begin(), landmarks_.landmarks.end(), has_depth)) {
        return;
    }
    {
        const Stopwatch stopwatch(timing_.pose_us);
        const Eigen::Matrix3Xd shape = points_.at(shape_coefficients, expression_coefficients_);
        PairMoments all, with_depth;
        int num_with_depth = 0;
        for (std::size_t i = 0; i < used_.size(); ++i) {
            const Eigen::Index column = static_cast<Eigen::Index>(i);
            const std::optional<double> depth_px = landmarks_.landmarks[used_[i].landmark_index].depth_px;
            const Eigen::Vector3d seen(image_points_(0, column), image_points_(1, column), depth_px.value_or(0.0));
            all.add(weights_[column], shape.col(column), seen);
            if (depth_px && weights_[column] > 0) {
                with_depth.add(weights_[column], shape.col(column), seen);
                ++num_with_depth;
            }
        }
        if (!turn_camera_by_depth(all, with_depth, num_with_depth, camera_)) {
            return;
        }
    }
    fit_expression(shape_coefficients);
}

inline void FrameFit::add_to(IdentitySystem& system, const Eigen::VectorXd& shape_coefficients)
{
    system.add(points_, image_points_, weights_, camera_, expression_coefficients_, shape_coefficients);
}

inline void FrameFit::fit_expression(const Eigen::VectorXd& shape_coefficients)
{
    const Stopwatch stopwatch(timing_.expression_us);
    if (expression_coefficients_.size() == 0) {
        return;
    }
    ExpressionOptions options;
    options.upper_bound = fitter_.options().max_expression;
    options.prior_standard_deviations =
        Eigen::VectorXd::Constant(expression_coefficients_.size(), fitter_.options().expression_sigma);
    const ExpressionResult fitted = lineament::fit_expression(points_, image_points_, camera_, weights_,
                                                              shape_coefficients, options, expression_coefficients_);
    num_held_expressions_ = fitted.num_at_upper_bound;
    expression_coefficients_ = fitted.coefficients;
    note(fitted.status, fitted.reason);
}

inline void FrameFit::note(FitStatus status, const std::string& reason)
{
    if (status == FitStatus::success || status_ == FitStatus::implausible) {
        return;
    }
    status_ = status;
    reason_ = reason;
}

inline FitResult FrameFit::result(const Eigen::VectorXd& shape_coefficients, int iterations) const
{
    FitResult result;
    result.status = status_;
    result.reason = reason_;
    note_held_expressions(num_held_expressions_, fitter_.options().max_expression, result);
    result.camera = camera_;
    result.shape_coefficients = shape_coefficients;
    if (const Blendshapes* expressions = fitter_.expressions()) {
        result.expression_set = expressions->name;
        result.expression_names = expressions->names;
    }
    result.expression_coefficients = expression_coefficients_;
    result.iterations = iterations;
    result.contour_view = view_;
    result.timing = timing_;

    const bool is_fitted = status_ != FitStatus::too_few_correspondences && status_ != FitStatus::degenerate;
    const auto project = [&](const ModelPoints& points) {
        const Eigen::Matrix3Xd shape = points.at(shape_coefficients, expression_coefficients_);
        return camera_.project(Eigen::Ref<const Eigen::Matrix3Xd>(shape));
    };
    const Eigen::Matrix2Xd map_points = project(fitter_.landmark_points());
    for (std::size_t l = 0; l < landmarks_.landmarks.size(); ++l) {
        const Landmark& landmark = landmarks_.landmarks[l];
        const Eigen::Vector2d fitted =
            use_.map_indices[l] >= 0 ? Eigen::Vector2d(map_points.col(use_.map_indices[l])) : landmark.point_px;
        result.landmarks.push_back({landmark.name, landmark.point_px, fitted, 0.0});
    }
    if (!is_fitted || used_.empty()) {
        return result;
    }
    const Eigen::Matrix2Xd fitted = project(points_);
    const double largest_weight = std::max(weights_.maxCoeff(), std::numeric_limits<double>::min());
    for (std::size_t i = 0; i < used_.size(); ++i) {
        const Eigen::Index column = static_cast<Eigen::Index>(i);
        add_used_point(fitted.col(column), weights_[column], largest_weight, result.landmarks[used_[i].landmark_index],
                       result.chi_square);
    }
    sum_up(fitter_.options(), result);
    return result;
}

} // namespace lineament::detail

#endif
