// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_FITTER_IMPL_HPP
#define LINEAMENT_FIT_JOINT_FITTER_IMPL_HPP

#include "lineament/fit/inline.hpp"
#include "lineament/fit/joint_fit_impl.hpp"
#include "lineament/fit/joint_result_impl.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace lineament {

LINEAMENT_FIT_INLINE void JointOptions::check() const
{
    const auto require_positive = [](double value, const char* member) {
        require(std::isfinite(value) && value > 0, "JointOptions", member, "a finite number > 0", to_text(value));
    };
    const auto require_not_negative = [](double value, const char* member) {
        require(std::isfinite(value) && value >= 0, "JointOptions", member, "a finite number >= 0", to_text(value));
    };
    require_positive(landmark_sigma_mm, "landmark_sigma_mm");
    require_positive(contour_sigma_mm, "contour_sigma_mm");
    require_not_negative(contour_along_sigma_mm, "contour_along_sigma_mm");
    for (const auto& [name, covariance] : covariances_mm) {
        detail::require_covariance(covariance, "JointOptions", "covariances_mm[\"" + name + "\"]");
    }
    require_not_negative(bias_sigma_mm, "bias_sigma_mm");
    require(std::isfinite(bias_depth_ratio) && bias_depth_ratio >= 1, "JointOptions", "bias_depth_ratio",
            "a finite number >= 1", to_text(bias_depth_ratio));
    require_positive(expression_sigma, "expression_sigma");
    require_positive(max_expression, "max_expression");
    require_positive(max_coefficient, "max_coefficient");
    require(contour_trim >= 0 && contour_trim < 1, "JointOptions", "contour_trim", "at least 0, less than 1",
            to_text(contour_trim));
    require_positive(phi_sigma_per_mm.value_or(1.0), "phi_sigma_per_mm");
    require(!focal_length_px || !phi_sigma_per_mm, "JointOptions", "phi_sigma_per_mm",
            "nothing where focal_length_px is known", to_text(phi_sigma_per_mm.value_or(0)));
    require(rounds >= 1, "JointOptions", "rounds", ">= 1", std::to_string(rounds));
    require(max_iterations >= 1, "JointOptions", "max_iterations", ">= 1", std::to_string(max_iterations));
    require_positive(tolerance, "tolerance");
}

namespace detail {

/// The options of the fitter that prepares landmark rows and outline; it checks those members too.
[[nodiscard]] inline FitOptions base_options(const JointOptions& options)
{
    options.check();
    FitOptions base;
    base.contour = options.contour;
    base.contour_matching = options.contour_matching;
    base.outline_beside_scheme = options.outline_beside_scheme;
    base.noise_detector = options.noise_detector;
    base.expression_set = options.expression_set;
    base.num_shape_coefficients = options.num_shape_coefficients;
    base.focal_length_px = options.focal_length_px;
    return base;
}

} // namespace detail

LINEAMENT_FIT_INLINE JointFitter::JointFitter(MorphableModel model, std::string scheme, JointOptions options,
                                              const kernels::Kernels* kernels)
    : options_(std::move(options)), base_(std::move(model), std::move(scheme), detail::base_options(options_)),
      points_(detail::joint_points(base_)), prior_(base_.num_shape_coefficients()), kernels_(kernels)
{}

LINEAMENT_FIT_INLINE JointWorkspace::JointWorkspace(const kernels::Kernels* kernels)
    : fit_(std::make_unique<detail::JointFit>(kernels)), fit_of_known_(std::make_unique<detail::JointFit>(kernels)),
      fit_of_frames_(std::make_unique<detail::JointFit>(kernels))
{}
LINEAMENT_FIT_INLINE JointWorkspace::JointWorkspace(JointWorkspace&&) noexcept = default;
LINEAMENT_FIT_INLINE JointWorkspace& JointWorkspace::operator=(JointWorkspace&&) noexcept = default;
LINEAMENT_FIT_INLINE JointWorkspace::~JointWorkspace() = default;

LINEAMENT_FIT_INLINE JointWorkspace JointFitter::make_workspace() const
{
    return JointWorkspace(kernels_);
}

LINEAMENT_FIT_INLINE void JointFitter::fit(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                                           JointWorkspace& workspace, JointFitResult& result, const FitResult* start,
                                           std::span<const Eigen::Matrix2d> covariances_px,
                                           const IdentityFilter* earlier) const
{
    std::optional<detail::IdentityPrior> of_earlier;
    if (earlier != nullptr) {
        require_size(earlier->state().vector.size(), num_shape_coefficients(), "JointFitter::fit", "earlier");
        of_earlier.emplace(earlier->state(), earlier->num_images());
    }
    detail::JointFit& fit = *workspace.fit_;
    fit.begin({base_, points_, options_, kernels_}, of_earlier ? *of_earlier : prior_);
    fit.add_image(landmarks, principal_point_px, start, covariances_px);
    fit.run();
    fit.write(result);
}

