// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The names of "arkit47" are those of Apple's ARFaceAnchor.BlendShapeLocation, without the sideways motion of the
// eyeballs and the tongue, which this mesh does not have. The six of "ekman6" are those of Ekman and Friesen, Unmasking
// the Face, 1975, as weighted sums of the former.
#include "default_expressions.hpp"

#include "smoothstep.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>

namespace lineament::build {

namespace {

constexpr float expression_standard_deviation = 0.3f;

enum class Part
{
    whole,
    left,
    right,
};

/// A target's share of an expression. Names that start with "unit/" are expression units (mean of three origins).
struct Share
{
    const char* target;
    double weight;
    Part part = Part::whole;
};

struct Recipe
{
    const char* name;
    std::vector<Share> shares;
};

std::vector<Recipe> arkit_recipes()
{
    constexpr Part left = Part::left;
    constexpr Part right = Part::right;
    return {
        {"eyeBlinkLeft", {{"unit/eye-left-closure", 1}}},
        {"eyeLookDownLeft", {{"unit/eye-left-closure", 0.45}}},
        {"eyeLookUpLeft", {{"unit/eye-left-opened-up", 0.75}}},
        {"eyeSquintLeft", {{"unit/eye-left-slit", 0.6}}},
        {"eyeWideLeft", {{"unit/eye-left-opened-up", 1}}},
        {"eyeBlinkRight", {{"unit/eye-right-closure", 1}}},
        {"eyeLookDownRight", {{"unit/eye-right-closure", 0.45}}},
        {"eyeLookUpRight", {{"unit/eye-right-opened-up", 0.75}}},
        {"eyeSquintRight", {{"unit/eye-right-slit", 0.6}}},
        {"eyeWideRight", {{"unit/eye-right-opened-up", 1}}},
        {"jawForward", {{"chin/chin-prognathism-more", 1}, {"mouth/mouth-trans-forward", 0.3}}},
        {"jawLeft", {{"asym/asym-jaw-3-l", 1}, {"mouth/mouth-trans-out", 0.5}}},
        {"jawRight", {{"asym/asym-jaw-3-r", 1}, {"mouth/mouth-trans-in", 0.5}}},
        {"jawOpen", {{"unit/mouth-open", 0.75}}},
        {"mouthClose", {}}, // from jawOpen, see below
        {"mouthFunnel", {{"unit/mouth-protusion", 1}}},
        {"mouthPucker", {{"unit/mouth-pursing", 1}}},
        {"mouthLeft", {{"mouth/mouth-trans-out", 1.6}}},
        {"mouthRight", {{"mouth/mouth-trans-in", 1.6}}},
        {"mouthSmileLeft", {{"unit/mouth-corner-puller", 1, left}}},
        {"mouthSmileRight", {{"unit/mouth-corner-puller", 1, right}}},
        {"mouthFrownLeft", {{"unit/mouth-depression", 1, left}}},
        {"mouthFrownRight", {{"unit/mouth-depression", 1, right}}},
        {"mouthDimpleLeft", {{"mouth/mouth-dimples-in", 1, left}, {"unit/mouth-retraction", 0.25, left}}},
        {"mouthDimpleRight", {{"mouth/mouth-dimples-in", 1, right}, {"unit/mouth-retraction", 0.25, right}}},
        {"mouthStretchLeft", {{"unit/mouth-retraction", 1, left}}},
        {"mouthStretchRight", {{"unit/mouth-retraction", 1, right}}},
        {"mouthRollLower", {{"mouth/mouth-lowerlip-volume-deflate", 1}, {"mouth/mouth-lowerlip-height-min", 1}}},
        {"mouthRollUpper", {{"mouth/mouth-upperlip-volume-deflate", 1}, {"mouth/mouth-upperlip-height-min", 1}}},
        {"mouthShrugLower", {{"unit/mouth-eversion", 1}}},
        {"mouthShrugUpper", {{"mouth/mouth-upperlip-middle-up", 1}, {"mouth/mouth-upperlip-volume-inflate", 0.5}}},
        {"mouthPressLeft", {{"unit/mouth-compression", 1, left}}},
        {"mouthPressRight", {{"unit/mouth-compression", 1, right}}},
        {"mouthLowerDownLeft", {{"unit/mouth-depression-retraction", 1, left}}},
        {"mouthLowerDownRight", {{"unit/mouth-depression-retraction", 1, right}}},
        {"mouthUpperUpLeft", {{"unit/mouth-elevation", 1, left}}},
        {"mouthUpperUpRight", {{"unit/mouth-elevation", 1, right}}},
        {"browDownLeft", {{"unit/eyebrows-left-down", 1}}},
        {"browDownRight", {{"unit/eyebrows-right-down", 1}}},
        {"browInnerUp", {{"unit/eyebrows-left-inner-up", 1}, {"unit/eyebrows-right-inner-up", 1}}},
        {"browOuterUpLeft", {{"unit/eyebrows-left-extern-up", 1}}},
        {"browOuterUpRight", {{"unit/eyebrows-right-extern-up", 1}}},
        {"cheekPuff", {{"cheek/l-cheek-volume-inflate", 0.8}, {"cheek/r-cheek-volume-inflate", 0.8}}},
        {"cheekSquintLeft", {{"cheek/l-cheek-trans-vert-up", 0.6}, {"unit/eye-left-slit", 0.5}}},
        {"cheekSquintRight", {{"cheek/r-cheek-trans-vert-up", 0.6}, {"unit/eye-right-slit", 0.5}}},
        {"noseSneerLeft", {{"unit/nose-left-elevation", 1}, {"unit/mouth-elevation", 0.25, left}}},
        {"noseSneerRight", {{"unit/nose-right-elevation", 1}, {"unit/mouth-elevation", 0.25, right}}},
    };
}

/// The six as sums of the above; a name without Left or Right stands for both sides.
std::vector<Recipe> ekman_recipes()
{
    return {
        {"anger",
         {{"browDown", 1},
          {"eyeSquint", 0.65},
          {"noseSneer", 0.35},
          {"mouthFrown", 0.35},
          {"mouthRollUpper", 0.6},
          {"mouthRollLower", 0.5},
          {"mouthStretch", 0.3}}},
        {"disgust",
         {{"noseSneer", 1},
          {"mouthUpperUp", 0.45},
          {"browDown", 0.6},
          {"eyeSquint", 1},
          {"mouthFrown", 0.3},
          {"cheekSquint", 0.4}}},
        {"fear",
         {{"browInnerUp", 1},
          {"browOuterUp", 0.35},
          {"browDown", 0.35},
          {"eyeWide", 1},
          {"mouthStretch", 0.9},
          {"jawOpen", 0.25},
          {"mouthLowerDown", 0.25}}},
        {"happiness", {{"mouthSmile", 1}, {"cheekSquint", 0.6}, {"eyeSquint", 0.4}, {"mouthUpperUp", 0.12}}},
        {"sadness",
         {{"browInnerUp", 1.2},
          {"browDown", 0.25},
          {"eyeSquint", 0.6},
          {"mouthFrown", 0.9},
          {"mouthShrugLower", 0.35}}},
        {"surprise", {{"browInnerUp", 1}, {"browOuterUp", 1}, {"eyeWide", 1}, {"jawOpen", 0.6}}},
    };
}

Eigen::Matrix3Xd load_share(const MakeHumanPackage& package, const std::string& target)
{
    const std::string unit_prefix = "unit/";
    if (target.compare(0, unit_prefix.size(), unit_prefix) != 0) {
        return package.load_target(target);
    }
    const std::string unit = target.substr(unit_prefix.size());
    Eigen::Matrix3Xd mean = Eigen::Matrix3Xd::Zero(3, package.base().vertices.cols());
    for (const char* origin : {"african", "asian", "caucasian"}) {
        mean += package.load_target(std::string("expression/units/") + origin + "/" + unit) / 3.0;
    }
    return mean;
}

/// The eye's cap bulges in front of the line between its lids; where the lids meet, the bulge must vanish.
void flatten_closing_eyes(const HeadTopology& head, const Eigen::Matrix3Xd& reference, Eigen::Matrix3Xd& offset)
{
    for (const EyeCap& eye : head.eyes) {
        for (std::size_t i = 0; i < EyeCap::num_columns; ++i) {
            const Eigen::Vector3d opening = reference.col(eye.upper[i]) - reference.col(eye.lower[i]);
            const Eigen::Vector3d change = offset.col(eye.upper[i]) - offset.col(eye.lower[i]);
            const double remaining = std::clamp((opening + change).norm() / opening.norm(), 0.0, 1.0);
            for (const int v : eye.vertices[i]) {
                offset.col(v) -= (1.0 - remaining) * head.offsets.col(v);
            }
        }
    }
}

/// What closes the lips of an open jaw: pulls them to their mean motion, fading with the distance from the lips.
Eigen::Matrix3Xd close_lips(const HeadTopology& head, const Eigen::Matrix3Xd& reference,
                            const Eigen::Matrix3Xd& jaw_open)
{
    constexpr double reach_mm = 9.0;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const int v : head.lip_loop) {
        mean += jaw_open.col(v) / static_cast<double>(head.lip_loop.size());
    }
    Eigen::Matrix3Xd offset(3, head.num_vertices());
    for (Eigen::Index v = 0; v < head.num_vertices(); ++v) {
        double distance = std::numeric_limits<double>::infinity();
        for (const int lip : head.lip_loop) {
            distance = std::min(distance, (reference.col(v) - reference.col(lip)).norm());
        }
        offset.col(v) = std::exp(-0.5 * distance * distance / (reach_mm * reach_mm)) * (mean - jaw_open.col(v));
    }
    return offset;
}

/// The package's targets of the two sides differ by up to 3 mm: each becomes the mean of itself and the mirror image of
/// its partner, which is itself for an expression without a side.
std::map<std::string, Eigen::Matrix3Xd> symmetrized(const HeadTopology& head,
                                                    const std::map<std::string, Eigen::Matrix3Xd>& expressions)
{
    std::map<std::string, Eigen::Matrix3Xd> result;
    for (const auto& [name, offset] : expressions) {
        std::string partner = name;
        if (const std::size_t left = name.rfind("Left"); left != std::string::npos) {
            partner.replace(left, 4, "Right");
        } else if (const std::size_t right = name.rfind("Right"); right != std::string::npos) {
            partner.replace(right, 5, "Left");
        }
        result[name] = 0.5 * (offset + head.mirrored(expressions.at(partner)));
    }
    return result;
}

Blendshapes make_set(const std::string& name, const std::vector<std::string>& names,
                     const std::vector<Eigen::Matrix3Xd>& offsets)
{
    Blendshapes set;
    set.name = name;
    set.names = names;
    set.offsets.resize(offsets.front().size(), static_cast<Eigen::Index>(offsets.size()));
    for (std::size_t k = 0; k < offsets.size(); ++k) {
        set.offsets.col(static_cast<Eigen::Index>(k)) =
            Eigen::Map<const Eigen::VectorXd>(offsets[k].data(), offsets[k].size()).cast<float>();
    }
    set.standard_deviations =
        Eigen::VectorXf::Constant(static_cast<Eigen::Index>(offsets.size()), expression_standard_deviation);
    return set;
}

} // namespace

