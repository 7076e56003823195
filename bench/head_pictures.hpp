// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "foreign_heads.hpp"

#include "lineament/camera/camera.hpp"
#include "lineament/core/image.hpp"
#include "lineament/core/mesh.hpp"
#include "lineament/core/random.hpp"
#include "lineament/io/file.hpp"
#include "lineament/io/safetensors.hpp"
#include "lineament/render/shading.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

/// Pictures of whole heads of the other model, painted so that face detectors take them for faces.
namespace lineament::bench {

/// Lines and areas of the neutral face, seen from the front (x, y) [mm].
class FrontalLine
{
public:
    FrontalLine(std::vector<Eigen::Vector2f> points, bool closed) : points_(std::move(points)), closed_(closed) {}

    /// Distance of a point [mm], negative inside of a closed line.
    [[nodiscard]] float distance(const Eigen::Vector2f& point) const
    {
        float least = std::numeric_limits<float>::infinity();
        bool inside = false;
        for (std::size_t i = closed_ ? 0 : 1; i < points_.size(); ++i) {
            const Eigen::Vector2f a = points_[i == 0 ? points_.size() - 1 : i - 1];
            const Eigen::Vector2f b = points_[i];
            const float along = std::clamp((point - a).dot(b - a) / (b - a).squaredNorm(), 0.0F, 1.0F);
            least = std::min(least, (a + along * (b - a) - point).norm());
            if ((a.y() > point.y()) != (b.y() > point.y()) &&
                point.x() < a.x() + (point.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x())) {
                inside = !inside;
            }
        }
        return closed_ && inside ? -least : least;
    }

private:
    std::vector<Eigen::Vector2f> points_;
    bool closed_;
};

/// The colours of a head as a function of the place on the neutral one: skin, hair, brows, lips, rims of the eyes,
/// eyeballs.
class HeadPaint
{
public:
    /// @param landmarks  3 x 68, of the neutral head [mm].
    /// @param eyes       3 x 2: centres of the right and the left eyeball.
    HeadPaint(const Eigen::Matrix3Xf& landmarks, const Eigen::Matrix<float, 3, 2>& eyes)
        : landmarks_(landmarks), eyes_(eyes), lips_(line(49, 60, true)),
          lip_seam_(seam()), rims_{line(37, 42, true), line(43, 48, true)}, brows_{brow(18, 1), brow(27, -1)}
    {}

    /// sRGB-encoded, [0, 1].
    [[nodiscard]] Eigen::Vector3f color(int part, const Eigen::Vector3f& point) const
    {
        const Eigen::Vector2f seen = point.head<2>();
        if (part == 2) {
            return eyeball((seen - eyes_.col(point.x() < 0.0F ? 0 : 1).head<2>()).norm());
        }
        if (part == 1 && point.z() > 25.0F && point.y() < 60.0F && point.y() > -62.0F && std::abs(point.x()) < 52.0F) {
            return {0.22F, 0.10F, 0.09F}; // behind the lids and the lips
        }
        const Eigen::Vector3f hair_color(0.20F, 0.15F, 0.12F);
        Eigen::Vector3f result(0.83F, 0.64F, 0.54F);
        if (point.z() > 60.0F) {
            const float cheek = std::exp(
                -((seen.cwiseAbs() - Eigen::Vector2f(45.0F, -5.0F)).cwiseQuotient(Eigen::Vector2f(18.0F, 14.0F)))
                     .squaredNorm());
            mix(result, {0.84F, 0.53F, 0.46F}, 0.5F * cheek);
            mix(result, {0.72F, 0.38F, 0.36F}, inside(lips_.distance(seen), 2.0F));
            mix(result, {0.30F, 0.12F, 0.12F}, inside(lip_seam_.distance(seen) - 0.6F, 1.2F));
            for (const FrontalLine& brow : brows_) {
                mix(result, hair_color, 0.8F * inside(brow.distance(seen), 2.5F));
            }
            for (const FrontalLine& rim : rims_) {
                mix(result, {0.25F, 0.15F, 0.13F}, 0.8F * inside(std::abs(rim.distance(seen)) - 0.6F, 1.5F));
            }
        }
        mix(result, hair_color, inside(hairline(point), 8.0F));
        return result;
    }

private:
    static void mix(Eigen::Vector3f& color, const Eigen::Vector3f& other, float part)
    {
        color += part * (other - color);
    }

