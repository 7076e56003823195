// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// RealtimeFitter: whole fits, tracking steps, meshes and single kernels for each instruction set of this machine,
// beside the reference path and a calibration kernel (multiply-adds over 4 MB). Checks first that both paths agree. Run
// with
// --benchmark_min_time=0.2 --benchmark_repetitions=15 --benchmark_enable_random_interleaving=true and read median and
// spread of the processor time.
#include "calibration.hpp"

#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"
#include "support/synthetic_face.hpp"

#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>

namespace {

using namespace lineament;
using kernels::AlignedBuffer;
using kernels::Kernels;

constexpr double max_yaw_deg = 45;
const Eigen::Vector2d centre(320, 240);

const MorphableModel& face_model()
{
    static const MorphableModel model = load_model(default_model_path());
    return model;
}

/// Faces drawn from the priors, yaw within 45 degrees (`yaw_deg` fixed: just that), 1.5 px of noise.
const std::vector<LandmarkSet>& faces(int yaw_deg)
{
    static std::mutex mutex;
    const std::lock_guard lock(mutex);
    static std::map<int, std::vector<LandmarkSet>> sets;
    std::vector<LandmarkSet>& set = sets[yaw_deg];
    Random random(7);
    while (set.size() < 64) {
        Camera camera = test::random_camera(random, max_yaw_deg);
        if (yaw_deg >= 0) {
            camera.camera_from_model = rotation_from_angles({radians(yaw_deg), radians(random.uniform(-8, 8)), 0});
        }
        set.push_back(test::project_landmarks(
            face_model(), "ibug68", test::random_normal(random, face_model().shape.num_coefficients()),
            test::random_uniform(random, 6, -0.4, 0.8).cwiseMax(0.0), camera, 1.5, random));
    }
    return set;
}

FitOptions options_of(ContourMode mode, const std::string& expression_set, int iterations = 5)
{
    FitOptions options;
    options.contour = mode;
    options.expression_set = expression_set;
    options.iterations = iterations;
    return options;
}

const RealtimeFitter& fitter_of(const Kernels& kernels, const FitOptions& options, MeshStorage storage)
{
    static std::mutex mutex; // threads of one benchmark share a fitter
    const std::lock_guard lock(mutex);
    static std::map<std::string, std::unique_ptr<RealtimeFitter>> fitters;
    const std::string key = std::string(kernels.name) + options.expression_set +
                            std::to_string(static_cast<int>(options.contour)) + std::to_string(options.iterations) +
                            std::to_string(static_cast<int>(storage));
    std::unique_ptr<RealtimeFitter>& fitter = fitters[key];
    if (!fitter) {
        fitter = std::make_unique<RealtimeFitter>(face_model(), "ibug68", options, kernels, storage);
    }
    return *fitter;
}

void reference_fit(benchmark::State& state, FitOptions options, int yaw_deg)
{
    const RealtimeFitter& fitter = fitter_of(kernels::scalar_kernels(), options, MeshStorage::float32);
    const std::vector<LandmarkSet>& sets = faces(yaw_deg);
    std::size_t next = 0;
    for (auto _ : state) {
        const FitResult fit = fitter.reference().fit(sets[next++ % sets.size()], centre);
        benchmark::DoNotOptimize(shape_of(fitter.reference().model(), fit).data());
    }
}

enum class Mesh
{
    none,
    float32,
    int16,
};

void whole_fit(benchmark::State& state, const Kernels& kernels, FitOptions options, int yaw_deg, Mesh mesh)
{
    const RealtimeFitter& fitter =
        fitter_of(kernels, options, mesh == Mesh::int16 ? MeshStorage::int16 : MeshStorage::float32);
    RealtimeWorkspace workspace = fitter.make_workspace();
    const std::vector<LandmarkSet>& sets = faces(yaw_deg);
    FitResult result;
    std::size_t next = 0;
    for (auto _ : state) {
        fitter.fit(sets[next++ % sets.size()], centre, workspace, result);
        if (mesh != Mesh::none) {
            benchmark::DoNotOptimize(fitter.shape_of(result, workspace).data());
        }
    }
    state.SetItemsProcessed(state.iterations());
    state.counters["reference_solves"] = static_cast<double>(workspace.num_reference_solves());
    state.counters["reference_fits"] = static_cast<double>(workspace.num_reference_fits());
}

/// One face moving by little from frame to frame: 64 frames there, then from the start again.
std::vector<LandmarkSet> video()
{
    Random random(8);
    const Eigen::VectorXd alpha = test::random_normal(random, face_model().shape.num_coefficients());
    std::vector<LandmarkSet> frames;
    for (int f = 0; f < 64; ++f) {
        const double phase = f * 2 * 3.14159265 / 64;
        Camera camera;
        camera.camera_from_model = rotation_from_angles({0.08 * std::sin(phase), 0.05 * std::cos(phase), 0});
        camera.scale_px_per_mm = 1.2;
        camera.principal_point_px = centre;
        const Eigen::VectorXd psi = Eigen::VectorXd::Constant(6, 0.15 * (1 + std::sin(phase)));
        frames.push_back(test::project_landmarks(face_model(), "ibug68", alpha, psi, camera, 0.5, random));
    }
    return frames;
}

void warm_step(benchmark::State& state, const Kernels& kernels, std::string expression_set)
{
    const FitOptions options = options_of(ContourMode::front_facing, expression_set, 1);
    const RealtimeFitter& fitter = fitter_of(kernels, options, MeshStorage::float32);
    RealtimeWorkspace workspace = fitter.make_workspace();
    const std::vector<LandmarkSet> frames = video();
    FitResult result;
    fitter.fit(frames[0], centre, workspace, result);
    std::size_t next = 0;
    for (auto _ : state) {
        fitter.fit(frames[next++ % frames.size()], centre, workspace, result, &result);
    }
    state.SetLabel(to_string(result.status));
}

void frozen_step(benchmark::State& state, const Kernels& kernels, std::string expression_set, Mesh mesh)
{
    const FitOptions options = options_of(ContourMode::front_facing, expression_set, 1);
    const RealtimeFitter& fitter =
        fitter_of(kernels, options, mesh == Mesh::int16 ? MeshStorage::int16 : MeshStorage::float32);
    RealtimeWorkspace workspace = fitter.make_workspace();
    const std::vector<LandmarkSet> frames = video();
    FitResult result;
    fitter.fit(frames[0], centre, workspace, result);
    const FrozenIdentity frozen = fitter.freeze(result.shape_coefficients);
    std::size_t next = 0;
    for (auto _ : state) {
        fitter.fit_pose_and_expression(frames[next++ % frames.size()], centre, frozen, workspace, result, &result);
        if (mesh != Mesh::none) {
            benchmark::DoNotOptimize(fitter.shape_of(frozen, result, workspace).data());
        }
    }
}

void mesh_alone(benchmark::State& state, const Kernels& kernels, std::string expression_set, MeshStorage storage)
{
    const RealtimeFitter& fitter = fitter_of(kernels, options_of(ContourMode::fixed, expression_set), storage);
    RealtimeWorkspace workspace = fitter.make_workspace();
    FitResult result;
    fitter.fit(faces(-1)[0], centre, workspace, result);
    for (auto _ : state) {
        benchmark::DoNotOptimize(fitter.shape_of(result, workspace).data());
    }
    const double columns =
        static_cast<double>(result.shape_coefficients.size() + result.expression_coefficients.size());
    state.counters["bytes"] = benchmark::Counter(
        static_cast<double>(3 * face_model().num_vertices()) * columns * (storage == MeshStorage::int16 ? 2 : 4),
        benchmark::Counter::kIsIterationInvariantRate, benchmark::Counter::kIs1000);
}

/// One identity from images of one person with a camera and expression each; time per image and round.
void sweep(benchmark::State& state, const Kernels& kernels, std::string expression_set, int num_images)
{
    const FitOptions options = options_of(ContourMode::front_facing, expression_set);
    const RealtimeFitter& fitter = fitter_of(kernels, options, MeshStorage::float32);
    RealtimeWorkspace workspace = fitter.make_workspace();
    std::vector<LandmarkSet> images;
    const std::vector<LandmarkSet> frames = video();
    for (int f = 0; f < num_images; ++f) {
        images.push_back(frames[static_cast<std::size_t>(f) % frames.size()]);
    }
    MultiFrameResult result;
    for (auto _ : state) {
        fitter.fit_frames(images, centre, workspace, result);
    }
    state.SetLabel(to_string(result.status));
    state.counters["time_per_image_and_round"] =
        benchmark::Counter(static_cast<double>(num_images * options.iterations),
                           benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
    state.counters["reference_fits"] = static_cast<double>(workspace.num_reference_fits());
}

void reference_sweep(benchmark::State& state, const FitOptions& options, int num_images)
{
    const RealtimeFitter& fitter = fitter_of(kernels::scalar_kernels(), options, MeshStorage::float32);
    const std::vector<LandmarkSet> frames = video();
    for (auto _ : state) {
        benchmark::DoNotOptimize(
            fit_frames(fitter.reference(), std::span(frames).first(num_images), centre).shape_coefficients.data());
    }
}

/// Meshes of many fits at once, time per face.
void mesh_batch(benchmark::State& state, const Kernels& kernels, std::string expression_set, MeshStorage storage)
{
    const RealtimeFitter& fitter = fitter_of(kernels, options_of(ContourMode::fixed, expression_set), storage);
    RealtimeWorkspace workspace = fitter.make_workspace();
    std::vector<FitResult> fits(64);
    for (std::size_t f = 0; f < fits.size(); ++f) {
        fitter.fit(faces(-1)[f], centre, workspace, fits[f]);
    }
    Eigen::MatrixXf shapes;
    for (auto _ : state) {
        fitter.shapes_of(fits, workspace, shapes);
        benchmark::DoNotOptimize(shapes.data());
    }
    state.counters["time_per_face"] = benchmark::Counter(
        static_cast<double>(fits.size()), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

/// Fits and meshes of many faces in each of two threads.
void batch(benchmark::State& state, const Kernels& kernels, const FitOptions& options, MeshStorage storage)
{
    const RealtimeFitter& fitter = fitter_of(kernels, options, storage);
    RealtimeWorkspace workspace = fitter.make_workspace();
    const std::vector<LandmarkSet>& sets = faces(-1);
    std::vector<FitResult> fits(sets.size());
    Eigen::MatrixXf shapes;
    for (auto _ : state) {
        for (std::size_t f = 0; f < sets.size(); ++f) {
            fitter.fit(sets[f], centre, workspace, fits[f]);
        }
        fitter.shapes_of(fits, workspace, shapes);
        benchmark::DoNotOptimize(shapes.data());
    }
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(sets.size()));
}

/// The limit of the mesh: as many bytes read once, in order, with one multiply-add for each number.
void read_alone(benchmark::State& state, const Kernels& kernels)
{
    const int num_rows = static_cast<int>(3 * face_model().num_vertices()) * 66 / 64;
    const AlignedBuffer<float> rows(static_cast<std::size_t>(num_rows) * 64);
    const AlignedBuffer<float> factors(static_cast<std::size_t>(num_rows));
    AlignedBuffer<float> sums(64);
    for (auto _ : state) {
        kernels.add_rows(rows.data(), num_rows, 64, factors.data(), sums.data());
        benchmark::DoNotOptimize(sums.data());
    }
    state.counters["bytes"] = benchmark::Counter(4.0 * 64 * num_rows, benchmark::Counter::kIsIterationInvariantRate,
                                                 benchmark::Counter::kIs1000);
}

void add_gram(benchmark::State& state, const Kernels& kernels)
{
    const int num_rows = 32;
    AlignedBuffer<float> rows(num_rows * 64);
    std::fill_n(rows.data(), rows.size(), 1e-3f);
    AlignedBuffer<float> gram(64 * 64);
    for (auto _ : state) {
        kernels.add_gram(rows.data(), num_rows, 64, gram.data());
        benchmark::DoNotOptimize(gram.data());
    }
    state.counters["flop"] = benchmark::Counter(num_rows * 64 * 65, benchmark::Counter::kIsIterationInvariantRate,
                                                benchmark::Counter::kIs1000);
}

void combine_grams(benchmark::State& state, const Kernels& kernels)
{
    const AlignedBuffer<float> grams(6 * 64 * 64);
    AlignedBuffer<float> gram(64 * 64);
    const float scales[6] = {1, 2, 3, 4, 5, 6};
    for (auto _ : state) {
        kernels.combine_grams(grams.data(), 64, scales, gram.data());
        benchmark::DoNotOptimize(gram.data());
    }
}

void solve_positive(benchmark::State& state, const Kernels& kernels)
{
    AlignedBuffer<float> system(64 * 64);
    AlignedBuffer<float> x(64);
    for (auto _ : state) {
        std::fill_n(system.data(), system.size(), 0.25f); // a copy of 16 kB, as small as the solve is large
        for (int i = 0; i < 60; ++i) {
            system[static_cast<std::size_t>(65 * i)] = 8;
        }
        benchmark::DoNotOptimize(kernels.solve_positive(system.data(), 60, 64, x.data()));
    }
}

/// Share of fits that differ, and the largest vertex distance of the others [um].
void report_agreement(const Kernels& kernels, const char* name, const FitOptions& options, int yaw_deg)
{
    const RealtimeFitter& fitter = fitter_of(kernels, options, MeshStorage::float32);
    RealtimeWorkspace workspace = fitter.make_workspace();
    FitResult result;
    double largest_um = 0;
    int num_flipped = 0;
    for (const LandmarkSet& set : faces(yaw_deg)) {
        fitter.fit(set, centre, workspace, result);
        const FitResult reference = fitter.reference().fit(set, centre);
        const Eigen::VectorXf difference =
            shape_of(fitter.reference().model(), result) - shape_of(fitter.reference().model(), reference);
        const double um =
            1000.0 *
            Eigen::Map<const Eigen::Matrix3Xf>(difference.data(), 3, difference.size() / 3).colwise().norm().maxCoeff();
        if (um > 1) {
            ++num_flipped;
        } else {
            largest_um = std::max(largest_um, um);
        }
    }
    std::fprintf(stderr, "%s, %s: %d of %d fits differ by more than 1 um, the others by at most %.2f um\n",
                 kernels.name, name, num_flipped, static_cast<int>(faces(yaw_deg).size()), largest_um);
}

void report_all()
{
    for (const Kernels* kernels : kernels::supported_kernels()) {
        report_agreement(*kernels, "front-facing", options_of(ContourMode::front_facing, "ekman6"), -1);
        report_agreement(*kernels, "front-facing, arkit47", options_of(ContourMode::front_facing, "arkit47"), -1);
        report_agreement(*kernels, "both, yaw 30", options_of(ContourMode::both, "ekman6"), 30);
    }
}

void register_all()
{
    const FitOptions front = options_of(ContourMode::front_facing, "ekman6");
    const FitOptions front47 = options_of(ContourMode::front_facing, "arkit47");
    const FitOptions both = options_of(ContourMode::both, "ekman6");
    const auto add = [](const std::string& name, auto function) {
        benchmark::RegisterBenchmark(name.c_str(), function)->Unit(benchmark::kMicrosecond);
    };
    add("calibration", bench::calibration);
    add("reference/front", [=](benchmark::State& state) { reference_fit(state, front, -1); });
    add("reference/front_arkit47", [=](benchmark::State& state) { reference_fit(state, front47, -1); });
    add("reference/both_yaw30", [=](benchmark::State& state) { reference_fit(state, both, 30); });
    add("reference/sweep_10", [=](benchmark::State& state) { reference_sweep(state, front, 10); });
    for (const Kernels* k : kernels::supported_kernels()) {
        const Kernels& kernels = *k;
        const std::string set = std::string(kernels.name) + "/";
        const auto add_fit = [&](const std::string& name, const FitOptions& options, int yaw_deg, Mesh mesh) {
            add(set + name, [=, &kernels](benchmark::State& s) { whole_fit(s, kernels, options, yaw_deg, mesh); });
        };
        add_fit("front", front, -1, Mesh::none);
        benchmark::RegisterBenchmark(
            (set + "batch").c_str(),
            [=, &kernels](benchmark::State& s) { batch(s, kernels, front, MeshStorage::float32); })
            ->Threads(2)
            ->UseRealTime()
            ->Unit(benchmark::kMicrosecond);
        add_fit("front_mesh", front, -1, Mesh::float32);
        add_fit("front_mesh_int16", front, -1, Mesh::int16);
        add_fit("front_arkit47", front47, -1, Mesh::none);
        add_fit("front_arkit47_mesh", front47, -1, Mesh::float32);
        add_fit("front_arkit47_mesh_int16", front47, -1, Mesh::int16);
        add_fit("both_yaw30", both, 30, Mesh::none);
        add_fit("both_yaw30_mesh", both, 30, Mesh::float32);
        add_fit("both_yaw30_mesh_int16", both, 30, Mesh::int16);
        for (const char* name : {"ekman6", "arkit47"}) {
            const std::string expressions = name;
            add(set + "warm_step_" + name, [=, &kernels](benchmark::State& s) { warm_step(s, kernels, expressions); });
            add(set + "frozen_" + name,
                [=, &kernels](benchmark::State& s) { frozen_step(s, kernels, expressions, Mesh::none); });
            add(set + "frozen_mesh_" + name,
                [=, &kernels](benchmark::State& s) { frozen_step(s, kernels, expressions, Mesh::float32); });
            add(set + "mesh_" + name,
                [=, &kernels](benchmark::State& s) { mesh_alone(s, kernels, expressions, MeshStorage::float32); });
            add(set + "mesh_batch_" + name,
                [=, &kernels](benchmark::State& s) { mesh_batch(s, kernels, expressions, MeshStorage::float32); });
            add(set + "sweep_10_" + name, [=, &kernels](benchmark::State& s) { sweep(s, kernels, expressions, 10); });
            add(set + "sweep_100_" + name, [=, &kernels](benchmark::State& s) { sweep(s, kernels, expressions, 100); });
            add(set + "mesh_int16_" + name,
                [=, &kernels](benchmark::State& s) { mesh_alone(s, kernels, expressions, MeshStorage::int16); });
        }
        add(set + "read", [&kernels](benchmark::State& s) { read_alone(s, kernels); });
        add(set + "add_gram_32x64", [&kernels](benchmark::State& s) { add_gram(s, kernels); });
        add(set + "combine_grams_64", [&kernels](benchmark::State& s) { combine_grams(s, kernels); });
        add(set + "solve_positive_60", [&kernels](benchmark::State& s) { solve_positive(s, kernels); });
    }
}

} // namespace

int main(int argc, char** argv)
{
    benchmark::Initialize(&argc, argv);
    if (argc > 1 && std::string(argv[1]) == "agreement") {
        report_all();
        return 0;
    }
    register_all();
    benchmark::RunSpecifiedBenchmarks();
    return 0;
}
