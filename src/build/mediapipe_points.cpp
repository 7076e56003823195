// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "mediapipe_points.hpp"

#include "lineament/core/closest_point.hpp"

#include <Eigen/Dense>

#include <algorithm>
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

/// A mixture of three vertices.
struct Mixture
{
    double distance = std::numeric_limits<double>::infinity(); ///< From the point asked for.
    Eigen::Vector3i vertices = Eigen::Vector3i::Zero();
    Eigen::Vector3d weights = Eigen::Vector3d::UnitX();
};

class CoarseSurface
{
public:
    explicit CoarseSurface(const MorphableModel& model)
        : model_(model), level_(model.levels.front()), vertices_(model.shape.mean.data(), 3, model.num_vertices())
    {}

    [[nodiscard]] Eigen::Vector3d vertex(int v) const { return vertices_.col(v).cast<double>(); }

    /// The nearest point on the triangles of the group.
    [[nodiscard]] Mixture closest(const Eigen::Vector3d& p, const std::string& group) const
    {
        Mixture best;
        for (Eigen::Index t = 0; t < level_.triangles.cols(); ++t) {
            if (!is_of(t, group)) {
                continue;
            }
            const Eigen::Vector3i corners = level_.triangles.col(t);
            const Eigen::Vector3d a = vertex(corners[0]);
            const Eigen::Vector3d b = vertex(corners[1]);
            const Eigen::Vector3d c = vertex(corners[2]);
            const Eigen::Vector3d point = closest_point_on_triangle(p, a, b, c);
            if ((point - p).norm() < best.distance) {
                Eigen::Matrix<double, 3, 2> edges;
                edges << b - a, c - a;
                const Eigen::Vector2d bc = edges.colPivHouseholderQr().solve(point - a);
                best = {(point - p).norm(), corners, Eigen::Vector3d(1.0 - bc.sum(), bc.x(), bc.y())};
            }
        }
        return best;
    }

    /// The nearest point where the skin meets the symmetry plane: on edges in the plane, and on triangles (v, partner
    /// of v, b in the plane) from the middle of v and its partner to b.
    [[nodiscard]] Mixture closest_in_symmetry_plane(const Eigen::Vector3d& p) const
    {
        Mixture best;
        const auto try_segment = [&](const Eigen::Vector3i& corners, const Eigen::Vector3d& from,
                                     const Eigen::Vector3d& to) {
            Eigen::Matrix3d points;
            points << vertex(corners[0]), vertex(corners[1]), vertex(corners[2]);
            const Eigen::Vector3d start = points * from;
            const Eigen::Vector3d along = points * to - start;
            const double s = std::clamp(along.dot(p - start) / along.squaredNorm(), 0.0, 1.0);
            const Eigen::Vector3d weights = (1.0 - s) * from + s * to;
            const double distance = (points * weights - p).norm();
            if (distance < best.distance) {
                best = {distance, corners, weights};
            }
        };
        for (Eigen::Index t = 0; t < level_.triangles.cols(); ++t) {
            if (!is_of(t, "skin")) {
                continue;
            }
            for (int i = 0; i < 3; ++i) {
                const Eigen::Vector3i corners(level_.triangles(i, t), level_.triangles((i + 1) % 3, t),
                                              level_.triangles((i + 2) % 3, t));
                const bool first_in_plane = model_.mirror[corners[0]] == corners[0];
                if (first_in_plane && model_.mirror[corners[1]] == corners[1]) {
                    try_segment(corners, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY());
                } else if (first_in_plane && model_.mirror[corners[1]] == corners[2]) {
                    try_segment(corners, Eigen::Vector3d(0.0, 0.5, 0.5), Eigen::Vector3d::UnitX());
                }
            }
        }
        return best;
    }

private:
    [[nodiscard]] bool is_of(Eigen::Index triangle, const std::string& group) const
    {
        return model_.triangle_group_names[static_cast<std::size_t>(level_.triangle_groups[triangle])] == group;
    }

    const MorphableModel& model_;
    const Level& level_;
    Eigen::Map<const Eigen::Matrix3Xf> vertices_;
};

/// Weights in float that are not negative and sum to 1.
Eigen::Vector3f rounded(const Eigen::Vector3d& weights)
{
    const Eigen::Vector3d positive = weights.cwiseMax(0.0);
    return (positive / positive.sum()).cast<float>();
}

} // namespace

LandmarkMap make_mediapipe_map(const MorphableModel& model)
{
    const CoarseSurface surface(model);
    const LandmarkMap& ibug = *model.find_landmark_map("ibug68");
    const Eigen::Vector3d right_corner = surface.vertex(ibug.vertices(0, ibug.index_of("37")));
    const Eigen::Vector3d left_corner = surface.vertex(ibug.vertices(0, ibug.index_of("46")));
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
        const Mixture mixture = entry.partner == entry.point ? surface.closest_in_symmetry_plane(target)
                                                             : surface.closest(target, is_iris ? "eyes" : "skin");
        map.vertices.col(entry.point) = mixture.vertices;
        map.weights.col(entry.point) = rounded(mixture.weights);
        const RegionNoise noise = noise_of(entry.region);
        const int count = region_sizes[static_cast<std::size_t>(entry.region)];
        noise_mm[entry.point] =
            static_cast<float>(0.01 * noise.percent * eye_distance * std::sqrt(count / noise.num_independent));
        if (entry.partner != entry.point) {
            for (int corner = 0; corner < 3; ++corner) {
                map.vertices(corner, entry.partner) = model.mirror[mixture.vertices[corner]];
            }
            map.weights.col(entry.partner) = map.weights.col(entry.point);
            noise_mm[entry.partner] = noise_mm[entry.point];
        }
    }
    map.noise_mm["mediapipe"] = noise_mm;
    return map;
}

} // namespace lineament::build
