// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "measures.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/core/closest_point.hpp"
#include "lineament/core/landmarks.hpp"
#include "lineament/core/random.hpp"
#include "lineament/evaluation/now.hpp"
#include "lineament/io/file.hpp"
#include "lineament/io/safetensors.hpp"
#include "lineament/model/morphable_model.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

/// Heads of another model (bench/ict_heads.py), as a camera sees them, and how far a shape of ours is from them.
namespace lineament::bench {

inline const Eigen::Vector2d principal_point_px(320, 240);

/// Regions of a face, as ranges of ibug68 landmarks.
struct Region
{
    const char* name;
    int first;
    int last;
};
inline constexpr std::array<Region, 5> regions = {
    {{"jaw", 1, 17}, {"brows", 18, 27}, {"nose", 28, 36}, {"eyes", 37, 48}, {"mouth", 49, 68}}};

/// The narrow face of the other model: no ears, no neck.
struct ForeignModel
{
    Eigen::VectorXf neutral;                   ///< 3V.
    Eigen::MatrixXf identity;                  ///< 3V x m.
    Eigen::VectorXi landmarks;                 ///< 68.
    Eigen::Matrix3Xi triangles;                ///< 3 x T.
    std::vector<std::size_t> region_of_vertex; ///< V, by the nearest landmark.
};

/// The region of each vertex.
[[nodiscard]] inline std::vector<std::size_t> regions_of(const Eigen::VectorXf& shape, const Eigen::VectorXi& landmarks)
{
    const Eigen::Map<const Eigen::Matrix3Xf> vertices(shape.data(), 3, shape.size() / 3);
    std::vector<std::size_t> result;
    for (const auto& vertex : vertices.colwise()) {
        Eigen::Index nearest = 0;
        (vertices(Eigen::all, landmarks).colwise() - vertex).colwise().squaredNorm().minCoeff(&nearest);
        std::size_t region = 0;
        while (nearest + 1 > regions[region].last) {
            ++region;
        }
        result.push_back(region);
    }
    return result;
}

/// The values of a tensor. @throws IoError if it is not in the file.
template <typename Scalar>
[[nodiscard]] Eigen::Map<const Eigen::VectorX<Scalar>> tensor_values(const Safetensors& file, const std::string& path,
                                                                     const std::string& name)
{
    const Tensor* tensor = file.find(name);
    if (tensor == nullptr) {
        throw IoError(IoErrorKind::content, path, "", "tensor " + name + " is missing");
    }
    return {reinterpret_cast<const Scalar*>(tensor->elements.data()),
            static_cast<Eigen::Index>(tensor->num_elements())};
}

[[nodiscard]] inline ForeignModel load_foreign_model(const std::string& path)
{
    const std::vector<std::byte> bytes = read_file(path);
    const Safetensors file = parse_safetensors(bytes, path);
    ForeignModel model;
    model.neutral = tensor_values<float>(file, path, "neutral");
    const auto identity = tensor_values<float>(file, path, "identity");
    model.identity = Eigen::Map<const Eigen::MatrixXf>(identity.data(), model.neutral.size(),
                                                       identity.size() / model.neutral.size());
    model.landmarks = tensor_values<int>(file, path, "landmarks");
    const auto triangles = tensor_values<int>(file, path, "triangles");
    model.triangles = Eigen::Map<const Eigen::Matrix3Xi>(triangles.data(), 3, triangles.size() / 3);
    model.region_of_vertex = regions_of(model.neutral, model.landmarks);
    return model;
}

struct Head
{
    Eigen::VectorXf coefficients; ///< m, ~ N(0, 1).
    Eigen::Matrix3Xd vertices;
    Eigen::Matrix3Xd landmarks; ///< 3 x 68.
    NowPoints now_points;
};

[[nodiscard]] inline Head make_head(const ForeignModel& foreign, Random& random)
{
    Head head;
    head.coefficients.resize(foreign.identity.cols());
    for (float& coefficient : head.coefficients) {
        coefficient = static_cast<float>(random.normal());
    }
    const Eigen::VectorXf shape = foreign.neutral + foreign.identity * head.coefficients;
    head.vertices = Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, shape.size() / 3).cast<double>();
    head.landmarks = head.vertices(Eigen::all, foreign.landmarks);
    for (std::size_t i = 0; i < now_point_names.size(); ++i) {
        head.now_points.col(static_cast<Eigen::Index>(i)) = head.landmarks.col(std::stoi(now_point_names[i]) - 1);
    }
    return head;
}

