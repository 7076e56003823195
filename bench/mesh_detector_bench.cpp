// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What the mesh detector costs, part by part, and how it does on rendered heads turned up to 90 degrees; with DATA also
// how many annotated faces it finds, how far its inner 51 points lie from the annotation, also by yaw, and how much
// they tremble in videos.
//   mesh_detector_bench [DATA]     DATA/images/<set>/ with iBUG .pts beside the pictures, DATA/video/*.mp4
#include "detector_measures.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/vision/mesh_detector.hpp"
#include "lineament/vision/video.hpp"
#include "mesh_detector_parts.hpp"
#include "photo_sets.hpp"

#include <algorithm>
#include <cstdio>
#include <optional>

namespace {

using namespace lineament;
using namespace lineament::bench;

void measure_set(MeshDetector& detector, const fs::path& folder, ErrorsByYaw& by_yaw)
{
    int annotated = 0;
    int unannotated = 0;
    std::vector<double> errors;
    std::vector<double> times_ms;
    for (const auto& [path, truths] : annotated_faces(folder)) {
        const ImageU8 picture = load_image(path);
        const double start_ms = thread_ms();
        const std::vector<MeshFace> faces = detector.detect(picture);
        times_ms.push_back(thread_ms() - start_ms);
        unannotated += static_cast<int>(faces.size());
        for (const LandmarkSet& truth : truths) {
            ++annotated;
            double best = other_face_percent;
            for (const MeshFace& face : faces) {
                best = std::min(best, error_percent(ibug68_from_mediapipe(face.landmarks), truth));
            }
            const bool is_found = best < other_face_percent;
            if (is_found) {
                errors.push_back(best);
                --unannotated;
            }
            by_yaw.add(truth, 0.5 * Eigen::Vector2d(picture.width, picture.height),
                       is_found ? std::optional(best) : std::nullopt);
        }
    }
    std::printf("%-18s %9d %6zu %12d %9.2f %8.2f\n", folder.filename().c_str(), annotated, errors.size(), unannotated,
                median(errors), median(times_ms));
}

void measure_video(MeshDetector& detector, const fs::path& path)
{
    VideoReader reader(path.string());
    int frames = 0;
    int followed = 0;
    int detections = 0;
    std::vector<double> follow_ms;
    std::vector<double> detect_ms;
    MeshFace face;
    bool found = false;
    Jitter jitter;
    while (const std::optional<VideoFrame> frame = reader.next()) {
        ++frames;
        double start_ms = thread_ms();
        if (found) {
            found = detector.follow_in_place(frame->picture, face);
            follow_ms.push_back(thread_ms() - start_ms);
            followed += found ? 1 : 0;
        }
        if (!found) {
            start_ms = thread_ms();
            const std::vector<MeshFace> faces = detector.detect(frame->picture, {.max_faces = 1});
            detect_ms.push_back(thread_ms() - start_ms);
            ++detections;
            found = !faces.empty();
            if (found) {
                face = faces.front();
            }
        }
        jitter.add(found ? std::optional(ibug68_from_mediapipe(face.landmarks)) : std::nullopt);
    }
    std::printf("%-32s %6d %8d %10d %9.2f %9.2f %8.2f\n", path.filename().c_str(), frames, followed, detections,
                median(follow_ms), median(detect_ms), jitter.percent());
}

} // namespace

int main(int count, char** arguments)
{
    if (count > 2) {
        std::fprintf(stderr, "usage: mesh_detector_bench [DATA]\n");
        return 2;
    }
    try {
        std::optional<MeshDetector> detector;
        print_loading(detector);
        MeshDetectorParts().print_times();
        print_rendered_yaw(*detector);
        if (count == 1) {
            return 0;
        }
        const fs::path data = arguments[1];
        ErrorsByYaw by_yaw;
        std::printf("\nset                annotated  found other_faces inner51_%% ms/photo   (medians)\n");
        for (const char* set : photo_sets) {
            measure_set(*detector, data / "images" / set, by_yaw);
        }
        by_yaw.print();
        std::printf("\nvideo                            frames followed detections follow_ms detect_ms jitter_%%\n");
        for (const auto& entry : fs::directory_iterator(data / "video")) {
            if (entry.path().extension() != ".md") {
                measure_video(*detector, entry.path());
            }
        }
    } catch (const std::exception& error) {
        std::fprintf(stderr, "mesh_detector_bench: error: %s\n", error.what());
        return 1;
    }
}
