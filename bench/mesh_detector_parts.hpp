// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "detector_measures.hpp"

#include "face_boxes.hpp"
#include "mesh_network.hpp"

#include "lineament/vision/mesh_detector.hpp"
#include "support/rendered_person.hpp"

#include <cstdio>
#include <cstdlib>
#include <functional>
#include <optional>
#include <string>
#include <vector>

/// What the mesh detector's parts cost, and how it does on turned heads whose points are known: on rendered people.
namespace lineament::bench {

[[nodiscard]] inline network::Network network_of(const network::KnownNetwork& known)
{
    const char* const folder = std::getenv("LINEAMENT_NETWORKS");
    return network::load_network(std::string(folder != nullptr ? folder : LINEAMENT_SOURCE_MODELS) + "/" +
                                     std::string(known.file),
                                 known.sha256);
}

/// The networks one by one, as MeshDetector holds them.
class MeshDetectorParts
{
public:
    /// Prints what each network adds to the memory once it has run.
    MeshDetectorParts()
    {
        std::printf("part               resident_MB\n");
        const ImageU8 blank(640, 480, 3);
        double before = resident_megabytes();
        const auto print = [&](const char* name) {
            const double now = resident_megabytes();
            std::printf("%-18s %11.1f\n", name, now - before);
            before = now;
        };
        std::vector<BoxedFace> faces;
        near_.emplace(network_of(network::short_range_network));
        near_->detect(blank, 0.5, faces);
        print("near network");
        far_.emplace(network_of(network::full_range_network));
        far_->detect(blank, 0.5, faces);
        print("far network");
        mesh_.emplace(network_of(network::landmark_network));
        MeshEstimate estimate;
        mesh_->estimate(blank, window_around(blank), estimate);
        print("mesh network");
    }

    /// Each step on a rendered face, and the whole detector on one and on four. The 10th percentile is what a quiet
    /// machine takes; the median is of this one.
    void print_times()
    {
        const ImageU8 picture = test::RenderedPerson(4).picture(20.0, 640, 480);
        const ImageU8 pair = test::side_by_side(picture, test::RenderedPerson(5).picture(-20.0, 640, 480));
        const ImageU8 four = test::side_by_side(pair, pair);
        MeshDetector detector;
        const MeshFace face = detector.detect(picture, {.max_faces = 1}).at(0);
        MeshFace followed = face;
        MeshEstimate estimate;
        std::vector<BoxedFace> boxes;
        boxes.reserve(far_->max_faces());
        std::vector<float> samples(192 * 192 * 3);
        const SquareWindow whole = window_around(picture);
        const SquareWindow around = window_of(face.points);
        const auto near = network::make_engine(network_of(network::short_range_network));
        const auto far = network::make_engine(network_of(network::full_range_network));
        const auto mesh = network::make_engine(network_of(network::landmark_network));
        sample_window(picture, whole, 128, Border::black, -1.0f, 1.0f, near->input());
        sample_window(picture, whole, 192, Border::black, -1.0f, 1.0f, far->input());
        sample_window(picture, around, 192, Border::repeated, 0.0f, 1.0f, mesh->input());

        std::printf("\nstep                         p10_ms median_ms\n");
        const auto time = [](const char* name, const std::function<void()>& step) {
            std::vector<double> times_ms;
            for (int repeat = 0; repeat < 200; ++repeat) {
                const double start_ms = thread_ms();
                step();
                times_ms.push_back(thread_ms() - start_ms);
            }
            std::printf("%-28s %6.3f %9.3f\n", name, quantile(times_ms, 0.1), median(times_ms));
        };
        time("crop, 128 x 128", [&] { sample_window(picture, whole, 128, Border::black, -1.0f, 1.0f, samples); });
        time("near network", [&] { near->run(); });
        time("crop, network and decoding", [&] { near_->detect(picture, 0.5, boxes); });
        time("crop, 192 x 192", [&] { sample_window(picture, whole, 192, Border::black, -1.0f, 1.0f, samples); });
        time("far network", [&] { far->run(); });
        time("crop, network and decoding", [&] { far_->detect(picture, 0.5, boxes); });
        time("crop, 192 x 192, turned",
             [&] { sample_window(picture, around, 192, Border::repeated, 0.0f, 1.0f, samples); });
        time("mesh network", [&] { mesh->run(); });
        time("crop, network and decoding", [&] { mesh_->estimate(picture, around, estimate); });
        time("detect, max_faces = 1", [&] { (void)detector.detect(picture, {.max_faces = 1}); });
        time("detect, one face of 16", [&] { (void)detector.detect(picture); });
        time("detect, four faces of 16", [&] { (void)detector.detect(four); });
        time("follow_in_place", [&] { (void)detector.follow_in_place(picture, followed); });
    }

private:
    std::optional<BoxDetector> near_;
    std::optional<BoxDetector> far_;
    std::optional<MeshNetwork> mesh_;
};

/// Share of turned heads found, and distance of points from those of the rendered model, % of the outer-eye distance as
/// it were from the front: the inner 51 points, and corners of eye and mouth of the nearer side.
inline void print_rendered_yaw(MeshDetector& detector)
{
    constexpr int num_people = 30;
    constexpr int side = 400;
    std::printf("\nyaw_deg  heads  found inner51_%% near_corners_%%   (rendered; medians)\n");
    for (int yaw_deg = 0; yaw_deg <= 90; yaw_deg += 10) {
        std::vector<double> inner;
        std::vector<double> corners;
        for (int i = 0; i < num_people; ++i) {
            const test::RenderedPerson person(static_cast<std::uint64_t>(i + 1));
            const double yaw = i % 2 == 0 ? yaw_deg : -yaw_deg;
            const std::vector<MeshFace> faces = detector.detect(person.picture(yaw, side, side), {.max_faces = 1});
            if (faces.empty()) {
                continue;
            }
            const Eigen::Matrix2Xd truth = person.mesh_points(yaw, side, side);
            LandmarkSet named = faces[0].landmarks;
            for (int k = 0; k < num_mesh_points; ++k) {
                named.landmarks[k].point_px = truth.col(k);
            }
            const double eyes = person.outer_eye_distance_px(yaw, side, side);
            const LandmarkSet points = ibug68_from_mediapipe(faces[0].landmarks);
            const LandmarkSet true_points = ibug68_from_mediapipe(named);
            double sum = 0.0;
            for (int ibug = 18; ibug <= 68; ++ibug) {
                const std::string name = std::to_string(ibug);
                sum += (points.find(name)->point_px - true_points.find(name)->point_px).norm();
            }
            inner.push_back(100.0 * sum / (51.0 * eyes));
            // The tip of the nose has moved away from the nearer eye.
            const bool right_is_near = std::abs(truth(0, 4) - truth(0, 33)) > std::abs(truth(0, 4) - truth(0, 263));
            double corner_sum = 0.0;
            for (const int k : right_is_near ? std::array{33, 133, 61} : std::array{263, 362, 291}) {
                corner_sum += (faces[0].points.col(k).head<2>().cast<double>() - truth.col(k)).norm();
            }
            corners.push_back(100.0 * corner_sum / (3.0 * eyes));
        }
        std::printf("%7d %6d %6zu %9.2f %14.2f\n", yaw_deg, num_people, inner.size(), median(inner), median(corners));
    }
}

} // namespace lineament::bench
