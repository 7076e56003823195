// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// RealtimeFitter: whole fits, tracking steps and meshes, the same of JointFitter (joint_parts.cpp) and single kernels
// (kernel_parts.cpp), for each instruction set of this machine, beside a calibration kernel (multiply-adds over 4 MB).
// With "agreement" it checks instead that both paths agree. Of a part SET/NAME there may be
//   reference/NAME  the same by the double precision path,
//   SET/limit/NAME  the time that the machine needs at least, measured: as many bytes read once and in order, with one
//                   multiply-add for each number, or as many multiply-adds in registers; its label says which.
// Run with --benchmark_repetitions=15 --benchmark_enable_random_interleaving=true --benchmark_out=FILE;
// realtime_table.py makes a table of the file.
#include "calibration.hpp"
#include "joint_parts.hpp"
#include "kernel_parts.hpp"
#include "timed_faces.hpp"

#include "lineament/kernels/dispatched_kernels.hpp"

#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

namespace {

using namespace lineament;
using namespace lineament::bench;
using kernels::Kernels;

const FaceFitter& reference_of(const FitOptions& options)
{
    return fitter_of(kernels::scalar_kernels(), options).reference();
}

void reference_fit(benchmark::State& state, const FitOptions& options, int yaw_deg, MeshKind mesh)
{
    const FaceFitter& fitter = reference_of(options);
    const std::vector<LandmarkSet>& sets = faces(yaw_deg);
    std::size_t next = 0;
    for (auto _ : state) {
        const FitResult fit = fitter.fit(sets[next++ % sets.size()], centre);
        benchmark::DoNotOptimize(fit.rms_px);
        if (mesh != MeshKind::none) {
            benchmark::DoNotOptimize(shape_of(fitter.model(), fit).data());
        }
    }
}

void whole_fit(benchmark::State& state, const Kernels& kernels, FitOptions options, int yaw_deg, MeshKind mesh)
{
    const RealtimeFitter& fitter = fitter_of(kernels, options, mesh);
    RealtimeWorkspace workspace = fitter.make_workspace();
    const std::vector<LandmarkSet>& sets = faces(yaw_deg);
    FitResult result;
    std::size_t next = 0;
    for (auto _ : state) {
        fitter.fit(sets[next++ % sets.size()], centre, workspace, result);
        if (mesh != MeshKind::none) {
            benchmark::DoNotOptimize(fitter.shape_of(result, workspace).data());
        }
    }
    state.SetItemsProcessed(state.iterations());
    state.counters["reference_solves"] = static_cast<double>(workspace.num_reference_solves());
    state.counters["reference_fits"] = static_cast<double>(workspace.num_reference_fits());
}

void warm_step(benchmark::State& state, const Kernels& kernels, std::string expression_set)
{
    const FitOptions options = options_of(ContourMode::front_facing, expression_set, 1);
    const RealtimeFitter& fitter = fitter_of(kernels, options);
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

void reference_warm_step(benchmark::State& state, std::string expression_set)
{
    const FaceFitter& fitter = reference_of(options_of(ContourMode::front_facing, expression_set, 1));
    const std::vector<LandmarkSet> frames = video();
    FitResult result = fitter.fit(frames[0], centre);
    std::size_t next = 0;
    for (auto _ : state) {
        result = fitter.fit(frames[next++ % frames.size()], centre, &result);
    }
    state.SetLabel(to_string(result.status));
}

void frozen_step(benchmark::State& state, const Kernels& kernels, std::string expression_set, MeshKind mesh)
{
    const FitOptions options = options_of(ContourMode::front_facing, expression_set, 1);
    const RealtimeFitter& fitter = fitter_of(kernels, options, mesh);
    RealtimeWorkspace workspace = fitter.make_workspace();
    const std::vector<LandmarkSet> frames = video();
    FitResult result;
    fitter.fit(frames[0], centre, workspace, result);
    const FrozenIdentity frozen = fitter.freeze(result.shape_coefficients);
    std::size_t next = 0;
    for (auto _ : state) {
        fitter.fit_pose_and_expression(frames[next++ % frames.size()], centre, frozen, workspace, result, &result);
        if (mesh != MeshKind::none) {
            benchmark::DoNotOptimize(fitter.shape_of(frozen, result, workspace).data());
        }
    }
}

/// The reference keeps nothing of a known identity: its mesh is made anew.
void reference_frozen_step(benchmark::State& state, std::string expression_set, MeshKind mesh)
{
    const FaceFitter& fitter = reference_of(options_of(ContourMode::front_facing, expression_set, 1));
    const std::vector<LandmarkSet> frames = video();
    FitResult result = fitter.fit(frames[0], centre);
    const Eigen::VectorXd identity = result.shape_coefficients;
    std::size_t next = 0;
    for (auto _ : state) {
        result = fitter.fit_pose_and_expression(frames[next++ % frames.size()], centre, identity, &result);
        if (mesh != MeshKind::none) {
            benchmark::DoNotOptimize(shape_of(fitter.model(), result).data());
        }
    }
}

/// Numbers of the columns of a mesh.
std::int64_t mesh_numbers(const std::string& expression_set)
{
    const Eigen::Index columns =
        face_model().find_expression_set(expression_set)->num_coefficients() + face_model().shape.num_coefficients();
    return 3 * static_cast<std::int64_t>(face_model().num_vertices()) * columns;
}

void mesh_alone(benchmark::State& state, const Kernels& kernels, std::string expression_set, MeshKind mesh)
{
    const RealtimeFitter& fitter = fitter_of(kernels, options_of(ContourMode::fixed, expression_set), mesh);
    RealtimeWorkspace workspace = fitter.make_workspace();
    FitResult result;
    fitter.fit(faces(-1)[0], centre, workspace, result);
    for (auto _ : state) {
        benchmark::DoNotOptimize(fitter.shape_of(result, workspace).data());
    }
}

/// The mesh of a known identity: neutral face and expression.
void frozen_mesh_alone(benchmark::State& state, const Kernels& kernels, std::string expression_set)
{
    const RealtimeFitter& fitter = fitter_of(kernels, options_of(ContourMode::fixed, expression_set));
    RealtimeWorkspace workspace = fitter.make_workspace();
    FitResult result;
    fitter.fit(faces(-1)[0], centre, workspace, result);
    const FrozenIdentity frozen = fitter.freeze(result.shape_coefficients);
    for (auto _ : state) {
        benchmark::DoNotOptimize(fitter.shape_of(frozen, result, workspace).data());
    }
}

void reference_meshes(benchmark::State& state, std::string expression_set, int num_faces)
{
    const FaceFitter& fitter = reference_of(options_of(ContourMode::fixed, expression_set));
    std::vector<FitResult> fits;
    for (int f = 0; f < num_faces; ++f) {
        fits.push_back(fitter.fit(faces(-1)[static_cast<std::size_t>(f)], centre));
    }
    for (auto _ : state) {
        for (const FitResult& fit : fits) {
            benchmark::DoNotOptimize(shape_of(fitter.model(), fit).data());
        }
    }
}

/// One identity from images of one person with a camera and expression each; time per image and round.
void sweep(benchmark::State& state, const Kernels& kernels, std::string expression_set, int num_images)
{
    const FitOptions options = options_of(ContourMode::front_facing, expression_set);
    const RealtimeFitter& fitter = fitter_of(kernels, options);
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

void reference_sweep(benchmark::State& state, std::string expression_set, int num_images)
{
    const FaceFitter& fitter = reference_of(options_of(ContourMode::front_facing, expression_set));
    const std::vector<LandmarkSet> frames = video();
    for (auto _ : state) {
        benchmark::DoNotOptimize(
            fit_frames(fitter, std::span(frames).first(num_images), centre).shape_coefficients.data());
    }
}

constexpr int batch_size = 64;

/// Meshes of many fits at once.
void mesh_batch(benchmark::State& state, const Kernels& kernels, std::string expression_set)
{
    const RealtimeFitter& fitter = fitter_of(kernels, options_of(ContourMode::fixed, expression_set));
    RealtimeWorkspace workspace = fitter.make_workspace();
    std::vector<FitResult> fits(batch_size);
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
void batch(benchmark::State& state, const Kernels& kernels, const FitOptions& options)
{
    const RealtimeFitter& fitter = fitter_of(kernels, options);
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

/// Share of fits that differ, and the largest vertex distance of the others [um].
void report_agreement(const Kernels& kernels, const char* name, const FitOptions& options, int yaw_deg)
{
    const RealtimeFitter& fitter = fitter_of(kernels, options);
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

void register_reference()
{
    const auto add_fit = [](const std::string& name, ContourMode mode, const char* expressions, int yaw_deg) {
        const FitOptions options = options_of(mode, expressions);
        for (const MeshKind mesh : {MeshKind::none, MeshKind::as_stored}) {
            add("reference/" + name + suffix_of(mesh),
                [=](benchmark::State& s) { reference_fit(s, options, yaw_deg, mesh); });
        }
    };
    add_fit("front", ContourMode::front_facing, "ekman6", -1);
    add_fit("front_arkit47", ContourMode::front_facing, "arkit47", -1);
    add_fit("both_yaw30", ContourMode::both, "ekman6", 30);
    for (const char* name : {"ekman6", "arkit47"}) {
        const std::string set = name;
        add("reference/warm_step_" + set, [=](benchmark::State& s) { reference_warm_step(s, set); });
        add("reference/frozen_" + set, [=](benchmark::State& s) { reference_frozen_step(s, set, MeshKind::none); });
        add("reference/frozen_mesh_" + set,
            [=](benchmark::State& s) { reference_frozen_step(s, set, MeshKind::as_stored); });
        add("reference/mesh_" + set, [=](benchmark::State& s) { reference_meshes(s, set, 1); });
        add("reference/mesh_batch_" + set, [=](benchmark::State& s) { reference_meshes(s, set, batch_size); });
        add("reference/sweep_10_" + set, [=](benchmark::State& s) { reference_sweep(s, set, 10); });
    }
    bench::register_reference_joint_parts();
    bench::register_reference_kernels();
}

void register_limits(const Kernels& kernels)
{
    const std::string prefix = std::string(kernels.name) + "/limit/";
    for (const std::string name : {"ekman6", "arkit47"}) {
        const FitOptions options = options_of(ContourMode::fixed, name);
        const auto bytes_of = [&](MeshKind mesh, bool is_frozen) {
            const RealtimeFitter& fitter = fitter_of(kernels, options, mesh);
            const MeshBytes columns = fitter.mesh_bytes();
            const std::size_t start = 3 * sizeof(float) * static_cast<std::size_t>(face_model().num_vertices());
            return static_cast<std::int64_t>(start + columns.expression + (is_frozen ? 0 : columns.identity));
        };
        bench::add_read_limit(prefix + "mesh_" + name, kernels, bytes_of(MeshKind::as_stored, false));
        bench::add_read_limit(prefix + "mesh_single_" + name, kernels, bytes_of(MeshKind::single, false));
        bench::add_read_limit(prefix + "mesh_of_frozen_" + name, kernels, bytes_of(MeshKind::as_stored, true));
        bench::add_arithmetic_limit(prefix + "mesh_batch_" + name, kernels, 2 * batch_size * mesh_numbers(name));
    }
}

void register_parts(const Kernels& kernels)
{
    const std::string prefix = std::string(kernels.name) + "/";
    const auto add_fit = [&](const std::string& name, ContourMode mode, const char* expressions, int yaw_deg) {
        const FitOptions options = options_of(mode, expressions);
        for (const MeshKind mesh : {MeshKind::none, MeshKind::as_stored, MeshKind::single}) {
            add(prefix + name + suffix_of(mesh),
                [=, &kernels](benchmark::State& s) { whole_fit(s, kernels, options, yaw_deg, mesh); });
        }
    };
    add_fit("front", ContourMode::front_facing, "ekman6", -1);
    add_fit("front_arkit47", ContourMode::front_facing, "arkit47", -1);
    add_fit("both_yaw30", ContourMode::both, "ekman6", 30);
    add(prefix + "batch",
        [&](benchmark::State& s) { batch(s, kernels, options_of(ContourMode::front_facing, "ekman6")); })
        ->Threads(2)
        ->UseRealTime();
    for (const char* name : {"ekman6", "arkit47"}) {
        const std::string set = name;
        const auto add_part = [&](const std::string& part, auto function) {
            add(prefix + part + "_" + set, [=, &kernels](benchmark::State& s) { function(s, kernels, set); });
        };
        add_part("warm_step", warm_step);
        add_part("frozen", [](auto& s, const Kernels& k, const auto& e) { frozen_step(s, k, e, MeshKind::none); });
        add_part("frozen_mesh",
                 [](auto& s, const Kernels& k, const auto& e) { frozen_step(s, k, e, MeshKind::as_stored); });
        add_part("mesh", [](auto& s, const Kernels& k, const auto& e) { mesh_alone(s, k, e, MeshKind::as_stored); });
        add_part("mesh_single",
                 [](auto& s, const Kernels& k, const auto& e) { mesh_alone(s, k, e, MeshKind::single); });
        add_part("mesh_of_frozen", frozen_mesh_alone);
        add_part("mesh_batch", mesh_batch);
        add_part("sweep_10", [](auto& s, const Kernels& k, const auto& e) { sweep(s, k, e, 10); });
        add_part("sweep_100", [](auto& s, const Kernels& k, const auto& e) { sweep(s, k, e, 100); });
    }
}

void register_all()
{
    add("calibration", calibration);
    register_reference();
    for (const Kernels* kernels : kernels::supported_kernels()) {
        register_parts(*kernels);
        register_limits(*kernels);
        register_joint_parts(*kernels);
        register_kernels(*kernels);
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
