// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "joint_parts.hpp"

#include "kernel_parts.hpp"
#include "timed_faces.hpp"

#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/joint_image.hpp"
#include "lineament/fit/joint_solver.hpp"
#include "lineament/kernels/scalar_kernels.hpp"

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

/// The mesh of a fit: by a RealtimeFitter's columns, as that of the real-time fits, or where there are no kernels by
/// the model's.
class Meshes
{
public:
    Meshes(const Kernels* kernels, const FitOptions& options)
        : fitter_(fitter_of(kernels != nullptr ? *kernels : kernels::scalar_kernels(), options)),
          workspace_(fitter_.make_workspace()), is_by_kernels_(kernels != nullptr)
    {}

    void make(const FitResult& fit)
    {
        if (is_by_kernels_) {
            benchmark::DoNotOptimize(fitter_.shape_of(fit, workspace_).data());
        } else {
            benchmark::DoNotOptimize(shape_of(face_model(), fit).data());
        }
    }

    void make(const FrozenIdentity& identity, const FitResult& fit)
    {
        if (is_by_kernels_) {
            benchmark::DoNotOptimize(fitter_.shape_of(identity, fit, workspace_).data());
        } else {
            make(fit);
        }
    }

    [[nodiscard]] FrozenIdentity freeze(const Eigen::VectorXd& alpha) const { return fitter_.freeze(alpha); }

private:
    const RealtimeFitter& fitter_;
    RealtimeWorkspace workspace_;
    bool is_by_kernels_;
};

void joint_fit(benchmark::State& state, const Kernels* kernels, ContourMode mode, const std::string& expression_set,
               int yaw_deg, MeshKind mesh)
{
    const JointFitter fitter(face_model(), "ibug68", joint_options(mode, expression_set), kernels);
    Meshes meshes(kernels, options_of(mode, expression_set));
    const std::vector<LandmarkSet>& sets = faces(yaw_deg);
    JointWorkspace workspace = fitter.make_workspace();
    JointFitResult result;
    std::size_t next = 0;
    for (auto _ : state) {
        fitter.fit(sets[next++ % sets.size()], centre, workspace, result);
        benchmark::DoNotOptimize(result.fit.rms_px);
        if (mesh != MeshKind::none) {
            meshes.make(result.fit);
        }
    }
}

/// One step, which says nothing of how sure it is.
JointOptions options_of_step(const std::string& expression_set)
{
    JointOptions options = joint_options(ContourMode::front_facing, expression_set, false);
    options.rounds = 1;
    options.max_iterations = 1;
    return options;
}

/// From the last result: a whole fit, or one step.
void joint_warm_fit(benchmark::State& state, const Kernels* kernels, const JointOptions& options)
{
    const JointFitter fitter(face_model(), "ibug68", options, kernels);
    const std::vector<LandmarkSet> frames = video();
    JointWorkspace workspace = fitter.make_workspace();
    JointFitResult result = fitter.fit(frames[0], centre);
    std::size_t next = 0;
    for (auto _ : state) {
        fitter.fit(frames[next++ % frames.size()], centre, workspace, result, &result.fit);
    }
    state.SetLabel(to_string(result.fit.status));
}

/// One step of a known identity, with its mesh.
void joint_frozen_step(benchmark::State& state, const Kernels* kernels, const std::string& expression_set)
{
    const JointFitter fitter(face_model(), "ibug68", options_of_step(expression_set), kernels);
    Meshes meshes(kernels, options_of(ContourMode::front_facing, expression_set));
    const std::vector<LandmarkSet> frames = video();
    JointFitResult result = fitter.fit(frames[0], centre);
    const KnownIdentity identity = fitter.freeze(result.fit.shape_coefficients);
    const FrozenIdentity frozen = meshes.freeze(identity.shape_coefficients());
    JointWorkspace workspace = fitter.make_workspace();
    std::size_t next = 0;
    for (auto _ : state) {
        fitter.fit_pose_and_expression(frames[next++ % frames.size()], centre, identity, workspace, result,
                                       &result.fit);
        meshes.make(frozen, result.fit);
    }
}

/// One identity of several images, all at once.
void joint_frames(benchmark::State& state, const Kernels* kernels, const std::string& expression_set, int num_images)
{
    const JointFitter fitter(face_model(), "ibug68", joint_options(ContourMode::front_facing, expression_set), kernels);
    const std::vector<LandmarkSet> frames = video();
    JointWorkspace workspace = fitter.make_workspace();
    JointFramesResult result;
    for (auto _ : state) {
        fitter.fit_frames(std::span(frames).first(num_images), centre, workspace, result);
        benchmark::DoNotOptimize(result.chi_square);
        state.counters["steps"] = result.frames[0].fit.iterations;
    }
}

