// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "fitters.hpp"

#include "console.hpp"

#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/multi_frame.hpp"
#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"
#include "lineament/vision/mesh_detector.hpp"

#include <algorithm>
#include <compare>
#include <map>
#include <optional>
#include <string>
#include <utility>

namespace lineament::cli {

namespace {

RobustLoss robust_loss(const std::string& name)
{
    return name == "none"            ? RobustLoss::none
           : name == "geman_mcclure" ? RobustLoss::geman_mcclure
                                     : RobustLoss::student_t;
}

ContourMode contour_mode(const std::optional<std::string>& name)
{
    return name == "ignored" ? ContourMode::ignored
           : name == "fixed" ? ContourMode::fixed
           : name == "front" ? ContourMode::front_facing
                             : ContourMode::both;
}

/// What of a set of landmarks decides which prepared fitter it needs.
struct LandmarkKind
{
    std::string scheme;
    bool has_outline = false;
    bool has_outline_beside = false; ///< Beside the landmarks of another scheme.

    explicit LandmarkKind(const LandmarkSet& set)
        : scheme(set.scheme), has_outline(std::any_of(set.landmarks.begin(), set.landmarks.end(),
                                                      [&](const Landmark& landmark) {
                                                          return outline_side(set.scheme, landmark.name).has_value();
                                                      })),
          has_outline_beside(has_outline && set.scheme != "ibug68")
    {}

    auto operator<=>(const LandmarkKind&) const = default;
};

/// The one whose kind suits all: the first with an outline, if any has one.
const LandmarkSet& representative(const std::vector<LandmarkSet>& sets)
{
    const auto found =
        std::find_if(sets.begin(), sets.end(), [](const auto& set) { return LandmarkKind(set).has_outline; });
    return found != sets.end() ? *found : sets.front();
}

FitOptions thesis_options(const ModelOptions& options, const LandmarkKind& kind)
{
    FitOptions fit = options.prior == "published" ? FitOptions::published_prior() : FitOptions{};
    fit.iterations = options.iterations.value_or(fit.iterations);
    fit.regularization = options.regularization.value_or(fit.regularization);
    fit.expression_set = options.expression_set == "none" ? "" : options.expression_set;
    fit.contour = contour_mode(options.contour);
    fit.outline_beside_scheme = kind.has_outline_beside;
    fit.landmark_sigma_mm = options.noise_mm.value_or(fit.landmark_sigma_mm);
    fit.contour_sigma_mm = options.outline_noise_mm.value_or(fit.contour_sigma_mm);
    return fit;
}

JointOptions joint_options(const ModelOptions& options, const LandmarkKind& kind)
{
    JointOptions fit;
    fit.rounds = options.iterations.value_or(fit.rounds);
    fit.expression_set = options.expression_set == "none" ? "" : options.expression_set;
    fit.contour = contour_mode(options.contour);
    fit.outline_beside_scheme = kind.has_outline_beside;
    fit.landmark_sigma_mm = options.noise_mm.value_or(fit.landmark_sigma_mm);
    fit.contour_sigma_mm = options.outline_noise_mm.value_or(fit.contour_sigma_mm);
    if (options.loss) {
        fit.loss = robust_loss(*options.loss);
    }
    if (options.focal_px > 0.0) {
        fit.focal_length_px = options.focal_px;
    }
    if (options.fits_focal) {
        fit.phi_sigma_per_mm = 0.002; // faces from 40 cm on
    }
    return fit;
}

/// The result with what the method says of its uncertainty.
Fitted with_evidence(const MorphableModel& model, const JointFitResult& joint)
{
    Fitted fitted{joint.fit, {}, {}, joint.unobservable_expressions, {}, joint.expression_deviations};
    const Eigen::Index num_shape = joint.fit.shape_coefficients.size();
    if (joint.covariance.rows() >= num_shape) {
        fitted.shape_covariance = joint.covariance.topLeftCorner(num_shape, num_shape);
        fitted.shape_standard_deviations = fitted.shape_covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
        fitted.predicted_rms_mm = predicted_rms_mm(model, fitted.shape_covariance);
    }
    return fitted;
}

void move_by(LandmarkSet& set, const Eigen::Vector2d& step_px)
{
    for (Landmark& landmark : set.landmarks) {
        landmark.point_px += step_px;
    }
}

void move_to(FitResult& fit, const Eigen::Vector2d& principal_point_px)
{
    const Eigen::Vector2d step_px = principal_point_px - fit.camera.principal_point_px;
    fit.camera.principal_point_px = principal_point_px;
    for (FittedLandmark& landmark : fit.landmarks) {
        landmark.point_px += step_px;
        landmark.fitted_px += step_px;
    }
}

/// A fitter of the frames of a video, one after the other, with its memory.
template <typename Fitter, typename Result>
struct FrameFitter
{
    using Workspace = decltype(std::declval<const Fitter&>().make_workspace());
    using Identity = decltype(std::declval<const Fitter&>().freeze(Eigen::VectorXd()));

