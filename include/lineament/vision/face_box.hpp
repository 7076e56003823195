// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lineament {

/// An upright square or rectangle around a face, in image space [px]; may reach beyond the picture.
struct FaceBox
{
    double left = 0.0;
    double top = 0.0;
    double width = 0.0;
    double height = 0.0;
    /// How sure the detector is that this is a face, in its own measure; 0 where no detector ran.
    /// DlibDetector: margin of its classifier, above 0 a face, above 1 beyond doubt.
    /// MeshDetector: score of its network, score_threshold to 1; what the mesh says is MeshFace::presence.
    double score = 0.0;

    bool operator==(const FaceBox&) const = default;
};

} // namespace lineament
