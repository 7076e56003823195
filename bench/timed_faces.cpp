// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "timed_faces.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/io/model_file.hpp"
#include "support/synthetic_face.hpp"

#include <cmath>
#include <map>
#include <memory>
#include <mutex>

namespace lineament::bench {

const MorphableModel& face_model()
{
    static const MorphableModel model = load_model(default_model_path());
    return model;
}

namespace {

constexpr double max_yaw_deg = 45;

/// The same with columns that no 16 bits hold, as a model has that was never rounded to them.
const MorphableModel& unrounded_model()
{
    static const MorphableModel model = [] {
        MorphableModel unrounded = face_model();
        Random random(9);
        const auto move = [&](Eigen::MatrixXf& columns) {
            for (float& entry : columns.reshaped()) {
                entry *= static_cast<float>(1 + 1e-5 * random.normal());
            }
        };
        move(unrounded.shape.basis);
        for (Blendshapes& set : unrounded.expression_sets) {
            move(set.offsets);
        }
        return unrounded;
    }();
    return model;
}

} // namespace

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

FitOptions options_of(ContourMode mode, const std::string& expression_set, int iterations)
{
    FitOptions options;
    options.contour = mode;
    options.expression_set = expression_set;
    options.iterations = iterations;
    return options;
}

const RealtimeFitter& fitter_of(const kernels::Kernels& kernels, const FitOptions& options, MeshKind mesh)
{
    static std::mutex mutex; // threads of one benchmark share a fitter
    const std::lock_guard lock(mutex);
    static std::map<std::string, std::unique_ptr<RealtimeFitter>> fitters;
    const std::string key = std::string(kernels.name) + options.expression_set +
                            std::to_string(static_cast<int>(options.contour)) + std::to_string(options.iterations) +
                            (mesh == MeshKind::single ? "single" : "");
    std::unique_ptr<RealtimeFitter>& fitter = fitters[key];
    if (!fitter) {
        fitter = std::make_unique<RealtimeFitter>(mesh == MeshKind::single ? unrounded_model() : face_model(), "ibug68",
                                                  options, kernels);
    }
    return *fitter;
}

const char* suffix_of(MeshKind mesh)
{
    return mesh == MeshKind::none ? "" : mesh == MeshKind::as_stored ? "_mesh" : "_mesh_single";
}

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

} // namespace lineament::bench
