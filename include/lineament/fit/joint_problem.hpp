// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_PROBLEM_HPP
#define LINEAMENT_FIT_JOINT_PROBLEM_HPP

#include "lineament/fit/pose.hpp"
#include "lineament/kernels/kernels.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <vector>

namespace lineament::detail {

/// A model point tied to a landmark.
struct JointPoint
{
    int landmark_index = 0;
    int bias_index = -1;                                ///< Position in the landmark map if it has a bias, or -1.
    int num_dimensions = 2;                             ///< 1 for a point on a re-matched outline.
    Eigen::Matrix2d root = Eigen::Matrix2d::Identity(); ///< U with W = U^T U [1/px].
};

/// By how much the scale may leave s_0 within a round, |log(s / s_0)|: the scale term alone would lower the energy of
/// landmarks that are no face by shrinking it without end.
inline constexpr double max_log_scale = 0.6931471805599453; // log 2

/// What of one image enters the energy. Constant within a round.
struct JointImage
{
    std::vector<JointPoint> used = {}; ///< One per point below.
    ModelPoints points = {};
    Eigen::Matrix2Xd image_points = {};
    double matched_scale = 1.0;  ///< s_0 [px/mm].
    double scale_strength = 0.0; ///< n_f.
};

/// The unknowns.
struct JointState
{
    Eigen::VectorXd alpha = {};
    double phi_per_mm = 0.0; ///< Of the shared unknown focal length, at the problem's reference scale.
    std::vector<Camera> cameras = {};
    std::vector<Eigen::VectorXd> psi = {}; ///< At scale s_0: times s_0 / s, those of a FitResult.
    Eigen::Matrix3Xd bias = {};            ///< 3 x L, mm at scale s_0, or empty.
};

/// Half the gradient of the energy and half its Gauss-Newton matrix, landmark biases eliminated. The unknowns are
/// [alpha | phi, where unknown | for each image: turn 3, log s, tau 2, psi].
struct JointSystem
{
    Eigen::MatrixXd hessian = {};  ///< K x K, symmetric.
    Eigen::VectorXd gradient = {}; ///< K.

    // Needed for the scale term and to recover the biases:
    std::vector<Eigen::MatrixXd> image_grams = {};     ///< J^T W J of each image's own unknowns, priors left out.
    std::vector<Eigen::MatrixXd> image_couplings = {}; ///< With the biases, each image's own part, x 3L.
    Eigen::MatrixXd bias_blocks = {};                  ///< 3 x 3L, the biases' own blocks, priors left out.
    Eigen::MatrixXd bias_coupling = {};                ///< K x 3L.
    Eigen::MatrixXd bias_inverse = {};                 ///< 3 x 3L, inverse blocks.
    Eigen::Matrix3Xd bias_gradient = {};               ///< 3 x L.
};

/// (a - mu)^T Lambda (a - mu); |a|^2 for the prior N(0, I).
[[nodiscard]] double prior_squares(const IdentityInformation& prior, const Eigen::VectorXd& alpha);

/// Energy (7) of a round, its derivatives and its moves.
class JointProblem
{
public:
    JointProblem(const JointOptions& options, const IdentityInformation& prior, Eigen::Index num_expressions)
        : options_(options), prior_(prior), num_expressions_(num_expressions)
    {}

    std::vector<JointImage> images = {};
    Eigen::Matrix3Xd bias_variances_mm = {};   ///< 3 x L, where there are biases, along x, y, z of model space [mm^2].
    double reference_scale = 1.0;              ///< phi of the shared focal length is that of an image of this scale.
    bool moves_expressions_only = false;       ///< Everything else is held.
    const kernels::Kernels* kernels = nullptr; ///< For J^T W J, in single precision; nullptr: in double precision.

    [[nodiscard]] Eigen::Index num_shape() const { return prior_.vector.size(); }
    [[nodiscard]] Eigen::Index num_shared() const { return num_shape() + has_phi(); }
    [[nodiscard]] Eigen::Index num_own() const { return 6 + num_expressions_; }
    [[nodiscard]] Eigen::Index num_unknowns() const
    {
        return num_shared() + num_own() * static_cast<Eigen::Index>(images.size());
    }
    [[nodiscard]] Eigen::Index own_begin(std::size_t image) const
    {
        return num_shared() + num_own() * static_cast<Eigen::Index>(image);
    }
    [[nodiscard]] bool is_camera(Eigen::Index unknown) const
    {
        return unknown >= num_shape() && (unknown < num_shared() || (unknown - num_shared()) % num_own() < 6);
    }

    /// Infinite where a point lies too near the camera's plane.
    [[nodiscard]] double energy(const JointState& state) const;

    /// Weighted squares of residuals and priors, without robust loss and scale term.
    [[nodiscard]] double chi_square(const JointState& state) const;

    [[nodiscard]] JointSystem linearize(const JointState& state) const;

    /// How far each unknown may go down and up.
    void room(const JointState& state, Eigen::VectorXd& down, Eigen::VectorXd& up) const;

    /// The state after a step within that room; biases follow by themselves, damped likewise.
    [[nodiscard]] JointState moved(const JointState& state, const JointSystem& system, const Eigen::VectorXd& step,
                                   double damping = 0.0) const;

    /// Weighted squared distance of a point from its landmark.
    [[nodiscard]] double squared_residual(std::size_t image, Eigen::Index point, const JointState& state,
                                          const Eigen::Matrix3Xd& shape) const;

    /// Model points of an image with expression and bias (3 x N).
    [[nodiscard]] Eigen::Matrix3Xd shape_of_points(std::size_t image, const JointState& state) const;

private:
    [[nodiscard]] bool has_phi() const { return options_.phi_sigma_per_mm.has_value(); }
    [[nodiscard]] double prior_energy(const JointState& state) const;
    [[nodiscard]] Eigen::MatrixXd gram_of(const Eigen::MatrixXd& rows) const;
    void add_image(std::size_t image, const JointState& state, JointSystem& system) const;
    void eliminate_biases(const JointState& state, JointSystem& system) const;

    const JointOptions& options_;
    const IdentityInformation& prior_;
    Eigen::Index num_expressions_;
};

} // namespace lineament::detail

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/joint_problem_impl.hpp"
#endif

#endif
