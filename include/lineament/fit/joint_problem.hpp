// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_PROBLEM_HPP
#define LINEAMENT_FIT_JOINT_PROBLEM_HPP

#include "lineament/fit/packed_points_impl.hpp"
#include "lineament/fit/pose.hpp"
#include "lineament/fit/positive_factor_impl.hpp"
#include "lineament/kernels/kernels.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

namespace lineament::detail {

/// A model point tied to a landmark.
struct JointPoint
{
    int landmark_index = 0;
    int bias_index = -1;    ///< Position in the landmark map if it has a bias, or -1.
    int num_dimensions = 2; ///< 1 for a point on a re-matched outline.
};

/// What of one image enters the energy. Constant within a round.
struct JointImage
{
    std::vector<JointPoint> used = {};            ///< One per point below.
    RoomyMatrix<Eigen::VectorXd> dimensions = {}; ///< N, theirs once more.
    std::vector<int> map_indices = {}; ///< Positions in the landmark map of those tied to it, which come first.
    PackedPoints points = {};
    Eigen::Matrix2Xd image_points = {};       ///< 2 x N, and perhaps room for more.
    RoomyMatrix<Eigen::MatrixX3d> roots = {}; ///< N x 3, U00, U01, U11 of the upper triangular U with W = U^T U [1/px].
    double matched_scale = 1.0;               ///< s_0 [px/mm].
    double scale_strength = 0.0;              ///< n_f.
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

/// The model points of an image at a state, and how far from their landmarks they are seen.
struct PlacedPoints
{
    RoomyMatrix<Eigen::Matrix3Xd> offsets = {};   ///< What expression and bias add [mm].
    RoomyMatrix<Eigen::Matrix3Xd> points = {};    ///< With them [mm].
    RoomyMatrix<Eigen::MatrixX2d> residuals = {}; ///< N x 2, U (seen - landmark).
    RoomyMatrix<Eigen::Matrix3Xd> shape = {};     ///< Mean and identity alone [mm], and perhaps room for more.
    Eigen::Index num_shaped = 0; ///< Leading points whose shape is that of the state they are placed at next.

    [[nodiscard]] double squared_residual(Eigen::Index i) const { return residuals.row(i).squaredNorm(); }

    AlignedBuffer<double> padded = {}; ///< Kept for its room.
};

/// What the points of an image say of the unknowns that move them, times the roots of their weights and curvatures.
struct PointTerms
{
    /// N x 20: derivatives by the model point (2 x 3), by turn, log s, tau (2 x 6), both row by row, by the shared phi.
    RoomyMatrix<Eigen::Matrix<double, Eigen::Dynamic, 20>> derivatives = {};
    RoomyMatrix<Eigen::MatrixX2d> residuals = {};

    RoomyMatrix<Eigen::VectorXd> root_curvatures = {}; ///< Kept for its room.

    [[nodiscard]] Eigen::Matrix<double, 2, 3> by_point(Eigen::Index i) const
    {
        Eigen::Matrix<double, 2, 3> by_point;
        by_point << derivatives.block<1, 3>(i, 0), derivatives.block<1, 3>(i, 3);
        return by_point;
    }
    [[nodiscard]] Eigen::Matrix<double, 2, 6> by_camera(Eigen::Index i) const
    {
        Eigen::Matrix<double, 2, 6> by_camera;
        by_camera << derivatives.block<1, 6>(i, 6), derivatives.block<1, 6>(i, 12);
        return by_camera;
    }
    [[nodiscard]] Eigen::Vector2d by_phi(Eigen::Index i) const { return derivatives.row(i).tail<2>().transpose(); }
};

/// Half the gradient of the energy and half its Gauss-Newton matrix, landmark biases eliminated. The unknowns are
/// [alpha | phi, where unknown | for each image: psi, turn 3, log s, tau 2].
struct JointSystem
{
    std::vector<int> unknowns = {};            ///< Those that the matrix is of, n of K, ascending.
    RoomyMatrix<Eigen::MatrixXd> hessian = {}; ///< n x n, lower triangle.
    ArrowMatrix arrow = {};                    ///< The same with the biases, hidden, where the problem is_arrow().
    UpperTriangle upper = {};                  ///< The same, where it is not.
    bool has_hessian = false;                  ///< Or by kernels the arrow or the upper triangle alone.
    Eigen::VectorXd gradient = {};             ///< K.
    Eigen::VectorXd down = {}; ///< K, how far each unknown may go; of the state that the gradient is of.
    Eigen::VectorXd up = {};

