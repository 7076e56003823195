// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/joint_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_JOINT_SOLVER_HPP
#define LINEAMENT_FIT_JOINT_SOLVER_HPP

#include "lineament/fit/joint_problem.hpp"

#include <Eigen/Core>

#include <vector>

namespace lineament::detail {

/// The block of those rows and columns, ascending, of a lower triangle.
[[nodiscard]] Eigen::MatrixXd block_of(const Eigen::Ref<const Eigen::MatrixXd>& matrix,
                                       const std::vector<int>& indices);

/// Room for a step.
struct StepRoom
{
    RoomyMatrix<Eigen::VectorXd> free = {};   ///< The solution without bounds.
    RoomyMatrix<Eigen::VectorXd> solved = {}; ///< With those found to hold.
    std::vector<int> held = {};               ///< K, positions among the unknowns.
    std::vector<unsigned char> is_held = {};
    std::vector<double> bounds = {};
    RoomyMatrix<Eigen::MatrixXd> columns = {}; ///< C.
    RoomyMatrix<Eigen::MatrixXd> of_held = {}; ///< C_KK.
    RoomyMatrix<Eigen::VectorXd> pulls = {};   ///< C_KK^-1 (x_K - bounds).

    Eigen::VectorXd change = {}, gradient = {}; ///< Of informed_step.
};

/// The damped Gauss-Newton step within the system's room: what would leave it is held at its bound and the rest solved
/// again. With H x = b and C the columns of H^-1 that belong to the held ones K, the rest's solution is
/// x - C C_KK^-1 (x_K - bounds). Not a number where the matrix is not positive definite.
/// @param gradient  In place of the system's.
/// @param factor    Of the system's matrix with this damping.
void bounded_step(const JointSystem& system, const Eigen::VectorXd& gradient, PositiveFactor& factor, StepRoom& room,
                  Eigen::VectorXd& step);

struct StepTaken
{
    Eigen::VectorXd step = {};
    Eigen::VectorXd gradient = {}; ///< Before it.
};

/// The same with a kept matrix, which the gradient's change over the last step has set right along that (BFGS with one
/// pair; Nocedal, Updating quasi-Newton matrices with limited storage, 1980), unless that leaves the bounds.
void informed_step(const JointSystem& system, const StepTaken& last, PositiveFactor& factor, StepRoom& room,
                   Eigen::VectorXd& step);

/// Sets n_f of every image, half the derivative of log det Lambda by its log s: its share in the effective number of
/// shape coefficients that the landmarks determine.                                      docs/joint-fit.md, Eq. (14)
/// @param factor  Of the system's matrix.
void refresh_scale_strengths(JointProblem& problem, const JointState& state, JointSystem& system,
                             PositiveFactor& factor);

struct JointProgress
{
    bool has_settled = false;
    int iterations = 0;
    std::vector<EnergyStep> energies = {};
};

/// Kept from round to round, for its room and the matrix.
struct JointScratch
{
    explicit JointScratch(const kernels::Kernels* kernels) : factor(kernels) {}

    JointSystem system = {};
    PositiveFactor factor;
    std::vector<PlacedPoints> placed = {}, next_placed = {};
    JointState next = {};
    StepRoom step_room = {};
    Eigen::VectorXd step = {};
    StepTaken last = {};
    bool keeps_matrix = false; ///< The next step may take the system's matrix and its factor over.
};

struct RoundLimits
{
    int max_iterations = 1;
    double tolerance = 0.1;
    bool sets_scale_strengths = true; ///< At the first step, if its matrix is new.
    bool reweighs = false;            ///< Has rho' in place of h.
};

/// Lowers the energy of a round by Gauss-Newton steps, whose matrix is kept while the steps are short, has rho' in
/// place of h after one that does not lower it, and is damped after another, until what is left to go after a step is
/// `tolerance` posterior standard deviations long (step^T H step = -gradient^T step, times the rate at which that
/// falls), or the iterations are used up.
void minimize(JointProblem& problem, JointState& state, const RoundLimits& limits, int round, JointScratch& scratch,
              JointProgress& progress);

} // namespace lineament::detail

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/joint_solver_impl.hpp"
#endif

#endif