    Fitter fitter;
    Workspace workspace;
    Result result = {};
    std::optional<Identity> identity = std::nullopt; ///< The last one asked for.

    explicit FrameFitter(Fitter prepared) : fitter(std::move(prepared)), workspace(fitter.make_workspace()) {}

    const Identity& frozen(const Eigen::VectorXd& shape_coefficients)
    {
        if (!identity || identity->shape_coefficients() != shape_coefficients) {
            identity = fitter.freeze(shape_coefficients);
        }
        return *identity;
    }
};
using ThesisFrameFitter = FrameFitter<RealtimeFitter, FitResult>;
using JointFrameFitter = FrameFitter<JointFitter, JointFitResult>;

} // namespace

struct Fitters::Implementation
{
    const MorphableModel* model;
    ModelOptions options;
    std::map<LandmarkKind, FaceFitter> thesis_fitters = {};
    std::map<LandmarkKind, JointFitter> joint_fitters = {};
    std::map<LandmarkKind, JointFrameFitter> joint_frame_fitters = {};
    std::map<LandmarkKind, ThesisFrameFitter> frame_fitters = {};

    std::optional<double> found_focal_px = std::nullopt; ///< Of the last identity.

    [[nodiscard]] bool is_joint() const { return options.method == "joint"; }

    [[nodiscard]] std::optional<double> focal_px() const
    {
        return options.focal_px > 0.0 ? std::optional(options.focal_px) : found_focal_px;
    }

    /// @throws Failure(wrong_use) if the user says what becomes of an outline that is not there or has no fixed points,
    /// or how noisy landmarks are of which the model states it.
    [[nodiscard]] LandmarkKind kind_of(const LandmarkSet& set) const
    {
        LandmarkKind kind(set);
        if (options.contour && !kind.has_outline) {
            throw Failure(wrong_use, "--contour: these landmarks (" + set.scheme +
                                         ") hold no outline; with the default detector give --outline dlib as well");
        }
        if (options.contour == "fixed" && kind.has_outline_beside) {
            throw Failure(wrong_use, "--contour fixed: the outline beside the landmarks of " + set.scheme +
                                         " has no fixed points of the model; give front, both or ignored");
        }
        if (options.outline_noise_mm && !kind.has_outline) {
            throw Failure(wrong_use, "--outline-noise: these landmarks (" + set.scheme +
                                         ") hold no outline; with the default detector give --outline dlib as well");
        }
        const LandmarkMap* map = model->find_landmark_map(set.scheme);
        if (options.noise_mm && map != nullptr && !map->noise_mm.empty()) {
            throw Failure(wrong_use, "--noise: the model itself states the noise of " + set.scheme +
                                         ", of each landmark; the option is for landmarks without");
        }
        return kind;
    }

    /// For frames of a known identity: with the focal length that is known by then.
    JointFrameFitter& joint_frames(const LandmarkSet& set)
    {
        const LandmarkKind kind = kind_of(set);
        const auto known = joint_frame_fitters.find(kind);
        if (known != joint_frame_fitters.end()) {
            return known->second;
        }
        JointOptions fit = joint_options(options, kind);
        fit.with_covariance = false;
        fit.focal_length_px = focal_px();
        fit.phi_sigma_per_mm.reset();
        JointFitter fitter(*model, kind.scheme, fit, &kernels::dispatched_kernels());
        return joint_frame_fitters.emplace(kind, JointFrameFitter(std::move(fitter))).first->second;
    }

