// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Pictures of random people, drawn by the renderer from the default model; the detector takes them for faces.
#pragma once

#include "lineament/core/random.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/render/shading.hpp"
#include "support/synthetic_face.hpp"

#include <algorithm>

namespace lineament::test {

class RenderedPerson
{
public:
    /// Shape with 0.7 of the prior's deviations, colours with all of them; the same seed gives the same person.
    explicit RenderedPerson(std::uint64_t seed)
    {
        const MorphableModel model = load_model(default_model_path());
        Random random(seed);
        const Eigen::VectorXd shape = 0.7 * random_normal(random, model.shape.num_coefficients());
        const Eigen::VectorXf color = model.color->instance(random_normal(random, model.color->num_coefficients()));
        mesh_ = model.mesh_of(model.shape.instance(shape));
        mesh_points_ = model.find_landmark_map("mediapipe478")->points_on(mesh_.vertices).cast<double>();
        mesh_.colors =
            Eigen::Map<const Eigen::Matrix3Xf>(color.data(), 3, model.num_vertices()).cwiseMax(0.0f).cwiseMin(1.0f);
    }

    /// The whole head before a light background, RGB; `margin` of each side is left free.
    [[nodiscard]] ImageU8 picture(double yaw_deg, int width, int height, double margin = 0.12) const
    {
        ShadingOptions options;
        options.ambient_occlusion = 0.0;
        const Camera camera = frame_camera(mesh_, {radians(yaw_deg), 0.0, 0.0}, width, height, margin);
        return render_mesh(mesh_, camera, width, height, options);
    }

    /// Where the model's 478 points of MediaPipe lie in that picture, hidden ones too [px].
    [[nodiscard]] Eigen::Matrix2Xd mesh_points(double yaw_deg, int width, int height, double margin = 0.12) const
    {
        const Camera camera = frame_camera(mesh_, {radians(yaw_deg), 0.0, 0.0}, width, height, margin);
        return camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(mesh_points_));
    }

    /// Of the outer corners of the eyes in that picture, were they seen from the front [px].
    [[nodiscard]] double outer_eye_distance_px(double yaw_deg, int width, int height, double margin = 0.12) const
    {
        const Camera camera = frame_camera(mesh_, {radians(yaw_deg), 0.0, 0.0}, width, height, margin);
        return camera.scale_px_per_mm * (mesh_points_.col(33) - mesh_points_.col(263)).norm();
    }

private:
    Mesh mesh_;
    Eigen::Matrix3Xd mesh_points_;
};

/// Two RGB pictures of one size side by side.
inline ImageU8 side_by_side(const ImageU8& left, const ImageU8& right)
{
    ImageU8 both(2 * left.width, left.height, 3);
    for (int row = 0; row < left.height; ++row) {
        std::copy_n(left.pixel(0, row), 3 * left.width, both.pixel(0, row));
        std::copy_n(right.pixel(0, row), 3 * left.width, both.pixel(left.width, row));
    }
    return both;
}

} // namespace lineament::test
