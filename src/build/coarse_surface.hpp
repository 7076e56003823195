// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/model/morphable_model.hpp"

#include <Eigen/Core>

#include <limits>
#include <string>

namespace lineament::build {

/// A mixture of three vertices: where a landmark is tied to the surface.
struct SurfacePoint
{
    double distance = std::numeric_limits<double>::infinity(); ///< From the point asked for [mm].
    Eigen::Vector3i vertices = Eigen::Vector3i::Zero();
    Eigen::Vector3d weights = Eigen::Vector3d::UnitX();

    /// The weights in float, not negative, of sum 1.
    [[nodiscard]] Eigen::Vector3f rounded_weights() const;
};

/// The mean face at its coarsest level, whose points exist at every level.
class CoarseSurface
{
public:
    /// @param model  With levels and a mirror map; must outlive the surface.
    explicit CoarseSurface(const MorphableModel& model);

    [[nodiscard]] Eigen::Vector3d vertex(int v) const { return vertices_.col(v).cast<double>(); }

    /// The nearest point on the triangles of the group.
    [[nodiscard]] SurfacePoint closest(const Eigen::Vector3d& point, const std::string& group) const;

    /// The nearest point where the skin meets the symmetry plane: on edges in the plane, and on triangles (v, partner
    /// of v, b in the plane) from the middle of v and its partner to b.
    [[nodiscard]] SurfacePoint closest_in_symmetry_plane(const Eigen::Vector3d& point) const;

    /// The same place on the other half of the face.
    [[nodiscard]] SurfacePoint mirrored(const SurfacePoint& point) const;

private:
    [[nodiscard]] bool is_of(Eigen::Index triangle, const std::string& group) const;

    const MorphableModel& model_;
    const Level& level_;
    Eigen::Map<const Eigen::Matrix3Xf> vertices_;
};

} // namespace lineament::build
