// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/vision/mesh_yaw.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/core/checks.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>

namespace lineament {

namespace {

constexpr double largest_yaw_deg = 50.0; // of the mesh, where the head is turned by 54
constexpr double doubtful = 0.2;         // confidence

/// On the subject's right and left: outer and inner eye corners, mouth corners, the oval before the ears.
constexpr std::array<std::pair<int, int>, 4> mirrored_points = {{{33, 263}, {133, 362}, {61, 291}, {234, 454}}};

/// On the symmetry plane: between the eyes, below the nose, chin.
constexpr std::array<int, 3> middle_points = {168, 2, 152};

void require_mesh(const LandmarkSet& set, const char* function)
{
    require(set.scheme == "mediapipe478", function, "set.scheme", "mediapipe478", set.scheme);
}

const Landmark* find_point(const LandmarkSet& set, int number)
{
    const auto is_it = [&](const Landmark& landmark) {
        int found = -1;
        const char* const end = landmark.name.data() + landmark.name.size();
        const auto [rest, error] = std::from_chars(landmark.name.data(), end, found);
        return error == std::errc() && rest == end && found == number;
    };
    const auto place = static_cast<std::size_t>(number);
    if (place < set.landmarks.size() && is_it(set.landmarks[place])) {
        return &set.landmarks[place];
    }
    for (const Landmark& landmark : set.landmarks) {
        if (is_it(landmark)) {
            return &landmark;
        }
    }
    return nullptr;
}

std::optional<Eigen::Vector3d> position(const Landmark* landmark)
{
    if (landmark == nullptr || !landmark->depth_px) {
        return std::nullopt;
    }
    return Eigen::Vector3d(landmark->point_px.x(), landmark->point_px.y(), *landmark->depth_px);
}

/// From the head's right to its left.
std::optional<Eigen::Vector3d> lateral_direction(const LandmarkSet& set)
{
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const auto& [right, left] : mirrored_points) {
        const std::optional<Eigen::Vector3d> from = position(find_point(set, right));
        const std::optional<Eigen::Vector3d> to = position(find_point(set, left));
        if (!from || !to) {
            return std::nullopt;
        }
        sum += *to - *from;
    }
    return sum.norm() > 0 ? std::optional(Eigen::Vector3d(sum.normalized())) : std::nullopt;
}

double yaw_of(const Eigen::Vector3d& lateral)
{
    return std::atan2(lateral.z(), lateral.head<2>().norm());
}

} // namespace

std::optional<double> mesh_yaw(const LandmarkSet& set)
{
    require_mesh(set, "mesh_yaw");
    const std::optional<Eigen::Vector3d> lateral = lateral_direction(set);
    return lateral ? std::optional(yaw_of(*lateral)) : std::nullopt;
}

void doubt_folded_points(LandmarkSet& set)
{
    require_mesh(set, "doubt_folded_points");
    const std::optional<Eigen::Vector3d> lateral = lateral_direction(set);
    if (!lateral || !(std::abs(yaw_of(*lateral)) > radians(largest_yaw_deg))) {
        return;
    }
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const int number : middle_points) {
        const std::optional<Eigen::Vector3d> point = position(find_point(set, number));
        if (!point) {
            return;
        }
        middle += *point / static_cast<double>(middle_points.size());
    }
    const double away = lateral->z() > 0 ? 1.0 : -1.0; // the left side is turned away, or the right
    for (Landmark& landmark : set.landmarks) {
        const std::optional<Eigen::Vector3d> point = position(&landmark);
        if (point && away * lateral->dot(*point - middle) > 0) {
            landmark.confidence = std::min(landmark.confidence, doubtful);
        }
    }
}

} // namespace lineament
