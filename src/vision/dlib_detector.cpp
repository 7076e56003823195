// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The only file that includes dlib: its headers take long to compile.
#include "lineament/vision/dlib_detector.hpp"

#include "grey_crop.hpp"
#include "lineament/core/checks.hpp"

#include <dlib/image_processing.h>
#include <dlib/image_processing/frontal_face_detector.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace lineament {
namespace {

constexpr double detector_window_px = 80.0; // height of the faces dlib's detector was trained on
constexpr double landmark_box_px = 200.0;   // side of the face box at which the landmark predictor runs

std::string find_landmark_model(const std::string& option)
{
    if (!option.empty()) {
        return option;
    }
    const char* variable = std::getenv("LINEAMENT_LANDMARK_MODEL");
    if (variable != nullptr && *variable != '\0') {
        return variable;
    }
    return "/usr/share/dlib/shape_predictor_68_face_landmarks.dat";
}

dlib::shape_predictor load_landmark_model(const std::string& path)
{
    const std::string expected = "expected dlib's 68-point shape predictor, found ";
    std::ifstream file(path, std::ios::binary);
    if (!file || std::filesystem::is_directory(path)) {
        throw IoError(IoErrorKind::system, path, "",
                      "landmark model not found or not readable; on Debian: apt-get install libdlib-data, or set "
                      "LINEAMENT_LANDMARK_MODEL");
    }
    char start[16] = {};
    file.read(start, sizeof start);
    if (file.gcount() == 0) {
        throw IoError(IoErrorKind::content, path, "", expected + "an empty file");
    }
    if (std::memcmp(start, "BZh", 3) == 0) {
        throw IoError(IoErrorKind::content, path, "", expected + "a bzip2 archive; unpack it: bunzip2 <file>");
    }
    if (std::memcmp(start, "version https://", 16) == 0) {
        throw IoError(IoErrorKind::content, path, "", expected + "a Git LFS pointer; fetch the file itself");
    }
    file.clear();
    file.seekg(0);
    dlib::shape_predictor predictor;
    try {
        dlib::deserialize(predictor, file);
    } catch (const std::exception&) {
        throw IoError(IoErrorKind::content, path, "", expected + "another or a cut file");
    }
    if (predictor.num_parts() != 68) {
        throw IoError(IoErrorKind::content, path, "",
                      expected + "one of " + std::to_string(predictor.num_parts()) + " points");
    }
    return predictor;
}

void require_rgb(const ImageU8& picture, const char* function)
{
    require(picture.channels == 3 || picture.empty(), function, "picture", "3 channels",
            std::to_string(picture.channels));
    require(picture.data.size() == static_cast<std::size_t>(picture.width) * picture.height * picture.channels,
            function, "picture", "width * height * 3 values", std::to_string(picture.data.size()));
}

dlib::array2d<unsigned char> to_dlib(const ImageU8& grey)
{
    dlib::array2d<unsigned char> image(grey.height, grey.width);
    for (int row = 0; row < grey.height; ++row) {
        std::copy_n(grey.pixel(0, row), grey.width, &image[row][0]);
    }
    return image;
}

/// Whether the box shares a point with the picture and its sides lie between 1 px and 4 times the picture's.
bool is_usable(const FaceBox& box, const ImageU8& picture)
{
    const double longest = 4.0 * std::max(picture.width, picture.height);
    return std::min(box.width, box.height) >= 1.0 && std::max(box.width, box.height) <= longest &&
           box.left < picture.width && box.top < picture.height && box.left + box.width > 0.0 &&
           box.top + box.height > 0.0;
}

double area(const FaceBox& box)
{
    return box.width * box.height;
}

/// Shared area over the area of the smaller box.
double overlap(const FaceBox& a, const FaceBox& b)
{
    const double width = std::min(a.left + a.width, b.left + b.width) - std::max(a.left, b.left);
    const double height = std::min(a.top + a.height, b.top + b.height) - std::max(a.top, b.top);
    return std::max(0.0, width) * std::max(0.0, height) / std::min(area(a), area(b));
}

std::vector<FaceBox> without_duplicates(std::vector<FaceBox> boxes, double max_overlap)
{
    std::stable_sort(boxes.begin(), boxes.end(), [](const FaceBox& a, const FaceBox& b) { return a.score > b.score; });
    std::vector<FaceBox> kept;
    for (const FaceBox& box : boxes) {
        if (std::none_of(kept.begin(), kept.end(),
                         [&](const FaceBox& other) { return overlap(box, other) > max_overlap; })) {
            kept.push_back(box);
        }
    }
    return kept;
}

struct Estimate
{
    LandmarkSet landmarks;
    double disagreement = 0.0; ///< Rms distance of the single answers from their mean, in sides of the box.
};

/// Thresholds between faces, where the answers lie about 0.003 of the box side apart, and other places, where they
/// follow their boxes and lie about 0.07 apart. How well they separate: bench/detector_bench, docs/vision.md.
double confidence_of(double disagreement)
{
    return std::clamp((0.05 - disagreement) / (0.05 - 0.01), 0.0, 1.0);
}

} // namespace