    RoomyMatrix<Eigen::Matrix3Xd> pulls_as_first = {}; ///< J^T W r of points that the first image has, of the others.

    // Needed for the scale term and to recover the biases:
    Eigen::MatrixXd bias_coupling = {};      ///< K x 3L; by kernels the coupling rows instead.
    Eigen::MatrixXd bias_blocks = {};        ///< 3 x 3L, the biases' own.
    Eigen::MatrixXd bias_inverse = {};       ///< 3 x 3L, their inverses.
    Eigen::Matrix3Xd bias_gradient = {};     ///< 3 x L.
    AlignedBuffer<float> coupling_rows = {}; ///< Three for each bias that has points, all of its columns.
    std::vector<int> rows_of_biases = {};    ///< L, where among these its three are, in threes, or -1.
    int num_coupling_rows = 0;
    Eigen::MatrixXd bias_points = {};      ///< 3 x 3L, J^T W J of the biases' model points.
    Eigen::MatrixXd bias_with_points = {}; ///< 3 x 3L, of the biases with these.

    // Kept for their room:
    std::vector<PointTerms> terms = {}; ///< Of each image.
    std::vector<int> free = {};
    UpperTriangle with_held = {};
    AlignedBuffer<float> rows = {}, expression_rows = {}, gram = {}, shape_gram = {};
    AlignedBuffer<double> factors = {}, sums = {};
    std::vector<int> targets = {};
};

/// A round may change a scale by this factor at most: where no face explains the landmarks the energy has no minimum
/// and falls with the scale, without end. Of 10^4 faces the last round changed none by more than a tenth.
inline constexpr double max_scale_change = 2.0;

[[nodiscard]] inline double inverse_square(double value)
{
    return 1 / (value * value);
}

/// U (seen - landmark) of points, N x 2.
/// @param kernels       May be nullptr.
/// @param image_points  The landmarks, 2 x N or more.
/// @param roots         Of U, as JointImage has them.
void set_residuals(const kernels::Kernels* kernels, const Camera& camera, const RoomyMatrix<Eigen::Matrix3Xd>& points,
                   const Eigen::Matrix2Xd& image_points, const RoomyMatrix<Eigen::MatrixX3d>& roots,
                   RoomyMatrix<Eigen::MatrixX2d>& residuals);

/// Energy (7) of a round, its derivatives and its moves.
class JointProblem
{
public:
    JointProblem() = default;
    JointProblem(const JointOptions& options, const IdentityPrior& prior, Eigen::Index num_expressions)
    {
        begin(options, prior, num_expressions);
    }

    /// Another problem in the same memory; the images are to follow.
    void begin(const JointOptions& options, const IdentityPrior& prior, Eigen::Index num_expressions)
    {
        options_ = &options;
        prior_ = &prior;
        num_expressions_ = num_expressions;
        bias_variances_mm.resize(3, 0);
        reference_scale = 1.0;
        reweighs = false;
    }

    std::vector<JointImage> images = {};
    Eigen::Matrix3Xd bias_variances_mm = {}; ///< 3 x L, where there are biases, along x, y, z of model space [mm^2].
    double reference_scale = 1.0;            ///< phi of the shared focal length is that of an image of this scale.
    bool holds_cameras = false;              ///< They are known.
    /// rho' stands for h. As rho is concave, the parabola of this matrix is nowhere below the energy of linear
    /// residuals: a step lowers it from however far.
    bool reweighs = false;
    /// For residuals and derivatives of points, products with the model's rows, and, in single precision, J^T W J and
    /// what biases take off it; nullptr: by Eigen in double precision. The model's rows are in single precision.
    const kernels::Kernels* kernels = nullptr;

    [[nodiscard]] Eigen::Index num_shape() const { return prior_->vector.size(); }
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
    [[nodiscard]] Eigen::Index camera_begin(std::size_t image) const { return own_begin(image) + num_expressions_; }
    [[nodiscard]] bool is_camera(Eigen::Index unknown) const
    {
        return unknown >= num_shape() &&
               (unknown < num_shared() || (unknown - num_shared()) % num_own() >= num_expressions_);
    }

    /// The points of every image.
    void place(const JointState& state, std::vector<PlacedPoints>& placed) const;

