// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "mediapipe_points.hpp"

#include "coarse_surface.hpp"

#include <cmath>
#include <limits>

namespace lineament::build {

namespace {

constexpr int num_points = 478;

/// How far the networks' points of a region lie from the face's, and as how many independent points they count: the
/// points of a region err together.
struct RegionNoise
{
    double percent = 0.0; ///< Standard deviation of a coordinate, % of the distance of the outer eye corners.
    double num_independent = 0.0;
};

constexpr RegionNoise noise_of(MeshRegion region)
{
    switch (region) {
    case MeshRegion::eyes:
        return {1.5, 12.0};
    case MeshRegion::brows:
        return {2.5, 8.0};
    case MeshRegion::nose:
        return {2.3, 8.0};
    case MeshRegion::mouth:
        return {1.5, 12.0};
    case MeshRegion::skin:
        return {2.8, 8.0};
    case MeshRegion::oval:
        return {5.2, 8.0};
    case MeshRegion::iris:
        break;
    }
    return {std::numeric_limits<double>::infinity(), 1.0};
}

} // namespace

LandmarkMap make_mediapipe_map(const MorphableModel& model, int right_eye_corner)
{
    const CoarseSurface surface(model);
    const Eigen::Vector3d right_corner = surface.vertex(right_eye_corner);
    const Eigen::Vector3d left_corner = surface.vertex(model.mirror[right_eye_corner]);
    const Eigen::Vector3d middle = 0.5 * (right_corner + left_corner);
    const double eye_distance = (left_corner - right_corner).norm();

    std::array<int, 7> region_sizes = {};
    for (const MeshPoint& entry : mediapipe_points) {
        region_sizes[static_cast<std::size_t>(entry.region)] += entry.partner == entry.point ? 1 : 2;
    }
    LandmarkMap map;
    map.scheme = "mediapipe478";
    map.vertices.resize(3, num_points);
    map.weights.resize(3, num_points);
    Eigen::VectorXf noise_mm(num_points);
    for (int i = 0; i < num_points; ++i) {
        map.names.push_back(std::to_string(i));
    }
    for (const MeshPoint& entry : mediapipe_points) {
        const Eigen::Vector3d target = middle + eye_distance * Eigen::Vector3d(entry.x, entry.y, entry.z);
        const bool is_iris = entry.region == MeshRegion::iris;
        const SurfacePoint place = entry.partner == entry.point ? surface.closest_in_symmetry_plane(target)
                                                                : surface.closest(target, is_iris ? "eyes" : "skin");
        map.vertices.col(entry.point) = place.vertices;
        map.weights.col(entry.point) = place.rounded_weights();
        const RegionNoise noise = noise_of(entry.region);
        const int count = region_sizes[static_cast<std::size_t>(entry.region)];
        noise_mm[entry.point] =
            static_cast<float>(0.01 * noise.percent * eye_distance * std::sqrt(count / noise.num_independent));
        if (entry.partner != entry.point) {
            map.vertices.col(entry.partner) = surface.mirrored(place).vertices;
            map.weights.col(entry.partner) = map.weights.col(entry.point);
            noise_mm[entry.partner] = noise_mm[entry.point];
        }
    }
    map.noise_mm["mediapipe"] = noise_mm;
    return map;
}

} // namespace lineament::build
