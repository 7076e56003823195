// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "default_color.hpp"

#include "face_points.hpp"
#include "smoothstep.hpp"
#include "symmetric_pca.hpp"

#include "lineament/io/image_file.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

namespace lineament::build {

namespace {

constexpr double blur_sigma_px = 0.6;
constexpr int num_skin_modes = 12;
constexpr double brow_strength = 0.72;
// The skins are light (14) or dark (6), with little between: two points at +0.65 and -1.53 standard deviations of the
// first mode. A normal distribution with all of it is lighter than the light ones one time in four; with this share of
// it, one time in six.
constexpr double light_dark_share = 0.65;

const Eigen::Vector3d sclera(0.78, 0.74, 0.71);
const Eigen::Vector3d iris(0.36, 0.25, 0.17);
const Eigen::Vector3d limbus(0.16, 0.11, 0.08);
const Eigen::Vector3d pupil(0.03, 0.02, 0.02);
const Eigen::Vector3d brow_hair(0.17, 0.12, 0.09);

/// Gaussian blur, colours in [0, 1], the border continued.
ImageF blurred(const ImageU8& image)
{
    constexpr int radius = 2;
    std::array<float, 2 * radius + 1> kernel = {};
    float sum = 0.0f;
    for (int k = -radius; k <= radius; ++k) {
        kernel[static_cast<std::size_t>(k + radius)] =
            static_cast<float>(std::exp(-0.5 * k * k / (blur_sigma_px * blur_sigma_px)));
        sum += kernel[static_cast<std::size_t>(k + radius)];
    }
    ImageF rows(image.width, image.height, 3);
    ImageF result(image.width, image.height, 3);
    for (const bool is_vertical : {false, true}) {
        for (int y = 0; y < image.height; ++y) {
            for (int x = 0; x < image.width; ++x) {
                for (int c = 0; c < 3; ++c) {
                    float value = 0.0f;
                    for (int k = -radius; k <= radius; ++k) {
                        const int column = std::clamp(is_vertical ? x : x + k, 0, image.width - 1);
                        const int row = std::clamp(is_vertical ? y + k : y, 0, image.height - 1);
                        const float pixel = is_vertical ? rows.at(column, row, c)
                                                        : static_cast<float>(image.at(column, row, c)) / 255.0f;
                        value += kernel[static_cast<std::size_t>(k + radius)] / sum * pixel;
                    }
                    (is_vertical ? result : rows).at(x, y, c) = value;
                }
            }
        }
    }
    return result;
}

/// The skins at the vertices (3V x number of skins); the vertices of the eyes hold zeros.
Eigen::MatrixXd sample_skins(const MakeHumanPackage& package, const HeadTopology& head)
{
    const auto paths = package.skin_paths();
    Eigen::MatrixXd skins = Eigen::MatrixXd::Zero(3 * head.num_vertices(), static_cast<Eigen::Index>(paths.size()));
    for (std::size_t i = 0; i < paths.size(); ++i) {
        const ImageF image = blurred(load_image(paths[i]));
        for (Eigen::Index v = 0; v < head.num_vertices(); ++v) {
            const int uv = head.uv_of_vertex[static_cast<std::size_t>(v)];
            if (uv < 0) {
                continue;
            }
            const Eigen::Vector2d point = package.base().uv_coordinates.col(uv);
            for (int c = 0; c < 3; ++c) {
                skins(3 * v + c, static_cast<Eigen::Index>(i)) =
                    sample_bilinear(image, static_cast<float>(point.x() * image.width),
                                    static_cast<float>((1.0 - point.y()) * image.height), c);
            }
        }
    }
    return skins;
}

/// How much brow hair covers each vertex: around a parabola y(x) through landmarks 18 to 22 as seen from the front,
/// thinner towards the temple; the left brow is its mirror image.
Eigen::VectorXd brow_coverage(const HeadTopology& head, const Eigen::Matrix3Xd& reference)
{
    constexpr std::size_t first = 17; // landmark 18
    Eigen::Matrix<double, 5, 3> powers;
    Eigen::Matrix<double, 5, 1> heights;
    for (int l = 0; l < 5; ++l) {
        const int base = landmark_base_vertices[first + static_cast<std::size_t>(l)];
        const Eigen::Vector3d point = reference.col(head.vertex_of_base[static_cast<std::size_t>(base)]);
        powers.row(l) << 1.0, point.x(), point.x() * point.x();
        heights[l] = point.y();
    }
    const Eigen::Vector3d parabola = powers.colPivHouseholderQr().solve(heights);
    const double outer = powers(0, 1);
    const double inner = powers(4, 1);
    Eigen::VectorXd coverage(head.num_vertices());
    for (Eigen::Index v = 0; v < head.num_vertices(); ++v) {
        const double x = -std::abs(reference(0, v)); // on the right side
        const double slope = parabola[1] + 2.0 * parabola[2] * x;
        const double above = reference(1, v) - parabola[0] - parabola[1] * x - parabola[2] * x * x;
        const double distance = above / std::sqrt(1.0 + slope * slope);
        const double along = (x - outer) / (inner - outer);
        const double width_mm = 2.1 + 0.8 * std::clamp(along, 0.0, 1.0);
        coverage[v] = std::exp(-0.5 * distance * distance / (width_mm * width_mm)) * smoothstep(-0.12, 0.12, along) *
                      smoothstep(1.12, 0.92, along) * smoothstep(90.0, 110.0, reference(2, v));
    }
    return coverage;
}

/// Colours of the eyes in a 3V vector: a brown iris that looks straight ahead.
void paint_eyes(const HeadTopology& head, const Eigen::Matrix3Xd& reference, Eigen::VectorXd& color)
{
    for (const EyeCap& eye : head.eyes) {
        for (std::size_t i = 0; i < EyeCap::num_columns; ++i) {
            for (std::size_t r = 0; r < EyeCap::num_rows; ++r) {
                const int v = eye.vertices[i][r];
                const double radius = (reference.col(v) - eye.eyeball_center).head<2>().norm();
                Eigen::Vector3d c = pupil;
                c += smoothstep(1.8, 2.8, radius) * (iris - pupil);
                c += smoothstep(4.6, 5.8, radius) * (limbus - c);
                c += smoothstep(5.8, 7.2, radius) * (sclera - c);
                c *= r == 0 ? 0.82 : 1.0; // the upper lid's shadow
                color.segment<3>(3 * v) = c;
            }
        }
    }
}

/// The part of `direction` that the columns of the orthonormal `basis` do not hold.
Eigen::VectorXd orthogonal_part(const Eigen::MatrixXd& basis, const Eigen::VectorXd& direction)
{
    Eigen::VectorXd rest = direction;
    for (int pass = 0; pass < 2; ++pass) { // twice is enough for full accuracy
        rest -= basis * (basis.transpose() * rest);
    }
    return rest;
}

} // namespace

PcaModel make_default_color(const MakeHumanPackage& package, const HeadTopology& head,
                            const Eigen::Matrix3Xd& reference, const std::map<std::string, Eigen::VectorXd>& regions)
{
    const Eigen::Index num_vertices = head.num_vertices();
    Eigen::MatrixXd skins = sample_skins(package, head);
    const Eigen::VectorXd skin_mean = skins.rowwise().mean();
    skins.colwise() -= skin_mean;
    skins /= std::sqrt(static_cast<double>(skins.cols() - 1));
    const Eigen::VectorXd brows = brow_coverage(head, reference);
    for (Eigen::Index v = 0; v < num_vertices; ++v) {
        skins.middleRows(3 * v, 3) *= 1.0 - brow_strength * brows[v]; // hair covers the skin
    }
    const PcaModel pca =
        compute_pca_of_displacements(skin_mean, split_by_symmetry(skins, head.mirror, 1.0), num_skin_modes);

    const Eigen::VectorXd& face = regions.at("face");
    const Eigen::VectorXd& mouth = regions.at("mouth");
    Eigen::VectorXd mean = skin_mean;
    Eigen::MatrixXd own = Eigen::MatrixXd::Zero(3 * num_vertices, 4); // brows, redness, yellowness, beard; one sd each
    const auto landmark = [&](std::size_t number) {
        return reference.col(head.vertex_of_base[static_cast<std::size_t>(landmark_base_vertices[number - 1])]);
    };
    const Eigen::Vector3d mouth_center = 0.5 * (landmark(49) + landmark(55));
    for (Eigen::Index v = 0; v < num_vertices; ++v) {
        const Eigen::Vector3d partner_mean = skin_mean.segment<3>(3 * head.mirror[v]);
        const Eigen::Vector3d skin = 0.5 * (skin_mean.segment<3>(3 * v) + partner_mean);
        const Eigen::Vector3d towards_hair = brows[v] * (brow_hair - skin);
        mean.segment<3>(3 * v) = skin + brow_strength * towards_hair;
        if (head.uv_of_vertex[static_cast<std::size_t>(v)] < 0) {
            continue; // the eyes do not change with the skin
        }
        own.col(0).segment<3>(3 * v) = 0.22 * towards_hair;
        const Eigen::Vector3d x = reference.col(v);
        const double cheek = std::exp(-0.5 * std::pow((std::abs(x.x()) - 38.0) / 16.0, 2) -
                                      0.5 * std::pow((x.y() - landmark(34).y()) / 18.0, 2));
        const double redness = 0.35 + 0.65 * std::max(face[v] * cheek, regions.at("nose")[v] * 0.7);
        own.col(1).segment<3>(3 * v) = redness * Eigen::Vector3d(0.030, -0.022, -0.018);
        own.col(2).segment<3>(3 * v) = Eigen::Vector3d(0.006, 0.004, -0.030);
        const double below_nose = smoothstep(landmark(34).y() + 2.0, landmark(34).y() - 6.0, x.y());
        const double sideways = std::max(smoothstep(52.0, 34.0, std::abs(x.x())),
                                         smoothstep(mouth_center.y(), mouth_center.y() - 25.0, x.y()));
        const double lips = std::exp(-0.5 * std::pow((x.x() - mouth_center.x()) / 17.0, 4) -
                                     0.5 * std::pow((x.y() - mouth_center.y()) / 7.0, 4));
        const double beard = below_nose * sideways * (1.0 - lips) * (1.0 - 0.7 * regions.at("neck")[v]) *
                             std::max(face[v], 0.5 * mouth[v]);
        own.col(3).segment<3>(3 * v) = beard * Eigen::Vector3d(-0.055, -0.045, -0.035);
    }
    paint_eyes(head, reference, mean);

    Eigen::MatrixXd basis = pca.basis.cast<double>();
    Eigen::VectorXd sigma = pca.standard_deviations.cast<double>();
    sigma[0] *= light_dark_share;
    for (Eigen::Index i = 0; i < own.cols(); ++i) {
        const Eigen::VectorXd rest = orthogonal_part(basis, own.col(i));
        basis.conservativeResize(Eigen::NoChange, basis.cols() + 1);
        basis.rightCols(1) = rest.normalized();
        sigma.conservativeResize(sigma.size() + 1);
        sigma[sigma.size() - 1] = rest.norm();
    }
    std::vector<Eigen::Index> order(static_cast<std::size_t>(sigma.size()));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) { return sigma[a] > sigma[b]; });
    PcaModel model;
    model.mean = mean.cast<float>();
    model.basis.resize(basis.rows(), basis.cols());
    model.standard_deviations.resize(sigma.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
        model.basis.col(static_cast<Eigen::Index>(i)) = basis.col(order[i]).cast<float>();
        model.standard_deviations[static_cast<Eigen::Index>(i)] = static_cast<float>(sigma[order[i]]);
    }
    return model;
}

} // namespace lineament::build