    ThesisFrameFitter& frame_fitter(const LandmarkSet& set)
    {
        const LandmarkKind kind = kind_of(set);
        auto known = frame_fitters.find(kind);
        if (known == frame_fitters.end()) {
            RealtimeFitter fitter(*model, kind.scheme, thesis_options(options, kind), kernels::dispatched_kernels());
            known = frame_fitters.emplace(kind, ThesisFrameFitter(std::move(fitter))).first;
        }
        return known->second;
    }

    const FaceFitter& thesis(const LandmarkSet& set)
    {
        const LandmarkKind kind = kind_of(set);
        const auto known = thesis_fitters.find(kind);
        if (known != thesis_fitters.end()) {
            return known->second;
        }
        FitOptions fit = thesis_options(options, kind);
        fit.focal_length_px = focal_px();
        return thesis_fitters.emplace(kind, FaceFitter(*model, kind.scheme, fit)).first->second;
    }

    /// A result of the thesis's method, with the expressions that its landmarks do not tell.
    Fitted with_observability(const LandmarkSet& set, FitResult fit)
    {
        std::vector<std::string> unobservable = joint(set).unobservable_expressions(set, fit);
        return {std::move(fit), {}, {}, std::move(unobservable), {}, {}};
    }

    const JointFitter& joint(const LandmarkSet& set)
    {
        const LandmarkKind kind = kind_of(set);
        const auto known = joint_fitters.find(kind);
        return known != joint_fitters.end()
                   ? known->second
                   : joint_fitters
                         .emplace(kind, JointFitter(*model, kind.scheme, joint_options(options, kind),
                                                    &kernels::dispatched_kernels()))
                         .first->second;
    }
};

Fitters::Fitters(const MorphableModel& model, const ModelOptions& options)
    : implementation_(new Implementation{&model, options})
{
    if (options.method == "joint" && (options.prior != "model" || options.regularization)) {
        throw Failure(wrong_use,
                      "--prior and --regularization are settings of --method thesis; the joint method weighs "
                      "the prior as the maximum a posteriori estimate does");
    }
    if (options.loss && options.method != "joint") {
        throw Failure(wrong_use, "--loss needs --method joint: the thesis's method fits by least squares");
    }
    if ((options.noise_mm || options.outline_noise_mm) && options.prior == "published") {
        throw Failure(wrong_use, "--noise and --outline-noise are in mm; the published prior has its noise in px");
    }
    if (options.fits_focal && options.method != "joint") {
        throw Failure(wrong_use, "--focal unknown needs --method joint: the thesis's method does not fit it");
    }
}

Fitters::~Fitters() = default;

LandmarkSet Fitters::in_scheme_of_model(LandmarkSet landmarks) const
{
    const MorphableModel& model = *implementation_->model;
    if (model.find_landmark_map(landmarks.scheme) != nullptr) {
        return landmarks;
    }
    if (landmarks.scheme == "mediapipe478" && model.find_landmark_map("ibug68") != nullptr) {
        return ibug68_from_mediapipe(landmarks);
    }
    std::string known;
    for (const LandmarkMap& map : model.landmark_maps) {
        known += (known.empty() ? "" : ", ") + map.scheme;
    }
    throw Failure(bad_input, "the model " + model.name + " has no landmarks of the scheme " + landmarks.scheme +
                                 " (it has: " + known + ")");
}

Fitted Fitters::fit(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                    std::span<const Eigen::Matrix2d> covariances_px)
{
    if (implementation_->is_joint()) {
        const JointFitter& fitter = implementation_->joint(landmarks);
        return with_evidence(*implementation_->model,
                             fitter.fit(landmarks, principal_point_px, nullptr, covariances_px));
    }
    return implementation_->with_observability(landmarks,
                                               implementation_->thesis(landmarks).fit(landmarks, principal_point_px));
}

std::vector<Fitted> Fitters::fit_same_person(std::vector<LandmarkSet> pictures,
                                             const std::vector<Eigen::Vector2d>& principal_points_px,
                                             std::span<const std::vector<Eigen::Matrix2d>> covariances_px)
{
    for (std::size_t i = 0; i < pictures.size(); ++i) { // all principal points into one
        move_by(pictures[i], -principal_points_px[i]);
    }
    const Eigen::Vector2d origin = Eigen::Vector2d::Zero();
    std::vector<Fitted> fitted;
    if (implementation_->is_joint()) {
        const JointFitter& fitter = implementation_->joint(representative(pictures));
        for (const JointFitResult& frame : fitter.fit_frames(pictures, origin, {}, covariances_px).frames) {
            fitted.push_back(with_evidence(*implementation_->model, frame));
        }
    } else {
        const std::vector<FitResult> frames =
            fit_frames(implementation_->thesis(representative(pictures)), pictures, origin).frames;
        for (std::size_t i = 0; i < frames.size(); ++i) {
            fitted.push_back(implementation_->with_observability(pictures[i], frames[i]));
        }
    }
    for (std::size_t i = 0; i < fitted.size(); ++i) {
        move_to(fitted[i].result, principal_points_px[i]);
    }
    return fitted;
}

Eigen::VectorXf Fitters::vertex_deviations_mm(const Eigen::MatrixXd& shape_covariance) const
{
    return vertex_standard_deviations(*implementation_->model, shape_covariance).colwise().norm().transpose();
}

FitResult Fitters::fit_frame(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px)
{
    if (implementation_->options.focal_px > 0.0) {
        return implementation_->thesis(landmarks).fit(landmarks, principal_point_px);
    }
    ThesisFrameFitter& frames = implementation_->frame_fitter(landmarks);
    frames.fitter.fit(landmarks, principal_point_px, frames.workspace, frames.result);
    return frames.result;
}

FitResult Fitters::fit_pose_and_expression(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                                           const Eigen::VectorXd& shape_coefficients, const FitResult* start)
{
    if (implementation_->is_joint()) {
        JointFrameFitter& frames = implementation_->joint_frames(landmarks);
        const KnownIdentity& identity = frames.frozen(shape_coefficients);
        frames.fitter.fit_pose_and_expression(landmarks, principal_point_px, identity, frames.workspace, frames.result,
                                              start);
        return frames.result.fit;
    }
    if (implementation_->focal_px()) {
        return implementation_->thesis(landmarks).fit_pose_and_expression(landmarks, principal_point_px,
                                                                          shape_coefficients, start);
    }
    ThesisFrameFitter& frames = implementation_->frame_fitter(landmarks);
    frames.fitter.fit_pose_and_expression(landmarks, principal_point_px, frames.frozen(shape_coefficients),
                                          frames.workspace, frames.result, start);
    return frames.result;
}

Eigen::VectorXd Fitters::fit_identity(const std::vector<LandmarkSet>& frames, const Eigen::Vector2d& principal_point_px)
{
    if (!implementation_->is_joint()) {
        return fit_frames(implementation_->thesis(representative(frames)), frames, principal_point_px)
            .shape_coefficients;
    }
    const JointFramesResult fitted =
        implementation_->joint(representative(frames)).fit_frames(frames, principal_point_px);
    if (implementation_->options.fits_focal) {
        implementation_->joint_frame_fitters.clear();
        implementation_->found_focal_px.reset();
        for (const JointFitResult& frame : fitted.frames) {
            const Camera& camera = frame.fit.camera;
            if (camera.phi_per_mm > 0) { // the same focal length in all of them
                implementation_->found_focal_px = camera.scale_px_per_mm / camera.phi_per_mm;
            }
        }
    }
    return fitted.shape_coefficients;
}

std::vector<std::string> Fitters::unobservable_expressions(const std::vector<LandmarkSet>& frames,
                                                           const Eigen::Vector2d& principal_point_px,
                                                           const Eigen::VectorXd& shape_coefficients)
{
    std::optional<std::vector<std::string>> unobservable;
    for (const LandmarkSet& frame : frames) {
        const FitResult fit = fit_pose_and_expression(frame, principal_point_px, shape_coefficients, nullptr);
        if (fit.status == FitStatus::degenerate || fit.status == FitStatus::too_few_correspondences) {
            continue;
        }
        const std::vector<std::string> now = implementation_->joint(frame).unobservable_expressions(frame, fit);
        if (unobservable) {
            std::erase_if(*unobservable, [&](const std::string& name) {
                return std::find(now.begin(), now.end(), name) == now.end();
            });
        } else {
            unobservable = now;
        }
        if (unobservable->empty()) {
            break;
        }
    }
    return unobservable.value_or(std::vector<std::string>{});
}

std::optional<double> Fitters::focal_px() const
{
    return implementation_->focal_px();
}

} // namespace lineament::cli
