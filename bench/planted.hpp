// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/procrustes.hpp"
#include "lineament/fit/fit_result.hpp"
#include "lineament/model/morphable_model.hpp"
#include "support/synthetic_face.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

// Planted faces: identity, expression, camera and noise drawn at random, and the landmarks they give.
namespace lineament::bench {

inline constexpr double outer_eye_px = 100.0;
inline const Eigen::Vector2d centre(320, 240);

/// Mean and standard error of what is added.
struct Mean
{
    double sum = 0, squares = 0;
    int count = 0;
    void add(double value)
    {
        sum += value;
        squares += value * value;
        ++count;
    }
    [[nodiscard]] double mean() const { return sum / count; }
    [[nodiscard]] double error() const
    {
        return std::sqrt(std::max(0.0, squares / count - mean() * mean()) / std::max(1, count - 1));
    }
};

/// Where the outline landmarks are put on the side of the face that is turned away.
enum class Outline
{
    model_points, ///< At the landmark map's points.
    visible,      ///< On the visible outline, as people and detectors mark it.
};

struct Protocol
{
    int num_images = 1;
    double noise_px = 2.8;
    double bias_mm = 0;     ///< Standard deviation per landmark and axis, the same in all images of a subject.
    double wild_share = 0;  ///< Of landmarks displaced uniformly within +-20 px.
    double distance_mm = 0; ///< Of the head; 0: far away (scaled orthographic).
    double focal_length_px = 0;
    double min_yaw_deg = -45;
    double max_yaw_deg = 45;
    double expression_sigma = 0.3; ///< Each psi is |N(0, sigma)|, at most 1.
    std::string expression_set = "ekman6";
    Outline outline = Outline::model_points;
};

struct Subject
{
    Eigen::VectorXd alpha;
    std::vector<Eigen::VectorXd> psi; ///< Of each image.
    std::vector<Camera> cameras;
    std::vector<LandmarkSet> images;
};

/// A model, and subjects drawn from its priors.
class PlantedFaces
{
public:
    explicit PlantedFaces(MorphableModel model) : model_(std::move(model))
    {
        const Eigen::VectorXf& mask = model_.masks.at("face");
        for (int v = 0; v < mask.size(); ++v) {
            if (mask[v] > 0.5f) {
                face_vertices_.push_back(v);
            }
        }
    }

    [[nodiscard]] const MorphableModel& model() const { return model_; }
    [[nodiscard]] const std::vector<int>& face_vertices() const { return face_vertices_; }
    /// px/mm at which the mean face's outer eye corners are 100 px apart.
    [[nodiscard]] double mean_scale() const { return outer_eye_px / outer_eye_mm(model_.shape.mean); }

    [[nodiscard]] double outer_eye_mm(const Eigen::VectorXf& shape) const
    {
        const Eigen::Matrix3Xd points = landmark_points(shape);
        return (points.col(map().index_of("37")) - points.col(map().index_of("46"))).norm();
    }

    /// The points of ibug68 on a shape (3 x 68).
    [[nodiscard]] Eigen::Matrix3Xd landmark_points(const Eigen::VectorXf& shape) const
    {
        return map().points_on(vertices_of(shape)).cast<double>();
    }

    /// Mean distance of the face's vertices on two shapes after a similarity or a rigid motion [mm].
    [[nodiscard]] double shape_error_mm(const Eigen::VectorXf& shape, const Eigen::VectorXf& truth,
                                        AlignmentScale alignment_scale = AlignmentScale::free) const
    {
        const Eigen::Matrix3Xd source = face_of(shape);
        const Eigen::Matrix3Xd target = face_of(truth);
        return (align_points(source, target, alignment_scale) * source - target).colwise().norm().mean();
    }

    /// The same of two neutral shapes.
    [[nodiscard]] double error_mm(const Eigen::VectorXd& alpha, const Eigen::VectorXd& truth,
                                  AlignmentScale alignment_scale = AlignmentScale::free) const
    {
        return shape_error_mm(model_.shape.instance(alpha), model_.shape.instance(truth), alignment_scale);
    }

    /// Mean length, over the face's vertices, of what expression coefficients move them by [mm].
    [[nodiscard]] double displacement_mm(const Eigen::VectorXd& psi, const std::string& expression_set) const
    {
        return face_of(model_.find_expression_set(expression_set)->displacement(psi)).colwise().norm().mean();
    }

    [[nodiscard]] Eigen::VectorXf shape_of(const Eigen::VectorXd& alpha, const Eigen::VectorXd& psi,
                                           const std::string& expression_set = "ekman6") const
    {
        return model_.shape.instance(alpha) + model_.find_expression_set(expression_set)->displacement(psi);
    }