    /// Infinite where a point lies too near the camera's plane.
    [[nodiscard]] double energy(const JointState& state, const std::vector<PlacedPoints>& placed) const;

    /// Weighted squares of residuals and priors, without robust loss and scale term.
    [[nodiscard]] double chi_square(const JointState& state, const std::vector<PlacedPoints>& placed) const;

    /// With the matrix of all unknowns, by kernels as an arrow, where it is_arrow().
    void linearize(const JointState& state, const std::vector<PlacedPoints>& placed, JointSystem& system) const;

    /// The unknowns that a step may move: those with room, unless at a bound that the energy pushes them against. Sets
    /// the system's room.
    void find_free_unknowns(const JointState& state, JointSystem& system, std::vector<int>& free) const;

    /// With the matrix of those, by kernels as an arrow or an upper triangle.
    void linearize_free(const JointState& state, const std::vector<PlacedPoints>& placed, JointSystem& system) const;

    /// Of several images or with biases, by kernels.
    [[nodiscard]] bool is_arrow() const
    {
        return kernels != nullptr && (images.size() > 1 || bias_variances_mm.size() > 0);
    }

    /// Sets the system's matrix if there is only what kernels left; that of a single image anew, in double precision.
    /// @param state  That of the system.
    void complete_hessian(const JointState& state, JointSystem& system) const;

    /// The gradient alone anew; what has been eliminated with the biases stays. False where unknowns are free that the
    /// matrix is not of.
    [[nodiscard]] bool renew_gradient(const JointState& state, const std::vector<PlacedPoints>& placed,
                                      JointSystem& system) const;

    /// (a - mu)^T Lambda (a - mu).
    [[nodiscard]] double prior_squares(const Eigen::VectorXd& alpha) const;

    [[nodiscard]] bool has_standard_prior() const { return prior_->matrix.size() == 0; } ///< Its matrix is 1.

    /// The prior's matrix of some of alpha; empty where it is 1.
    [[nodiscard]] Eigen::MatrixXd prior_of(const std::vector<int>& coefficients) const;

    /// Unknowns of the system's matrix that move an image, as positions in [shared | own].
    [[nodiscard]] std::vector<int> unknowns_of_image(std::size_t image, const std::vector<int>& unknowns) const;

    /// n_f of every image, where there are several or biases.
    /// @param linear   The system's unknowns without cameras.
    /// @param columns  Those of alpha, of the inverse of these unknowns' block.
    /// @param hidden   Their rows of the biases of the system's arrow, where they are known.
    [[nodiscard]] std::vector<double> scale_strengths(const JointState& state, const std::vector<int>& linear,
                                                      const Eigen::MatrixXd& columns, const Eigen::MatrixXd& hidden,
                                                      JointSystem& system) const;

    /// How far each unknown may go down and up.
    void room(const JointState& state, Eigen::VectorXd& down, Eigen::VectorXd& up) const;

