// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/io/model_file.hpp"
#include "lineament/model/morphable_model.hpp"
#include "lineament/render/texture.hpp"

#include <optional>
#include <string>

namespace CLI {
class App;
}

namespace lineament::cli {

/// The options that `fit` and `track` share: which model, and how it is fitted.
struct ModelOptions
{
    std::string model;          ///< File; empty: the default model.
    std::string level = "full"; ///< "full", or 0 (coarsest), 1, ...
    std::string method = "joint";
    std::string expression_set = "ekman6";
    std::optional<std::string> contour; ///< Empty: both.
    std::string prior = "model";
    std::optional<int> iterations;          ///< Empty: the default of the method.
    std::optional<double> regularization;   ///< Empty: the default of the prior.
    std::optional<double> noise_mm;         ///< Of inner landmarks; empty: the default of the method.
    std::optional<double> outline_noise_mm; ///< Of outline landmarks, likewise.
    std::optional<std::string> loss;        ///< Empty: the default of the joint method.
    double focal_px = 0.0;                  ///< 0: not known.
    bool fits_focal = false;                ///< Unknown and fitted; otherwise scaled orthographic if not known.
};

void add_model_options(CLI::App& command, ModelOptions& options);

/// The file named, or that of the default model if the name is empty.
[[nodiscard]] std::string model_path_or_default(const std::string& path);

/// load_model_file, with a warning for each of the file's. @throws IoError; Failure(bad_input) with --strict.
[[nodiscard]] ModelFile load_model_with_warnings(const std::string& path);

/// The model at the chosen level, with warnings as above.
/// @throws IoError; Failure(wrong_use) for a level or expression set it has not; (bad_input) if it has no uv layout.
[[nodiscard]] MorphableModel load_chosen_model(const ModelOptions& options);

/// The uv layout of the finest level without the inside of the mouth.
[[nodiscard]] TextureLayout make_texture_layout(const MorphableModel& model, int size);

} // namespace lineament::cli
