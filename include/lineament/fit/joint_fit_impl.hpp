// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_FIT_IMPL_HPP
#define LINEAMENT_FIT_JOINT_FIT_IMPL_HPP

#include "lineament/fit/frame_fit_impl.hpp"
#include "lineament/fit/joint_certainty_impl.hpp"
#include "lineament/fit/joint_image.hpp"
#include "lineament/fit/joint_solver.hpp"
#include "lineament/fit/joint_start_impl.hpp"
#include "lineament/fit/pair_moments_impl.hpp"
#include "lineament/fit/pose_support_impl.hpp"
#include "lineament/fit/positive_factor_impl.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

namespace lineament::detail {

/// The joint fit of images, from first poses to results.
class JointFit
{
public:
    /// @param num_before  Images that the prior comes from.
    /// @param kernels     As of the JointFitter.
    JointFit(const FaceFitter& base, const JointPoints& points, const JointOptions& options,
             const IdentityInformation& prior, int num_before, const kernels::Kernels* kernels);

    void add_image(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px, const FitResult* start,
                   std::span<const Eigen::Matrix2d> covariances_px);
    /// After the images: the identity is known.
    void hold_identity(const Eigen::VectorXd& alpha);
    void run();
    [[nodiscard]] JointFramesResult result();

    /// Of the one image added, linearised at a fit of it, without a prior.
    [[nodiscard]] IdentityInformation identity_information(const JointFitResult& at);

    /// k, of the one image added, at any fit of it: as JointFitResult::expression_deviations.
    [[nodiscard]] Eigen::VectorXd expression_deviations(const FitResult& at);

private:
    struct Image
    {
        const LandmarkSet* landmarks = nullptr;
        JointImageMatcher matcher;
        FitStatus status = FitStatus::success;
        std::string reason = {};
        Camera camera = {}; ///< Neutral where there is no usable pose.
    };

    void estimate_pose(Image& image, const JointImage& fixed, const Eigen::VectorXd& psi);
    /// Of the one image, linearised there.
    void set_system_at(const Camera& camera, const Eigen::VectorXd& alpha, const Eigen::VectorXd& psi,
                       double matched_scale, double scale_strength);
    void linearize();                              ///< At the state, with its points placed.
    [[nodiscard]] JointCertainty find_certainty(); ///< At the state, where its points are placed.
    void set_certainty(JointFramesResult& result); ///< Of each frame.
    void match();
    void turn_by_depth(std::size_t used_index);
    [[nodiscard]] FitResult unfitted_result(const Image& image) const;
    void set_fit(std::size_t used_index, FitResult& result) const;
    void judge(JointFramesResult& result) const;
    void judge_image(std::size_t used_index, FitResult& fit) const;
    void withhold_unless_finite(JointFramesResult& result) const;

