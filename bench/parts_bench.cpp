// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Time of every part between a photo and its files, beside a calibration kernel: reading, detection, the parts of a
// fit, texture, pictures, writing. The photo is a rendering of the default model, 640 x 480, which the detectors take
// for a face. Run with --benchmark_repetitions=15 --benchmark_enable_random_interleaving=true and read median and
// spread of the processor time.
#include "calibration.hpp"
#include "fit_by_parts.hpp"

#include "lineament/fit/contour.hpp"
#include "lineament/fit/expression.hpp"
#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/identity.hpp"
#include "lineament/fit/pose.hpp"
#include "lineament/io/glb_file.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/io/mesh_file.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/render/shading.hpp"
#include "lineament/render/texture.hpp"
#include "lineament/render/texture_completion.hpp"
#include "lineament/report/face_view.hpp"
#include "lineament/report/fit_report.hpp"
#include "lineament/report/overlay.hpp"
#include "lineament/vision/dlib_detector.hpp"
#include "lineament/vision/mesh_detector.hpp"
#include "support/rendered_person.hpp"
#include "support/synthetic_face.hpp"

#include <benchmark/benchmark.h>

#include <cstdio>
#include <functional>
#include <string>
#include <vector>

namespace {

using namespace lineament;

/// Everything that the parts take, made once: a photo and what each step before has made of it.
struct Scene
{
    MorphableModel model = load_model(default_model_path());
    ImageU8 photo = test::RenderedPerson(4).picture(20.0, 640, 480);
    std::vector<std::byte> png = format_png(photo);
    std::vector<std::byte> jpeg = format_jpeg(photo);
    MeshDetector mesh_detector;
    DlibDetector face_detector;
    MeshFace mesh_face = mesh_detector.detect(photo).at(0);

    // A planted face of 68 points for the fit and its parts, at a yaw where one side is turned away.
    Eigen::Vector2d center = {320, 240};
    LandmarkSet landmarks = planted_landmarks();
    FaceFitter fitter{model};
    FaceFitter dense_fitter{model, "mediapipe478"};
    FitResult fit = fitter.fit(landmarks, center);
    ModelPoints points = fitter.landmark_points();
    Eigen::Matrix2Xd image_points = bench::points_of(landmarks);
    Eigen::Matrix3Xd shape_points = points.at(fit.shape_coefficients, fit.expression_coefficients);
    ContourModel contour{model};
    Mesh mesh = model.mesh_of(shape_of(model, fit));

    FitResult photo_fit = dense_fitter.fit(mesh_face.landmarks, center);
    Mesh photo_mesh = model.mesh_of(shape_of(model, photo_fit));
    TextureLayout layout{photo_mesh, 512};
    TextureMap texture = extract_texture(layout, photo_mesh.vertices, photo_mesh.triangles, photo_fit.camera, photo);
    ImageU8 whole_texture = complete_texture(texture).color;

