// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "joint_parts.hpp"

#include "kernel_parts.hpp"
#include "timed_faces.hpp"

#include "lineament/fit/joint_fitter.hpp"

#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <utility>

namespace lineament::bench {

namespace {

using kernels::Kernels;

JointOptions joint_options(ContourMode mode, const std::string& expression_set, bool with_covariance = true)
{
    JointOptions options;
    options.contour = mode;
    options.expression_set = expression_set;
    options.with_covariance = with_covariance;
    return options;
}

/// The mesh by a RealtimeFitter's columns, as that of the real-time fits.
void joint_fit(benchmark::State& state, const Kernels& kernels, ContourMode mode, const std::string& expression_set,
               int yaw_deg, MeshKind mesh)
{
    const JointFitter fitter(face_model(), "ibug68", joint_options(mode, expression_set), &kernels);
    const RealtimeFitter& meshes = fitter_of(kernels, options_of(mode, expression_set));
    RealtimeWorkspace workspace = meshes.make_workspace();
    const std::vector<LandmarkSet>& sets = faces(yaw_deg);
    JointWorkspace joint = fitter.make_workspace();
    JointFitResult result;
    std::size_t next = 0;
    for (auto _ : state) {
        fitter.fit(sets[next++ % sets.size()], centre, joint, result);
        benchmark::DoNotOptimize(result.fit.rms_px);
        if (mesh != MeshKind::none) {
            benchmark::DoNotOptimize(meshes.shape_of(result.fit, workspace).data());
        }
    }
}

/// From the last result: a whole fit, or one step, which says nothing of how sure it is.
void joint_warm_fit(benchmark::State& state, const Kernels& kernels, std::string expression_set, bool is_whole)
{
    JointOptions options = joint_options(ContourMode::front_facing, expression_set, is_whole);
    if (!is_whole) {
        options.rounds = 1;
        options.max_iterations = 1;
    }
    const JointFitter fitter(face_model(), "ibug68", options, &kernels);
    const std::vector<LandmarkSet> frames = video();
    JointWorkspace workspace = fitter.make_workspace();
    JointFitResult result = fitter.fit(frames[0], centre);
    std::size_t next = 0;
    for (auto _ : state) {
        fitter.fit(frames[next++ % frames.size()], centre, workspace, result, &result.fit);
    }
    state.SetLabel(to_string(result.fit.status));
}

/// The same of a known identity, with its mesh.
void joint_frozen_step(benchmark::State& state, const Kernels& kernels, std::string expression_set)
{
    JointOptions options = joint_options(ContourMode::front_facing, expression_set, false);
    options.rounds = 1;
    options.max_iterations = 1;
    const JointFitter fitter(face_model(), "ibug68", options, &kernels);
    const RealtimeFitter& meshes = fitter_of(kernels, options_of(ContourMode::front_facing, expression_set));
    RealtimeWorkspace workspace = meshes.make_workspace();
    const std::vector<LandmarkSet> frames = video();
    JointFitResult result = fitter.fit(frames[0], centre);
    const KnownIdentity identity = fitter.freeze(result.fit.shape_coefficients);
    const FrozenIdentity frozen = meshes.freeze(identity.shape_coefficients());
    JointWorkspace joint = fitter.make_workspace();
    std::size_t next = 0;
    for (auto _ : state) {
        fitter.fit_pose_and_expression(frames[next++ % frames.size()], centre, identity, joint, result, &result.fit);
        benchmark::DoNotOptimize(meshes.shape_of(frozen, result.fit, workspace).data());
    }
}

/// One identity of several images, all at once.
void joint_frames(benchmark::State& state, const Kernels& kernels, std::string expression_set, int num_images)
{
    const JointFitter fitter(face_model(), "ibug68", joint_options(ContourMode::front_facing, expression_set),
                             &kernels);
    const std::vector<LandmarkSet> frames = video();
    JointWorkspace workspace = fitter.make_workspace();
    JointFramesResult result;
    for (auto _ : state) {
        fitter.fit_frames(std::span(frames).first(num_images), centre, workspace, result);
        benchmark::DoNotOptimize(result.chi_square);
        state.counters["steps"] = result.frames[0].fit.iterations;
    }
}

/// Of many faces, with their meshes.
void joint_batch(benchmark::State& state, const Kernels& kernels, bool with_covariance)
{
    static std::mutex mutex; // threads share a fitter
    static std::map<std::string, std::unique_ptr<JointFitter>> fitters;
    const JointFitter* fitter = nullptr;
    {
        const std::lock_guard lock(mutex);
        std::unique_ptr<JointFitter>& shared = fitters[kernels.name + std::to_string(with_covariance)];
        if (!shared) {
            shared = std::make_unique<JointFitter>(
                face_model(), "ibug68", joint_options(ContourMode::front_facing, "ekman6", with_covariance), &kernels);
        }
        fitter = shared.get();
    }
    const RealtimeFitter& meshes = fitter_of(kernels, options_of(ContourMode::front_facing, "ekman6"));
    RealtimeWorkspace workspace = meshes.make_workspace();
    const std::vector<LandmarkSet>& sets = faces(-1);
    JointWorkspace joint = fitter->make_workspace();
    JointFitResult result;
    std::vector<FitResult> fits(sets.size());
    Eigen::MatrixXf shapes;
    for (auto _ : state) {
        for (std::size_t f = 0; f < sets.size(); ++f) {
            fitter->fit(sets[f], centre, joint, result);
            std::swap(fits[f], result.fit);
        }
        meshes.shapes_of(fits, workspace, shapes);
        benchmark::DoNotOptimize(shapes.data());
    }
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(sets.size()));
}

} // namespace

void register_joint_parts(const Kernels& kernels)
{
    const std::string prefix = std::string(kernels.name) + "/";
    const auto add_fit = [&](const std::string& name, ContourMode mode, const char* expressions, int yaw_deg) {
        for (const MeshKind mesh : {MeshKind::none, MeshKind::as_stored}) {
            add(prefix + "joint_" + name + suffix_of(mesh),
                [=, &kernels](benchmark::State& s) { joint_fit(s, kernels, mode, expressions, yaw_deg, mesh); });
        }
    };
    add_fit("front", ContourMode::front_facing, "ekman6", -1);
    add_fit("front_arkit47", ContourMode::front_facing, "arkit47", -1);
    add_fit("both_yaw30", ContourMode::both, "ekman6", 30);
    for (const bool with_covariance : {true, false}) {
        add(prefix + (with_covariance ? "joint_batch" : "joint_batch_without_covariance"),
            [=, &kernels](benchmark::State& s) { joint_batch(s, kernels, with_covariance); })
            ->Threads(2)
            ->UseRealTime();
    }
    for (const char* name : {"ekman6", "arkit47"}) {
        const std::string set = name;
        const auto add_part = [&](const std::string& part, auto function) {
            add(prefix + part + "_" + set, [=, &kernels](benchmark::State& s) { function(s, kernels, set); });
        };
        add_part("joint_warm", [](auto& s, const Kernels& k, const auto& e) { joint_warm_fit(s, k, e, true); });
        add_part("joint_step", [](auto& s, const Kernels& k, const auto& e) { joint_warm_fit(s, k, e, false); });
        add_part("joint_frozen", joint_frozen_step);
        add_part("joint_frames_10", [](auto& s, const Kernels& k, const auto& e) { joint_frames(s, k, e, 10); });
        add_part("joint_frames_64", [](auto& s, const Kernels& k, const auto& e) { joint_frames(s, k, e, 64); });
    }
}

} // namespace lineament::bench