    const FaceFitter& base_;
    const JointPoints& points_;
    const JointOptions& options_;
    const IdentityInformation& prior_;
    int num_before_;
    std::vector<Image> images_ = {};
    JointProblem problem_; ///< Of the usable images only, in order.
    std::vector<std::size_t> used_ = {};
    JointState state_ = {}; ///< The minimum of the energy.
    JointState shown_ = {}; ///< The same as a result: cameras and expressions after the turn by depth, psi at scale s.
    std::vector<double> matched_scales_ = {};
    JointProgress progress_ = {};
    JointScratch scratch_;
    double total_us_ = 0.0;
    double contour_us_ = 0.0;
};

inline JointFit::JointFit(const FaceFitter& base, const JointPoints& points, const JointOptions& options,
                          const IdentityInformation& prior, int num_before, const kernels::Kernels* kernels)
    : base_(base), points_(points), options_(options), prior_(prior), num_before_(num_before),
      problem_(options, prior, base.landmark_points().num_expression_coefficients()), scratch_(kernels)
{
    problem_.kernels = kernels;
    state_.alpha = prior_mean(prior);
    const double bound = options.max_coefficient;
    state_.alpha = state_.alpha.cwiseMax(-bound).cwiseMin(bound);
}

inline void JointFit::add_image(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                                const FitResult* start, std::span<const Eigen::Matrix2d> covariances_px)
{
    const char* const function = "JointFitter::fit";
    require_finite(principal_point_px, function, "principal_point_px");
    Eigen::VectorXd psi = Eigen::VectorXd::Zero(base_.landmark_points().num_expression_coefficients());
    if (start != nullptr) {
        require_size(start->shape_coefficients.size(), state_.alpha.size(), function, "start->shape_coefficients");
        require_finite(start->shape_coefficients, function, "start->shape_coefficients");
        require_size(start->expression_coefficients.size(), psi.size(), function, "start->expression_coefficients");
        require_finite(start->expression_coefficients, function, "start->expression_coefficients");
        psi = start->expression_coefficients.cwiseMax(0.0).cwiseMin(options_.max_expression);
        if (images_.empty()) {
            const double bound = options_.max_coefficient;
            state_.alpha = start->shape_coefficients.cwiseMax(-bound).cwiseMin(bound);
        }
    }
    images_.push_back(
        {&landmarks, JointImageMatcher(base_, points_, options_, problem_.kernels, landmarks, covariances_px)});
    images_.back().camera.principal_point_px = principal_point_px;
    if (start != nullptr) {
        images_.back().matcher.set_view(start->contour_view);
    }
    state_.psi.push_back(psi);
}

inline void JointFit::estimate_pose(Image& image, const JointImage& fixed, const Eigen::VectorXd& psi)
{
    const Eigen::Matrix3Xd shape = fixed.points.at(problem_.kernels, state_.alpha, psi);
    const Eigen::Matrix2Xd image_points = fixed.image_points.leftCols(shape.cols());
    const Eigen::Vector2d principal_point_px = image.camera.principal_point_px;
    const auto pose_for = [&](const Eigen::VectorXd& weights) {
        return options_.focal_length_px ? estimate_pose_perspective(shape, image_points, *options_.focal_length_px,
                                                                    weights, principal_point_px)
                                        : lineament::estimate_pose(shape, image_points, weights, principal_point_px);
    };
    const Eigen::VectorXd weights = image.matcher.start_weights();
    PoseResult pose = pose_for(weights);
    if (has_wild_points(pose, shape, image_points)) {
        const PoseResult without = pose_for(without_wild_points(shape, image_points, weights));
        pose = without.status == FitStatus::success ? without : pose;
    }
    image.camera = pose.camera;
    if (pose.status != FitStatus::success && pose.status != FitStatus::not_converged) {
        image.status = pose.status;
        image.reason = pose.reason;
    }
}

inline void JointFit::match()
{
    const Stopwatch stopwatch(contour_us_);
    matched_scales_.clear();
    for (std::size_t f = 0; f < used_.size(); ++f) {
        const double scale = state_.cameras[f].scale_px_per_mm;
        const NoiseSharing noise{scale, static_cast<int>(used_.size()), num_before_, state_.bias.size() > 0};
        images_[used_[f]].matcher.match(state_.cameras[f], state_.alpha, state_.psi[f], noise, problem_.images[f]);
        matched_scales_.push_back(scale);
    }
}

inline void JointFit::hold_identity(const Eigen::VectorXd& alpha)
{
    state_.alpha = alpha;
    problem_.holds_identity = true;
}

inline void JointFit::run()
{
    const Stopwatch stopwatch(total_us_);
    std::vector<Eigen::VectorXd> psi;
    for (std::size_t f = 0; f < images_.size(); ++f) {
        JointImage seen = images_[f].matcher.fixed_image();
        estimate_pose(images_[f], seen, state_.psi[f]);
        if (images_[f].status == FitStatus::success) {
            used_.push_back(f);
            problem_.images.push_back(std::move(seen));
            state_.cameras.push_back(images_[f].camera);
            psi.push_back(state_.psi[f]);
        }
    }
    state_.psi = psi;
    if (used_.empty()) {
        state_.alpha.setZero();
        return;
    }
    const int num_images = static_cast<int>(used_.size());
    if (num_images > 1 && options_.bias_sigma_mm > 0) {
        const Eigen::Index num_biases = base_.landmark_map().num_landmarks();
        state_.bias = Eigen::Matrix3Xd::Zero(3, num_biases);
        problem_.bias_variances_mm.resize(3, num_biases);
        for (int b = 0; b < static_cast<int>(num_biases); ++b) {
            problem_.bias_variances_mm.col(b) = bias_variances_mm(base_, options_, b);
        }
    }
    for (int round = 0; round < options_.rounds; ++round) {
        const bool is_last = round + 1 == options_.rounds;
        match();
        const double sum = std::accumulate(matched_scales_.begin(), matched_scales_.end(), 0.0);
        const double reference = sum / num_images;
        state_.phi_per_mm *= reference / problem_.reference_scale; // the same focal length
        problem_.reference_scale = reference;
        // Before the last round it is enough to come near, after the first by a step with the matrix that there is.
        RoundLimits limits{round == 0 ? 2 : 1, 0.1, round == 0};
        if (is_last) {
            limits = {options_.max_iterations, options_.tolerance, true};
            scratch_.keeps_matrix = false;
        }
        minimize(problem_, state_, limits, round, scratch_, progress_);
    }
    shown_ = state_;
    for (std::size_t f = 0; f < used_.size(); ++f) {
        turn_by_depth(f);
        const double own_scale = matched_scales_[f] / shown_.cameras[f].scale_px_per_mm;
        const double bound = options_.max_expression;
        shown_.psi[f] = shown_.psi[f].unaryExpr(
            [&](double value) { return value < bound ? std::min(own_scale * value, bound) : bound; });
    }
}

/// After the minimum, so that identity and biases, of which depth says nothing, are what the image points say.
inline void JointFit::turn_by_depth(std::size_t f)
{
    const std::vector<Landmark>& landmarks = images_[used_[f]].landmarks->landmarks;
    if (options_.focal_length_px || options_.phi_sigma_per_mm ||
        std::none_of(landmarks.begin(), landmarks.end(), [](const Landmark& l) { return l.depth_px.has_value(); })) {
        return;
    }
    JointProblem alone(options_, prior_, problem_.num_own() - 6);
    alone.images = {problem_.images[f]};
    alone.moves_expressions_only = true;
    alone.holds_identity = problem_.holds_identity;
    JointImage& seen = alone.images.front();
    JointState state{state_.alpha, 0.0, {state_.cameras[f]}, {state_.psi[f]}, {}};
    const double own_scale = seen.matched_scale / state.cameras.front().scale_px_per_mm;
    const Eigen::Matrix3Xd shape = seen.points.at(nullptr, state.alpha, own_scale * state.psi.front());
    const PlacedPoints& placed = scratch_.placed[f];
    PairMoments all, with_depth;
    int num_with_depth = 0;
    for (std::size_t i = 0; i < seen.used.size(); ++i) {
        const JointPoint& used = seen.used[i];
        const Eigen::Index column = static_cast<Eigen::Index>(i);
        const double weight = robust_weight(options_.loss, placed.squared_residual(column), used.num_dimensions) *
                              seen.roots.row(column).squaredNorm() / 2;
        const std::optional<double> depth_px = landmarks[static_cast<std::size_t>(used.landmark_index)].depth_px;
        const Eigen::Vector3d point(seen.image_points(0, column), seen.image_points(1, column), depth_px.value_or(0.0));
        all.add(weight, shape.col(column), point);
        if (depth_px && weight > 0) {
            with_depth.add(weight, shape.col(column), point);
            ++num_with_depth;
        }
    }
    if (!turn_camera_by_depth(all, with_depth, num_with_depth, state.cameras.front())) {
        return;
    }
    seen.points.mean.leftCols(shape.cols()) += placed.points - shape; // biases are held
    for (JointPoint& used : seen.used) {
        used.bias_index = -1;
    }
    JointProgress progress;
    JointScratch scratch(nullptr);
    minimize(alone, state, {options_.max_iterations, options_.tolerance, true}, 0, scratch, progress);
    shown_.cameras[f] = state.cameras.front();
    shown_.psi[f] = state.psi.front();
}

inline FitResult JointFit::unfitted_result(const Image& image) const
{
    FitResult result;
    result.method = "joint";
    result.status = image.status;
    result.reason = image.reason;
    result.camera = image.camera;
    result.shape_coefficients = Eigen::VectorXd::Zero(state_.alpha.size());
    result.expression_coefficients = Eigen::VectorXd::Zero(base_.landmark_points().num_expression_coefficients());
    if (const Blendshapes* expressions = base_.expressions()) {
        result.expression_set = expressions->name;
        result.expression_names = expressions->names;
    }
    result.iterations = progress_.iterations;
    result.contour_view = image.matcher.view();
    result.timing.total_us = total_us_;
    result.timing.contour_us = contour_us_;
    for (const Landmark& landmark : image.landmarks->landmarks) {
        result.landmarks.push_back({landmark.name, landmark.point_px, landmark.point_px, 0.0});
    }
    return result;
}

/// What of an unfitted result the fit has changed.
inline void JointFit::set_fit(std::size_t f, FitResult& result) const
{
    const Image& image = images_[used_[f]];
    const JointImage& seen = problem_.images[f];
    result.camera = shown_.cameras[f];
    result.shape_coefficients = state_.alpha;
    result.expression_coefficients = shown_.psi[f];
    const std::vector<int>& map_indices = image.matcher.map_indices();
    std::vector<bool> is_used(map_indices.size(), false);
    for (const JointPoint& used : seen.used) {
        is_used[static_cast<std::size_t>(used.landmark_index)] = true;
    }
    for (std::size_t l = 0; l < map_indices.size(); ++l) {
        if (!is_used[l] && map_indices[l] >= 0) { // its point of the landmark map
            result.landmarks[l].fitted_px = result.camera.project(
                base_.landmark_points().at(map_indices[l], result.shape_coefficients, result.expression_coefficients));
        }
    }
    const Eigen::Matrix3Xd shape = seen.points.at(problem_.kernels, state_.alpha, shown_.psi[f]);
    double sum = 0;
    for (std::size_t i = 0; i < seen.used.size(); ++i) {
        const JointPoint& used = seen.used[i];
        const Eigen::Index column = static_cast<Eigen::Index>(i);
        FittedLandmark& landmark = result.landmarks[static_cast<std::size_t>(used.landmark_index)];
        const double squared = scratch_.placed[f].squared_residual(column);
        landmark.fitted_px = result.camera.project(Eigen::Vector3d(shape.col(column)));
        landmark.weight = image.landmarks->landmarks[static_cast<std::size_t>(used.landmark_index)].confidence *
                          robust_weight(options_.loss, squared, used.num_dimensions) /
                          robust_weight(options_.loss, 0.0, used.num_dimensions);
        result.chi_square += squared;
        sum += (landmark.fitted_px - landmark.point_px).squaredNorm();
    }
    result.rms_px = std::sqrt(sum / static_cast<double>(seen.used.size()));
    result.chi_square +=
        problem_.prior_squares(state_.alpha) + (state_.psi[f] / options_.expression_sigma).squaredNorm();
    result.degrees_of_freedom = 2 * static_cast<int>(seen.used.size()) - 6;
}

inline void JointFit::judge(JointFramesResult& result) const
{
    const auto num_at_bound = (state_.alpha.array().abs() >= options_.max_coefficient).count();
    result.status = FitStatus::success;
    if (!progress_.has_settled) {
        result.status = FitStatus::not_converged;
        result.reason = "the joint fit did not settle in " + std::to_string(progress_.iterations) + " steps";
    }
    if (num_at_bound > 0 && !problem_.holds_identity) {
        result.status = FitStatus::implausible;
        result.reason = std::to_string(num_at_bound) + " shape coefficients were held at " +
                        to_text(options_.max_coefficient) + " standard deviations";
    }
    const FitStatus shared_status = result.status;
    const std::string shared_reason = result.reason;
    for (std::size_t f = 0; f < used_.size(); ++f) {
        FitResult& fit = result.frames[used_[f]].fit;
        fit.status = shared_status;
        fit.reason = shared_reason;
        judge_image(f, fit);
        if (fit.status == FitStatus::implausible && result.status != FitStatus::implausible) {
            result.status = fit.status;
            result.reason = images_.size() > 1 ? "image " + std::to_string(used_[f] + 1) + " of " +
                                                     std::to_string(images_.size()) + ": " + fit.reason
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
    neutral.shape_coefficients = Eigen::VectorXd::Zero(state_.alpha.size());
    neutral.landmark_bias_mm = Eigen::Matrix3Xd::Zero(3, result.landmark_bias_mm.cols());
    for (const Image& image : images_) {
        FitResult fit = unfitted_result(image);
        if (image.status == FitStatus::success) {
            fit.status = neutral.status;
            fit.reason = neutral.reason;
            fit.camera = Camera{};
            fit.camera.principal_point_px = image.camera.principal_point_px;
        }
        fit.shape_coefficients.setZero();
        neutral.frames.push_back({std::move(fit)});
    }
    result = std::move(neutral);
}

/// Names of the expressions whose deviations are above 0.9 of the prior's.
[[nodiscard]] inline std::vector<std::string> unobservable_names(const Eigen::VectorXd& deviations,
                                                                 const std::vector<std::string>& names, double sigma)
{
    std::vector<std::string> unobservable;
    for (std::size_t k = 0; k < names.size(); ++k) {
        if (deviations[static_cast<Eigen::Index>(k)] > 0.9 * sigma) {
            unobservable.push_back(names[k]);
        }
    }
    return unobservable;
}

inline void JointFit::linearize()
{
    problem_.place(state_, scratch_.placed);
    problem_.linearize(state_, scratch_.placed, scratch_.system);
}

inline JointCertainty JointFit::find_certainty()
{
    problem_.linearize(state_, scratch_.placed, scratch_.system);
    const JointCertainty certainty = certainty_of(problem_, state_, scratch_.system, scratch_.factor);
    if (problem_.kernels == nullptr || certainty.is_finite()) {
        return certainty;
    }
    // The matrix is not positive definite to single precision.
    const kernels::Kernels* const kernels = std::exchange(problem_.kernels, nullptr);
    linearize();
    problem_.kernels = kernels;
    return certainty_of(problem_, state_, scratch_.system, scratch_.factor);
}

inline void JointFit::set_certainty(JointFramesResult& result)
{
    const JointCertainty certainty = find_certainty();
    const Eigen::Index num_shape = problem_.num_shape();
    const Eigen::Index num_expressions = problem_.num_own() - 6;
    std::vector<int> face(static_cast<std::size_t>(num_shape + num_expressions)); // alpha and one image's psi
    std::iota(face.begin(), face.begin() + num_shape, 0);
    for (std::size_t f = 0; f < used_.size(); ++f) {
        JointFitResult& frame = result.frames[used_[f]];
        const Eigen::Index begin = problem_.own_begin(f);
        std::iota(face.begin() + num_shape, face.end(), static_cast<int>(begin));
        frame.covariance = certainty.covariance_of(face);
        frame.expression_deviations = certainty.deviations.segment(begin, num_expressions);
        frame.unobservable_expressions =
            unobservable_names(frame.expression_deviations, frame.fit.expression_names, options_.expression_sigma);
    }
}

inline JointFramesResult JointFit::result()
{
    JointFramesResult result;
    result.shape_coefficients = state_.alpha;
    result.landmark_bias_mm = Eigen::Matrix3Xd::Zero(3, base_.landmark_map().num_landmarks());
    result.num_used_frames = static_cast<int>(used_.size());
    for (const Image& image : images_) {
        result.frames.push_back({unfitted_result(image)});
    }
    if (used_.empty()) {
        result.reason = "no image has a usable pose";
        return result;
    }
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
    if (options_.with_covariance) {
        set_certainty(result);
    }
    judge(result);
    withhold_unless_finite(result);
    return result;
}

inline void JointFit::set_system_at(const Camera& camera, const Eigen::VectorXd& alpha, const Eigen::VectorXd& psi,
                                    double matched_scale, double scale_strength)
{
    used_ = {0};
    problem_.images = {images_[0].matcher.fixed_image()};
    problem_.images[0].scale_strength = scale_strength;
    state_.alpha = alpha;
    state_.cameras = {camera};
    state_.psi = {psi};
    problem_.reference_scale = camera.scale_px_per_mm;
    state_.phi_per_mm = camera.phi_per_mm;
    const NoiseSharing noise{matched_scale, 1, num_before_, false};
    images_[0].matcher.match(camera, alpha, psi, noise, problem_.images[0]);
    linearize();
}

inline Eigen::VectorXd JointFit::expression_deviations(const FitResult& at)
{
    const Eigen::VectorXd psi = state_.psi[0]; // within its bounds
    set_system_at(at.camera, at.shape_coefficients, psi, at.camera.scale_px_per_mm, 0.0);
    return certainty_of(problem_, state_, scratch_.system, scratch_.factor)
        .deviations.segment(problem_.own_begin(0), psi.size());
}

inline IdentityInformation JointFit::identity_information(const JointFitResult& at)
{
    set_system_at(at.minimum_camera, at.fit.shape_coefficients, at.minimum_expression, at.matched_scale_px_per_mm,
                  at.scale_strength);
    const JointSystem& system = scratch_.system;
    const Eigen::MatrixXd hessian = system.hessian.selfadjointView<Eigen::Lower>();
    std::vector<int> others = problem_.free_unknowns(state_, scratch_.system); // camera and free expressions
    const int num_shape = static_cast<int>(problem_.num_shape());
    std::erase_if(others, [&](int i) { return i < num_shape; });
    const Eigen::MatrixXd cross = hessian.leftCols(num_shape)(others, Eigen::all);
    const Eigen::LLT<Eigen::MatrixXd> cholesky(Eigen::MatrixXd(hessian(others, others)));
    IdentityInformation information;
    information.matrix = hessian.topLeftCorner(num_shape, num_shape) - cross.transpose() * cholesky.solve(cross);
    information.vector = information.matrix * state_.alpha - system.gradient.head(num_shape) +
                         cross.transpose() * cholesky.solve(Eigen::VectorXd(system.gradient(others)));
    return information;
}

} // namespace lineament::detail

#endif
