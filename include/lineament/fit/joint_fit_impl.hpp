// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_FIT_IMPL_HPP
#define LINEAMENT_FIT_JOINT_FIT_IMPL_HPP

#include "lineament/fit/frame_fit_impl.hpp"
#include "lineament/fit/joint_fit.hpp"
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

/// Makes room for `count` of a list whose elements keep their memory.
template <typename T>
void make_room(std::vector<T>& list, std::size_t count)
{
    if (list.size() < count) {
        list.resize(count);
    }
}

inline void JointFit::begin(const JointContext& context, const IdentityPrior& prior)
{
    context_.emplace(context);
    prior_ = &prior;
    num_images_ = 0;
    problem_.begin(options(), prior, num_expressions());
    problem_.kernels = context.kernels;
    used_.clear();
    const double bound = options().max_coefficient;
    state_.alpha = prior.mean.cwiseMax(-bound).cwiseMin(bound);
    state_.phi_per_mm = 0.0;
    state_.cameras.clear();
    state_.bias.resize(3, 0);
    progress_.has_settled = false;
    progress_.iterations = 0;
    progress_.energies.clear();
    scratch_.keeps_matrix = false;
    for (PlacedPoints& placed : scratch_.placed) {
        placed.num_shaped = 0;
    }
    total_us_ = 0.0;
    contour_us_ = 0.0;
}

inline void JointFit::add_image(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                                const FitResult* start, std::span<const Eigen::Matrix2d> covariances_px)
{
    const char* const function = "JointFitter::fit";
    require_finite(principal_point_px, function, "principal_point_px");
    make_room(images_, num_images_ + 1);
    make_room(state_.psi, num_images_ + 1);
    Image& image = images_[num_images_];
    Eigen::VectorXd& psi = state_.psi[num_images_];
    psi.setZero(num_expressions());
    if (start != nullptr) {
        require_size(start->shape_coefficients.size(), base().num_shape_coefficients(), function,
                     "start->shape_coefficients");
        require_finite(start->shape_coefficients, function, "start->shape_coefficients");
        require_size(start->expression_coefficients.size(), psi.size(), function, "start->expression_coefficients");
        require_finite(start->expression_coefficients, function, "start->expression_coefficients");
        psi = start->expression_coefficients.cwiseMax(0.0).cwiseMin(options().max_expression);
        if (num_images_ == 0 && context_->known_identity == nullptr) {
            const double bound = options().max_coefficient;
            state_.alpha = start->shape_coefficients.cwiseMax(-bound).cwiseMin(bound);
        }
    }
    image.landmarks = &landmarks;
    image.matcher.begin(*context_, landmarks, covariances_px);
    image.status = FitStatus::success;
    image.reason.clear();
    image.camera = Camera{};
    image.camera.principal_point_px = principal_point_px;
    if (start != nullptr) {
        image.matcher.set_view(start->contour_view);
    }
    ++num_images_;
}

inline void JointFit::estimate_pose(Image& image, const JointImage& fixed, const Eigen::VectorXd& psi)
{
    make_room(scratch_.placed, used_.size() + 1);
    RoomyMatrix<Eigen::Matrix3Xd>& shape = scratch_.placed[used_.size()].shape;
    fixed.points.evaluate_shape(context_->kernels, state_.alpha, 0, products_.padded, shape);
    fixed.points.expression.multiply(context_->kernels, fixed.points.num_points, psi, products_.padded,
                                     products_.by_expression);
    points_ = shape.leftCols(fixed.points.num_points) + products_.by_expression;
    const auto image_points = fixed.image_points.leftCols(points_.cols());
    const Eigen::Vector2d principal_point_px = image.camera.principal_point_px;
    const auto pose_for = [&](const Eigen::VectorXd& weights) {
        return options().focal_length_px ? estimate_pose_perspective(points_, image_points, *options().focal_length_px,
                                                                     weights, principal_point_px)
                                         : pose_of_pairs(points_, image_points, weights, principal_point_px);
    };
    image.matcher.set_start_weights(weights_);
    PoseResult pose = pose_for(weights_);
    set_residuals(context_->kernels, pose.camera, points_, fixed.image_points, fixed.roots, distances_);
    if (has_wild_points(pose, distances_)) {
        const PoseResult without = pose_for(without_wild_points(points_, image_points, weights_));
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
        const NoiseSharing noise{scale, static_cast<int>(used_.size()), prior_->num_images, state_.bias.size() > 0};
        images_[used_[f]].matcher.match(state_.cameras[f], state_.alpha, state_.psi[f], noise, problem_.images[f]);
        matched_scales_.push_back(scale);
        scratch_.placed[f].num_shaped = images_[used_[f]].matcher.num_fixed(); // as a pose or a step has left them
    }
}

