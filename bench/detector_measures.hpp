// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "measures.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/core/image.hpp"
#include "lineament/core/landmarks.hpp"
#include "lineament/fit/face_fitter.hpp"
#include "lineament/io/model_file.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>
#include <vector>

/// What the benchmark programs of both detectors measure alike.
namespace lineament::bench {

[[nodiscard]] inline double resident_megabytes()
{
    std::ifstream file("/proc/self/statm");
    double total = 0.0;
    double resident = 0.0;
    file >> total >> resident;
    return resident * 4096.0 / 1e6;
}

/// Loads a detector, and prints the time it takes and what it keeps in memory once it has looked at a picture.
template <typename Detector>
void print_loading(std::optional<Detector>& detector)
{
    const double memory_before = resident_megabytes();
    const double start_ms = thread_ms();
    detector.emplace();
    const double loading_ms = thread_ms() - start_ms;
    (void)detector->detect(ImageU8(640, 480, 3));
    std::printf("loaded in %.1f ms, %.1f MB resident\n\n", loading_ms, resident_megabytes() - memory_before);
}

/// Errors of faces by how far the head is turned, which a fit to the annotation tells.
class ErrorsByYaw
{
public:
    /// @param error_percent  Of a face that was found.
    void add(const LandmarkSet& annotation, const Eigen::Vector2d& picture_center, std::optional<double> error_percent)
    {
        const Camera camera = fitter_.fit(annotation, picture_center).camera;
        const double yaw_deg = degrees(std::abs(angles_from_rotation(camera.camera_from_model).yaw));
        Bin& bin = bins_[static_cast<std::size_t>(std::min(yaw_deg / 15.0, 3.0))];
        ++bin.num_annotated;
        if (error_percent) {
            bin.errors.push_back(*error_percent);
        }
    }

    void print() const
    {
        std::printf("\n|yaw|_deg          annotated  found inner51_%%\n");
        constexpr std::array names = {"0 to 15", "15 to 30", "30 to 45", "from 45"};
        for (std::size_t b = 0; b < bins_.size(); ++b) {
            std::printf("%-18s %9d %6zu %9.2f\n", names[b], bins_[b].num_annotated, bins_[b].errors.size(),
                        median(bins_[b].errors));
        }
    }

private:
    struct Bin
    {
        int num_annotated = 0;
        std::vector<double> errors = {};
    };
    FaceFitter fitter_{load_model(default_model_path())};
    std::array<Bin, 4> bins_ = {};
};

/// How much the points 18 to 68 tremble from frame to frame: the standard deviation of independent noise of a
/// coordinate that has the same median second difference, % of the outer-eye distance. Smooth motion cancels in it.
class Jitter
{
public:
    /// @param points  Of the next frame; a frame without a face: nothing.
    void add(const std::optional<LandmarkSet>& points)
    {
        frames_.push_back(points);
        const std::size_t count = frames_.size();
        if (count < 3 || !frames_[count - 1] || !frames_[count - 2] || !frames_[count - 3]) {
            return;
        }
        const LandmarkSet &now = *frames_[count - 1], &before = *frames_[count - 2], &first = *frames_[count - 3];
        const double distance = (now.find("37")->point_px - now.find("46")->point_px).norm();
        for (int ibug = 18; ibug <= 68; ++ibug) {
            const std::string name = std::to_string(ibug);
            const Eigen::Vector2d second =
                now.find(name)->point_px - 2.0 * before.find(name)->point_px + first.find(name)->point_px;
            differences_.push_back(100.0 * std::abs(second.x()) / distance);
            differences_.push_back(100.0 * std::abs(second.y()) / distance);
        }
    }

    [[nodiscard]] double percent() const
    {
        constexpr double median_of_normal = 0.6745; // of |x|, x of deviation 1; second differences have sqrt(6)
        return median(differences_) / (median_of_normal * std::sqrt(6.0));
    }

private:
    std::vector<std::optional<LandmarkSet>> frames_ = {};
    std::vector<double> differences_ = {};
};

} // namespace lineament::bench
