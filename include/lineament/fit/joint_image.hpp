// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_IMAGE_HPP
#define LINEAMENT_FIT_JOINT_IMAGE_HPP

#include "lineament/fit/joint_problem.hpp"
#include "lineament/fit/landmark_use_impl.hpp"

#include <Eigen/Core>

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace lineament::detail {

/// An outline landmark, and where the model's outline comes nearest to it.
struct OutlineMatch
{
    int landmark_index = 0;
    int vertex = 0;
    int next_vertex = 0; ///< The point lies at `fraction` from vertex to next_vertex.
    double fraction = 0.0;
    Eigen::Vector2d normal = Eigen::Vector2d::Zero(); ///< Of the projected outline, unit; zero where it has none.
    double distance_px = 0.0;                         ///< Across the outline.
};

/// The nearest point of the projected polyline of candidates, ear to chin.
[[nodiscard]] OutlineMatch match_polyline(const std::vector<int>& vertices, const Eigen::Matrix2Xd& projected,
                                          const Eigen::Vector2d& landmark);

/// The nearest silhouette vertex within `max_distance_px`, and the direction of the silhouette around it.
[[nodiscard]] std::optional<OutlineMatch> match_silhouette(const std::vector<int>& vertices,
                                                           const Eigen::Matrix2Xd& projected,
                                                           const Eigen::Vector2d& landmark, double radius_px,
                                                           double max_distance_px);

/// What turns the options' noise into that of one image.
struct NoiseSharing
{
    double scale_px_per_mm = 1.0; ///< s_0.
    int num_images = 1;           ///< Fitted together.
    int num_before = 0;           ///< Images of the same person in the prior.
    bool has_bias = false;        ///< Points tied to their map point have a bias among the unknowns.
};

/// The variances [mm^2], along the axes of model space, of the bias of a landmark of the map: the options', or its
/// share in the noise the map states.
[[nodiscard]] Eigen::Vector3d bias_variances_mm(const FaceFitter& base, const JointOptions& options, int map_index);

/// Ties the landmarks of one image to model points, round by round, and gives them their weights.
class JointImageMatcher
{
public:
    JointImageMatcher(const FaceFitter& base, const JointPoints& points, const JointOptions& options,
                      const kernels::Kernels* kernels, const LandmarkSet& landmarks,
                      std::span<const Eigen::Matrix2d> covariances_px);

    [[nodiscard]] const std::vector<int>& map_indices() const { return use_.map_indices; }

    /// Points of landmarks tied to their map point alone, weights 1: for the first pose.
    [[nodiscard]] JointImage fixed_image() const;

    /// Gives the points of fixed_image() their weights and has those of the outline follow, for a camera and shape;
    /// `noise` says how mm become px and what images have in common.
    void match(const Camera& camera, const Eigen::VectorXd& alpha, const Eigen::VectorXd& psi,
               const NoiseSharing& noise, JointImage& image);

    /// Of those points, for the first pose: confidence over the variance stated for the landmark, by the caller or by
    /// the landmark map, or else the options' variance of an inner one; empty where all weigh the same.
    [[nodiscard]] Eigen::VectorXd start_weights() const;

    /// What the last match found, or a start says.
    [[nodiscard]] ContourView view() const { return view_; }
    void set_view(ContourView view) { view_ = view; }

private:
    [[nodiscard]] std::vector<OutlineMatch> match_outline(const Camera& camera, const Eigen::VectorXd& alpha,
                                                          const Eigen::VectorXd& psi);
    /// The noise of a landmark and, where that counts as noise, its bias: those stated for it, or the default.
    [[nodiscard]] Eigen::Matrix2d covariance_px(int landmark_index, double default_variance_mm,
                                                const Eigen::Vector3d& bias_variances, const Camera& camera,
                                                const NoiseSharing& noise, bool has_bias) const;
    const FaceFitter& base_;
    const JointPoints& points_;
    const JointOptions& options_;
    const kernels::Kernels* kernels_;
    const LandmarkSet& landmarks_;
    std::span<const Eigen::Matrix2d> covariances_px_;
    LandmarkUse use_ = {};
    std::vector<FaceSide> outline_sides_ = {}; ///< Of use_.outline.
    ContourView view_ = ContourView::frontal;
    Eigen::Matrix3Xf shape_vertices_ = {};
};

/// @throws InvalidArgument unless symmetric, finite and positive definite.
void require_covariance(const Eigen::Matrix2d& covariance, const char* function, const std::string& place);

} // namespace lineament::detail

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/joint_image_impl.hpp"
#endif

#endif
