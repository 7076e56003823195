// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Clips of rendered people who turn their heads and move their faces, seen through MediaPipe's networks: one joint
// identity, and each frame fitted with it by either method, from the last one's result, as `lineament track` does.
// Prints how far expressions and poses lie from those rendered, and how much they shake.       docs/joint-fit.md
//
//   rendered_frames [--model FILE] [--people N] [--frames N]
#include "options.hpp"
#include "planted.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/fit/frame_selection.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"
#include "lineament/render/shading.hpp"
#include "lineament/vision/mesh_detector.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

namespace {

using namespace lineament;

using bench::Mean;

constexpr int side_px = 480;
const Eigen::Vector2d middle(side_px / 2, side_px / 2);

/// How a face moves.
struct Motion
{
    std::string expression_set;
    bool one_at_a_time; ///< Six expressions to their full and back; otherwise all of the set as waves cut off below 0.
};

/// What was rendered, and what was seen of it.
struct Clip
{
    std::vector<Eigen::VectorXd> psi;
    std::vector<Eigen::Matrix3d> rotations;
    std::vector<LandmarkSet> landmarks;
};

std::vector<Eigen::VectorXd> draw_expressions(const Motion& motion, Eigen::Index count, int num_frames, Random& random)
{
    std::vector<Eigen::VectorXd> frames(static_cast<std::size_t>(num_frames), Eigen::VectorXd::Zero(count));
    if (motion.one_at_a_time) {
        constexpr int num_shown = 6;
        for (int i = 0; i < num_shown; ++i) {
            const Eigen::Index shown = random.index(static_cast<int>(count));
            for (int t = i * num_frames / num_shown; t < (i + 1) * num_frames / num_shown; ++t) {
                const double turn = 2 * std::numbers::pi * (t * num_shown - i * num_frames) / num_frames;
                frames[static_cast<std::size_t>(t)][shown] = 0.5 - 0.5 * std::cos(turn);
            }
        }
        return frames;
    }
    for (Eigen::Index k = 0; k < count; ++k) {
        const double slow = 0.3 * random.normal(), fast = 0.3 * random.normal();
        const double slow_phase = random.uniform(0, 6.28), fast_phase = random.uniform(0, 6.28);
        for (int t = 0; t < num_frames; ++t) {
            const double wave = slow * std::sin(0.11 * t + slow_phase) + fast * std::sin(0.27 * t + fast_phase);
            frames[static_cast<std::size_t>(t)][k] = std::clamp(wave, 0.0, 1.0);
        }
    }
    return frames;
}

/// @throws Error if the detector finds no face in a frame.
Clip make_clip(const MorphableModel& model, const Motion& motion, int num_frames, std::uint64_t seed,
               MeshDetector& detector)
{
    Random random(seed);
    const Blendshapes& expressions = *model.find_expression_set(motion.expression_set);
    const Eigen::VectorXd alpha = 0.7 * test::random_normal(random, model.shape.num_coefficients());
    const Eigen::VectorXf neutral = model.shape.instance(alpha);
    const Eigen::VectorXf color = model.color->instance(test::random_normal(random, model.color->num_coefficients()));
    const double yaw_phase = random.uniform(0, 6.28), pitch_phase = random.uniform(0, 6.28);
    Camera camera = frame_camera(model.mesh_of(neutral), {}, side_px, side_px, 0.15);
    ShadingOptions shading;
    shading.ambient_occlusion = 0.0;
    Clip clip;
    clip.psi = draw_expressions(motion, expressions.num_coefficients(), num_frames, random);
    for (int t = 0; t < num_frames; ++t) {
        camera.camera_from_model =
            rotation_from_angles({radians(25 * std::sin(0.05 * t + yaw_phase)),
                                  radians(8 * std::sin(0.08 * t + pitch_phase)), radians(6 * std::sin(0.06 * t))});
        Mesh mesh = model.mesh_of(neutral + expressions.displacement(clip.psi[static_cast<std::size_t>(t)]));
        mesh.colors =
            Eigen::Map<const Eigen::Matrix3Xf>(color.data(), 3, model.num_vertices()).cwiseMax(0.0f).cwiseMin(1.0f);
        const ImageU8 picture = render_mesh(mesh, camera, side_px, side_px, shading);
        std::optional<MeshFace> face;
        if (!clip.landmarks.empty()) {
            face = detector.follow(picture, clip.landmarks.back());
        }
        if (!face) {
            MeshDetectionOptions one;
            one.max_faces = 1;
            const std::vector<MeshFace> found = detector.detect(picture, one);
            require(!found.empty(), "make_clip", "picture", "a face that is found", "none");
            face = found.front();
        }
        clip.rotations.push_back(camera.camera_from_model);
        clip.landmarks.push_back(face->landmarks);
    }
    return clip;
}

/// Means over the frames of each clip.
struct FrameErrors
{
    Mean expression_mm, rotation_deg, shaking, time_us;
    double largest = 0;