enum class Jaw
{
    outline,  ///< On the visible outline of the face, at the height of the fixed vertex.
    vertices, ///< At fixed vertices.
};

/// A head as a camera sees it.
struct View
{
    Camera camera;
    Eigen::Matrix2Xd exact_px[2]; ///< 2 x 68, projected without noise, by Jaw.
    Eigen::Matrix2Xd unit_noise;  ///< 2 x 68, N(0, 1): the same draws at every noise level.
};

/// The farthest point of the edges along `direction` on the line through `from`, or `from` if none meets it.
[[nodiscard]] inline Eigen::Vector2d leave_edges(const Eigen::Matrix2Xd& points,
                                                 const std::vector<std::array<int, 2>>& edges,
                                                 const Eigen::Vector2d& from, const Eigen::Vector2d& direction)
{
    double last = -std::numeric_limits<double>::infinity();
    for (const auto& [a, b] : edges) {
        const Eigen::Vector2d p = points.col(a) - from;
        const Eigen::Vector2d q = points.col(b) - from;
        const double side_p = direction.x() * p.y() - direction.y() * p.x();
        const double side_q = direction.x() * q.y() - direction.y() * q.x();
        if ((side_p < 0.0) != (side_q < 0.0)) {
            last = std::max(last, direction.dot(p + side_p / (side_p - side_q) * (q - p)));
        }
    }
    return std::isfinite(last) ? Eigen::Vector2d(from + last * direction) : from;
}

/// The edges of the face that can be its outline: neither the nose, which in a half profile reaches beyond the cheek,
/// nor what lies under the jaw and looks down.
[[nodiscard]] inline std::vector<std::array<int, 2>> outline_edges(const ForeignModel& foreign, const Head& head)
{
    constexpr double nose_radius_mm = 35.0; // about the tip
    constexpr double least_upwards = -0.5;  // of a normal
    const Eigen::Vector3d nose_tip = head.landmarks.col(30);
    std::vector<std::array<int, 2>> edges;
    for (const auto& triangle : foreign.triangles.colwise()) {
        const Eigen::Vector3d a = head.vertices.col(triangle[0]);
        const Eigen::Vector3d normal = (head.vertices.col(triangle[1]) - a).cross(head.vertices.col(triangle[2]) - a);
        if (normal.y() < least_upwards * normal.norm()) {
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            if ((head.vertices.col(triangle[k]) - nose_tip).norm() > nose_radius_mm) {
                edges.push_back({triangle[k], triangle[(k + 1) % 3]});
            }
        }
    }
    return edges;
}

/// Yaw uniform in +-45 deg, pitch and roll with sd 8 and 5 deg, outer-eye distance 100 px.
/// @param phi_per_mm  1 / distance of the camera; 0: scaled orthographic.
[[nodiscard]] inline View make_view(const ForeignModel& foreign, const Head& head, Random& random,
                                    double phi_per_mm = 0.0)
{
    const auto point = [&](int ibug) { return Eigen::Vector3d(head.landmarks.col(ibug - 1)); };
    View view;
    view.camera.camera_from_model = rotation_from_angles(
        {radians(random.uniform(-45, 45)), radians(8 * random.normal()), radians(5 * random.normal())});
    view.camera.scale_px_per_mm = 100.0 / (point(37) - point(46)).norm();
    view.camera.phi_per_mm = phi_per_mm;
    view.camera.principal_point_px = principal_point_px;

    const Eigen::Matrix2Xd vertices_px = view.camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(head.vertices));
    Eigen::Matrix2Xd& outline = view.exact_px[static_cast<int>(Jaw::outline)];
    Eigen::Matrix2Xd& vertices = view.exact_px[static_cast<int>(Jaw::vertices)];
    vertices.resize(2, 68);
    view.unit_noise.resize(2, 68);
    for (int ibug = 1; ibug <= 68; ++ibug) {
        vertices.col(ibug - 1) = vertices_px.col(foreign.landmarks[ibug - 1]);
        view.unit_noise.col(ibug - 1) << random.normal(), random.normal();
    }
    outline = vertices;
    const std::vector<std::array<int, 2>> edges = outline_edges(foreign, head);
    const Eigen::Vector2d up = view.camera.camera_from_model.topRows<2>().col(1).normalized();
    const Eigen::Vector2d to_the_right(-up.y(), up.x()); // of the picture, in the face's own sense of level
    for (int ibug = 1; ibug <= 17; ++ibug) {
        if (ibug != 9) { // the chin
            const double side = ibug < 9 ? -1.0 : 1.0;
            outline.col(ibug - 1) = leave_edges(vertices_px, edges, vertices.col(ibug - 1), side * to_the_right);
        }
    }
    return view;
}