    /// The state after a step within that room; biases follow by themselves, damped likewise.
    void move(const JointState& state, const JointSystem& system, const Eigen::VectorXd& step, double damping,
              JointState& moved) const;

private:
    [[nodiscard]] bool has_phi() const { return options_->phi_sigma_per_mm.has_value(); }
    [[nodiscard]] double prior_energy(const JointState& state) const;
    /// The prior's matrix has this on its diagonal, of an unknown other than alpha.
    [[nodiscard]] double prior_of_other(Eigen::Index unknown) const
    {
        if (unknown < num_shared()) {
            return inverse_square(*options_->phi_sigma_per_mm);
        }
        return is_camera(unknown) ? 0.0 : inverse_square(options_->expression_sigma);
    }
    /// How many of an image's points, tied to the landmark map, begin as the first image's do; of the first itself
    /// none.
    [[nodiscard]] Eigen::Index num_as_first(std::size_t image) const
    {
        const std::vector<int>&tied = images[image].map_indices, &first = images.front().map_indices;
        return image > 0 ? std::mismatch(tied.begin(), tied.end(), first.begin(), first.end()).first - tied.begin() : 0;
    }
    /// @param first  The points of the first image, placed already where the image is another.
    void place_image(std::size_t image, const JointState& state, const PlacedPoints& first, PlacedPoints& placed) const;
    [[nodiscard]] double own_scale(std::size_t image, const JointState& state) const
    {
        return images[image].matched_scale / state.cameras[image].scale_px_per_mm;
    }
    void set_terms(std::size_t image, const JointState& state, const PlacedPoints& placed, PointTerms& terms) const;
    void set_gradient(const JointState& state, const std::vector<PlacedPoints>& placed, JointSystem& system) const;
    void add_gradient(std::size_t image, const JointState& state, JointSystem& system) const;
    void set_couplings(const JointState& state, JointSystem& system) const;
    void set_rows_of_biases(Eigen::Index num_biases, JointSystem& system) const;
    void add_coupling_of_image(std::size_t image, double own_scale, JointSystem& system) const;
    void add_coupling_rows_of_image(std::size_t image, double own_scale, JointSystem& system) const;
    template <typename MatrixOf>
    void add_turned_points_of_biases(MatrixOf matrix_of, float* rows, int width, JointSystem& system) const;
    /// Of coupling rows: [shared | own of each image], each part filled up.
    [[nodiscard]] int coupling_column(Eigen::Index unknown) const
    {
        const int shared = static_cast<int>(num_shared()), own = static_cast<int>(num_own());
        const int in_own = static_cast<int>(unknown) - shared;
        return in_own < 0 ? static_cast<int>(unknown)
                          : kernels::round_up(shared, kernels::width_step) +
                                in_own / own * kernels::round_up(own, kernels::width_step) + in_own % own;
    }
    [[nodiscard]] int coupling_width() const { return coupling_column(num_unknowns()); }
    [[nodiscard]] std::vector<double> scale_strengths_of_grams(const JointState& state, const std::vector<int>& linear,
                                                               const Eigen::MatrixXd& columns,
                                                               const Eigen::MatrixXd& spread,
                                                               JointSystem& system) const;
    [[nodiscard]] std::vector<double> scale_strengths_of_arrow(const JointState& state, const std::vector<int>& linear,
                                                               const Eigen::MatrixXd& columns,
                                                               const Eigen::MatrixXd& spread,
                                                               JointSystem& system) const;
    /// The covariance of where alpha moves the points that have a bias, with that and with the bias; not a number where
    /// there is no point.
    struct SpreadOfPoints
    {
        Eigen::Matrix3Xd by_alpha = {}; ///< 3 x 3L.
        Eigen::Matrix3Xd by_bias = {};  ///< 3 x 3L.
    };
    [[nodiscard]] SpreadOfPoints spread_of_points(const float* of_alpha, const Eigen::MatrixXd& spread,
                                                  JointSystem& system) const;
    [[nodiscard]] double product_with_gram(const JointImage& image, const PointTerms& terms, Eigen::Index begin,
                                           const float* factors, JointSystem& system) const;
    [[nodiscard]] Eigen::MatrixXd bias_spread(const std::vector<int>& linear, const Eigen::MatrixXd& columns,
                                              const Eigen::MatrixXd& hidden, JointSystem& system) const;
    [[nodiscard]] Eigen::Matrix3Xd bias_pulls(const JointSystem& system, const Eigen::VectorXd& step) const;
    void eliminate_bias_gradient(JointSystem& system) const;
    void set_hessian(const JointState& state, JointSystem& system, bool is_by_kernels) const;
    void eliminate_bias_hessian(JointSystem& system) const;
    void set_gram(std::size_t image, double own_scale, const std::vector<int>& unknowns, const JointSystem& system,
                  RoomyMatrix<Eigen::MatrixXd>& gram) const;
    void set_upper_gram(std::size_t image, double own_scale, std::span<const int> unknowns, JointSystem& system,
                        UpperTriangle& gram) const;
    float* set_rows(std::size_t image, double own_scale, std::span<const int> others, int alpha_begin, int others_begin,
                    int width, JointSystem& system) const;
    void set_upper(const JointState& state, JointSystem& system) const;
    void set_arrow(const JointState& state, JointSystem& system) const;
    void complete_hessian_of_arrow(JointSystem& system) const;
    void set_arrow_of_biases(JointSystem& system) const;
    void set_less_biases(JointSystem& system) const;
    void add_shape_gram_of_biases(JointSystem& system, float* gram) const;
    void set_rows_of_point(std::size_t image, Eigen::Index point, const PointTerms& terms, double own_scale,
                           Eigen::MatrixX2d& rows) const;

    const JointOptions* options_ = nullptr;
    const IdentityPrior* prior_ = nullptr;
    Eigen::Index num_expressions_ = 0;
};

} // namespace lineament::detail

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/joint_problem_impl.hpp"
#endif

#endif