    /// 1 inside, 0 outside of an edge of that width.
    static float inside(float distance, float width) { return std::clamp(0.5F - distance / width, 0.0F, 1.0F); }

    static Eigen::Vector3f eyeball(float radius)
    {
        Eigen::Vector3f result(0.88F, 0.86F, 0.84F);
        mix(result, {0.30F, 0.19F, 0.11F}, inside(radius - 6.0F, 0.8F));
        mix(result, {0.03F, 0.03F, 0.03F}, inside(radius - 2.4F, 0.8F));
        return result;
    }

    /// Below 0 under the hair: above a line from the forehead down to the ears, and behind them.
    static float hairline(const Eigen::Vector3f& point)
    {
        const float lowest = point.z() < -15.0F ? -30.0F : 42.0F + 0.85F * std::max(point.z() - 20.0F, 0.0F);
        return lowest - point.y();
    }

    [[nodiscard]] Eigen::Vector2f seen(int ibug) const { return landmarks_.col(ibug - 1).head<2>(); }

    [[nodiscard]] FrontalLine line(int first, int last, bool closed) const
    {
        std::vector<Eigen::Vector2f> points;
        for (int ibug = first; ibug <= last; ++ibug) {
            points.push_back(seen(ibug));
        }
        return {points, closed};
    }

    /// The brow whose outer end is a landmark, which marks its upper edge.
    [[nodiscard]] FrontalLine brow(int outer, int step) const
    {
        std::vector<Eigen::Vector2f> points;
        for (int i = 0; i < 5; ++i) {
            points.push_back(seen(outer + step * i));
        }
        for (int i = 4; i >= 0; --i) {
            points.emplace_back(seen(outer + step * i) - Eigen::Vector2f(0.0F, 2.0F + static_cast<float>(i)));
        }
        return {points, true};
    }

    [[nodiscard]] FrontalLine seam() const
    {
        return {{seen(49), 0.5F * (seen(62) + seen(68)), 0.5F * (seen(63) + seen(67)), 0.5F * (seen(64) + seen(66)),
                 seen(55)},
                false};
    }

    Eigen::Matrix3Xf landmarks_;
    Eigen::Matrix<float, 3, 2> eyes_;
    FrontalLine lips_;
    FrontalLine lip_seam_;
    std::array<FrontalLine, 2> rims_;
    std::array<FrontalLine, 2> brows_;
};

/// Makes the pictures.
class HeadPictures
{
public:
    /// @param path  Of bench/ict_heads.py.
    explicit HeadPictures(const std::string& path)
    {
        const std::vector<std::byte> bytes = read_file(path);
        const Safetensors file = parse_safetensors(bytes, path);
        neutral_ = tensor_values<float>(file, path, "head_neutral");
        const auto identity = tensor_values<float>(file, path, "head_identity");
        identity_ =
            Eigen::Map<const Eigen::MatrixXf>(identity.data(), neutral_.size(), identity.size() / neutral_.size());
        const auto triangles = tensor_values<int>(file, path, "head_triangles");
        const auto parts = tensor_values<int>(file, path, "head_parts");
        divide(Eigen::Map<const Eigen::Matrix3Xi>(triangles.data(), 3, triangles.size() / 3));
        paint(parts, tensor_values<int>(file, path, "landmarks"));
    }

    /// 640 x 480, before a blurred background of random colours, with noise of 3 levels.
    [[nodiscard]] ImageU8 render(const Eigen::VectorXf& coefficients, const Camera& camera, Random& random) const
    {
        Mesh mesh = mesh_;
        mesh.vertices = refined(neutral_ + identity_ * coefficients);
        mesh.colors *= static_cast<float>(random.uniform(0.7, 1.05)); // exposure
        ImageU8 picture = render_mesh_over(background(random), mesh, camera);
        for (std::uint8_t& value : picture.data) {
            value = static_cast<std::uint8_t>(std::clamp(value + 3.0 * random.normal() + 0.5, 0.0, 255.0));
        }
        return picture;
    }

private:
    static ImageU8 background(Random& random)
    {
        ImageU8 colors(8, 6, 3);
        for (std::uint8_t& value : colors.data) {
            value = static_cast<std::uint8_t>(random.uniform(60, 220));
        }
        ImageU8 picture(static_cast<int>(2 * principal_point_px.x()), static_cast<int>(2 * principal_point_px.y()), 3);
        for (int row = 0; row < picture.height; ++row) {
            for (int column = 0; column < picture.width; ++column) {
                for (int channel = 0; channel < 3; ++channel) {
                    picture.at(column, row, channel) = static_cast<std::uint8_t>(sample_bilinear(
                        colors, static_cast<float>(column) / 80.0F, static_cast<float>(row) / 80.0F, channel));
                }
            }
        }
        return picture;
    }