/// Steps of all of several images, as a round takes them, each time from a little beside where their fit has ended: one
/// with a new matrix, or two with that of a step before.
void joint_frames_step(benchmark::State& state, const Kernels* kernels, const std::string& expression_set,
                       int num_images, bool keeps_matrix)
{
    const JointOptions options = joint_options(ContourMode::front_facing, expression_set, false);
    const std::vector<LandmarkSet> frames = video();
    const JointFramesResult at =
        JointFitter(face_model(), "ibug68", options, kernels).fit_frames(std::span(frames).first(num_images), centre);
    const FaceFitter& base =
        fitter_of(kernels::scalar_kernels(), options_of(ContourMode::front_facing, expression_set)).reference();
    const detail::JointPoints points = detail::joint_points(base);
    const detail::IdentityPrior prior(base.num_shape_coefficients());
    detail::JointProblem problem(options, prior, at.frames[0].fit.expression_coefficients.size());
    problem.kernels = kernels;
    detail::JointState joint;
    joint.alpha = at.shape_coefficients;
    joint.bias = at.landmark_bias_mm;
    problem.bias_variances_mm.resize(3, joint.bias.cols());
    for (int b = 0; b < static_cast<int>(joint.bias.cols()); ++b) {
        problem.bias_variances_mm.col(b) = detail::bias_variances_mm(options, base.landmark_noise_mm(), b);
    }
    for (int f = 0; f < num_images; ++f) {
        const JointFitResult& frame = at.frames[static_cast<std::size_t>(f)];
        detail::JointImageMatcher matcher;
        matcher.begin({base, points, options, kernels}, frames[static_cast<std::size_t>(f)], {});
        detail::JointImage& image = problem.images.emplace_back();
        matcher.set_fixed_points(image);
        matcher.match(frame.minimum_camera, joint.alpha, frame.minimum_expression,
                      {frame.matched_scale_px_per_mm, num_images, 0, true}, image);
        image.scale_strength = frame.scale_strength;
        joint.cameras.push_back(frame.minimum_camera);
        joint.psi.push_back(frame.minimum_expression);
    }
    detail::JointScratch scratch(kernels);
    detail::JointProgress progress;
    const int num_steps = keeps_matrix ? 2 : 1;
    const detail::RoundLimits limits{num_steps, 0.0, false};
    detail::minimize(problem, joint, {options.max_iterations, options.tolerance, false}, 0, scratch, progress);
    joint.alpha.array() += 0.02;
    const detail::JointState start = joint;
    for (auto _ : state) {
        joint = start;
        scratch.keeps_matrix = keeps_matrix;
        progress.energies.clear();
        progress.iterations = 0;
        detail::minimize(problem, joint, limits, 0, scratch, progress);
        if (progress.iterations != num_steps) {
            state.SkipWithError("it took another number of steps");
        }
        benchmark::DoNotOptimize(joint.alpha.data());
    }
    state.counters["us_of_an_image_and_step"] = benchmark::Counter(
        1e-6 * num_images * num_steps, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
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

/// @param kernels  nullptr: the double precision path.
void register_fits(const std::string& prefix, const Kernels* kernels)
{
    const auto add_fit = [&](const std::string& name, ContourMode mode, const char* expressions, int yaw_deg) {
        for (const MeshKind mesh : {MeshKind::none, MeshKind::as_stored}) {
            add(prefix + "joint_" + name + suffix_of(mesh),
                [=](benchmark::State& s) { joint_fit(s, kernels, mode, expressions, yaw_deg, mesh); });
        }
    };
    add_fit("front", ContourMode::front_facing, "ekman6", -1);
    add_fit("front_arkit47", ContourMode::front_facing, "arkit47", -1);
    add_fit("both_yaw30", ContourMode::both, "ekman6", 30);
    for (const char* name : {"ekman6", "arkit47"}) {
        const std::string set = name;
        const auto add_part = [&](const std::string& part, auto function) {
            add(prefix + part + "_" + set, [=](benchmark::State& s) { function(s, kernels, set); });
        };
        add_part("joint_warm", [](auto& s, const Kernels* k, const auto& e) {
            joint_warm_fit(s, k, joint_options(ContourMode::front_facing, e));
        });
        add_part("joint_step",
                 [](auto& s, const Kernels* k, const auto& e) { joint_warm_fit(s, k, options_of_step(e)); });
        add_part("joint_frozen", joint_frozen_step);
        for (const int count : {10, 64}) {
            if (kernels == nullptr && count > 10 && set != "ekman6") {
                continue; // seconds each
            }
            const std::string frames = "joint_frames_" + std::to_string(count);
            add_part(frames, [=](auto& s, const Kernels* k, const auto& e) { joint_frames(s, k, e, count); });
            add_part(frames + "_step",
                     [=](auto& s, const Kernels* k, const auto& e) { joint_frames_step(s, k, e, count, false); });
            add_part(frames + "_kept_steps",
                     [=](auto& s, const Kernels* k, const auto& e) { joint_frames_step(s, k, e, count, true); });
        }
    }
}

} // namespace

void register_joint_parts(const Kernels& kernels)
{
    const std::string prefix = std::string(kernels.name) + "/";
    register_fits(prefix, &kernels);
    for (const bool with_covariance : {true, false}) {
        add(prefix + (with_covariance ? "joint_batch" : "joint_batch_without_covariance"),
            [=, &kernels](benchmark::State& s) { joint_batch(s, kernels, with_covariance); })
            ->Threads(2)
            ->UseRealTime();
    }
}

void register_reference_joint_parts()
{
    register_fits("reference/", nullptr);
}

} // namespace lineament::bench