    void add(const bench::PlantedFaces& faces, const Motion& motion, const Clip& clip,
             const std::vector<FitResult>& fits, double seconds)
    {
        double expression = 0, rotation = 0, second_differences = 0;
        for (std::size_t t = 0; t < fits.size(); ++t) {
            const Eigen::VectorXd& psi = fits[t].expression_coefficients;
            expression += faces.displacement_mm(psi - clip.psi[t], motion.expression_set);
            const Eigen::Matrix3d turn = fits[t].camera.camera_from_model * clip.rotations[t].transpose();
            rotation += degrees(Eigen::AngleAxisd(turn).angle());
            largest = std::max(largest, psi.maxCoeff());
            if (t >= 2) {
                second_differences +=
                    (psi - 2 * fits[t - 1].expression_coefficients + fits[t - 2].expression_coefficients)
                        .cwiseAbs()
                        .mean();
            }
        }
        const double count = static_cast<double>(fits.size());
        expression_mm.add(expression / count);
        rotation_deg.add(rotation / count);
        shaking.add(second_differences / (count - 2));
        time_us.add(1e6 * seconds / count);
    }
    void print(const Motion& motion, const char* method) const
    {
        std::printf("| %s, %s | %s | %.3f ± %.3f | %.2f ± %.2f | %.3f | %.2f | %.0f |\n", motion.expression_set.c_str(),
                    motion.one_at_a_time ? "one at a time" : "all at once", method, expression_mm.mean(),
                    expression_mm.error(), rotation_deg.mean(), rotation_deg.error(), shaking.mean(), largest,
                    time_us.mean());
        std::fflush(stdout);
    }
};

/// @param fit_frame  From landmarks and the last frame's result, or nullptr, to a result.
template <typename FitFrame>
void add_fits(FrameErrors& errors, const bench::PlantedFaces& faces, const Motion& motion, const Clip& clip,
              const FitFrame& fit_frame)
{
    const auto begin = std::chrono::steady_clock::now();
    std::vector<FitResult> fits;
    for (const LandmarkSet& landmarks : clip.landmarks) {
        fits.push_back(fit_frame(landmarks, fits.empty() ? nullptr : &fits.back()));
    }
    const std::chrono::duration<double> duration = std::chrono::steady_clock::now() - begin;
    errors.add(faces, motion, clip, fits, duration.count());
}

void compare(const bench::PlantedFaces& faces, const Motion& motion, int num_people, int num_frames)
{
    JointOptions joint_options;
    FitOptions thesis_options;
    joint_options.expression_set = thesis_options.expression_set = motion.expression_set;
    joint_options.with_covariance = false;
    const char* const scheme = "mediapipe478";
    const JointFitter joint(faces.model(), scheme, joint_options, &kernels::dispatched_kernels());
    const RealtimeFitter thesis(faces.model(), scheme, thesis_options, kernels::dispatched_kernels());
    RealtimeWorkspace workspace = thesis.make_workspace();
    JointWorkspace joint_workspace = joint.make_workspace();
    JointFitResult result;
    MeshDetector detector;
    FrameErrors of_thesis, of_joint;
    for (int person = 0; person < num_people; ++person) {
        const Clip clip =
            make_clip(faces.model(), motion, num_frames, 1000003ull * static_cast<std::uint64_t>(person + 1), detector);
        std::vector<FitResult> alone;
        for (const LandmarkSet& landmarks : clip.landmarks) {
            thesis.fit(landmarks, middle, workspace, alone.emplace_back());
        }
        std::vector<LandmarkSet> chosen;
        for (const int frame : select_spread_frames(alone)) {
            chosen.push_back(clip.landmarks[static_cast<std::size_t>(frame)]);
        }
        const JointFramesResult found = joint.fit_frames(chosen, middle);
        const KnownIdentity identity = joint.freeze(found.shape_coefficients);
        const FrozenIdentity frozen = thesis.freeze(found.shape_coefficients);
        add_fits(of_thesis, faces, motion, clip, [&](const LandmarkSet& landmarks, const FitResult* last) {
            FitResult fit;
            thesis.fit_pose_and_expression(landmarks, middle, frozen, workspace, fit, last);
            return fit;
        });
        add_fits(of_joint, faces, motion, clip, [&](const LandmarkSet& landmarks, const FitResult* last) {
            joint.fit_pose_and_expression(landmarks, middle, identity, joint_workspace, result, last);
            return result.fit;
        });
    }
    of_thesis.print(motion, "thesis");
    of_joint.print(motion, "joint");
}

} // namespace

int main(int argc, char** argv)
{
    const bench::Options given(argc, argv, "rendered_frames [--model FILE] [--people N] [--frames N]");
    const int num_people = given.count("--people", 10, 2);
    const int num_frames = given.count("--frames", 150, 6);
    try {
        const bench::PlantedFaces faces(load_model(given.text("--model", default_model_path())));
        std::printf("model %s, %d people, %d frames each\n\n"
                    "| expressions | method | expression, mm | rotation, degrees | second difference of psi | largest "
                    "psi | us a frame |\n| --- | --- | --- | --- | --- | --- | --- |\n",
                    faces.model().name.c_str(), num_people, num_frames);
        for (const std::string expression_set : {"ekman6", "arkit47"}) {
            for (const bool one_at_a_time : {true, false}) {
                compare(faces, {expression_set, one_at_a_time}, num_people, num_frames);
            }
        }
    } catch (const Error& error) {
        std::fprintf(stderr, "rendered_frames: error: %s\n", error.what());
        return 1;
    }
    return 0;
}