std::vector<Blendshapes> make_default_expressions(const MakeHumanPackage& package, const HeadTopology& head,
                                                  const Eigen::Matrix3Xd& reference)
{
    std::vector<std::string> arkit_names;
    std::vector<Eigen::Matrix3Xd> arkit;
    std::map<std::string, Eigen::Matrix3Xd> by_name;
    for (const Recipe& recipe : arkit_recipes()) {
        Eigen::Matrix3Xd offset = Eigen::Matrix3Xd::Zero(3, head.num_vertices());
        for (const Share& share : recipe.shares) {
            Eigen::Matrix3Xd moved = share.weight * head.displacement(load_share(package, share.target));
            for (Eigen::Index v = 0; v < moved.cols() && share.part != Part::whole; ++v) {
                const double left = smoothstep(-6.0, 6.0, reference(0, v));
                moved.col(v) *= share.part == Part::left ? left : 1.0 - left;
            }
            offset += moved;
        }
        if (std::string(recipe.name) == "mouthClose") {
            offset = close_lips(head, reference, by_name.at("jawOpen"));
        }
        flatten_closing_eyes(head, reference, offset);
        arkit_names.emplace_back(recipe.name);
        by_name[recipe.name] = offset;
    }
    by_name = symmetrized(head, by_name);
    for (const std::string& name : arkit_names) {
        arkit.push_back(by_name.at(name));
    }

    std::vector<std::string> ekman_names;
    std::vector<Eigen::Matrix3Xd> ekman;
    for (const Recipe& recipe : ekman_recipes()) {
        Eigen::Matrix3Xd offset = Eigen::Matrix3Xd::Zero(3, head.num_vertices());
        for (const Share& share : recipe.shares) {
            const std::string name = share.target;
            if (by_name.count(name) > 0) {
                offset += share.weight * by_name.at(name);
            } else {
                offset += share.weight * (by_name.at(name + "Left") + by_name.at(name + "Right"));
            }
        }
        ekman_names.emplace_back(recipe.name);
        ekman.push_back(offset);
    }
    return {make_set("ekman6", ekman_names, ekman), make_set("arkit47", arkit_names, arkit)};
}

} // namespace lineament::build
