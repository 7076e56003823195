// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "model_options.hpp"

#include "lineament/fit/face_fitter.hpp"

#include <map>
#include <string>

namespace lineament::cli {

/// The fitters of one model, one for each landmark scheme that turns up, made when it does.
class Fitters
{
public:
    /// @param model  Must outlive this.
    Fitters(const MorphableModel& model, const ModelOptions& options) : model_(&model), options_(fit_options(options))
    {}

    /// The landmarks in a scheme of the model: as they are, or MediaPipe's as the 52 of ibug68 that have a counterpart.
    /// @throws Failure(bad_input) if the model knows neither.
    [[nodiscard]] LandmarkSet in_scheme_of_model(LandmarkSet landmarks) const;

    /// The fitter for a scheme of the model.
    [[nodiscard]] const FaceFitter& for_scheme(const std::string& scheme);

private:
    const MorphableModel* model_;
    FitOptions options_;
    std::map<std::string, FaceFitter> fitters_;
};

} // namespace lineament::cli
