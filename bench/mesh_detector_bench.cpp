// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// How many annotated faces the mesh detector finds, how far its inner 51 points lie from the annotation, what it costs.
//   mesh_detector_bench DATA     DATA/images/<set>/ with iBUG .pts beside the pictures, DATA/video/*.mp4
#include "lineament/io/image_file.hpp"
#include "lineament/io/landmark_file.hpp"
#include "lineament/vision/mesh_detector.hpp"
#include "lineament/vision/video.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>

namespace {

using namespace lineament;
namespace fs = std::filesystem;

/// Processor time of this thread: does not count what other programs take.
double thread_ms()
{
    timespec time = {};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return 1000.0 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

double resident_megabytes()
{
    std::ifstream file("/proc/self/statm");
    double total = 0.0;
    double resident = 0.0;
    file >> total >> resident;
    return resident * 4096.0 / 1e6;
}

double median(std::vector<double> values)
{
    std::sort(values.begin(), values.end());
    return values.empty() ? 0.0 : values[values.size() / 2];
}

/// Mean distance of the inner points 18 ... 68, % of the outer-eye distance of the annotation.
double inner_error_percent(const LandmarkSet& found, const LandmarkSet& truth)
{
    double sum = 0.0;
    for (int i = 18; i <= 68; ++i) {
        const std::string name = std::to_string(i);
        sum += (found.find(name)->point_px - truth.find(name)->point_px).norm();
    }
    return 100.0 * sum / (51.0 * (truth.find("37")->point_px - truth.find("46")->point_px).norm());
}

/// The picture an annotation belongs to: same stem, or the stem without what follows the first or last "_".
fs::path picture_of(const fs::path& annotation)
{
    const std::string stem = annotation.stem().string();
    for (const std::string& name : {stem, stem.substr(0, stem.find('_')), stem.substr(0, stem.rfind('_'))}) {
        for (const char* extension : {".jpg", ".png"}) {
            if (fs::exists(annotation.parent_path() / (name + extension))) {
                return annotation.parent_path() / (name + extension);
            }
        }
    }
    return {};
}

void measure_set(MeshDetector& detector, const fs::path& folder)
{
    std::map<fs::path, std::vector<LandmarkSet>> faces_of;
    for (const auto& entry : fs::directory_iterator(folder)) {
        if (entry.path().extension() == ".pts" && !picture_of(entry.path()).empty()) {
            // iBUG counts pixels from 1; the reannotated AFLW2000 points from 0.
            LandmarkFileOptions options = {.pts_header = PtsHeader::optional};
            if (entry.path().stem().string().find("reannotated") != std::string::npos) {
                options.pts_origin = PtsOrigin::zero_based;
            }
            faces_of[picture_of(entry.path())].push_back(load_landmarks(entry.path().string(), options).frames[0].set);
        }
    }
    int annotated = 0;
    int unannotated = 0;
    std::vector<double> errors;
    std::vector<double> times_ms;
    for (const auto& [path, truths] : faces_of) {
        const ImageU8 picture = load_image(path);
        const double start_ms = thread_ms();
        const std::vector<MeshFace> faces = detector.detect(picture);
        times_ms.push_back(thread_ms() - start_ms);
        unannotated += static_cast<int>(faces.size());
        for (const LandmarkSet& truth : truths) {
            ++annotated;
            double best = 35.0; // a larger error means another face
            for (const MeshFace& face : faces) {
                best = std::min(best, inner_error_percent(ibug68_from_mediapipe(face.landmarks), truth));
            }
            if (best < 35.0) {
                errors.push_back(best);
                --unannotated;
            }
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
    }
    std::printf("%-32s %6d %8d %10d %9.2f %9.2f\n", path.filename().c_str(), frames, followed, detections,
                median(follow_ms), median(detect_ms));
}

} // namespace

int main(int count, char** arguments)
{
    if (count != 2) {
        std::fprintf(stderr, "usage: mesh_detector_bench DATA\n");
        return 2;
    }
    try {
        const fs::path data = arguments[1];
        const double memory_before = resident_megabytes();
        const double start_ms = thread_ms();
        MeshDetector detector;
        std::printf("loaded in %.1f ms", thread_ms() - start_ms);
        (void)detector.detect(ImageU8(640, 480, 3));
        std::printf(", %.1f MB resident\n\n", resident_megabytes() - memory_before);
        std::printf("set                annotated  found other_faces inner51_%% ms/photo   (medians)\n");
        for (const char* set : {"helen_test", "helen_train", "afw", "lfpw_same_person", "aflw2000"}) {
            measure_set(detector, data / "images" / set);
        }
        std::printf("\nvideo                            frames followed detections follow_ms detect_ms\n");
        for (const auto& entry : fs::directory_iterator(data / "video")) {
            if (entry.path().extension() != ".md") {
                measure_video(detector, entry.path());
            }
        }
    } catch (const std::exception& error) {
        std::fprintf(stderr, "mesh_detector_bench: error: %s\n", error.what());
        return 1;
    }
}
