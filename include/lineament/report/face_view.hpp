// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/core/mesh.hpp"
#include "lineament/fit/fit_result.hpp"
#include "lineament/model/morphable_model.hpp"

#include <Eigen/Core>

namespace lineament {

/// A face as the 3D viewer of a report shows it: the neutral mesh of the person, its morph targets and its texture.
struct FaceView
{
    Mesh neutral = {};                      ///< Model space, mm. Empty: the report has no 3D view.
    Blendshapes expressions = {};           ///< Morph targets, k of them, offsets in mm; may be empty.
    Eigen::VectorXd expression_values = {}; ///< k, the values the view starts with.
    ImageU8 texture = {};                   ///< In uv space; RGB or RGBA (alpha 0: texel not seen); may be empty.
};

/// The view of a fitted face: mean + B alpha as the neutral mesh, the fit's expression set as morph targets.
/// @throws InvalidArgument if the fit has more coefficients than the model, or names an expression set it has not.
[[nodiscard]] FaceView make_face_view(const MorphableModel& model, const FitResult& fit, const ImageU8& texture = {});

} // namespace lineament
