// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/core/landmarks.hpp"
#include "lineament/vision/dlib_detector.hpp"
#include "lineament/vision/mesh_detector.hpp"

#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace lineament::cli {

struct FinderOptions
{
    std::string detector = "mediapipe"; ///< mediapipe, dlib or none.
    double min_face_px = 0.0;           ///< dlib only: smallest face searched; 0: 80, and 40 if none is found.
    std::string outline = "none";       ///< What adds outline landmarks to the points of mediapipe: none or dlib.
};

/// --detector, --min-face and --outline.
/// @param takes_landmark_files  Whether the command can do without a detector.
void add_finder_options(CLI::App& command, FinderOptions& options, bool takes_landmark_files);

/// A face found in a picture.
struct FoundFace
{
    LandmarkSet landmarks = {};
    double confidence = 1.0; ///< [0, 1], that this is a face whose landmarks lie on it.
};

/// Faces in pictures by the detector that the user chose; its networks are loaded when the first picture comes.
class FaceFinder
{
public:
    explicit FaceFinder(FinderOptions options) : options_(std::move(options)) {}

    /// All faces, largest first.
    /// @throws Failure(wrong_use) if the detector is "none", has no smallest face or finds outlines itself; IoError if
    ///         its files are missing.
    [[nodiscard]] std::vector<FoundFace> find(const ImageU8& picture);

    /// The largest face.
    [[nodiscard]] std::optional<FoundFace> find_one(const ImageU8& picture);

    /// The face of the previous frame again, or nothing if it is lost.
    [[nodiscard]] std::optional<FoundFace> follow(const ImageU8& picture, const FoundFace& previous);

    /// With --outline dlib: adds dlib's 16 outline landmarks of the face whose mesh points these are.
    void add_outline(const ImageU8& picture, LandmarkSet& mesh_points);

private:
    [[nodiscard]] bool uses_mesh() const { return options_.detector == "mediapipe"; }
    [[nodiscard]] bool adds_outline() const { return options_.outline == "dlib"; }
    void load();

    FinderOptions options_;
    std::optional<DlibDetector> dlib_;
    std::optional<MeshDetector> mesh_;
};

} // namespace lineament::cli
