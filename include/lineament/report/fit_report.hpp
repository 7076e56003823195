// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/report/face_view.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>
#include <vector>

namespace lineament {

/// One face of a fit report. Pictures that are empty are left out of the page.
struct FitReportFace
{
    std::string id = {}; ///< "face_1"; shown where there are several.
    FitResult fit = {};
    FaceView view = {};                             ///< make_face_view; its texture is shown as the texture map too.
    ImageU8 frontal = {};                           ///< Frontal render with neutral expression.
    Eigen::VectorXd shape_standard_deviations = {}; ///< Posterior, of alpha; empty, or one a coefficient.
    std::vector<std::string> unobservable_expressions = {}; ///< Names whose value the landmarks cannot tell.
    std::optional<double> predicted_rms_mm = {}; ///< Expected error of the neutral face's vertices; empty: not known.
    ImageU8 uncertainty = {}; ///< The face coloured by each vertex's standard deviation, with the scale.
};

/// What a fit report is made of.
struct FitReport
{
    std::string title = {}; ///< Name of the picture.
    ImageU8 picture = {};   ///< Grey, RGB or RGBA.
    ImageU8 overlay = {};   ///< The picture with every face drawn (draw_overlay); may be empty.
    std::string model_name = {};
    std::string program = {};                      ///< "lineament 0.1.0".
    std::optional<double> focal_px = std::nullopt; ///< Of a perspective camera.
    std::vector<FitReportFace> faces = {};         ///< May be empty: the page says that no face was found.
};

/// One HTML file that needs nothing else: the picture with its overlay, a 3D view of each face to turn and to pull
/// faces with, pose, coefficients, expression values, residuals, status and timing, each with its unit. It makes no
/// request (its content policy forbids any) and every text from outside is escaped. Pictures are reduced to 1600 px.
/// @throws InvalidArgument if a face's mesh, morph targets, or list of standard deviations disagree in size.
[[nodiscard]] std::string format_fit_report(const FitReport& report);

} // namespace lineament
