// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/texture.hpp"

namespace lineament {

/// Where a texel of a completed texture comes from.
enum class TexelOrigin : std::uint8_t
{
    seen = 0,
    mirrored = 1, ///< From the other side of the face, its colour shifted to join smoothly.
    diffused = 2, ///< Spread from the texels around; no detail of its own.
};

enum class Mirroring
{
    none,
    flip_u, ///< The layout is symmetric: texel (u, v) has the partner (1 - u, v).
};

struct CompletionOptions
{
    Mirroring mirroring = Mirroring::flip_u;
    /// Texels with less than this share of the median weight of the seen ones are replaced too: at grazing angles a
    /// picture shows more of what lies beside the face than of it. In [0, 1]; 0: only holes. Relative, because weights
    /// are small all over where the picture is coarser than the map, and large where many frames were fused.
    double min_relative_weight = 0.25;

    void check() const; ///< @throws InvalidArgument naming the member and the value.
};

/// A texture without holes, and the mask that says which texels are guesses.
struct CompletedTexture
{
    ImageU8 color = {};              ///< RGB.
    Image<std::uint8_t> origin = {}; ///< Values of TexelOrigin.
};

/// The texture with every texel filled: seen texels unchanged, then the mirrored side, then diffusion, which also runs
/// into the unmapped texels so that no seam shows when the map is sampled between texels. A map in which nothing is
/// seen becomes mid-grey.
/// @throws InvalidArgument if the images of the map differ in size, or on bad options.
[[nodiscard]] CompletedTexture complete_texture(const TextureMap& map, const CompletionOptions& options = {});

/// Fills values (any number of channels) where the weight is 0 by diffusion from where it is not: averaged into
/// coarser and coarser images until no hole is left, then interpolated back. Values with weight >= 1 are unchanged;
/// without any weight everything becomes 0.
/// @par Reference  Pull-push: Gortler et al., The Lumigraph, SIGGRAPH 1996.
[[nodiscard]] ImageF diffuse(const ImageF& values, const ImageF& weights);

} // namespace lineament

#ifndef LINEAMENT_COMPILED_RENDER
#include "lineament/render/texture_completion_impl.hpp"
#endif