    [[nodiscard]] Subject draw_subject(const Protocol& protocol, std::uint64_t seed) const
    {
        Random random(seed);
        Subject subject;
        subject.alpha = test::random_normal(random, model_.shape.num_coefficients());
        const double eyes_mm = outer_eye_mm(model_.shape.instance(subject.alpha));
        const Eigen::VectorXd bias = protocol.bias_mm * test::random_normal(random, 3 * map().num_landmarks());
        Random wild(seed ^ 0x5bd1e995u); // so that the clean landmarks are the same with and without wild ones
        for (int f = 0; f < protocol.num_images; ++f) {
            Eigen::VectorXd psi =
                protocol.expression_sigma *
                test::random_normal(random, model_.find_expression_set(protocol.expression_set)->num_coefficients());
            psi = psi.cwiseAbs().cwiseMin(1.0);
            Camera camera;
            const double yaw = random.uniform(protocol.min_yaw_deg, protocol.max_yaw_deg);
            const double pitch = 8 * random.normal(), roll = 5 * random.normal();
            camera.camera_from_model = rotation_from_angles({radians(yaw), radians(pitch), radians(roll)});
            camera.principal_point_px = centre;
            camera.scale_px_per_mm = outer_eye_px / eyes_mm;
            if (protocol.distance_mm > 0) {
                camera.phi_per_mm = 1 / protocol.distance_mm;
                camera.scale_px_per_mm = protocol.focal_length_px / protocol.distance_mm;
            }
            camera.translation_mm = {random.uniform(-20, 20), random.uniform(-20, 20)};
            const Eigen::VectorXf shape = shape_of(subject.alpha, psi, protocol.expression_set);
            Eigen::Matrix3Xd points = landmark_points(shape);
            points += Eigen::Map<const Eigen::Matrix3Xd>(bias.data(), 3, map().num_landmarks());
            Eigen::Matrix2Xd seen = camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(points));
            if (protocol.outline == Outline::visible) {
                move_to_outline(shape, camera, radians(yaw), seen);
            }
            LandmarkSet set;
            for (Eigen::Index l = 0; l < points.cols(); ++l) {
                Landmark landmark{map().names[static_cast<std::size_t>(l)], seen.col(l)};
                landmark.point_px += protocol.noise_px * Eigen::Vector2d{random.normal(), random.normal()};
                if (wild.uniform() < protocol.wild_share) {
                    landmark.point_px += Eigen::Vector2d{wild.uniform(-20, 20), wild.uniform(-20, 20)};
                }
                set.landmarks.push_back(landmark);
            }
            subject.psi.push_back(psi);
            subject.cameras.push_back(camera);
            subject.images.push_back(set);
        }
        return subject;
    }

    [[nodiscard]] std::vector<Subject> draw_subjects(const Protocol& protocol, int count) const
    {
        std::vector<Subject> subjects;
        for (int i = 0; i < count; ++i) {
            subjects.push_back(draw_subject(protocol, 1000003ull * static_cast<std::uint64_t>(i + 1)));
        }
        return subjects;
    }

private:
    [[nodiscard]] const LandmarkMap& map() const { return *model_.find_landmark_map("ibug68"); }
    [[nodiscard]] Eigen::Map<const Eigen::Matrix3Xf> vertices_of(const Eigen::VectorXf& shape) const
    {
        return {shape.data(), 3, model_.num_vertices()};
    }
    [[nodiscard]] Eigen::Matrix3Xd face_of(const Eigen::VectorXf& shape) const
    {
        return vertices_of(shape)(Eigen::all, face_vertices_).cast<double>();
    }

    /// On the side turned away, each outline landmark goes outwards at its height, across the head's upward axis, to
    /// where that line leaves the face: the outermost mesh edge on it, without ears, neck and nose.
    void move_to_outline(const Eigen::VectorXf& shape, const Camera& camera, double yaw, Eigen::Matrix2Xd& seen) const
    {
        constexpr double nose_radius_mm = 35.0; // about the tip: in a half profile the nose reaches beyond the cheek
        const auto vertices = vertices_of(shape);
        const Eigen::VectorXf& ears = model_.masks.at("ears");
        const Eigen::VectorXf& neck = model_.masks.at("neck");
        const Eigen::Vector3f tip = landmark_points(shape).col(map().index_of("31")).cast<float>();
        const Eigen::Matrix3Xd exact = vertices.cast<double>();
        const Eigen::Matrix2Xd vertices_px = camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(exact));
        const auto belongs = [&](int v) {
            return ears[v] < 0.5f && neck[v] < 0.5f && (vertices.col(v) - tip).norm() > nose_radius_mm &&
                   (vertices(0, v) > 0) == (yaw > 0); // yaw > 0 turns the subject's left side (x > 0) away
        };
        const Eigen::Vector2d up = camera.camera_from_model.col(1).head<2>().normalized();
        const Eigen::Vector2d outwards = (yaw > 0 ? 1 : -1) * Eigen::Vector2d(-up.y(), up.x());
        for (int ibug = yaw > 0 ? 10 : 1; ibug <= (yaw > 0 ? 17 : 8); ++ibug) {
            const Eigen::Vector2d origin = seen.col(map().index_of(std::to_string(ibug)));
            double last = 0;
            for (const auto& triangle : model_.levels.back().triangles.colwise()) {
                for (int k = 0; k < 3; ++k) {
                    const int a = triangle[k], b = triangle[(k + 1) % 3];
                    const Eigen::Vector2d p = vertices_px.col(a) - origin, q = vertices_px.col(b) - origin;
                    const double side_p = up.dot(p), side_q = up.dot(q);
                    if ((side_p < 0) != (side_q < 0) && belongs(a) && belongs(b)) {
                        last = std::max(last, outwards.dot(p + side_p / (side_p - side_q) * (q - p)));
                    }
                }
            }
            seen.col(map().index_of(std::to_string(ibug))) += last * outwards;
        }
    }

    MorphableModel model_;
    std::vector<int> face_vertices_ = {};
};

} // namespace lineament::bench
