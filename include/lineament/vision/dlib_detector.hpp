// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/core/landmarks.hpp"
#include "lineament/vision/face_box.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace lineament {

/// A face with its 68 landmarks (scheme ibug68).
struct DetectedFace
{
    FaceBox box = {};
    LandmarkSet landmarks = {};
    double confidence = 1.0; ///< [0, 1], that this is a face whose landmarks lie on it.
};

struct DlibDetectorOptions
{
    /// File of dlib's 68-point shape predictor. Empty: $LINEAMENT_LANDMARK_MODEL, else where Debian's package
    /// libdlib-data puts it.
    std::string landmark_model = {};
};

struct DetectionOptions
{
    /// Smallest height of a face box searched [px]. 0: 80 px, and 40 px if nothing is found. Large values are fast.
    double min_face_size_px = 0.0;
    double score_threshold = 0.0; ///< Detections below are dropped as false alarms.
    double max_overlap = 0.4;     ///< Of two boxes that share more of the smaller one's area the better stays, [0, 1].
    std::int64_t max_search_pixels =
        4'000'000; ///< The picture is searched at this size at most; bounds time and memory.
};

/// Faces and landmarks in photos and videos, by dlib's frontal HOG detector and its 68-point regression trees.
///
/// Finds faces up to about 45 degrees of yaw and 20 degrees of roll. Not thread-safe: one detector for each thread
/// (copies of the model: 100 MB each). Same picture, same answer.
///
/// @par Reference  Dalal and Triggs, Histograms of Oriented Gradients for Human Detection, CVPR 2005; Kazemi and
///                 Sullivan, One Millisecond Face Alignment with an Ensemble of Regression Trees, CVPR 2014.
/// @par Licence    The landmark model was trained on iBUG 300-W, whose terms exclude commercial use: docs/vision.md.
class DlibDetector
{
public:
    /// Loads the landmark model, about 100 MB: make one detector and keep it.
    /// @throws IoError if the model is missing, cut or of another kind, or the library was built without dlib
    /// (LINEAMENT_WITH_DLIB); the message says what to do.
    explicit DlibDetector(const DlibDetectorOptions& options = {});
    ~DlibDetector();
    DlibDetector(DlibDetector&&) noexcept;
    DlibDetector& operator=(DlibDetector&&) noexcept;

    /// The faces of an RGB picture, largest first; none is a normal answer.
    /// @throws InvalidArgument unless the picture has three channels (it may be empty) and the options are in range.
    [[nodiscard]] std::vector<DetectedFace> detect(const ImageU8& picture, const DetectionOptions& options = {});

    /// The 68 landmarks of the face that fills the box; the predictor answers for any box, face or not.
    /// @throws InvalidArgument unless the picture is RGB and the box overlaps it, its sides from 1 px to 4 times
    /// the longer one of the picture.
    [[nodiscard]] LandmarkSet landmarks(const ImageU8& picture, const FaceBox& box);

    /// The face of the previous video frame found again: kept where the landmark predictor, started from three boxes
    /// around its last place, agrees with itself; in doubt the detector searches a crop around that place.
    /// @param previous  68 landmarks (scheme ibug68) of the same face in the previous frame.
    /// @return The face with its confidence, or nothing if it is lost.
    /// @throws InvalidArgument unless the picture is RGB and not empty and `previous` holds ibug68 18 ... 68.
    [[nodiscard]] std::optional<DetectedFace> follow(const ImageU8& picture, const LandmarkSet& previous);

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

/// The box that dlib's detector would put around these landmarks (scheme ibug68; 18 ... 68 are used).
/// @throws InvalidArgument unless all of 18 ... 68 are there, finite, and not all in one point.
[[nodiscard]] FaceBox box_of(const LandmarkSet& landmarks);

} // namespace lineament
