// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// How many annotated faces the detector finds, how far its landmarks lie from the annotation, also by yaw, and how much
// they tremble in videos.
//   detector_bench DATA     DATA/images/<set>/ with iBUG .pts beside the pictures, DATA/video/*.mp4
// Times of detection and following are processor times, those of decoding are wall times on all cores.
#include "detector_measures.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/vision/dlib_detector.hpp"
#include "lineament/vision/video.hpp"
#include "photo_sets.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <optional>

namespace {

using namespace lineament;
using namespace lineament::bench;

/// What the constants of box_of and of the confidence rest on.
struct Calibration
{
    std::vector<double> side_per_spread;   ///< Side of the detector's box over the rms distance of 18 ... 68.
    std::vector<double> centre_x_per_side; ///< Centre of the box less centroid of 18 ... 68, in sides.
    std::vector<double> centre_y_per_side;
    std::vector<double> confidence;  ///< Of annotated faces that were found.
    std::vector<double> beside_kept; ///< 1 if `follow`, started beside the face, believes to have one; else 0.

    void add(DlibDetector& detector, const ImageU8& picture, const std::vector<DetectedFace>& faces,
             const DetectedFace& face);
    void print() const;
};

void Calibration::add(DlibDetector& detector, const ImageU8& picture, const std::vector<DetectedFace>& faces,
                      const DetectedFace& face)
{
    Eigen::Matrix<double, 2, 51> points;
    for (int i = 0; i < 51; ++i) {
        points.col(i) = face.landmarks.landmarks[17 + i].point_px;
    }
    const Eigen::Vector2d centroid = points.rowwise().mean();
    const FaceBox& box = face.box;
    side_per_spread.push_back(box.width / std::sqrt((points.colwise() - centroid).squaredNorm() / 51.0));
    centre_x_per_side.push_back((box.left + 0.5 * box.width - centroid.x()) / box.width);
    centre_y_per_side.push_back((box.top + 0.5 * box.height - centroid.y()) / box.width);
    confidence.push_back(face.confidence);
    for (const double shift : {-2.0 * box.width, 2.0 * box.width}) {
        const double left = box.left + shift;
        const bool free = std::none_of(faces.begin(), faces.end(), [&](const DetectedFace& other) {
            return std::abs(other.box.left - left) < 1.5 * box.width &&
                   std::abs(other.box.top - box.top) < 1.5 * box.width;
        });
        if (free && left > 0.0 && left + box.width < picture.width) {
            LandmarkSet beside = face.landmarks;
            for (Landmark& landmark : beside.landmarks) {
                landmark.point_px.x() += shift;
            }
            beside_kept.push_back(detector.follow(picture, beside) ? 1.0 : 0.0);
        }
    }
}

void Calibration::print() const
{
    const auto row = [](const char* name, const std::vector<double>& values) {
        std::printf("%-38s %4zu %8.3f %8.3f %8.3f\n", name, values.size(), quantile(values, 0.1), median(values),
                    quantile(values, 0.9));
    };
    std::printf("\ncalibration                             num     10 %%     50 %%     90 %%\n");
    row("box side / rms distance", side_per_spread);
    row("(box centre - centroid) / side, x", centre_x_per_side);
    row("(box centre - centroid) / side, y", centre_y_per_side);
    row("confidence on faces", confidence);
    std::printf("started two box widths beside a face   %4zu, kept %td\n", beside_kept.size(),
                std::count(beside_kept.begin(), beside_kept.end(), 1.0));
}

double milliseconds_since(std::chrono::steady_clock::time_point start)
{
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

void measure_set(DlibDetector& detector, const fs::path& folder, Calibration& calibration, ErrorsByYaw& by_yaw)
{
    int annotated = 0;
    int unannotated = 0;
    std::vector<double> inner;
    std::vector<double> all;
    std::vector<double> times_ms;
    for (const auto& [path, truths] : annotated_faces(folder)) {
        const ImageU8 picture = load_image(path);
        const double start_ms = thread_ms();
        const std::vector<DetectedFace> faces = detector.detect(picture);
        times_ms.push_back(thread_ms() - start_ms);
        unannotated += static_cast<int>(faces.size());
        for (const LandmarkSet& truth : truths) {
            ++annotated;
            const auto error = [&](const DetectedFace& face) { return error_percent(face.landmarks, truth); };
            const auto best = std::min_element(faces.begin(), faces.end(),
                                               [&](const auto& a, const auto& b) { return error(a) < error(b); });
            const bool is_found = best != faces.end() && error(*best) < other_face_percent;
            if (is_found) {
                inner.push_back(error(*best));
                all.push_back(error_percent(best->landmarks, truth, 1));
                --unannotated;
                calibration.add(detector, picture, faces, *best);
            }
            by_yaw.add(truth, 0.5 * Eigen::Vector2d(picture.width, picture.height),
                       is_found ? std::optional(error(*best)) : std::nullopt);
        }
    }
    std::printf("%-18s %9d %6zu %12d %9.2f %7.2f %8.0f\n", folder.filename().c_str(), annotated, inner.size(),
                unannotated, median(inner), median(all), median(times_ms));
}

void measure_video(DlibDetector& detector, const fs::path& path)
{
    VideoReader reader(path.string());
    int frames = 0;
    int followed = 0;
    int detections = 0;
    double decode_ms = 0.0;
    std::vector<double> follow_ms;
    std::optional<DetectedFace> face;
    Jitter jitter;
    while (true) {
        const auto start = std::chrono::steady_clock::now();
        const std::optional<VideoFrame> frame = reader.next();
        decode_ms += milliseconds_since(start);
        if (!frame) {
            break;
        }
        ++frames;
        if (face) {
            const double start_ms = thread_ms();
            face = detector.follow(frame->picture, face->landmarks);
            follow_ms.push_back(thread_ms() - start_ms);
            followed += face ? 1 : 0;
        }
        if (!face && frames % 5 == 1) {
            const std::vector<DetectedFace> faces = detector.detect(frame->picture);
            ++detections;
            if (!faces.empty()) {
                face = faces.front();
            }
        }
        jitter.add(face ? std::optional(face->landmarks) : std::nullopt);
    }
    std::printf("%-32s %6d %8d %10d %10.0f %9.1f %8.2f\n", path.filename().c_str(), frames, followed, detections,
                1000.0 * frames / decode_ms, median(follow_ms), jitter.percent());
}

} // namespace

int main(int count, char** arguments)
{
    if (count != 2) {
        std::fprintf(stderr, "usage: detector_bench DATA\n");
        return 2;
    }
    try {
        const fs::path data = arguments[1];
        std::optional<DlibDetector> detector;
        print_loading(detector);
        ErrorsByYaw by_yaw;
        std::printf("set                annotated  found other_faces inner51_%%  all68_%% ms/photo   (medians)\n");
        Calibration calibration;
        for (const char* set : photo_sets) {
            measure_set(*detector, data / "images" / set, calibration, by_yaw);
        }
        calibration.print();
        by_yaw.print();
        std::printf("\nvideo                            frames followed detections decode_fps follow_ms jitter_%%\n");
        for (const auto& entry : fs::directory_iterator(data / "video")) {
            measure_video(*detector, entry.path());
        }
    } catch (const std::exception& error) {
        std::fprintf(stderr, "detector_bench: error: %s\n", error.what());
        return 1;
    }
}
