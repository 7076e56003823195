// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Where annotators put the points of ibug68, as offsets from the vertices of our model: learned from one half of the
// annotated photos, checked on the other.
//
//   lineament-make-default-model PACKAGE_FOLDER vertices.safetensors --landmarks-at-vertices
//   landmark_offsets DATA vertices.safetensors        DATA/images/<set>/ with iBUG .pts beside the pictures
//
// A round fits the model to the training faces with a yaw below 25 deg, takes the mean residual of each point on the
// image plane turned back into model axes, left and right together, adds 0.7 of it to the point's offset and puts the
// point back on the surface. The outline stays: fits match it anew. Fit errors are those of photo_accuracy: mean
// distance of the points 18 ... 68, % of the outer-eye distance.
#include "lineament/camera/angles.hpp"
#include "lineament/fit/face_fitter.hpp"
#include "lineament/io/model_file.hpp"

#include "ibug_points.hpp"
#include "photo_sets.hpp"

#include <array>
#include <cstdio>
#include <exception>

namespace {

using namespace lineament;
using namespace lineament::bench;

constexpr int num_rounds = 6;
constexpr double step = 0.7;
constexpr double max_yaw_deg = 25.0;
constexpr Eigen::Index num_points = 68;

/// Fit errors of one half, and the mean residuals of its faces that look ahead.
struct Half
{
    std::vector<double> fit_percent = {};
    Eigen::Matrix2Xd residual_sum_mm = Eigen::Matrix2Xd::Zero(2, num_points);
    int num_frontal = 0;
};

void add(Half& half, const FaceFitter& fitter, const LandmarkSet& annotation)
{
    const FitResult fit = fitter.fit(annotation, Eigen::Vector2d::Zero());
    LandmarkSet fitted;
    for (const FittedLandmark& landmark : fit.landmarks) {
        fitted.landmarks.push_back({landmark.name, landmark.fitted_px, 1.0});
    }
    half.fit_percent.push_back(error_percent(fitted, annotation));
    if (std::abs(degrees(angles_from_rotation(fit.camera.camera_from_model).yaw)) > max_yaw_deg) {
        return;
    }
    ++half.num_frontal;
    for (Eigen::Index i = 0; i < num_points; ++i) {
        const FittedLandmark& landmark = fit.landmarks[static_cast<std::size_t>(i)];
        const Eigen::Vector2d residual_mm = (landmark.point_px - landmark.fitted_px) / fit.camera.scale_px_per_mm;
        half.residual_sum_mm.col(i) += (fit.camera.camera_from_model.topRows<2>().transpose() * residual_mm).head<2>();
    }
}

void measure(const fs::path& data, MorphableModel model)
{
    std::vector<LandmarkSet> annotations;
    for (const char* set : photo_sets) {
        for (const auto& [path, faces] : annotated_faces(data / "images" / set)) {
            annotations.insert(annotations.end(), faces.begin(), faces.end());
        }
    }
    std::vector<int> vertices;
    std::size_t ibug = 0;
    while (model.landmark_maps[ibug].scheme != "ibug68") {
        ++ibug;
    }
    for (Eigen::Index i = 0; i < num_points; ++i) {
        vertices.push_back(model.landmark_maps[ibug].vertices(0, i));
    }
    const auto partner_of = [&](Eigen::Index i) {
        return std::find(vertices.begin(), vertices.end(), model.mirror[vertices[static_cast<std::size_t>(i)]]) -
               vertices.begin();
    };
    const Eigen::Matrix3Xf mean = Eigen::Map<const Eigen::Matrix3Xf>(model.shape.mean.data(), 3, model.num_vertices());
    Eigen::Matrix2Xd offsets = Eigen::Matrix2Xd::Zero(2, num_points);
    std::printf("%zu faces, every other one for training\nround  training_%%  held_out_%%  (medians)\n",
                annotations.size());
    for (int round = 0;; ++round) {
        model.landmark_maps[ibug] = build::make_ibug_map(model, vertices, offsets);
        const FaceFitter fitter(model);
        std::array<Half, 2> halves;
        for (std::size_t a = 0; a < annotations.size(); ++a) {
            add(halves[a % 2], fitter, annotations[a]);
        }
        std::printf("%5d %11.2f %11.2f\n", round, median(halves[0].fit_percent), median(halves[1].fit_percent));
        if (round == num_rounds) {
            break;
        }
        const Eigen::Matrix3Xf points = model.landmark_maps[ibug].points_on(mean);
        for (Eigen::Index i = 0; i < num_points; ++i) {
            const bool is_outline = i < 17;
            const Eigen::Vector2d mirrored =
                halves[0].residual_sum_mm.col(partner_of(i)).cwiseProduct(Eigen::Vector2d(-1.0, 1.0));
            const Eigen::Vector2d residual_mm =
                0.5 * (halves[0].residual_sum_mm.col(i) + mirrored) / halves[0].num_frontal;
            const Eigen::Vector2d reached =
                (points.col(i) - mean.col(vertices[static_cast<std::size_t>(i)])).head<2>().cast<double>();
            offsets.col(i) = is_outline ? Eigen::Vector2d::Zero() : Eigen::Vector2d(reached + step * residual_mm);
        }
    }
    std::printf("\noffsets of the subject's right and of the symmetry plane [mm]: to the subject's left, up\n");
    for (Eigen::Index i = 0; i < num_points; ++i) {
        if (mean(0, vertices[static_cast<std::size_t>(i)]) <= 0.01F && !offsets.col(i).isZero()) {
            std::printf("    {%td, %.1f, %.1f},\n", i + 1, offsets(0, i), offsets(1, i));
        }
    }
}

} // namespace

int main(int argc, char** argv)
{
    if (argc != 3) {
        std::fprintf(stderr, "usage: landmark_offsets DATA vertices.safetensors\n");
        return 2;
    }
    try {
        measure(argv[1], load_model(argv[2]));
    } catch (const std::exception& error) {
        std::fprintf(stderr, "landmark_offsets: error: %s\n", error.what());
        return 1;
    }
    return 0;
}
