// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/identity_filter.hpp"
#include "lineament/fit/identity_prior_impl.hpp"
#include "lineament/fit/packed_points_impl.hpp"
#include "lineament/fit/robust_loss.hpp"
#include "lineament/kernels/kernels.hpp"

#include <Eigen/Core>

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace lineament {

/// How to fit jointly. Every member has its default here and nowhere else.
struct JointOptions
{
    double landmark_sigma_mm = 2.0;       ///< Noise of inner landmarks, per coordinate, bias apart, > 0.
    double contour_sigma_mm = 4.0;        ///< Of outline landmarks, > 0; across the outline where it is re-matched.
    double contour_along_sigma_mm = 12.0; ///< Added along a re-matched outline, >= 0: where on it a landmark lies says
                                          ///< little.
    std::map<std::string, Eigen::Matrix2d> covariances_mm = {}; ///< Of single landmarks, in their stead [mm^2].
    std::string noise_detector = {}; ///< Whose LandmarkMap::noise_mm to use instead; empty: the only one, if any. It is
                                     ///< split into noise and bias in the ratio of the options' variances.
    double bias_sigma_mm = 2.0;    ///< By how much, per axis, a detector's idea of a landmark differs from the model's
                                   ///< point in the same way in all images of a person; 0: not at all.
    double bias_depth_ratio = 5.0; ///< How many times as wide along z of model space, where noise_detector's noise is
                                   ///< used; >= 1. A network that draws whole faces draws them of one depth: turned
                                   ///< heads tell nothing of the person's.
    RobustLoss loss = RobustLoss::student_t;
    double expression_sigma = 0.3; ///< Of the prior of each psi, > 0.
    double max_expression = 1.0;   ///< Upper bound of each psi, > 0.
    double max_coefficient = 5.0;  ///< |a_j| is held at this, > 0; the status says so.
    ContourMode contour = ContourMode::both;
    ContourOptions contour_matching = {};
    bool outline_beside_scheme = false;    ///< As FitOptions::outline_beside_scheme.
    double contour_trim = 0.05;            ///< Share of the outline matches, the farthest, left out; [0, 1).
    std::string expression_set = "ekman6"; ///< Of the model; empty: no expressions.
    std::optional<int> num_shape_coefficients = std::nullopt; ///< Leading components to fit; empty: all m.
    std::optional<double> focal_length_px = std::nullopt;     ///< Known: perspective.
    std::optional<double> phi_sigma_per_mm = std::nullopt;    ///< Unknown focal length, the same in all images: the
                                                              ///< prior's width of the inverse distance (0.002 suits
                                                              ///< selfies). Neither: scaled orthographic.
    int rounds = 3;              ///< Of weights and outline matches, >= 1; after the last they are frozen.
    int max_iterations = 60;     ///< Steps of the last round, >= 1.
    double tolerance = 1e-4;     ///< The last round ends when what is left to go is this many posterior standard
                                 ///< deviations, > 0.
    bool with_covariance = true; ///< Whether results say how sure they are, which takes a sixth of the time of a fit.

    void check() const; ///< @throws InvalidArgument naming the member and the value.
};

/// The energy after a step that was taken. It falls within a round; a new round is a new function.
struct EnergyStep
{
    int round = 0;
    double energy = 0.0;
};

/// A face and how sure it is.
struct JointFitResult
{
    FitResult fit = {};

    /// (m + k) x (m + k), of shape and expression coefficients, with camera and landmark bias integrated out. Rows of
    /// expressions at a bound are 0. Empty without a usable pose or options.with_covariance.
    Eigen::MatrixXd covariance = {};

    /// k, standard deviations of the expression coefficients as if none were held at its bound: what the landmarks say
    /// of each, against options.expression_sigma before. Empty likewise.
    Eigen::VectorXd expression_deviations = {};
    /// Names of the expressions the landmarks tell next to nothing of: their deviation is above 0.9 of the prior's.
    std::vector<std::string> unobservable_expressions = {};

    /// Where the energy is least, for JointFitter::identity_information: camera and expression of `fit` as they were
    /// before depth turned the head, the expression at the scale s_0. Neutral and empty without a usable pose.
    Camera minimum_camera = {};
    Eigen::VectorXd minimum_expression = {}; ///< k.

    double matched_scale_px_per_mm = 1.0; ///< s_0 of the last round: turned mm of noise into px.
    double scale_strength = 0.0;          ///< n_f of the scale term.
    std::vector<EnergyStep> energies = {};
};

/// One identity from several images.
struct JointFramesResult
{
    FitStatus status = FitStatus::too_few_correspondences;
    std::string reason = {};
    Eigen::VectorXd shape_coefficients = {}; ///< m, shared by all images.
    Eigen::MatrixXd shape_covariance = {};   ///< m x m; empty without a usable image, a finite fit or
                                             ///< options.with_covariance.
    std::vector<JointFitResult> frames = {}; ///< In the order given; one without a pose keeps its own status.
    int num_used_frames = 0;                 ///< With a usable pose; the others do not touch the identity.
    Eigen::Matrix3Xd landmark_bias_mm = {};  ///< 3 x L, in the landmark map's order, model space; zero for one image.
    double chi_square = 0.0;                 ///< Of all images, every prior counted once.
    int degrees_of_freedom = 0;              ///< 2 per used landmark minus 6 per used image.
};

namespace detail {
class JointFit;
}

/// A known identity with the points of its neutral face: made once by JointFitter::freeze, good for any
/// number of frames and threads, with that fitter only.
class KnownIdentity
{
public:
    [[nodiscard]] const Eigen::VectorXd& shape_coefficients() const { return shape_coefficients_; }

private:
    friend class JointFitter;
    KnownIdentity(Eigen::VectorXd shape_coefficients, detail::JointPoints points)
        : shape_coefficients_(std::move(shape_coefficients)), points_(std::move(points))
    {}
    Eigen::VectorXd shape_coefficients_; ///< m.
    detail::JointPoints points_;
};

/// The memory one thread fits in: made by JointFitter::make_workspace, used with that fitter only, by one thread at a
/// time. What a fit leaves in it never changes the next one.
class JointWorkspace
{
public:
    JointWorkspace(JointWorkspace&&) noexcept;
    JointWorkspace& operator=(JointWorkspace&&) noexcept;
    ~JointWorkspace();

private:
    friend class JointFitter;
    explicit JointWorkspace(const kernels::Kernels* kernels);
    // Each keeps the sizes of its unknowns.
    std::unique_ptr<detail::JointFit> fit_;
    std::unique_ptr<detail::JointFit> fit_of_known_;  ///< Identity.
    std::unique_ptr<detail::JointFit> fit_of_frames_; ///< Several.
};

/// Fits identity, expressions and cameras of one or several images of one person as the minimum of one energy:
///
///   E = sum rho(r^T W r) + |a|^2 + sum_f |psi_f / sigma|^2 + 2 sum_f n_f log s_f          docs/joint-fit.md, Eq. (7)
///
/// with r the distance of a projected model point from its landmark, W its inverse covariance, |a_j| <= 5 and
/// 0 <= psi <= 1. The last term keeps the scale from growing so that the coefficients may shrink. Steps are damped
/// Gauss-Newton steps on all unknowns at once; each step taken lowers E. `const` members may run in several threads at
/// once. Same input, same bits.
/// @par Cost       About O(L (m + k)^2 + (m + F k)^3) a step for F images; by kernels O(F k (m + 3L)^2 + (m + 3L)^3)
///                 where that is less, covariances too. Meant for some dozens of images at once.
/// @par Reference  The maximum a posteriori form of Huber's pipeline (PhD thesis, University of Surrey 2017, chapters 4
///                 and 5); the scale term and the bias model are derived in docs/joint-fit.md.
class JointFitter
{
public:
    /// @param kernels  For points, products with the model's rows and the steps; they must outlive this. nullptr: by
    ///                 Eigen in double precision, with the instructions of the caller's flags. By kernels the matrices
    ///                 are summed, and steps solved, in single precision, the gradient is not: the faces differ by less
    ///                 than the tolerance, standard deviations by some 1e-4 at a noise of 2 mm, 1e-2 at 0.3 mm.
    /// @throws InvalidArgument as FaceFitter.
    explicit JointFitter(MorphableModel model, std::string scheme = "ibug68", JointOptions options = {},
                         const kernels::Kernels* kernels = nullptr);

    /// The face that explains the landmarks. Statuses and exceptions as of FaceFitter::fit.
    /// @param start           An earlier result with this model; nullptr: the mean face.
    /// @param covariances_px  One for each landmark in the order given, [px^2], replacing the options' noise of it;
    ///                        empty: none.
    /// @param earlier         What earlier images of this person said of the identity; nullptr: nothing.
    /// @throws InvalidArgument also on a covariance that is not symmetric positive definite, or a filter of another
    /// size.
    [[nodiscard]] JointFitResult fit(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                                     const FitResult* start = nullptr,
                                     std::span<const Eigen::Matrix2d> covariances_px = {},
                                     const IdentityFilter* earlier = nullptr) const;

    /// As fit, with the identity known and left alone; rows of it in the covariance are 0.
    /// @param shape_coefficients  At most as many as are fitted; missing ones are 0.
    [[nodiscard]] JointFitResult fit_pose_and_expression(const LandmarkSet& landmarks,
                                                         const Eigen::Vector2d& principal_point_px,
                                                         const Eigen::VectorXd& shape_coefficients,
                                                         const FitResult* start = nullptr,
                                                         std::span<const Eigen::Matrix2d> covariances_px = {}) const;

    [[nodiscard]] JointWorkspace make_workspace() const;

    /// The same bits, written to `result`, whose memory is used again.
    ///
    /// With kernels, and once it has grown to what such faces need, nothing is allocated for a face that is a success
    /// or has not settled, long names of unobservable expressions apart, unless `covariances_px` or `earlier` are
    /// given, a focal length is known or asked for, landmarks have depths, are wild or lie on a silhouette.
    /// @param start  May be result.fit.
    void fit(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px, JointWorkspace& workspace,
             JointFitResult& result, const FitResult* start = nullptr,
             std::span<const Eigen::Matrix2d> covariances_px = {}, const IdentityFilter* earlier = nullptr) const;

    /// The identity, ready for fit_pose_and_expression.
    /// @throws InvalidArgument on more coefficients than are fitted, or one that is not finite.
    [[nodiscard]] KnownIdentity freeze(const Eigen::VectorXd& shape_coefficients) const;

    /// As fit_pose_and_expression above, likewise.
    void fit_pose_and_expression(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                                 const KnownIdentity& identity, JointWorkspace& workspace, JointFitResult& result,
                                 const FitResult* start = nullptr,
                                 std::span<const Eigen::Matrix2d> covariances_px = {}) const;

    /// One identity, with its prior counted once, from images of one person; camera and expression of each its own.
    /// @param starts          Earlier results, one for each image, or empty; the first one's identity is taken.
    /// @param covariances_px  As of `fit`, for each image, or empty.
    [[nodiscard]] JointFramesResult fit_frames(std::span<const LandmarkSet> frames,
                                               const Eigen::Vector2d& principal_point_px,
                                               std::span<const FitResult> starts = {},
                                               std::span<const std::vector<Eigen::Matrix2d>> covariances_px = {}) const;

    /// The same bits, written to `result`, whose memory is used again.
    void fit_frames(std::span<const LandmarkSet> frames, const Eigen::Vector2d& principal_point_px,
                    JointWorkspace& workspace, JointFramesResult& result, std::span<const FitResult> starts = {},
                    std::span<const std::vector<Eigen::Matrix2d>> covariances_px = {}) const;

    /// What one image says of the identity, its camera and expression integrated out, linearised at a fit of it.
    /// @param at           A result of `fit` or `fit_frames` for these landmarks, with a usable pose.
    /// @param num_earlier  Images of this person that the sum holds already: a landmark's bias is the same in all.
    /// @param covariances_px  Those given to the fit.
    /// @throws InvalidArgument as fit, and if `at` has no usable pose.
    [[nodiscard]] IdentityInformation identity_information(const LandmarkSet& landmarks, const JointFitResult& at,
                                                           int num_earlier = 0,
                                                           std::span<const Eigen::Matrix2d> covariances_px = {}) const;

    /// Names of the expressions that these landmarks tell next to nothing of at a fit of them, whichever fitter made
    /// it: as JointFitResult::unobservable_expressions. None without a usable pose.
    /// @throws InvalidArgument as fit, and if `at` has other numbers of coefficients.
    [[nodiscard]] std::vector<std::string> unobservable_expressions(const LandmarkSet& landmarks,
                                                                    const FitResult& at) const;

    [[nodiscard]] const MorphableModel& model() const { return base_.model(); }
    [[nodiscard]] const std::string& scheme() const { return base_.scheme(); }
    [[nodiscard]] const JointOptions& options() const { return options_; }
    [[nodiscard]] Eigen::Index num_shape_coefficients() const { return base_.num_shape_coefficients(); }

private:
    JointOptions options_;
    FaceFitter base_; ///< Landmark rows and outline, prepared.
    detail::JointPoints points_;
    detail::IdentityPrior prior_; ///< Where no images came earlier.
    const kernels::Kernels* kernels_;
};

/// Standard deviations (3 x V, mm, per coordinate, model space) of the neutral face under a covariance of its m or
/// fewer leading coefficients. The root mean square of the column norms is the predicted error of a vertex.
/// @throws InvalidArgument unless the covariance is square, finite and not larger than m x m.
[[nodiscard]] Eigen::Matrix3Xf vertex_standard_deviations(const MorphableModel& model,
                                                          const Eigen::MatrixXd& shape_covariance);

/// As above, of the fitted face with its expression.
/// @throws InvalidArgument if the result has no covariance or the model another number of coefficients.
[[nodiscard]] Eigen::Matrix3Xf vertex_standard_deviations(const MorphableModel& model, const JointFitResult& result);

/// The predicted error of the neutral face [mm]: root mean square, over the vertices, of the distance between the
/// fitted and the true one in model space, the head's size included, under a covariance of its m or fewer leading
/// coefficients.                                                                             docs/joint-fit.md, Eq.
/// (16)
/// @throws InvalidArgument as vertex_standard_deviations.
[[nodiscard]] double predicted_rms_mm(const MorphableModel& model, const Eigen::MatrixXd& shape_covariance);

} // namespace lineament

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/joint_fitter_impl.hpp"
#endif
