// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_FIT_HPP
#define LINEAMENT_FIT_JOINT_FIT_HPP

#include "lineament/fit/joint_certainty_impl.hpp"
#include "lineament/fit/joint_image.hpp"
#include "lineament/fit/joint_solver.hpp"

#include <Eigen/Core>

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace lineament::detail {

/// The joint fit of images, from first poses to results, and the memory it works in: one fit after the other.
class JointFit
{
public:
    explicit JointFit(const kernels::Kernels* kernels) : scratch_(kernels), alone_(kernels) {}

    /// Another fit. What the arguments refer to must stay until its results are written.
    void begin(const JointContext& context, const IdentityPrior& prior);
    void add_image(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px, const FitResult* start,
                   std::span<const Eigen::Matrix2d> covariances_px);
    void run();

    /// The memory of `result` is used again.
    void write(JointFramesResult& result);
    /// Of the one image added.
    void write(JointFitResult& result);

    /// Of the one image added, linearised at a fit of it, without a prior.
    [[nodiscard]] IdentityInformation identity_information(const JointFitResult& at);

    /// k, of the one image added, at any fit of it: as JointFitResult::expression_deviations.
    [[nodiscard]] Eigen::VectorXd expression_deviations(const FitResult& at);

private:
    struct Image
    {
        const LandmarkSet* landmarks = nullptr;
        JointImageMatcher matcher = {};
        FitStatus status = FitStatus::success;
        std::string reason = {};
        Camera camera = {}; ///< Neutral where there is no usable pose.
    };

    [[nodiscard]] const FaceFitter& base() const { return context_->base; }
    [[nodiscard]] const JointOptions& options() const { return context_->options; }
    [[nodiscard]] Eigen::Index num_expressions() const
    {
        return base().landmark_points().num_expression_coefficients();
    }

    void estimate_pose(Image& image, const JointImage& fixed, const Eigen::VectorXd& psi);
    void set_bias_variances();
    /// Of the one image, linearised there.
    void set_system_at(const Camera& camera, const Eigen::VectorXd& alpha, const Eigen::VectorXd& psi,
                       double matched_scale, double scale_strength);
    void linearize();                              ///< At the state, with its points placed.
    void find_certainty();                         ///< At the state, where its points are placed.
    void set_certainty(JointFramesResult& result); ///< Of each frame.
    void match();
    [[nodiscard]] bool turn_by_depth(std::size_t used_index); ///< False where it stays.
    void fit_expression_of(std::size_t used_index, const Camera& camera, double own_scale, Eigen::VectorXd& psi);
    void set_unfitted(const Image& image, FitResult& result) const;
    void set_fit(std::size_t used_index, FitResult& result);
    void judge(JointFramesResult& result);
    void judge_image(std::size_t used_index, FitResult& fit) const;
    void withhold_unless_finite(JointFramesResult& result) const;

    std::optional<JointContext> context_ = std::nullopt;
    const IdentityPrior* prior_ = nullptr;
    std::vector<Image> images_ = {}; ///< The leading num_images_.
    std::size_t num_images_ = 0;
    JointProblem problem_ = {}; ///< Of the usable images only, in order.
    std::vector<std::size_t> used_ = {};
    JointState state_ = {}; ///< The minimum of the energy.
    JointState shown_ = {}; ///< The same as a result: cameras and expressions after the turn by depth, psi at scale s.
    std::vector<double> matched_scales_ = {};
    std::vector<unsigned char> is_turned_ = {}; ///< By depth.
    JointProgress progress_ = {};
    JointScratch scratch_;
    double total_us_ = 0.0;
    double contour_us_ = 0.0;

    // Kept for their room:
    PackedPoints::Products products_ = {};
    RoomyMatrix<Eigen::Matrix3Xd> points_ = {};
    Eigen::VectorXd weights_ = {};
    RoomyMatrix<Eigen::MatrixX2d> distances_ = {};
    RoomyMatrix<Eigen::MatrixX3d> unit_roots_ = {};
    std::vector<unsigned char> is_used_ = {};
    JointCertainty certainty_ = {};
    std::vector<int> face_ = {};
    std::string shared_reason_ = {};
    JointFramesResult result_ = {};

    /// For the expression of one image.
    struct Alone
    {
        explicit Alone(const kernels::Kernels* kernels) : scratch(kernels) {}

        IdentityPrior nothing = IdentityPrior(0); ///< Of the identity is unknown.
        JointProblem problem = {};
        JointState state = {};
        JointScratch scratch;
        JointProgress progress = {};
    };
    Alone alone_;
};

} // namespace lineament::detail

#endif
