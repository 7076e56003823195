// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Instead of dlib_detector.cpp where the library is built without dlib: the constructor says so, the rest is never
// reached.
#include "lineament/vision/dlib_detector.hpp"

#include "lineament/core/error.hpp"

namespace lineament {

struct DlibDetector::Implementation
{};

DlibDetector::DlibDetector(const DlibDetectorOptions&)
{
    throw IoError(IoErrorKind::system, "dlib", "",
                  "expected a build with dlib's detector, found one without; install dlib (Debian: libdlib-dev) and "
                  "configure with LINEAMENT_WITH_DLIB, or use MeshDetector (--detector mediapipe)");
}

DlibDetector::~DlibDetector() = default;
DlibDetector::DlibDetector(DlibDetector&&) noexcept = default;
DlibDetector& DlibDetector::operator=(DlibDetector&&) noexcept = default;

std::vector<DetectedFace> DlibDetector::detect(const ImageU8&, const DetectionOptions&)
{
    return {};
}

LandmarkSet DlibDetector::landmarks(const ImageU8&, const FaceBox&)
{
    return {};
}

std::optional<DetectedFace> DlibDetector::follow(const ImageU8&, const LandmarkSet&)
{
    return std::nullopt;
}

} // namespace lineament
