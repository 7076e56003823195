// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "default_identity.hpp"

#include "lineament/core/checks.hpp"

#include "symmetric_pca.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>

namespace lineament::build {

namespace {

/// Standard deviations of sliders that were calibrated: the spread of 17 distances between landmarks against that in
/// models of scanned people (docs/model.md). Names without the side.
const std::map<std::string, double>& calibrated_standard_deviations()
{
    static const std::map<std::string, double> table = {
        {"head-age-less|more", 0.088},
        {"head-angle-in|out", 0.219},
        {"head-skinny|fat", 0.231},
        {"head-scale-horiz-less|more", 0.223},
        {"head-scale-vert-less|more", 0.241},
        {"head-oval", 0.022},
        {"head-round", 0.022},
        {"head-invertedtriangular", 0.090},
        {"eyebrows-trans-depth-less|more", 0.185},
        {"eyebrows-angle-up|down", 0.281},
        {"eyebrows-trans-vert-less|more", 0.129},
        {"eye-push1-in|out", 0.044},
        {"eye-push2-out|in", 0.245},
        {"eye-move-in|out", 0.202},
        {"eye-move-down|up", 0.180},
        {"eye-size-small|big", 0.044},
        {"eye-corner1-down|up", 0.211},
        {"nose-trans-vert-down|up", 0.044},
        {"nose-scale-vert-decr|incr", 0.269},
        {"nose-scale-horiz-decr|incr", 0.094},
        {"nose-scale-depth-decr|incr", 0.044},
        {"nose-nostril-width-min|max", 0.114},
        {"nose-height-min|max", 0.214},
        {"nose-width3-min|max", 0.110},
        {"nose-compression-compress|uncompress", 0.209},
        {"nose-hump-lesshump|morehump", 0.166},
        {"nose-volume-potato|point", 0.184},
        {"nose-point-down|up", 0.044},
        {"nose-septumangle-decr|incr", 0.174},
        {"mouth-scale-horiz-decr|incr", 0.240},
        {"mouth-scale-vert-decr|incr", 0.293},
        {"mouth-trans-down|up", 0.044},
        {"mouth-trans-backward|forward", 0.044},
        {"mouth-lowerlip-height-min|max", 0.328},
        {"mouth-upperlip-height-min|max", 0.044},
        {"mouth-lowerlip-middle-up|down", 0.260},
        {"mouth-philtrum-volume-increase|decrease", 0.118},
        {"mouth-upperlip-middle-down|up", 0.252},
        {"chin-prominent-less|more", 0.242},
        {"chin-height-min|max", 0.157},
        {"chin-prognathism-less|more", 0.247},
        // Sideways motion of the middle of the face is asymmetry, and small.
        {"nose-trans-horiz-in|out", 0.06},
        {"mouth-trans-in|out", 0.06},
        {"neck-trans-horiz-in|out", 0.06},
        // The pose of the head on the neck is not identity.
        {"head-trans-in|out", 0.0},
        {"head-trans-down|up", 0.0},
        {"head-trans-backward|forward", 0.0},
        {"neck-scale-vert-less|more", 0.0},
        {"neck-trans-vert-down|up", 0.0},
        {"neck-back-scale-depth-less|more", 0.0},
    };
    return table;
}

constexpr double prior_standard_deviation = 0.22;
constexpr double one_sided_standard_deviation = 0.11;
constexpr double ear_and_neck_factor = 0.8;
constexpr double left_right_standard_deviation = 0.05;
constexpr double asymmetry_standard_deviation = 0.10;
constexpr double height_standard_deviation = 0.035;

bool has_side(const std::string& name)
{
    return name.compare(0, 2, "r-") == 0 || name.compare(0, 2, "l-") == 0;
}

/// Origin x sex x age: the 18 macro targets.
constexpr std::array<const char*, 3> origins = {"african", "asian", "caucasian"};
constexpr std::array<const char*, 2> sexes = {"female", "male"};
constexpr std::array<const char*, 3> ages = {"child", "young", "old"};
constexpr int num_macro_targets = 18;
using MacroWeights = Eigen::Matrix<double, num_macro_targets, 1>;

std::string macro_target(int index)
{
    return std::string("macrodetails/") + origins[static_cast<std::size_t>(index / 6)] + "-" +
           sexes[static_cast<std::size_t>(index / 3 % 2)] + "-" + ages[static_cast<std::size_t>(index % 3)];
}

/// Weights of child, young and old as MakeHuman blends them: 25 years is young alone, 90 years is old alone.
Eigen::Vector3d age_weights(double years)
{
    if (years >= 25.0) {
        const double old = (years - 25.0) / 65.0;
        return {0.0, 1.0 - old, old};
    }
    const double a = (years - 1.0) / 48.0; // 0.5 at 25 years
    const double young = std::max(0.0, 3.2 * (a - 0.1875));
    return {1.0 - young, young, 0.0};
}

struct WeightedValue
{
    double value;
    double probability;
};

struct WeightedOrigin
{
    Eigen::Vector3d mix;
    double probability;
};

/// Mean and covariance of the macro weights of the population: sex (0 female, 1 male) around 0.15 and 0.85 with
/// standard deviation 0.12; adults from 18 to 75 years; origins mixed as a Dirichlet distribution (0.5, 0.5, 0.7).
void macro_distribution(MacroWeights& mean, Eigen::Matrix<double, num_macro_targets, num_macro_targets>& covariance)
{
    const std::array<WeightedValue, 6> sex = {
        {{0.0, 1.0 / 6}, {0.15, 1.0 / 6}, {0.30, 1.0 / 6}, {0.70, 1.0 / 6}, {0.85, 1.0 / 6}, {1.0, 1.0 / 6}}};
    const std::array<WeightedValue, 6> years = {
        {{20, 0.12}, {27, 0.24}, {35, 0.24}, {44, 0.20}, {55, 0.13}, {67, 0.07}}};
    std::vector<WeightedOrigin> mixes;
    // Three points with the mean p and the covariance (diag(p) - p p^T) / (1 + concentration) of the distribution:
    // p + (e_i - p) / sqrt(1 + concentration), with probability p_i.
    const Eigen::Vector3d concentration(0.5, 0.5, 0.7);
    const Eigen::Vector3d p = concentration / concentration.sum();
    for (int i = 0; i < 3; ++i) {
        const Eigen::Vector3d mix = p + (Eigen::Vector3d::Unit(i) - p) / std::sqrt(1.0 + concentration.sum());
        mixes.push_back({mix, p[i]});
    }
    mean.setZero();
    covariance.setZero();
    for (const WeightedOrigin& origin : mixes) {
        for (const WeightedValue& s : sex) {
            for (const WeightedValue& y : years) {
                MacroWeights w;
                const Eigen::Vector3d age = age_weights(y.value);
                for (int i = 0; i < num_macro_targets; ++i) {
                    w[i] = origin.mix[i / 6] * (i / 3 % 2 == 1 ? s.value : 1.0 - s.value) * age[i % 3];
                }
                const double probability = origin.probability * s.probability * y.probability;
                mean += probability * w;
                covariance += probability * w * w.transpose();
            }
        }
    }
    covariance -= mean * mean.transpose();
}

Eigen::VectorXd flat(const Eigen::Matrix3Xd& values)
{
    return Eigen::Map<const Eigen::VectorXd>(values.data(), values.size());
}

} // namespace

double slider_standard_deviation(const MakeHumanModifier& modifier)
{
    const std::string name = has_side(modifier.name) ? modifier.name.substr(2) : modifier.name;
    const auto& table = calibrated_standard_deviations();
    if (const auto found = table.find(name); found != table.end()) {
        return found->second;
    }
    if (modifier.negative.empty()) {
        return one_sided_standard_deviation;
    }
    return prior_standard_deviation *
           (modifier.group == "ears" || modifier.group == "neck" ? ear_and_neck_factor : 1.0);
}

Eigen::Matrix3Xd load_reference(const MakeHumanPackage& package)
{
    Eigen::Matrix3Xd reference = package.base().vertices;
    for (int i = 0; i < num_macro_targets; ++i) {
        if (i % 3 == 1) { // young
            reference += package.load_target(macro_target(i)) / 6.0;
        }
    }
    return reference;
}

Eigen::Matrix3Xd load_population_mean(const MakeHumanPackage& package)
{
    MacroWeights mean;
    Eigen::Matrix<double, num_macro_targets, num_macro_targets> covariance;
    macro_distribution(mean, covariance);
    Eigen::Matrix3Xd vertices = package.base().vertices;
    for (int i = 0; i < num_macro_targets; ++i) {
        vertices += mean[i] * package.load_target(macro_target(i));
    }
    return vertices;
}

Eigen::MatrixXd load_population_displacements(const MakeHumanPackage& package, const HeadTopology& head)
{
    std::vector<Eigen::VectorXd> columns;

    MacroWeights mean;
    Eigen::Matrix<double, num_macro_targets, num_macro_targets> covariance;
    macro_distribution(mean, covariance);
    Eigen::MatrixXd macro(3 * head.num_vertices(), num_macro_targets);
    for (int i = 0; i < num_macro_targets; ++i) {
        macro.col(i) = flat(head.displacement(package.load_target(macro_target(i))));
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
    const Eigen::MatrixXd root =
        macro * eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
    for (int i = 0; i < num_macro_targets; ++i) {
        columns.push_back(root.col(i));
    }

    Eigen::Matrix3Xd height = Eigen::Matrix3Xd::Zero(3, package.base().vertices.cols());
    for (const char* sex : sexes) {
        const std::string prefix = std::string("macrodetails/height/") + sex + "-young-averagemuscle-averageweight-";
        height += package.load_target(prefix + "maxheight") / 2.0;
        height -= package.load_target(prefix + "minheight") / 2.0;
    }
    columns.push_back(height_standard_deviation *
                      flat(head.displacement(height))); // (max - min) / 2 a slider unit of 1/2

    const auto displacement = [&](const MakeHumanModifier& modifier) {
        const Eigen::Matrix3Xd positive = package.load_target(modifier.positive);
        if (modifier.negative.empty()) {
            return flat(head.displacement(positive));
        }
        return flat(head.displacement(Eigen::Matrix3Xd((positive - package.load_target(modifier.negative)) / 2.0)));
    };
    const auto& modifiers = package.face_modifiers();
    for (const MakeHumanModifier& modifier : modifiers) {
        const double sigma = slider_standard_deviation(modifier);
        if (sigma == 0.0 || modifier.name.compare(0, 2, "l-") == 0) {
            continue;
        }
        if (modifier.name.compare(0, 2, "r-") != 0) {
            columns.push_back(sigma * displacement(modifier));
            continue;
        }
        std::string left_name = modifier.name;
        left_name[0] = 'l';
        const auto left = std::find_if(modifiers.begin(), modifiers.end(),
                                       [&](const MakeHumanModifier& m) { return m.name == left_name; });
        if (left == modifiers.end()) {
            throw IoError(IoErrorKind::content, "modeling_modifiers.json", "", "no slider \"" + left_name + "\"");
        }
        const Eigen::VectorXd of_right = displacement(modifier);
        const Eigen::VectorXd of_left = displacement(*left);
        const bool is_ear = modifier.group == "ears";
        columns.push_back(sigma * (of_right + of_left));
        columns.push_back(left_right_standard_deviation * (is_ear ? ear_and_neck_factor : 1.0) * (of_right - of_left));
    }
    for (const std::string& name : package.target_names("asym/asym-")) {
        if (name.compare(name.size() - 2, 2, "-l") == 0) {
            const std::string other = name.substr(0, name.size() - 1) + "r";
            columns.push_back(asymmetry_standard_deviation *
                              flat(head.displacement(
                                  Eigen::Matrix3Xd((package.load_target(name) - package.load_target(other)) / 2.0))));
        }
    }

    Eigen::MatrixXd result(3 * head.num_vertices(), static_cast<Eigen::Index>(columns.size()));
    for (std::size_t i = 0; i < columns.size(); ++i) {
        result.col(static_cast<Eigen::Index>(i)) = columns[i];
    }
    return result;
}

} // namespace lineament::build
