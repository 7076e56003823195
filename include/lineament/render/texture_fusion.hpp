// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/texture.hpp"

#include <Eigen/Core>

#include <cstdint>

namespace lineament {

struct FusionOptions
{
    bool match_exposure = true; ///< Bring each frame to the brightness of the map so far.
    double max_gain = 2.0;      ///< A gain beyond [1 / max_gain, max_gain] is clamped; >= 1.
    int min_overlap = 100;      ///< Texels that must be seen in both for a match, >= 2; else gain 1, offset 0.

    void check() const; ///< @throws InvalidArgument naming the member and the value.
};

/// How a frame was brought to the exposure of the map: colour' = gain * colour + offset, per channel (0..255).
struct ExposureMatch
{
    Eigen::Vector3f gain = Eigen::Vector3f::Ones();
    Eigen::Vector3f offset = Eigen::Vector3f::Zero();
    int num_texels = 0; ///< Seen in both.
};

/// Texture of a face from many frames in constant memory: the running weighted mean of each texel,
///
///   mean = sum_f w_f (g_f I_f + o_f) / sum_f w_f,    w_f = texel weight x frame weight.
///
/// Gain and offset make the weighted mean and standard deviation of the texels seen in both equal to those of the map
/// so far; the first frame sets the exposure.
class TextureAccumulator
{
public:
    /// @throws InvalidArgument unless 1 <= size <= 8192, or on bad options.
    explicit TextureAccumulator(int size, const FusionOptions& options = {});

    /// Adds a frame.
    /// @param frame_weight  For example `sharpness`, relative to other frames; >= 0, finite. 0 adds nothing.
    /// @throws InvalidArgument on a map of another size or a bad weight.
    ExposureMatch add(const TextureMap& map, double frame_weight = 1.0);

    /// The mean so far. Its weights are the sums of all frames' (not bounded by 1); a texel's visibility is the best of
    /// any frame, in the order visible, self_occluded, back_facing, outside_image, unmapped.
    [[nodiscard]] TextureMap texture() const;

    [[nodiscard]] int num_frames() const { return num_frames_; } ///< With a weight > 0.

private:
    [[nodiscard]] ExposureMatch match(const TextureMap& map) const;

    FusionOptions options_;
    int size_;
    int num_frames_ = 0;
    ImageF mean_; // RGB, 0..255
    ImageF weight_sum_;
    Image<std::uint8_t> visibility_;
};

/// Variance of the Laplacian (4 neighbours) of the brightness over the texels of a map that are seen together with
/// their four neighbours; 0 if there are none. Larger is sharper. Brightness is (R + 2 G + B) / 4 of 0..255.
/// @par Reference  Pech-Pacheco et al., Diatom Autofocusing in Brightfield Microscopy, ICPR 2000.
[[nodiscard]] double sharpness(const TextureMap& map);

/// The same over the pixels of a picture (grey, RGB or RGBA) inside [left, right) x [top, bottom), which is clipped to
/// the picture; 0 if nothing is left of it.
[[nodiscard]] double sharpness(const ImageU8& picture, int left, int top, int right, int bottom);

} // namespace lineament

#ifndef LINEAMENT_COMPILED_RENDER
#include "lineament/render/texture_fusion_impl.hpp"
#endif