LINEAMENT_FIT_INLINE JointFitResult JointFitter::fit(const LandmarkSet& landmarks,
                                                     const Eigen::Vector2d& principal_point_px, const FitResult* start,
                                                     std::span<const Eigen::Matrix2d> covariances_px,
                                                     const IdentityFilter* earlier) const
{
    JointWorkspace workspace = make_workspace();
    JointFitResult result;
    fit(landmarks, principal_point_px, workspace, result, start, covariances_px, earlier);
    return result;
}

LINEAMENT_FIT_INLINE KnownIdentity JointFitter::freeze(const Eigen::VectorXd& shape_coefficients) const
{
    const char* const function = "JointFitter::freeze";
    require(shape_coefficients.size() <= num_shape_coefficients(), function, "shape_coefficients",
            "at most " + std::to_string(num_shape_coefficients()), std::to_string(shape_coefficients.size()));
    require_finite(shape_coefficients, function, "shape_coefficients");
    Eigen::VectorXd alpha = Eigen::VectorXd::Zero(num_shape_coefficients());
    alpha.head(shape_coefficients.size()) = shape_coefficients;
    detail::JointPoints points{points_.landmarks.of_person(alpha), points_.candidates.of_person(alpha)};
    return {std::move(alpha), std::move(points)};
}

LINEAMENT_FIT_INLINE void JointFitter::fit_pose_and_expression(const LandmarkSet& landmarks,
                                                               const Eigen::Vector2d& principal_point_px,
                                                               const KnownIdentity& identity, JointWorkspace& workspace,
                                                               JointFitResult& result, const FitResult* start,
                                                               std::span<const Eigen::Matrix2d> covariances_px) const
{
    const detail::IdentityPrior nothing_unknown(0);
    detail::JointFit& fit = *workspace.fit_of_known_;
    fit.begin({base_, identity.points_, options_, kernels_, &identity.shape_coefficients_}, nothing_unknown);
    fit.add_image(landmarks, principal_point_px, start, covariances_px);
    fit.run();
    fit.write(result);
}

LINEAMENT_FIT_INLINE JointFitResult JointFitter::fit_pose_and_expression(
    const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px, const Eigen::VectorXd& shape_coefficients,
    const FitResult* start, std::span<const Eigen::Matrix2d> covariances_px) const
{
    JointWorkspace workspace = make_workspace();
    JointFitResult result;
    fit_pose_and_expression(landmarks, principal_point_px, freeze(shape_coefficients), workspace, result, start,
                            covariances_px);
    return result;
}

LINEAMENT_FIT_INLINE void JointFitter::fit_frames(std::span<const LandmarkSet> frames,
                                                  const Eigen::Vector2d& principal_point_px, JointWorkspace& workspace,
                                                  JointFramesResult& result, std::span<const FitResult> starts,
                                                  std::span<const std::vector<Eigen::Matrix2d>> covariances_px) const
{
    require(starts.empty() || starts.size() == frames.size(), "JointFitter::fit_frames", "starts",
            "none, or one for each image", std::to_string(starts.size()));
    require(covariances_px.empty() || covariances_px.size() == frames.size(), "JointFitter::fit_frames",
            "covariances_px", "none, or those of each image", std::to_string(covariances_px.size()));
    detail::JointFit& fit = *workspace.fit_of_frames_;
    fit.begin({base_, points_, options_, kernels_}, prior_);
    for (std::size_t f = 0; f < frames.size(); ++f) {
        fit.add_image(frames[f], principal_point_px, starts.empty() ? nullptr : &starts[f],
                      covariances_px.empty() ? std::span<const Eigen::Matrix2d>() : covariances_px[f]);
    }
    fit.run();
    fit.write(result);
    const auto sure = std::find_if(result.frames.begin(), result.frames.end(),
                                   [](const JointFitResult& frame) { return frame.covariance.size() > 0; });
    if (sure != result.frames.end()) { // the same in all that have one
        result.shape_covariance = sure->covariance.topLeftCorner(num_shape_coefficients(), num_shape_coefficients());
    } else {
        result.shape_covariance.resize(0, 0);
    }
}

LINEAMENT_FIT_INLINE JointFramesResult JointFitter::fit_frames(
    std::span<const LandmarkSet> frames, const Eigen::Vector2d& principal_point_px, std::span<const FitResult> starts,
    std::span<const std::vector<Eigen::Matrix2d>> covariances_px) const
{
    JointWorkspace workspace = make_workspace();
    JointFramesResult result;
    fit_frames(frames, principal_point_px, workspace, result, starts, covariances_px);
    return result;
}

LINEAMENT_FIT_INLINE IdentityInformation
JointFitter::identity_information(const LandmarkSet& landmarks, const JointFitResult& at, int num_earlier,
                                  std::span<const Eigen::Matrix2d> covariances_px) const
{
    require(at.fit.degrees_of_freedom > 0, "JointFitter::identity_information", "at", "a fit with a usable pose",
            to_string(at.fit.status));
    require(num_earlier >= 0, "JointFitter::identity_information", "num_earlier", ">= 0", std::to_string(num_earlier));
    const Eigen::Index size = num_shape_coefficients();
    const detail::IdentityPrior nothing({Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)}, num_earlier);
    detail::JointFit fit(nullptr);
    fit.begin({base_, points_, options_}, nothing);
    fit.add_image(landmarks, at.fit.camera.principal_point_px, &at.fit, covariances_px);
    return fit.identity_information(at);
}