inline void JointFit::set_bias_variances()
{
    const Eigen::Index num_biases = base().landmark_map().num_landmarks();
    state_.bias = Eigen::Matrix3Xd::Zero(3, num_biases);
    problem_.bias_variances_mm.resize(3, num_biases);
    for (int b = 0; b < static_cast<int>(num_biases); ++b) {
        problem_.bias_variances_mm.col(b) = bias_variances_mm(options(), base().landmark_noise_mm(), b);
    }
}

inline void JointFit::run()
{
    const Stopwatch stopwatch(total_us_);
    problem_.images.resize(num_images_);
    for (std::size_t f = 0; f < num_images_; ++f) {
        JointImage& seen = problem_.images[used_.size()];
        images_[f].matcher.set_fixed_points(seen);
        estimate_pose(images_[f], seen, state_.psi[f]);
        if (images_[f].status == FitStatus::success) {
            std::swap(state_.psi[used_.size()], state_.psi[f]);
            used_.push_back(f);
            state_.cameras.push_back(images_[f].camera);
        }
    }
    problem_.images.resize(used_.size());
    state_.psi.resize(used_.size());
    if (used_.empty()) {
        state_.alpha.setZero();
        return;
    }
    const int num_images = static_cast<int>(used_.size());
    if (num_images > 1 && options().bias_sigma_mm > 0) {
        set_bias_variances();
    }
    for (int round = 0; round < options().rounds; ++round) {
        const bool is_last = round + 1 == options().rounds;
        match();
        const double sum = std::accumulate(matched_scales_.begin(), matched_scales_.end(), 0.0);
        const double reference = sum / num_images;
        state_.phi_per_mm *= reference / problem_.reference_scale; // the same focal length
        problem_.reference_scale = reference;
        // Before the last round it is enough to come near, after the first by a step with the matrix that there is.
        // Where h is small, a step with it goes too far.
        RoundLimits limits{round == 0 ? 2 : 1, 0.1, round == 0, true};
        if (is_last) {
            limits = {options().max_iterations, options().tolerance, true};
            scratch_.keeps_matrix = false;
        }
        minimize(problem_, state_, limits, round, scratch_, progress_);
    }
    problem_.reweighs = false;
    shown_ = state_;
    is_turned_.clear();
    for (std::size_t f = 0; f < used_.size(); ++f) {
        is_turned_.push_back(turn_by_depth(f) ? 1 : 0);
        const double own_scale = matched_scales_[f] / shown_.cameras[f].scale_px_per_mm;
        const double bound = options().max_expression;
        shown_.psi[f] = shown_.psi[f].unaryExpr(
            [&](double value) { return value < bound ? std::min(own_scale * value, bound) : bound; });
    }
}

/// After the minimum, so that identity and biases, of which depth says nothing, are what the image points say.
inline bool JointFit::turn_by_depth(std::size_t f)
{
    const std::vector<Landmark>& landmarks = images_[used_[f]].landmarks->landmarks;
    if (options().focal_length_px || options().phi_sigma_per_mm ||
        std::none_of(landmarks.begin(), landmarks.end(), [](const Landmark& l) { return l.depth_px.has_value(); })) {
        return false;
    }
    JointImage& seen = problem_.images[f];
    const PlacedPoints& placed = scratch_.placed[f];
    Camera camera = state_.cameras[f];
    const double own_scale = seen.matched_scale / camera.scale_px_per_mm;
    seen.points.evaluate(context_->kernels, state_.alpha, own_scale * state_.psi[f], products_, points_);
    PairMoments all, with_depth;
    int num_with_depth = 0;
    for (std::size_t i = 0; i < seen.used.size(); ++i) {
        const JointPoint& used = seen.used[i];
        const Eigen::Index column = static_cast<Eigen::Index>(i);
        const double weight = robust_weight(options().loss, placed.squared_residual(column), used.num_dimensions) *
                              seen.roots.row(column).squaredNorm() / 2;
        const std::optional<double> depth_px = landmarks[static_cast<std::size_t>(used.landmark_index)].depth_px;
        const Eigen::Vector3d point(seen.image_points(0, column), seen.image_points(1, column), depth_px.value_or(0.0));
        all.add(weight, points_.col(column), point);
        if (depth_px && weight > 0) {
            with_depth.add(weight, points_.col(column), point);
            ++num_with_depth;
        }
    }
    if (!turn_camera_by_depth(all, with_depth, num_with_depth, camera)) {
        return false;
    }
    shown_.cameras[f] = camera;
    fit_expression_of(f, camera, own_scale, shown_.psi[f]);
    return true;
}

