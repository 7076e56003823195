// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "face_finder.hpp"
#include "fitters.hpp"
#include "model_options.hpp"

#include "lineament/core/image.hpp"
#include "lineament/core/landmarks.hpp"
#include "lineament/model/morphable_model.hpp"

#include <Eigen/Core>

#include <filesystem>
#include <string>
#include <vector>

namespace lineament::cli {

/// Which faces of a picture count, and where their landmarks come from if not from a detector.
struct PictureOptions
{
    std::string landmarks = {};     ///< A landmark file, or a folder of them; empty: detect.
    std::string pts_origin = "one"; ///< one or zero.
    bool pts_headerless = false;
    std::string landmark_units = "pixels"; ///< pixels or normalized.
    int face = 0;                          ///< Only this one, 1 is the largest; 0: all.
    double max_megapixels = 64.0;
};

/// The landmarks of one face in a picture.
struct SeenFace
{
    LandmarkSet landmarks;
    std::vector<Eigen::Matrix2d> covariances_px = {}; ///< As JointFitter takes them, or none.
};

/// A picture with the faces found in it.
struct SeenPicture
{
    ImageU8 picture;
    std::vector<SeenFace> faces; ///< The largest first.

    [[nodiscard]] Eigen::Vector2d center() const { return {0.5 * picture.width, 0.5 * picture.height}; }
};

/// Where the landmarks of a picture may be: in the file given, or in one with the picture's stem in the folder given.
[[nodiscard]] std::vector<std::filesystem::path> landmark_candidates(const std::filesystem::path& picture,
                                                                     const std::string& landmarks);

/// Reads pictures and finds the landmarks of their faces, in a scheme of the model.
class PictureReader
{
public:
    /// @param model, fitters  Must outlive this, as must the options.
    PictureReader(const PictureOptions& options, const FinderOptions& finder_options, const ModelOptions& model_options,
                  const MorphableModel& model, const Fitters& fitters)
        : options_(options), finder_options_(finder_options), model_options_(model_options), model_(model),
          fitters_(fitters), finder_(finder_options)
    {}

    /// @throws Failure, IoError: no face is found, a file cannot be read, or landmarks are those of another picture or
    ///         cannot be used as the options say.
    [[nodiscard]] SeenPicture look_at(const std::filesystem::path& path);

private:
    [[nodiscard]] std::vector<SeenFace> find_faces(const std::filesystem::path& picture_path, const ImageU8& picture);

    const PictureOptions& options_;
    const FinderOptions& finder_options_;
    const ModelOptions& model_options_;
    const MorphableModel& model_;
    const Fitters& fitters_;
    FaceFinder finder_;
};

} // namespace lineament::cli
