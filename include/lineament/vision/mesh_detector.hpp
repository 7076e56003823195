// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/core/landmarks.hpp"
#include "lineament/vision/face_box.hpp"

#include <Eigen/Core>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace lineament {

/// A face with the 478 points of MediaPipe's face mesh.
struct MeshFace
{
    FaceBox box = {};      ///< Upright box of the points 0 ... 467; score: of the detector in [0, 1], 0 when followed.
    double presence = 0.0; ///< [0, 1], that this is a face whose points lie on it.
    LandmarkSet landmarks = {}; ///< Scheme mediapipe478, names "0" ... "477"; 468 ... 477 are the irises.
    /// 3 x 478: x, y as in `landmarks` [px]; z grows away from the camera, in the unit of x, from about the head's
    /// middle. It is the depth of a generic face in this pose: fit for visibility and starting values, not for shape.
    Eigen::Matrix3Xf points = {};
};

/// Which network files MeshDetector takes.
enum class NetworkTrust
{
    known_only, ///< Those tested with this library, each in its place, told by their SHA-256.
    /// Every network of the right input and outputs, for example one trained anew. The file's numbers are checked, but
    /// XNNPACK aborts the process on some graphs it does not like: for files from people you trust only.
    any
};

struct MeshDetectorOptions
{
    /// Folder of the three networks (models/README.md). Empty: $LINEAMENT_NETWORKS, else the installed ones, else those
    /// of the source tree the library was built from.
    std::string network_folder = {};
    NetworkTrust trust = NetworkTrust::known_only;
};

struct MeshDetectionOptions
{
    /// The largest faces are given, at most so many: see num_left_out. 1: the near-range network, and the far-range one
    /// only if that finds nothing: fastest. More: both, merged.
    int max_faces = 16;
    double score_threshold = 0.5;    ///< Detections below are dropped, (0, 1). 0.6 loses one face in twenty.
    double presence_threshold = 0.5; ///< Faces below are false alarms and dropped, [0, 1].
};

/// Faces and 478 landmarks in photos and videos, by MediaPipe's networks on one thread.
///
/// Finds faces in profile too, but the points hold up to about 65 degrees of yaw only, and those of the side turned
/// away less: doubt_folded_points (mesh_yaw.hpp) has lowered their confidence. Pictures are sampled at 128 x 128 or 192
/// x 192 points, so that time does not depend on their size. Points are sub-pixel. Not thread-safe: one detector for
/// each thread (35 MB each). Same picture, same answer.
///
/// @par Reference  Bazarevsky et al., BlazeFace: Sub-millisecond Neural Face Detection on Mobile GPUs, CVPR Workshop
///                 2019; Kartynnik et al., Real-time Facial Surface Geometry from Monocular Video on Mobile GPUs, CVPR
///                 Workshop 2019; Grishchenko et al., Attention Mesh, CVPR Workshop 2020.
/// @par Licence    The networks are Apache-2.0: models/README.md.
class MeshDetector
{
public:
    /// Loads the networks, 3.8 MB: make one detector and keep it.
    /// @throws IoError if a network is missing, damaged or not the one of its name, and what was expected and found.
    explicit MeshDetector(const MeshDetectorOptions& options = {});
    ~MeshDetector();
    MeshDetector(MeshDetector&&) noexcept;
    MeshDetector& operator=(MeshDetector&&) noexcept;

    /// The faces of an RGB picture, largest first; none is a normal answer.
    /// @throws InvalidArgument unless the picture has three channels (it may be empty) and the options are in range.
    [[nodiscard]] std::vector<MeshFace> detect(const ImageU8& picture, const MeshDetectionOptions& options = {});

    /// How many faces the last call of detect found beyond max_faces and left out, the smaller ones. Under max_faces =
    /// 1 it counts those of one network only.
    [[nodiscard]] int num_left_out() const;

    /// The face of the previous video frame found again from its points; in doubt, that is at a presence below 0.9, the
    /// detector must confirm it.
    /// @param previous  Points 0 ... 467 (scheme mediapipe478) of the same face in the previous frame.
    /// @return The face, or nothing if it is lost.
    /// @throws InvalidArgument unless the picture is RGB and not empty and `previous` holds 0 ... 467, finite and not
    /// all in one point.
    [[nodiscard]] std::optional<MeshFace> follow(const ImageU8& picture, const LandmarkSet& previous);

    /// As follow, but overwrites the face, whose `points` are taken as the previous ones; allocates nothing once the
    /// face has been through detect, follow or this, also where a detector must confirm it (with XNNPACK).
    /// @return Whether the face was found; if not, it is left as it was.
    [[nodiscard]] bool follow_in_place(const ImageU8& picture, MeshFace& face);

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

/// The points that have a counterpart among the 68 iBUG landmarks, under those names: chin, eyebrows, nose, eyes, lips.
/// The outline but for the chin has none: iBUG marks the visible edge, which no fixed point of a surface does.
/// @param set  Scheme mediapipe478; points without a counterpart or missing are left out, confidence and depth kept.
/// @throws InvalidArgument if the scheme is another.
[[nodiscard]] LandmarkSet ibug68_from_mediapipe(const LandmarkSet& set);

} // namespace lineament
