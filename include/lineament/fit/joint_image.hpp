// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_IMAGE_HPP
#define LINEAMENT_FIT_JOINT_IMAGE_HPP

#include "lineament/fit/joint_problem.hpp"
#include "lineament/fit/landmark_use_impl.hpp"

#include <Eigen/Core>

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace lineament::detail {

/// An outline landmark, and where the model's outline comes nearest to it.
struct OutlineMatch
{
    int landmark_index = 0;
    bool is_silhouette = false; ///< Matched to a silhouette's vertex, not to the candidates.
    int position = 0; ///< Of that vertex, or of a candidate; the point lies at `fraction` from it to the next.
    double fraction = 0.0;
    Eigen::Vector2d normal = Eigen::Vector2d::Zero(); ///< Of the projected outline, unit; zero where it has none.
    double distance_px = 0.0;                         ///< Across the outline.
};

/// Projected points from ear to chin, two or more, and the segments between them.
class Polyline
{
public:
    /// @param projected  2 x N.
    void set_points(const Eigen::Ref<const Eigen::Matrix2Xd>& projected);

    /// For each landmark the first of the segments nearest to it.
    /// @param u, v  A multiple of 8 of each.
    void find_nearest(const kernels::Kernels& kernels, const AlignedBuffer<double>& u, const AlignedBuffer<double>& v,
                      std::vector<int>& segments) const;

    /// The point of a segment that is nearest to the landmark.
    [[nodiscard]] OutlineMatch match(int segment, const Eigen::Vector2d& landmark) const;

private:
    RoomyMatrix<Eigen::Matrix2Xd> points_ = {};
    RoomyMatrix<Eigen::Matrix<double, Eigen::Dynamic, 5>> segments_ = {}; ///< As kernels have them.
};

/// The silhouette vertex nearest to the landmark, within `max_distance_px`, and the direction of the silhouette around
/// it.
[[nodiscard]] std::optional<OutlineMatch> match_silhouette(const Eigen::Matrix2Xd& projected,
                                                           const Eigen::Vector2d& landmark, double radius_px,
                                                           double max_distance_px);

/// The landmark points and outline candidates of a fitter's model.
[[nodiscard]] JointPoints joint_points(const FaceFitter& base);

/// What the fits of a JointFitter have in common.
struct JointContext
{
    const FaceFitter& base;
    const JointPoints& points;
    const JointOptions& options;
    const kernels::Kernels* kernels = nullptr;
    /// All coefficients, where the points are those of one person and none of them is unknown.
    const Eigen::VectorXd* known_identity = nullptr;

    [[nodiscard]] const Eigen::VectorXd& identity(const Eigen::VectorXd& alpha) const
    {
        return known_identity != nullptr ? *known_identity : alpha;
    }
};

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
/// @param stated  FaceFitter::landmark_noise_mm.
[[nodiscard]] Eigen::Vector3d bias_variances_mm(const JointOptions& options, const Eigen::VectorXf* stated,
                                                int map_index);

/// Ties the landmarks of one image to model points, round by round, and gives them their weights.
class JointImageMatcher
{
public:
    /// Another image in the same memory. What the arguments refer to must stay.
    /// @throws InvalidArgument on landmarks or covariances that cannot be used.
    void begin(const JointContext& context, const LandmarkSet& landmarks,
               std::span<const Eigen::Matrix2d> covariances_px);

    [[nodiscard]] const std::vector<int>& map_indices() const { return use_.map_indices; }

    /// Points of set_fixed_points, which stay.
    [[nodiscard]] Eigen::Index num_fixed() const { return static_cast<Eigen::Index>(use_.fixed.size()); }

    /// Points of landmarks tied to their map point alone, weights 1: for the first pose.
    void set_fixed_points(JointImage& image) const;

    /// Gives the points of set_fixed_points their weights and has those of the outline follow, for a camera and shape;
    /// `noise` says how mm become px and what images have in common.
    void match(const Camera& camera, const Eigen::VectorXd& alpha, const Eigen::VectorXd& psi,
               const NoiseSharing& noise, JointImage& image);

    /// Of those points, for the first pose: confidence over the variance stated for the landmark, by the caller or by
    /// the landmark map, or else the options' variance of an inner one; the largest is 1.
    void set_start_weights(Eigen::VectorXd& weights) const;

    /// What the last match found, or a start says.
    [[nodiscard]] ContourView view() const { return view_; }
    void set_view(ContourView view) { view_ = view; }

private:
    void set_outline();
    void match_outline(const Camera& camera, const Eigen::VectorXd& alpha, const Eigen::VectorXd& psi);
    void match_candidates(FaceSide side, const Camera& camera);
    void match_silhouette_of(FaceSide side, const Camera& camera);
    void trim_matches();
    void set_point_of_match(const OutlineMatch& match, Eigen::Index to, PackedPoints& points);
    /// The noise of a landmark and, where that counts as noise, its bias: those stated for it, or the default.
    [[nodiscard]] Eigen::Matrix2d covariance_px(int landmark_index, double default_variance_mm,
                                                const Eigen::Vector3d& bias_variances, const Camera& camera,
                                                const NoiseSharing& noise, bool has_bias) const;
    [[nodiscard]] const FaceFitter& base() const { return context_->base; }
    [[nodiscard]] const JointOptions& options() const { return context_->options; }
    [[nodiscard]] const Landmark& landmark(int index) const
    {
        return landmarks_->landmarks[static_cast<std::size_t>(index)];
    }

    std::optional<JointContext> context_ = std::nullopt;
    const LandmarkSet* landmarks_ = nullptr;
    std::span<const Eigen::Matrix2d> covariances_px_ = {};
    LandmarkUse use_ = {};
    /// Those of one side.
    struct OutlineLandmarks
    {
        std::vector<int> indices = {};
        AlignedBuffer<double> u = {}, v = {};
    };
    std::array<OutlineLandmarks, 2> outline_ = {}; ///< By FaceSide.
    ContourView view_ = ContourView::frontal;

    // Of the last match:
    std::vector<OutlineMatch> matches_ = {};
    std::vector<int> silhouette_vertices_ = {};

    // Kept for their room:
    PackedPoints::Products products_ = {};
    RoomyMatrix<Eigen::Matrix3Xd> candidates_ = {};
    RoomyMatrix<Eigen::Matrix2Xd> projected_ = {};
    Polyline line_ = {};
    std::vector<int> segments_ = {};
    Eigen::Matrix3Xf shape_vertices_ = {};
};

/// With them residuals are distances [px].
inline void set_unit_roots(Eigen::Index num_points, RoomyMatrix<Eigen::MatrixX3d>& roots)
{
    roots.resize(num_points, 3);
    roots.col(0).setOnes();
    roots.col(1).setZero();
    roots.col(2).setOnes();
}

/// @throws InvalidArgument unless symmetric, finite and positive definite.
void require_covariance(const Eigen::Matrix2d& covariance, const char* function, const std::string& place);

} // namespace lineament::detail

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/joint_image_impl.hpp"
#endif

#endif