    [[nodiscard]] LandmarkSet planted_landmarks() const
    {
        Random random(7);
        Camera camera;
        camera.camera_from_model = rotation_from_angles({radians(30), radians(5), 0});
        camera.scale_px_per_mm = 1.2;
        camera.principal_point_px = center;
        return test::project_landmarks(model, "ibug68", 0.7 * test::random_normal(random, 10), {}, camera, 1.5, random);
    }
};

/// Registers a part; its result is kept from being optimised away.
template <typename Part>
void add_part(const char* name, const Part& part)
{
    benchmark::RegisterBenchmark(name, [part](benchmark::State& state) {
        for (auto _ : state) {
            benchmark::DoNotOptimize(part());
        }
    })->Unit(benchmark::kMicrosecond);
}

void add_parts(Scene& scene)
{
    benchmark::RegisterBenchmark("calibration", bench::calibration)->Unit(benchmark::kMicrosecond);

    add_part("read/model", [] { return load_model(default_model_path()).num_vertices(); });
    add_part("read/png", [&] { return parse_image(scene.png, "photo.png").width; });
    add_part("read/jpeg", [&] { return parse_image(scene.jpeg, "photo.jpg").width; });

    add_part("detect/mesh", [&] { return scene.mesh_detector.detect(scene.photo).size(); });
    add_part("detect/mesh, follow",
             [&] { return scene.mesh_detector.follow(scene.photo, scene.mesh_face.landmarks).has_value(); });
    add_part("detect/68 points of dlib", [&] { return scene.face_detector.detect(scene.photo).size(); });

    add_part("fit/prepare", [&] { return FaceFitter(scene.model).num_shape_coefficients(); });
    add_part("fit/pose", [&] { return estimate_pose(scene.shape_points, scene.image_points).rms_px; });
    add_part("fit/pose, perspective",
             [&] { return estimate_pose_perspective(scene.shape_points, scene.image_points, 800.0).rms_px; });
    add_part("fit/contour, facing", [&] {
        ContourOptions options;
        options.occluding_match = OccludingMatch::none;
        return match_contour(scene.contour, scene.mesh.vertices, scene.fit.camera, scene.landmarks,
                             ContourView::frontal, options)
            .matches.size();
    });
    add_part("fit/contour, both", [&] {
        return match_contour(scene.contour, scene.mesh.vertices, scene.fit.camera, scene.landmarks).matches.size();
    });
    add_part("fit/identity", [&] {
        return fit_identity(scene.points, scene.image_points, scene.fit.camera, {}, scene.fit.expression_coefficients)
            .coefficients[0];
    });
    add_part("fit/expression", [&] {
        return fit_expression(scene.points, scene.image_points, scene.fit.camera, {}, scene.fit.shape_coefficients)
            .coefficients[0];
    });
    add_part("fit/shape", [&] { return shape_of(scene.model, scene.fit)[0]; });
    add_part("fit/whole, 68 points", [&] { return scene.fitter.fit(scene.landmarks, scene.center).rms_px; });
    add_part("fit/whole, 478 points",
             [&] { return scene.dense_fitter.fit(scene.mesh_face.landmarks, scene.center).rms_px; });

    add_part("texture/extract", [&] {
        return extract_texture(scene.layout, scene.photo_mesh.vertices, scene.photo_mesh.triangles,
                               scene.photo_fit.camera, scene.photo)
            .color.width;
    });
    add_part("texture/complete", [&] { return complete_texture(scene.texture).color.width; });

    add_part("draw/overlay", [&] { return draw_overlay(scene.photo, scene.model, scene.photo_fit).width; });
    add_part("draw/frontal", [&] {
        const Camera camera = frame_camera(scene.photo_mesh, {}, 480, 600);
        return render_mesh(scene.photo_mesh, scene.whole_texture, camera, 480, 600).width;
    });

    add_part("write/png, 640 x 480", [&] { return format_png(scene.photo).size(); });
    add_part("write/glb", [&] {
        GlbScene glb;
        glb.mesh = scene.photo_mesh;
        return format_glb(glb).size();
    });
    add_part("write/obj", [&] { return format_obj(scene.photo_mesh).size(); });
    add_part("write/ply", [&] { return format_ply(scene.photo_mesh).size(); });
    add_part("write/report", [&] {
        FitReport report;
        report.picture = report.overlay = scene.photo;
        FitReportFace& face = report.faces.emplace_back();
        face.fit = scene.photo_fit;
        face.view = make_face_view(scene.model, scene.photo_fit, scene.whole_texture);
        return format_fit_report(report).size();
    });
}

} // namespace

int main(int argc, char** argv)
{
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) {
        return 2;
    }
    try {
        Scene scene;
        add_parts(scene);
        benchmark::RunSpecifiedBenchmarks();
    } catch (const std::exception& error) {
        std::fprintf(stderr, "parts_bench: error: %s\n", error.what());
        return 1;
    }
}
