// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/fit/fit_result.hpp"
#include "lineament/io/file.hpp"
#include "lineament/io/glb_file.hpp"
#include "lineament/model/morphable_model.hpp"
#include "lineament/render/texture.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace lineament::cli {

/// One face of a picture, with what is drawn from it.
struct FittedFace
{
    int id = 1;
    FitResult fit = {};
    ImageU8 texture = {};       ///< RGBA in uv space; alpha 0 where nothing was seen.
    ImageU8 whole_texture = {}; ///< RGB, holes filled, for meshes.
    ImageU8 frontal = {};       ///< Frontal render with neutral expression.
};

/// Which files are written besides the standard ones.
struct OutputOptions
{
    bool obj = true;
    bool ply = false;
    bool neutral = false;
    bool report = true;
    int texture_size = 512; ///< Texels a side.
};

/// The names of all files that `lineament fit` can write for a picture.
[[nodiscard]] std::vector<std::string> fit_file_names();

/// The picture in uv space for a fitted face. Ears are taken only where the head is turned to show them: landmarks say
/// little about their place, and from the front hair or background would be painted on.
[[nodiscard]] TextureMap extract_face_texture(const MorphableModel& model, const TextureLayout& layout,
                                              const Mesh& mesh, const Camera& camera, const ImageU8& picture);

/// The texture of a fitted face and its frontal, expression-neutralised render.
[[nodiscard]] FittedFace make_fitted_face(int id, const FitResult& fit, const MorphableModel& model,
                                          const TextureLayout& layout, const ImageU8& picture);

/// Writes mesh.glb, mesh.obj, texture.png ... of one face into the folder, which exists.
void write_face(FileBatch& files, const std::filesystem::path& folder, const MorphableModel& model,
                const FittedFace& face, const OutputOptions& options);

/// Writes uncertainty.glb, the neutral face with its expressions, and uncertainty.png, both coloured by the standard
/// deviation of each vertex on a scale from 0 to 8 mm.
/// @return The picture: front and side, and the scale.
ImageU8 write_uncertainty(FileBatch& files, const std::filesystem::path& folder, const MorphableModel& model,
                          const FitResult& fit, const Eigen::VectorXf& vertex_deviations_mm);

/// The neutral mesh (mean + B a) of a fit, with uv.
[[nodiscard]] Mesh neutral_mesh(const MorphableModel& model, const Eigen::VectorXd& shape_coefficients);

/// The blendshapes of a set as morph targets of a GLB with these default weights; none for a set the model has not.
[[nodiscard]] std::vector<GlbMorphTarget>
make_morph_targets(const MorphableModel& model, const std::string& expression_set, const Eigen::VectorXd& weights);

/// The bytes of a PNG file.
[[nodiscard]] std::string png_text(const ImageU8& image);

/// The mesh seen from the front with its texture, 480 x 600 px (thesis, figure 4.4, for a neutral mesh).
[[nodiscard]] ImageU8 render_frontal(const Mesh& mesh, const ImageU8& texture);

} // namespace lineament::cli