/// Swaps two things, and back at its end.
template <typename T>
class SwappedForNow
{
public:
    SwappedForNow(T& one, T& other) : one_(one), other_(other) { std::swap(one_, other_); }
    ~SwappedForNow() { std::swap(one_, other_); }
    SwappedForNow(const SwappedForNow&) = delete;
    SwappedForNow& operator=(const SwappedForNow&) = delete;

private:
    T& one_;
    T& other_;
};

/// Anew for another camera, where identity and biases are as they are.
inline void JointFit::fit_expression_of(std::size_t f, const Camera& camera, double own_scale, Eigen::VectorXd& psi)
{
    JointImage& seen = problem_.images[f];
    alone_.problem.begin(options(), alone_.nothing, num_expressions());
    alone_.problem.kernels = context_->kernels;
    alone_.problem.holds_cameras = true;
    alone_.problem.images.resize(1);
    JointImage& same = alone_.problem.images.front();
    same.used = seen.used;
    for (JointPoint& used : same.used) {
        used.bias_index = -1;
    }
    same.image_points = seen.image_points;
    same.roots = seen.roots;
    same.dimensions = seen.dimensions;
    same.matched_scale = seen.matched_scale;
    same.points.num_points = seen.points.num_points;
    const SwappedForNow lent(same.points.expression, seen.points.expression);
    same.points.expression.multiply(context_->kernels, same.points.num_points, own_scale * state_.psi[f],
                                    products_.padded, products_.by_expression);
    same.points.mean = scratch_.placed[f].points - products_.by_expression;
    alone_.state.cameras.assign(1, camera);
    alone_.state.psi.assign(1, state_.psi[f]);
    alone_.scratch.keeps_matrix = false;
    alone_.progress.energies.clear();
    minimize(alone_.problem, alone_.state, {options().max_iterations, options().tolerance, false}, 0, alone_.scratch,
             alone_.progress);
    psi = alone_.state.psi.front();
}

inline void JointFit::set_system_at(const Camera& camera, const Eigen::VectorXd& alpha, const Eigen::VectorXd& psi,
                                    double matched_scale, double scale_strength)
{
    used_ = {0};
    problem_.images.resize(1);
    images_[0].matcher.set_fixed_points(problem_.images[0]);
    problem_.images[0].scale_strength = scale_strength;
    state_.alpha = alpha;
    state_.cameras = {camera};
    state_.psi = {psi};
    problem_.reference_scale = camera.scale_px_per_mm;
    state_.phi_per_mm = camera.phi_per_mm;
    const NoiseSharing noise{matched_scale, 1, prior_->num_images, false};
    images_[0].matcher.match(camera, alpha, psi, noise, problem_.images[0]);
    linearize();
}

inline Eigen::VectorXd JointFit::expression_deviations(const FitResult& at)
{
    const Eigen::VectorXd psi = state_.psi[0]; // within its bounds
    set_system_at(at.camera, at.shape_coefficients, psi, at.camera.scale_px_per_mm, 0.0);
    certainty_.find(problem_, state_, scratch_.system, scratch_.factor);
    return certainty_.deviations().segment(problem_.own_begin(0), psi.size());
}

inline IdentityInformation JointFit::identity_information(const JointFitResult& at)
{
    set_system_at(at.minimum_camera, at.fit.shape_coefficients, at.minimum_expression, at.matched_scale_px_per_mm,
                  at.scale_strength);
    const JointSystem& system = scratch_.system;
    const Eigen::MatrixXd hessian = system.hessian.selfadjointView<Eigen::Lower>();
    std::vector<int> others; // camera and free expressions
    problem_.find_free_unknowns(state_, scratch_.system, others);
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
