// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "picture_reader.hpp"

#include "console.hpp"
#include "inputs.hpp"

#include "lineament/io/file.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/io/landmark_file.hpp"
#include "lineament/vision/mesh_yaw.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>

namespace lineament::cli {

namespace fs = std::filesystem;

std::vector<fs::path> landmark_candidates(const fs::path& picture, const std::string& landmarks)
{
    std::error_code ignored;
    if (!fs::is_directory(landmarks, ignored)) {
        return {landmarks};
    }
    std::vector<fs::path> candidates;
    for (const char* extension : {".pts", ".json", ".csv"}) {
        candidates.push_back(fs::path(landmarks) / (picture.stem().string() + extension));
    }
    return candidates;
}

namespace {

fs::path landmark_file_of(const fs::path& picture, const std::string& landmarks)
{
    const std::vector<fs::path> candidates = landmark_candidates(picture, landmarks);
    if (candidates.size() == 1) {
        return candidates.front();
    }
    std::string tried;
    std::error_code ignored;
    for (const fs::path& candidate : candidates) {
        if (fs::exists(candidate, ignored)) {
            return candidate;
        }
        tried += (tried.empty() ? "" : ", ") + candidate.filename().string();
    }
    throw Failure(system_failed,
                  landmarks + ": no landmark file for " + picture.string() + " (looked for " + tried + ")");
}

std::string size_text(int width, int height)
{
    return std::to_string(width) + " x " + std::to_string(height);
}

/// @throws Failure(bad_input) if the file says that its image has another size than the picture.
void check_image_size(const LandmarkFile& file, const fs::path& path, const fs::path& picture_path,
                      const ImageU8& picture)
{
    const int width = file.image_width.value_or(picture.width);
    const int height = file.image_height.value_or(picture.height);
    if (width != picture.width || height != picture.height) {
        throw Failure(bad_input, path.string() + ":/image: expected the size of " + picture_path.string() + ", " +
                                     size_text(picture.width, picture.height) + ", found " + size_text(width, height) +
                                     "; are these the landmarks of another picture?");
    }
}

/// @throws Failure(no_answer) if more than half of a face's landmarks lie outside the picture.
void check_inside(const LandmarkSet& set, const fs::path& path, const fs::path& picture_path, const ImageU8& picture)
{
    const auto num_outside = std::count_if(set.landmarks.begin(), set.landmarks.end(), [&](const Landmark& landmark) {
        const Eigen::Vector2d& point = landmark.point_px;
        return point.minCoeff() < 0.0 || point.x() > picture.width || point.y() > picture.height;
    });
    if (2 * static_cast<std::size_t>(num_outside) > set.landmarks.size()) {
        throw Failure(no_answer, path.string() + ": " + std::to_string(num_outside) + " of " +
                                     std::to_string(set.landmarks.size()) + " landmarks lie outside " +
                                     picture_path.string() + " (" + size_text(picture.width, picture.height) +
                                     "); are they those of another picture or size?");
    }
}

/// @throws Failure(bad_input) if the faces of a file are seen at different times: rows of a video, not of a picture.
void check_one_time(const LandmarkFile& file, const fs::path& path)
{
    for (const LandmarkFrame& frame : file.frames) {
        const LandmarkFrame& first = file.frames.front();
        if (frame.frame != first.frame || frame.time_s != first.time_s) {
            throw Failure(bad_input, path.string() + ": expected the landmarks of one picture, found the " +
                                         std::to_string(file.frames.size()) +
                                         " rows of a video; keep the rows of the frame that the picture shows");
        }
    }
}

/// Of the box around the landmarks [px^2].
double area_of(const LandmarkSet& set)
{
    Eigen::AlignedBox2d box;
    for (const Landmark& landmark : set.landmarks) {
        box.extend(landmark.point_px);
    }
    return box.isEmpty() ? 0.0 : box.volume();
}

/// Warns, or throws Failure(wrong_use), where the noise that a file states is not what the fit goes by.
void check_use_of_covariances(const FinderOptions& finder, const ModelOptions& model, const fs::path& path)
{
    if (model.method != "joint") {
        warn_of_input(path.string() + ": its covariances are left out of --method thesis, to which all landmarks are "
                                      "alike");
    } else if (model.noise_mm || model.outline_noise_mm) {
        throw Failure(wrong_use, "--noise and --outline-noise: " + path.string() +
                                     " itself states the covariance of each landmark");
    } else if (finder.outline != "none") {
        throw Failure(wrong_use, "--outline would add landmarks to those of " + path.string() +
                                     " that have no covariance, where each must have one");
    }
}

/// Warns of a name that belongs to another format than the picture's.
void check_extension(const fs::path& path, std::span<const std::byte> bytes)
{
    const std::optional<ContentGuess> guess = guess_content(bytes);
    const std::string extension = lower_extension(path);
    const bool is_png = guess && guess->kind == "a PNG image";
    const bool fits = is_png ? extension == ".png" : extension == ".jpg" || extension == ".jpeg";
    if (guess && !fits && !extension.empty()) {
        warn_of_input(path.string() + ": the name ends in " + extension + ", but the file is " + guess->kind +
                      " and is read as such");
    }
}

} // namespace

std::vector<SeenFace> PictureReader::find_faces(const fs::path& picture_path, const ImageU8& picture)
{
    std::vector<SeenFace> faces;
    fs::path landmark_path;
    if (!options_.landmarks.empty()) {
        LandmarkFileOptions file_options;
        file_options.pts_origin = options_.pts_origin == "zero" ? PtsOrigin::zero_based : PtsOrigin::one_based;
        file_options.pts_header = options_.pts_headerless ? PtsHeader::optional : PtsHeader::required;
        file_options.units =
            options_.landmark_units == "normalized" ? LandmarkUnits::normalized : LandmarkUnits::pixels;
        file_options.mediapipe_points = model_.find_landmark_map("mediapipe478") != nullptr
                                            ? MediapipePoints::mediapipe478
                                            : MediapipePoints::ibug68;
        file_options.image_width = picture.width;
        file_options.image_height = picture.height;
        landmark_path = landmark_file_of(picture_path, options_.landmarks);
        const LandmarkFile file = load_landmarks(landmark_path.string(), file_options);
        check_image_size(file, landmark_path, picture_path, picture);
        check_one_time(file, landmark_path);
        for (const LandmarkFrame& frame : file.frames) {
            if (!frame.set.landmarks.empty()) {
                faces.push_back({frame.set, frame.covariances_px});
            }
        }
        std::stable_sort(faces.begin(), faces.end(), [](const SeenFace& a, const SeenFace& b) {
            return area_of(a.landmarks) > area_of(b.landmarks);
        });
        if (faces.empty()) {
            throw Failure(no_answer, landmark_path.string() + ": the file holds no face");
        }
    } else {
        for (FoundFace& face : finder_.find(picture)) {
            faces.push_back({std::move(face.landmarks)});
        }
        if (faces.empty()) {
            throw Failure(no_answer, "no face found in " + picture_path.string() + " (" +
                                         size_text(picture.width, picture.height) +
                                         "); give --landmarks, or a picture with a larger, more frontal face");
        }
    }
    if (options_.face > 0) {
        if (options_.face > static_cast<int>(faces.size())) {
            throw Failure(no_answer, picture_path.string() + ": --face " + std::to_string(options_.face) +
                                         ", but only " + std::to_string(faces.size()) +
                                         " found (the largest is number 1)");
        }
        faces = {faces[static_cast<std::size_t>(options_.face - 1)]};
    }
    for (SeenFace& face : faces) {
        LandmarkSet& set = face.landmarks;
        if (!face.covariances_px.empty()) {
            check_use_of_covariances(finder_options_, model_options_, landmark_path);
        }
        if (!options_.landmarks.empty()) {
            check_inside(set, landmark_path, picture_path, picture);
            if (set.scheme == "mediapipe478") {
                finder_.add_outline(picture, set);
                doubt_folded_points(set);
            } else if (finder_options_.outline != "none") {
                throw Failure(wrong_use, "--outline adds to the points of mediapipe; those of " +
                                             landmark_path.string() + " are of the scheme " + set.scheme);
            }
        }
        const std::string scheme = set.scheme;
        set = fitters_.in_scheme_of_model(std::move(set));
        if (set.scheme != scheme && !face.covariances_px.empty()) {
            throw Failure(bad_input, landmark_path.string() + ": covariances of landmarks of " + scheme +
                                         ", which this model does not have; give those of " + set.scheme);
        }
    }
    return faces;
}

SeenPicture PictureReader::look_at(const fs::path& path)
{
    ImageLimits limits;
    limits.max_megapixels = options_.max_megapixels;
    SeenPicture seen;
    const std::vector<std::byte> bytes = read_file(path);
    seen.picture = parse_image(bytes, path.string(), limits);
    check_extension(path, bytes);
    seen.faces = find_faces(path, seen.picture);
    return seen;
}

} // namespace lineament::cli
