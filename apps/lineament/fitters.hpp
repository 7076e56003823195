// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "model_options.hpp"

#include "lineament/core/landmarks.hpp"
#include "lineament/fit/fit_result.hpp"

#include <Eigen/Core>

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace lineament::cli {

/// A fitted face and what the method says of its uncertainty.
struct Fitted
{
    FitResult result = {};
    Eigen::VectorXd shape_standard_deviations = {};         ///< m, posterior; empty: the method does not know.
    Eigen::MatrixXd shape_covariance = {};                  ///< m x m, likewise.
    std::vector<std::string> unobservable_expressions = {}; ///< Those the landmarks hardly tell anything of.
    std::optional<double> predicted_rms_mm = {};            ///< Of the neutral face's vertices; empty: not known.
    Eigen::VectorXd expression_standard_deviations = {};    ///< k, as shape_standard_deviations.
};

/// The solvers of one model as the user chose them, one for each landmark scheme that turns up, made when it does.
/// Only this class includes them: they take long to compile.
class Fitters
{
public:
    /// @param model  Must outlive this.
    /// @throws Failure(wrong_use) for options that the method does not have.
    Fitters(const MorphableModel& model, const ModelOptions& options);
    ~Fitters();

    /// The landmarks in a scheme of the model: as they are, or MediaPipe's as the 52 of ibug68 that have a counterpart.
    /// @throws Failure(bad_input) if the model knows neither.
    [[nodiscard]] LandmarkSet in_scheme_of_model(LandmarkSet landmarks) const;

    /// @param covariances_px  As JointFitter::fit takes them; the thesis's method does not.
    [[nodiscard]] Fitted fit(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                             std::span<const Eigen::Matrix2d> covariances_px = {});

    /// One person in several pictures, one identity; pose and expression of each picture.
    /// @param principal_points_px  One for each picture.
    /// @param covariances_px       Likewise, each as above.
    [[nodiscard]] std::vector<Fitted> fit_same_person(std::vector<LandmarkSet> pictures,
                                                      const std::vector<Eigen::Vector2d>& principal_points_px,
                                                      std::span<const std::vector<Eigen::Matrix2d>> covariances_px);

    /// How sure the place of each vertex of the neutral face is (V, mm): the root of the summed variances of its three
    /// coordinates, in model space, the head's size included.
    [[nodiscard]] Eigen::VectorXf vertex_deviations_mm(const Eigen::MatrixXd& shape_covariance) const;

    /// One of many frames by itself; by the thesis's method whichever is chosen, in real time where the camera allows
    /// it.
    [[nodiscard]] FitResult fit_frame(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px);

    /// Pose and expression of one of many frames, of a person whose identity is known.
    /// @param start  The result of the frame before, or nullptr.
    [[nodiscard]] FitResult fit_pose_and_expression(const LandmarkSet& landmarks,
                                                    const Eigen::Vector2d& principal_point_px,
                                                    const Eigen::VectorXd& shape_coefficients, const FitResult* start);

    /// The shape coefficients of one person seen in several frames of a video. An unknown focal length that is to be
    /// fitted is known from then on.
    [[nodiscard]] Eigen::VectorXd fit_identity(const std::vector<LandmarkSet>& frames,
                                               const Eigen::Vector2d& principal_point_px);

    /// The expressions that the landmarks of none of several frames of one person tell anything of, each frame by
    /// itself, fitted with that identity.
    [[nodiscard]] std::vector<std::string> unobservable_expressions(const std::vector<LandmarkSet>& frames,
                                                                    const Eigen::Vector2d& principal_point_px,
                                                                    const Eigen::VectorXd& shape_coefficients);

    /// Given, or found by fit_identity.
    [[nodiscard]] std::optional<double> focal_px() const;

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

} // namespace lineament::cli