LINEAMENT_FIT_INLINE std::vector<std::string> JointFitter::unobservable_expressions(const LandmarkSet& landmarks,
                                                                                    const FitResult& at) const
{
    detail::JointFit fit(kernels_);
    fit.begin({base_, points_, options_, kernels_}, prior_);
    fit.add_image(landmarks, at.camera.principal_point_px, &at, {});
    const Blendshapes* expressions = base_.expressions();
    if (expressions == nullptr || at.status == FitStatus::degenerate ||
        at.status == FitStatus::too_few_correspondences) {
        return {};
    }
    std::vector<std::string> unobservable;
    detail::set_unobservable_names(fit.expression_deviations(at), expressions->names, options_.expression_sigma,
                                   unobservable);
    return unobservable;
}

namespace detail {

/// Square roots of the diagonal of B C B^T, for a row-stacked B (3V x n) and covariance C.
[[nodiscard]] inline Eigen::Matrix3Xf spread_over_vertices(const Eigen::MatrixXf& basis,
                                                           const Eigen::MatrixXd& covariance)
{
    const Eigen::MatrixXf product = basis * covariance.cast<float>();
    Eigen::Matrix3Xf spread(3, basis.rows() / 3);
    Eigen::Map<Eigen::VectorXf>(spread.data(), spread.size()) =
        product.cwiseProduct(basis).rowwise().sum().cwiseMax(0.0f).cwiseSqrt();
    return spread;
}

} // namespace detail

namespace detail {

/// The columns that the covariance is of [mm].
[[nodiscard]] inline Eigen::MatrixXf columns_of(const MorphableModel& model, const Eigen::MatrixXd& shape_covariance,
                                                const char* function)
{
    const Eigen::Index count = shape_covariance.rows();
    require(shape_covariance.cols() == count && count <= model.shape.num_coefficients(), function, "shape_covariance",
            "a square matrix of at most " + std::to_string(model.shape.num_coefficients()) + " rows",
            std::to_string(count) + " x " + std::to_string(shape_covariance.cols()));
    require_finite(shape_covariance, function, "shape_covariance");
    return model.shape.basis.leftCols(count) * model.shape.standard_deviations.head(count).asDiagonal();
}

} // namespace detail

LINEAMENT_FIT_INLINE Eigen::Matrix3Xf vertex_standard_deviations(const MorphableModel& model,
                                                                 const Eigen::MatrixXd& shape_covariance)
{
    const Eigen::MatrixXf basis = detail::columns_of(model, shape_covariance, "vertex_standard_deviations");
    return detail::spread_over_vertices(basis, shape_covariance);
}

LINEAMENT_FIT_INLINE double predicted_rms_mm(const MorphableModel& model, const Eigen::MatrixXd& shape_covariance)
{
    const Eigen::MatrixXf basis = detail::columns_of(model, shape_covariance, "predicted_rms_mm");
    Eigen::MatrixXf gram = Eigen::MatrixXf::Zero(basis.cols(), basis.cols());
    gram.selfadjointView<Eigen::Lower>().rankUpdate(basis.transpose());
    const Eigen::MatrixXd products = Eigen::MatrixXf(gram.selfadjointView<Eigen::Lower>()).cast<double>();
    const double trace = products.cwiseProduct(shape_covariance).sum(); // of B C B^T
    return std::sqrt(std::max(trace, 0.0) / static_cast<double>(model.num_vertices()));
}

LINEAMENT_FIT_INLINE Eigen::Matrix3Xf vertex_standard_deviations(const MorphableModel& model,
                                                                 const JointFitResult& result)
{
    const char* const function = "vertex_standard_deviations";
    const Eigen::Index num_shape = result.fit.shape_coefficients.size();
    const Eigen::Index num_expressions = result.fit.expression_coefficients.size();
    require(num_shape <= model.shape.num_coefficients(), function, "result.fit.shape_coefficients",
            "at most " + std::to_string(model.shape.num_coefficients()), std::to_string(num_shape));
    require(result.covariance.size() > 0, function, "result.covariance", "that of a fit with a usable pose", "none");
    require_size(result.covariance.rows(), num_shape + num_expressions, function, "result.covariance");
    require_size(result.covariance.cols(), num_shape + num_expressions, function, "result.covariance");
    require_finite(result.covariance, function, "result.covariance");
    Eigen::MatrixXf basis(model.shape.mean.size(), num_shape + num_expressions);
    basis.leftCols(num_shape) =
        model.shape.basis.leftCols(num_shape) * model.shape.standard_deviations.head(num_shape).asDiagonal();
    if (num_expressions > 0) {
        const Blendshapes* set = model.find_expression_set(result.fit.expression_set);
        require(set != nullptr && set->num_coefficients() == num_expressions, function, "result.fit.expression_set",
                "one of the model's expression sets", "\"" + result.fit.expression_set + "\"");
        basis.rightCols(num_expressions) = set->offsets;
    }
    return detail::spread_over_vertices(basis, result.covariance);
}

} // namespace lineament

#endif
