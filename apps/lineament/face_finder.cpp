// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "face_finder.hpp"

#include "console.hpp"

#include "lineament/vision/dlib_outline.hpp"

#include <CLI/CLI.hpp>

namespace lineament::cli {

namespace {

FoundFace found(DetectedFace&& face)
{
    return {std::move(face.landmarks), face.confidence};
}

FoundFace found(MeshFace&& face)
{
    return {std::move(face.landmarks), face.presence};
}

template <typename Face>
std::optional<FoundFace> found(std::optional<Face>&& face)
{
    return face ? std::optional(found(std::move(*face))) : std::nullopt;
}

} // namespace

void add_finder_options(CLI::App& command, FinderOptions& options, bool takes_landmark_files)
{
    std::vector<std::string> detectors = {"mediapipe", "dlib"};
    std::string help = "What finds faces and landmarks: mediapipe (478 points), dlib (68 points; its landmark model "
                       "excludes commercial use)";
    if (takes_landmark_files) {
        detectors.emplace_back("none");
        help += ", none (landmark files only)";
    }
    command.add_option("--detector", options.detector, help + ".")
        ->check(CLI::IsMember(detectors))
        ->capture_default_str();
    command
        .add_option("--min-face", options.min_face_px,
                    "With --detector dlib: smallest face searched [px]; 0: 80, and 40 if none is found.")
        ->check(CLI::NonNegativeNumber);
    command
        .add_option("--outline", options.outline,
                    "What adds the visible edge of jaw and cheeks to mediapipe's points, whose oval is a line on the "
                    "surface: none, or dlib (16 landmarks; its landmark model excludes commercial use).")
        ->check(CLI::IsMember({"none", "dlib"}))
        ->capture_default_str();
}

void FaceFinder::load()
{
    if (options_.detector == "none") {
        throw Failure(wrong_use, "--detector none: nothing finds faces then; give --landmarks");
    }
    if (uses_mesh() && options_.min_face_px > 0.0) {
        throw Failure(wrong_use, "--min-face is a setting of --detector dlib; mediapipe's networks have no such limit");
    }
    if (!uses_mesh() && adds_outline()) {
        throw Failure(wrong_use, "--outline adds to the points of mediapipe; --detector dlib finds the outline itself");
    }
    if (uses_mesh() && !mesh_) {
        mesh_.emplace();
    } else if (!uses_mesh() && !dlib_) {
        dlib_.emplace();
    }
}

void FaceFinder::add_outline(const ImageU8& picture, LandmarkSet& mesh_points)
{
    if (!adds_outline()) {
        return;
    }
    if (!dlib_) {
        dlib_.emplace();
    }
    add_dlib_outline(mesh_points, *dlib_, picture);
}

std::vector<FoundFace> FaceFinder::find(const ImageU8& picture)
{
    load();
    std::vector<FoundFace> faces;
    if (uses_mesh()) {
        MeshDetectionOptions detection;
        detection.max_faces = 1000; // all there are
        for (MeshFace& face : mesh_->detect(picture, detection)) {
            faces.push_back(found(std::move(face)));
            add_outline(picture, faces.back().landmarks);
        }
    } else {
        DetectionOptions detection;
        detection.min_face_size_px = options_.min_face_px;
        for (DetectedFace& face : dlib_->detect(picture, detection)) {
            faces.push_back(found(std::move(face)));
        }
    }
    return faces;
}

std::optional<FoundFace> FaceFinder::find_one(const ImageU8& picture)
{
    load();
    if (!uses_mesh()) {
        std::vector<FoundFace> faces = find(picture);
        return faces.empty() ? std::nullopt : std::optional(std::move(faces.front()));
    }
    MeshDetectionOptions detection;
    detection.max_faces = 1;
    std::vector<MeshFace> faces = mesh_->detect(picture, detection);
    if (faces.empty()) {
        return std::nullopt;
    }
    add_outline(picture, faces.front().landmarks);
    return found(std::move(faces.front()));
}

std::optional<FoundFace> FaceFinder::follow(const ImageU8& picture, const FoundFace& previous)
{
    load();
    if (!uses_mesh()) {
        return found(dlib_->follow(picture, previous.landmarks));
    }
    std::optional<FoundFace> face = found(mesh_->follow(picture, previous.landmarks));
    if (face) {
        add_outline(picture, face->landmarks);
    }
    return face;
}

} // namespace lineament::cli