    /// Four triangles for each, so that colours at vertices are fine enough.
    void divide(const Eigen::Matrix3Xi& triangles)
    {
        std::map<std::pair<int, int>, int> middles;
        const auto middle = [&](int a, int b) {
            const auto [known, is_new] = middles.try_emplace(std::minmax(a, b), static_cast<int>(middles.size()));
            if (is_new) {
                edges_.push_back({a, b});
            }
            return static_cast<int>(neutral_.size() / 3) + known->second;
        };
        mesh_.triangles.resize(3, 4 * triangles.cols());
        for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
            const Eigen::Vector3i corner = triangles.col(t);
            const Eigen::Vector3i opposite(middle(corner[1], corner[2]), middle(corner[2], corner[0]),
                                           middle(corner[0], corner[1]));
            mesh_.triangles.col(4 * t) << corner[0], opposite[2], opposite[1];
            mesh_.triangles.col(4 * t + 1) << corner[1], opposite[0], opposite[2];
            mesh_.triangles.col(4 * t + 2) << corner[2], opposite[1], opposite[0];
            mesh_.triangles.col(4 * t + 3) = opposite;
        }
    }

    void paint(const Eigen::VectorXi& parts, const Eigen::VectorXi& landmarks)
    {
        const Eigen::Matrix3Xf vertices = refined(neutral_);
        std::vector<int> part_of_vertex(static_cast<std::size_t>(vertices.cols()));
        for (Eigen::Index t = 0; t < mesh_.triangles.cols(); ++t) {
            for (int k = 0; k < 3; ++k) {
                part_of_vertex[static_cast<std::size_t>(mesh_.triangles(k, t))] = parts[t / 4];
            }
        }
        Eigen::Matrix<float, 3, 2> eyes = Eigen::Matrix<float, 3, 2>::Zero();
        Eigen::Vector2f counts = Eigen::Vector2f::Zero();
        for (Eigen::Index v = 0; v < vertices.cols(); ++v) {
            if (part_of_vertex[static_cast<std::size_t>(v)] == 2) {
                const int side = vertices(0, v) < 0.0F ? 0 : 1;
                eyes.col(side) += vertices.col(v);
                ++counts[side];
            }
        }
        const HeadPaint colors(vertices(Eigen::all, landmarks), eyes * counts.cwiseInverse().asDiagonal());
        mesh_.colors.resize(3, vertices.cols());
        for (Eigen::Index v = 0; v < vertices.cols(); ++v) {
            mesh_.colors.col(v) = colors.color(part_of_vertex[static_cast<std::size_t>(v)], vertices.col(v));
        }
    }

    /// The vertices and the middles of the edges.
    [[nodiscard]] Eigen::Matrix3Xf refined(const Eigen::VectorXf& shape) const
    {
        const Eigen::Map<const Eigen::Matrix3Xf> coarse(shape.data(), 3, shape.size() / 3);
        Eigen::Matrix3Xf vertices(3, coarse.cols() + static_cast<Eigen::Index>(edges_.size()));
        vertices.leftCols(coarse.cols()) = coarse;
        Eigen::Index column = coarse.cols();
        for (const auto& [a, b] : edges_) {
            vertices.col(column++) = 0.5F * (coarse.col(a) + coarse.col(b));
        }
        return vertices;
    }

    Eigen::VectorXf neutral_ = {};                ///< 3W.
    Eigen::MatrixXf identity_ = {};               ///< 3W x m.
    std::vector<std::pair<int, int>> edges_ = {}; ///< Whose middles are the vertices after the first W.
    Mesh mesh_ = {};                              ///< Without vertices.
};

} // namespace lineament::bench
