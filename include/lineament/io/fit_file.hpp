// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/fit_result.hpp"

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace lineament {

struct FitFileFace
{
    int id = 1; ///< >= 1, left to right in the picture.
    FitResult fit = {};
    std::vector<double> shape_standard_deviations = {}; ///< m, posterior, of the shape coefficients; empty: not known.
    std::vector<std::string> unobservable = {};         ///< Expressions that the landmarks do not determine.
    std::optional<double> predicted_rms_mm = {};        ///< Of the neutral face's vertices; empty: not known.
    std::vector<double> expression_standard_deviations = {}; ///< k, of the expression coefficients; empty: not known.
};

/// The content of `fit.json`: all faces fitted in one picture.                          docs/formats.md, "fit.json"
struct FitFile
{
    int width = 0;  ///< Of the picture [px].
    int height = 0; ///< Of the picture [px].
    std::string model = {};
    std::string method = {};
    std::vector<FitFileFace> faces = {};
};

/// The JSON text; numbers are the shortest that read back to the same double, those not finite are null.
/// parse_fit_json gives everything back.
[[nodiscard]] std::string format_fit_json(const FitFile& file);

/// @param path  Name for messages.
/// @throws IoError with line:column for text that is not JSON, with a JSON pointer for what is missing or wrong in it.
[[nodiscard]] FitFile parse_fit_json(std::string_view text, const std::string& path);

[[nodiscard]] FitFile load_fit_json(const std::string& path);
void save_fit_json(const std::string& path, const FitFile& file);

} // namespace lineament
