// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Heads of another model turned far away: how long do MediaPipe's points hold, and what are those of the far side
// worth?
//
//   bench/ict_heads.py FOLDER heads.safetensors       (ICT-FaceKit: modes of 100 scanned identities)
//   turned_heads heads.safetensors [--heads 40]
//
// Each head is painted, rendered and detected at each yaw, to the left and to the right in turn, and fitted by
// JointFitter to all points alike, to those that MeshDetector gives (far side doubted), and to the near side alone.
// Identity: NoW protocol.
#include "foreign_heads.hpp"
#include "head_pictures.hpp"
#include "options.hpp"

#include "lineament/fit/fitted_shape.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"
#include "lineament/vision/mesh_detector.hpp"
#include "lineament/vision/mesh_yaw.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <string>

namespace {

using namespace lineament;
using namespace lineament::bench;

enum Points
{
    all,
    doubted,
    near_side,
    num_kinds,
};

/// Means over the heads found at one yaw.
struct Row
{
    int num_found = 0;
    double mesh_yaw_deg = 0.0;
    double mean_face_mm = 0.0;
    std::array<double, num_kinds> yaw_deg = {};
    std::array<double, num_kinds> distance_mm = {};
};

/// The points with the confidence they would have as one of the kinds.
LandmarkSet as_kind(LandmarkSet set, Points kind)
{
    for (Landmark& landmark : set.landmarks) {
        landmark.confidence = kind == all                                    ? 1.0
                              : kind == near_side && landmark.confidence < 1 ? 0.0
                                                                             : landmark.confidence;
    }
    return set;
}

/// The view, turned to that yaw.
Camera turned_to(Camera camera, double yaw_deg)
{
    HeadAngles angles = angles_from_rotation(camera.camera_from_model);
    angles.yaw = radians(yaw_deg);
    camera.camera_from_model = rotation_from_angles(angles);
    return camera;
}

} // namespace

int main(int argc, char** argv)
{
    const Options options(argc, argv, "turned_heads HEADS.safetensors [--heads N]", 1);
    const int num_heads = options.count("--heads", 40, 1);
    const ForeignModel foreign = load_foreign_model(argv[1]);
    const HeadPictures pictures(argv[1]);
    const MorphableModel model = load_model_file(default_model_path().string()).model;
    const JointFitter fitter(model, "mediapipe478", {}, &kernels::dispatched_kernels());
    MeshDetector detector;

    std::printf("means over the heads found; distance: median of a head, NoW protocol\n"
                "%4s %7s %9s | %-26s | %-38s\n%4s %7s %9s | %8s %8s %8s | %8s %8s %8s %10s\n",
                "", "", "", "yaw of the fit, degrees", "distance, mm", "yaw", "found", "mesh yaw", "all", "doubted",
                "near", "all", "doubted", "near", "mean face");
    for (int yaw_deg = 40; yaw_deg <= 90; yaw_deg += 8) {
        Random random(1);
        Row row;
        for (int h = 0; h < num_heads; ++h) {
            const Head head = make_head(foreign, random);
            const double side = h % 2 == 0 ? 1.0 : -1.0;
            const Camera camera = turned_to(make_view(foreign, head, random).camera, side * yaw_deg);
            const ImageU8 picture = pictures.render(head.coefficients, camera, random);
            const std::vector<MeshFace> faces = detector.detect(picture, {.max_faces = 1});
            if (faces.empty()) {
                continue;
            }
            ++row.num_found;
            const LandmarkSet& landmarks = faces.front().landmarks;
            row.mesh_yaw_deg += side * degrees(mesh_yaw(landmarks).value());
            row.mean_face_mm += distance(head, foreign, model, model.shape.mean).median_mm;
            for (int kind = 0; kind < num_kinds; ++kind) {
                const FitResult fit = fitter.fit(as_kind(landmarks, static_cast<Points>(kind)), principal_point_px).fit;
                row.yaw_deg[kind] += side * degrees(angles_from_rotation(fit.camera.camera_from_model).yaw);
                row.distance_mm[kind] += distance(head, foreign, model, neutral_shape_of(model, fit)).median_mm;
            }
        }
        const double n = std::max(row.num_found, 1);
        std::printf("%4d %3d/%-3d %9.1f | %8.1f %8.1f %8.1f | %8.3f %8.3f %8.3f %10.3f\n", yaw_deg, row.num_found,
                    num_heads, row.mesh_yaw_deg / n, row.yaw_deg[all] / n, row.yaw_deg[doubted] / n,
                    row.yaw_deg[near_side] / n, row.distance_mm[all] / n, row.distance_mm[doubted] / n,
                    row.distance_mm[near_side] / n, row.mean_face_mm / n);
        std::fflush(stdout);
    }
    return 0;
}
