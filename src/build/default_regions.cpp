// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "default_regions.hpp"

#include "smoothstep.hpp"

namespace lineament::build {

namespace {

/// How much of the largest displacement by the targets each vertex takes, as a soft step; the same on both sides.
Eigen::VectorXd moved_by(const MakeHumanPackage& package, const HeadTopology& head,
                         const std::vector<std::string>& targets)
{
    Eigen::Matrix3Xd displacement = Eigen::Matrix3Xd::Zero(3, head.num_vertices());
    for (const std::string& target : targets) {
        displacement += head.displacement(package.load_target(target));
    }
    const Eigen::VectorXd length = displacement.colwise().norm();
    const double largest = length.maxCoeff();
    Eigen::VectorXd weights(length.size());
    for (Eigen::Index v = 0; v < length.size(); ++v) {
        weights[v] = smoothstep(0.2, 0.7, 0.5 * (length[v] + length[head.mirror[v]]) / largest);
    }
    return weights;
}

} // namespace

std::map<std::string, Eigen::VectorXd> make_default_regions(const MakeHumanPackage& package, const HeadTopology& head,
                                                            const Eigen::Matrix3Xd& reference)
{
    std::map<std::string, Eigen::VectorXd> regions;
    regions["nose"] = moved_by(package, head, {"nose/nose-trans-vert-up"});
    regions["mouth"] = moved_by(package, head, {"mouth/mouth-trans-up"});
    regions["eyes"] = moved_by(package, head, {"eyes/r-eye-move-up", "eyes/l-eye-move-up"});
    regions["ears"] = moved_by(package, head, {"ears/r-ear-trans-vert-up", "ears/l-ear-trans-vert-up"});

    Eigen::VectorXd neck(head.num_vertices());
    Eigen::VectorXd face(head.num_vertices());
    for (Eigen::Index v = 0; v < head.num_vertices(); ++v) {
        const double y = reference(1, v);
        const double z = reference(2, v);
        const double jaw_line = 626.0 + 0.5 * (125.0 - z); // from below the chin to below the ear, seen from the side
        neck[v] = smoothstep(0.0, -12.0, y - jaw_line);
        const double before_ears = smoothstep(45.0, 65.0, z);
        const double below_hair = smoothstep(812.0, 792.0, y);
        face[v] = (1.0 - neck[v]) * (1.0 - regions["ears"][v]) * before_ears * below_hair;
    }
    regions["neck"] = neck;
    regions["face"] = face;
    return regions;
}

} // namespace lineament::build