/// Image points (2 x 68) as landmarks "1" ... "68" of ibug68.
[[nodiscard]] inline LandmarkSet as_ibug68(const Eigen::Matrix2Xd& points)
{
    LandmarkSet landmarks;
    for (int i = 0; i < 68; ++i) {
        landmarks.landmarks.push_back({std::to_string(i + 1), points.col(i), 1.0});
    }
    return landmarks;
}

[[nodiscard]] inline NowPoints now_points_of(const MorphableModel& model, const Eigen::VectorXf& shape)
{
    const LandmarkMap& map = *model.find_landmark_map("ibug68");
    const Eigen::Matrix3Xf points =
        map.points_on(Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, model.num_vertices()));
    NowPoints now;
    for (std::size_t i = 0; i < now_point_names.size(); ++i) {
        now.col(static_cast<Eigen::Index>(i)) = points.col(map.index_of(now_point_names[i])).cast<double>();
    }
    return now;
}

struct Distance
{
    double median_mm = 0.0;
    std::array<double, regions.size()> region_mean_mm = {};
    Eigen::Matrix3d foreign_from_model = Eigen::Matrix3d::Identity(); ///< Rotation that lays the shape on the head.
};

/// Distances of a head to a shape of our model, by the NoW protocol.
[[nodiscard]] inline Distance distance(const Head& head, const ForeignModel& foreign, const MorphableModel& model,
                                       const Eigen::VectorXf& shape)
{
    constexpr Eigen::Index every = 15; // scan vertices used: 400 in the crop, enough for a median
    Eigen::Matrix3Xd scan(3, (head.vertices.cols() + every - 1) / every);
    for (Eigen::Index i = 0; i < scan.cols(); ++i) {
        scan.col(i) = head.vertices.col(every * i);
    }
    const Eigen::Matrix3Xd prediction =
        Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, model.num_vertices()).cast<double>();
    const Eigen::Matrix3Xi& triangles = model.levels.back().triangles;
    const NowResult now = evaluate_now(scan, head.now_points, prediction, triangles, now_points_of(model, shape));
    Distance result;
    result.median_mm = median(now.distances_mm);
    result.foreign_from_model = now.scan_from_prediction.rotation;

    const ClosestPointTree surface(now.scan_from_prediction * prediction, triangles);
    std::array<int, regions.size()> counts = {};
    for (Eigen::Index i = 0; i < scan.cols(); ++i) {
        const std::size_t region = foreign.region_of_vertex[static_cast<std::size_t>(every * i)];
        result.region_mean_mm[region] += surface.closest(scan.col(i)).distance;
        ++counts[region];
    }
    for (std::size_t r = 0; r < regions.size(); ++r) {
        result.region_mean_mm[r] /= counts[r];
    }
    return result;
}

/// One head, the mean face against the fit.
struct Pair
{
    Distance mean_face;
    Distance fit;
};

struct Comparison
{
    double mean_face_mm = 0.0;
    double fit_mm = 0.0;
    double standard_error_mm = 0.0; ///< Of the mean paired difference.

    explicit Comparison(const std::vector<Pair>& pairs)
    {
        double squares = 0.0;
        const double count = static_cast<double>(pairs.size());
        for (const Pair& pair : pairs) {
            mean_face_mm += pair.mean_face.median_mm / count;
            fit_mm += pair.fit.median_mm / count;
            squares += std::pow(pair.mean_face.median_mm - pair.fit.median_mm, 2) / count;
        }
        standard_error_mm = std::sqrt((squares - gain_mm() * gain_mm()) / (count - 1));
    }

    [[nodiscard]] double gain_mm() const { return mean_face_mm - fit_mm; }
    [[nodiscard]] double percent(double mm) const { return 100.0 * mm / mean_face_mm; }
};

/// The heads that a fit brings nearer than the mean face.
[[nodiscard]] inline std::ptrdiff_t num_better(const std::vector<Pair>& pairs)
{
    return std::count_if(pairs.begin(), pairs.end(),
                         [](const Pair& pair) { return pair.fit.median_mm < pair.mean_face.median_mm; });
}

} // namespace lineament::bench
