// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// One whole fit with both contours and six expressions, beside the calibration kernel; its parts are in parts_bench.
// Run with --benchmark_repetitions=15 --benchmark_enable_random_interleaving=true and read median and spread.
#include "calibration.hpp"

#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/multi_frame.hpp"
#include "lineament/io/model_file.hpp"
#include "support/synthetic_face.hpp"

#include <benchmark/benchmark.h>

namespace {

using namespace lineament;

/// The installed face model, or where there is none a synthetic face of as many vertices and coefficients.
const MorphableModel& face_model()
{
    static const MorphableModel model = [] {
        try {
            return load_model(default_model_path());
        } catch (const IoError&) {
            test::SyntheticFaceOptions options;
            options.half_columns = 28;
            options.half_rows = 26; // 57 x 53 = 3,021 vertices
            options.num_shape_coefficients = 60;
            options.num_expressions = 6;
            return test::make_synthetic_face(options);
        }
    }();
    return model;
}

LandmarkSet landmarks_at(double yaw_deg)
{
    Random random(7);
    Camera camera;
    camera.camera_from_model = rotation_from_angles({radians(yaw_deg), radians(5), 0});
    camera.scale_px_per_mm = 1.2;
    camera.principal_point_px = {320, 240};
    return test::project_landmarks(face_model(), "ibug68", 0.7 * test::random_normal(random, 10), {}, camera, 1.5,
                                   random);
}

BENCHMARK(bench::calibration)->Unit(benchmark::kMicrosecond);

void fit(benchmark::State& state)
{
    const FaceFitter fitter(face_model());
    const LandmarkSet landmarks = landmarks_at(static_cast<double>(state.range(0)));
    FitResult result;
    for (auto _ : state) {
        result = fitter.fit(landmarks, {320, 240});
        benchmark::DoNotOptimize(result.rms_px);
    }
    state.counters["vertices"] = static_cast<double>(face_model().num_vertices());
    state.SetLabel(face_model().name + " " + to_string(result.status));
}
BENCHMARK(fit)->ArgName("yaw_deg")->Arg(0)->Arg(30)->Arg(60)->Unit(benchmark::kMicrosecond);

void fit_ten_frames(benchmark::State& state)
{
    const FaceFitter fitter(face_model());
    std::vector<LandmarkSet> frames;
    for (int f = 0; f < 10; ++f) {
        frames.push_back(landmarks_at(-45 + 10 * f));
    }
    for (auto _ : state) {
        benchmark::DoNotOptimize(fit_frames(fitter, frames, {320, 240}).num_used_frames);
    }
}
BENCHMARK(fit_ten_frames)->Unit(benchmark::kMicrosecond);

} // namespace

BENCHMARK_MAIN();