struct DlibDetector::Implementation
{
    dlib::frontal_face_detector detector = dlib::get_frontal_face_detector();
    dlib::shape_predictor predictor;

    /// The boxes found in a crop, in the coordinates of the picture.
    std::vector<FaceBox> search(const ImageU8& picture, const CropPlace& place, double threshold)
    {
        std::vector<std::pair<double, dlib::rectangle>> detections;
        detector(to_dlib(crop_grey(picture, place)), detections, threshold);
        std::vector<FaceBox> boxes;
        for (const auto& [score, rectangle] : detections) {
            boxes.push_back({.left = place.left + static_cast<double>(rectangle.left()) / place.scale,
                             .top = place.top + static_cast<double>(rectangle.top()) / place.scale,
                             .width = static_cast<double>(rectangle.width()) / place.scale,
                             .height = static_cast<double>(rectangle.height()) / place.scale,
                             .score = score});
        }
        return boxes;
    }

    std::vector<FaceBox> search_all(const ImageU8& picture, double scale, double threshold)
    {
        return search(picture,
                      {.scale = scale,
                       .width = std::max(1, static_cast<int>(std::lround(picture.width * scale))),
                       .height = std::max(1, static_cast<int>(std::lround(picture.height * scale)))},
                      threshold);
    }

    /// Landmarks as the mean of the predictor's answers from three boxes around the given one, and how far the
    /// answers lie apart. The face is resampled to one size first, since dlib's points are whole pixels.
    Estimate estimate(const ImageU8& picture, const FaceBox& box) const
    {
        const double side = std::max(box.width, box.height);
        const double scale = landmark_box_px / side;
        const CropPlace place = {.left = box.left + 0.5 * box.width - side,
                                 .top = box.top + 0.5 * box.height - side,
                                 .scale = scale,
                                 .width = static_cast<int>(2.0 * landmark_box_px),
                                 .height = static_cast<int>(2.0 * landmark_box_px)};
        const dlib::array2d<unsigned char> crop = to_dlib(crop_grey(picture, place));

        constexpr double shift = 0.06;                                                           // of the side
        constexpr double starts[3][3] = {{-1.0, 0.0, 1.0}, {0.5, 1.0, 1.06}, {0.5, -1.0, 0.94}}; // x, y, size
        std::array<Eigen::Matrix<double, 2, 68>, 3> answers;
        for (int k = 0; k < 3; ++k) {
            const double width = starts[k][2] * box.width * scale;
            const double height = starts[k][2] * box.height * scale;
            const double left = landmark_box_px * (1.0 + shift * starts[k][0]) - 0.5 * width;
            const double top = landmark_box_px * (1.0 + shift * starts[k][1]) - 0.5 * height;
            const dlib::rectangle start(std::lround(left), std::lround(top), std::lround(left + width) - 1,
                                        std::lround(top + height) - 1);
            const dlib::full_object_detection found = predictor(crop, start);
            for (int i = 0; i < 68; ++i) {
                answers[k].col(i) << static_cast<double>(found.part(i).x()), static_cast<double>(found.part(i).y());
            }
        }
        const Eigen::Matrix<double, 2, 68> mean = (answers[0] + answers[1] + answers[2]) / 3.0;
        Estimate result;
        double sum = 0.0;
        for (const auto& answer : answers) {
            sum += (answer - mean).rightCols<51>().squaredNorm();
        }
        result.disagreement = std::sqrt(sum / (3.0 * 51.0)) / landmark_box_px;
        for (int i = 0; i < 68; ++i) {
            // dlib counts pixel centres: +0.5 to image space.
            const Eigen::Vector2d point_in_crop = mean.col(i).array() + 0.5;
            result.landmarks.landmarks.push_back(
                {.name = std::to_string(i + 1),
                 .point_px = Eigen::Vector2d(place.left, place.top) + point_in_crop / scale});
        }
        return result;
    }

