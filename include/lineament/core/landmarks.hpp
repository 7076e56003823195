// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace lineament {

/// A named point seen in an image.
inline constexpr double max_coordinate_px = 1e7; ///< Of image points and depths that fits take, either sign.
inline constexpr double least_confidence = 1e-6; ///< Below it a landmark is ignored as if not seen.

struct Landmark
{
    std::string name = {};                              ///< For the scheme ibug68: "1" ... "68".
    Eigen::Vector2d point_px = Eigen::Vector2d::Zero(); ///< Image space: pixel centres at +0.5, y down.
    double confidence = 1.0;                            ///< [0, 1]; 0 means: not seen, point ignored. A factor of
                                                        ///< the weight, the inverse of the noise's variance.
    /// Depth, growing away from the camera, from an origin that the points of a face share; in px, as one mm of it is
    /// as many as one mm across. What a network draws here follows the turn of the head, not the person: it only serves
    /// the pose.
    std::optional<double> depth_px = std::nullopt;

    bool operator==(const Landmark&) const = default;
};

/// Before the name of an outline landmark of ibug68 among the landmarks of another scheme: "ibug68:1".
inline constexpr std::string_view outline_prefix = "ibug68:";

/// The landmarks of one face under one naming scheme, in any order; missing ones are simply absent.
struct LandmarkSet
{
    std::string scheme = "ibug68";
    std::vector<Landmark> landmarks = {};

    /// The landmark of that name, if it is in the set.
    [[nodiscard]] std::optional<Landmark> find(const std::string& name) const
    {
        for (const Landmark& landmark : landmarks) {
            if (landmark.name == name) {
                return landmark;
            }
        }
        return std::nullopt;
    }

    bool operator==(const LandmarkSet&) const = default;
};

} // namespace lineament
