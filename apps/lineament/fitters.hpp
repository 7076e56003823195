// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "model_options.hpp"

#include "lineament/core/landmarks.hpp"
#include "lineament/fit/fit_result.hpp"

#include <Eigen/Core>

#include <memory>
#include <vector>

namespace lineament::cli {

/// The solvers of one model as the user chose them, one for each landmark scheme that turns up, made when it does.
/// Only this class includes them: they take long to compile.
class Fitters
{
public:
    /// @param model  Must outlive this.
    Fitters(const MorphableModel& model, const ModelOptions& options);
    ~Fitters();

    /// The landmarks in a scheme of the model: as they are, or MediaPipe's as the 52 of ibug68 that have a counterpart.
    /// @throws Failure(bad_input) if the model knows neither.
    [[nodiscard]] LandmarkSet in_scheme_of_model(LandmarkSet landmarks) const;

    [[nodiscard]] FitResult fit(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px);

    /// @param start  The result of the frame before, or nullptr.
    [[nodiscard]] FitResult fit_pose_and_expression(const LandmarkSet& landmarks,
                                                    const Eigen::Vector2d& principal_point_px,
                                                    const Eigen::VectorXd& shape_coefficients, const FitResult* start);

    /// The shape coefficients of one person seen in several frames of one scheme.
    [[nodiscard]] Eigen::VectorXd fit_identity(const std::vector<LandmarkSet>& frames,
                                               const Eigen::Vector2d& principal_point_px);

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

} // namespace lineament::cli