    DetectedFace face(const ImageU8& picture, const FaceBox& box) const
    {
        Estimate found = estimate(picture, box);
        return {.box = box, .landmarks = std::move(found.landmarks), .confidence = confidence_of(found.disagreement)};
    }
};

DlibDetector::DlibDetector(const DlibDetectorOptions& options) : implementation_(std::make_unique<Implementation>())
{
    implementation_->predictor = load_landmark_model(find_landmark_model(options.landmark_model));
}

DlibDetector::~DlibDetector() = default;
DlibDetector::DlibDetector(DlibDetector&&) noexcept = default;
DlibDetector& DlibDetector::operator=(DlibDetector&&) noexcept = default;

std::vector<DetectedFace> DlibDetector::detect(const ImageU8& picture, const DetectionOptions& options)
{
    const char* const function = "DlibDetector::detect";
    require_rgb(picture, function);
    require(std::isfinite(options.min_face_size_px) && options.min_face_size_px >= 0.0, function, "min_face_size_px",
            "a number >= 0", to_text(options.min_face_size_px));
    require(std::isfinite(options.score_threshold), function, "score_threshold", "a finite number",
            to_text(options.score_threshold));
    require(options.max_overlap >= 0.0 && options.max_overlap <= 1.0, function, "max_overlap", "a number in [0, 1]",
            to_text(options.max_overlap));
    require(options.max_search_pixels > 0, function, "max_search_pixels", "a number > 0",
            std::to_string(options.max_search_pixels));
    if (picture.empty()) {
        return {};
    }
    const double largest_scale =
        std::sqrt(static_cast<double>(options.max_search_pixels) / (double(picture.width) * picture.height));
    const auto search = [&](double scale) {
        return without_duplicates(
            implementation_->search_all(picture, std::min(scale, largest_scale), options.score_threshold),
            options.max_overlap);
    };
    std::vector<FaceBox> boxes;
    if (options.min_face_size_px > 0.0) {
        boxes = search(detector_window_px / options.min_face_size_px);
    } else {
        boxes = search(1.0);
        if (boxes.empty() && largest_scale > 1.0) {
            boxes = search(2.0);
        }
    }
    std::stable_sort(boxes.begin(), boxes.end(), [](const FaceBox& a, const FaceBox& b) { return area(a) > area(b); });
    std::vector<DetectedFace> faces;
    for (const FaceBox& box : boxes) {
        faces.push_back(implementation_->face(picture, box));
    }
    return faces;
}

LandmarkSet DlibDetector::landmarks(const ImageU8& picture, const FaceBox& box)
{
    const char* const function = "DlibDetector::landmarks";
    require_rgb(picture, function);
    require(!picture.empty(), function, "picture", "a picture", "an empty one");
    require(is_usable(box, picture), function, "box", "a box that overlaps the picture, sides from 1 px to 4 times its",
            to_text(box.width) + " x " + to_text(box.height) + " at " + to_text(box.left) + ", " + to_text(box.top));
    return implementation_->estimate(picture, box).landmarks;
}

std::optional<DetectedFace> DlibDetector::follow(const ImageU8& picture, const LandmarkSet& previous)
{
    require_rgb(picture, "DlibDetector::follow");
    require(!picture.empty(), "DlibDetector::follow", "picture", "a picture", "an empty one");
    const FaceBox expected = box_of(previous);
    if (!is_usable(expected, picture)) {
        return std::nullopt;
    }
    const DetectedFace kept = implementation_->face(picture, expected);
    if (kept.confidence > 0.8) {
        return kept;
    }
    // In doubt: ask the detector, in a crop with room for a quick move.
    constexpr double crop_per_side = 2.2;
    constexpr double expected_side_px = 100.0; // in the crop: a face of 0.8 of the size is still found
    const CropPlace place = {.left = expected.left - 0.5 * (crop_per_side - 1.0) * expected.width,
                             .top = expected.top - 0.5 * (crop_per_side - 1.0) * expected.height,
                             .scale = expected_side_px / expected.width,
                             .width = static_cast<int>(crop_per_side * expected_side_px),
                             .height = static_cast<int>(crop_per_side * expected_side_px)};
    const std::vector<FaceBox> boxes = without_duplicates(implementation_->search(picture, place, 0.0), 0.4);
    if (!boxes.empty()) {
        const DetectedFace found = implementation_->face(picture, boxes.front());
        return found.confidence >= kept.confidence ? found : kept;
    }
    return kept.confidence > 0.2 ? std::optional<DetectedFace>(kept) : std::nullopt;
}

} // namespace lineament
