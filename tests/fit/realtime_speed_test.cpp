// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The speed of the single precision fit and of the joint fit on kernels as a ratio to the benchmarks' calibration
// kernel, measured in turn in one process. Least processor times of many rounds, so that a busy machine does not
// matter; no absolute time is asserted.
#include "calibration_kernel.hpp"
#include "measures.hpp"

#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/face_model.hpp"
#include "support/sanitized.hpp"
#include "support/synthetic_face.hpp"

#include <functional>
#include <limits>

// Elsewhere the ratio says nothing of the program that is shipped.
#if defined(LINEAMENT_IS_SANITIZED)
#define SKIP_UNLESS_TIMES_MEAN_SOMETHING() GTEST_SKIP() << "built with a sanitizer"
#elif !defined(__OPTIMIZE__) || !defined(NDEBUG)
#define SKIP_UNLESS_TIMES_MEAN_SOMETHING() GTEST_SKIP() << "built without optimisation or with assertions"
#else
#define SKIP_UNLESS_TIMES_MEAN_SOMETHING() static_cast<void>(0)
#endif

namespace lineament {
namespace {

using test::face_model;

// About twice what AVX2 kernels and three times what AVX-512 kernels need. The plain ones need more, FaceFitter far
// more.
constexpr double max_fit_ratio = 1.4;
constexpr double max_step_ratio = 0.25;
constexpr double max_joint_fit_ratio = 3.0;
constexpr double max_joint_step_ratio = 0.8;

const Eigen::Vector2d centre(320, 240);
float sink = 0; ///< Takes every answer, so that none is left out.

RealtimeFitter make_fitter(int iterations, const kernels::Kernels& kernels = kernels::dispatched_kernels())
{
    FitOptions options;
    options.contour = ContourMode::front_facing;
    options.expression_set = "ekman6";
    options.iterations = iterations;
    return RealtimeFitter(face_model(), "ibug68", options, kernels);
}

LandmarkSet plant(const Eigen::VectorXd& alpha, double expression, const Camera& camera, Random& random)
{
    return test::project_landmarks(face_model(), "ibug68", alpha, Eigen::VectorXd::Constant(6, expression), camera, 1.5,
                                   random);
}

/// Other faces, yaw within 45 degrees.
std::vector<LandmarkSet> plant_faces(int count)
{
    Random random(7);
    std::vector<LandmarkSet> faces;
    while (static_cast<int>(faces.size()) < count) {
        faces.push_back(plant(test::random_normal(random, face_model().shape.num_coefficients()),
                              random.uniform(0.0, 0.4), test::random_camera(random, 45), random));
    }
    return faces;
}

/// One face that turns by little from frame to frame.
std::vector<LandmarkSet> plant_video(int num_frames)
{
    Random random(8);
    const Eigen::VectorXd alpha = test::random_normal(random, face_model().shape.num_coefficients());
    std::vector<LandmarkSet> frames;
    Camera camera;
    camera.scale_px_per_mm = 1.2;
    camera.principal_point_px = centre;
    for (int f = 0; f < num_frames; ++f) {
        camera.camera_from_model = rotation_from_angles({0, radians(10.0 * f / num_frames), 0});
        frames.push_back(plant(alpha, 0.2 * f / num_frames, camera, random));
    }
    return frames;
}

/// The least processor time of `run`, of one of its `num_runs` parts, over that of the calibration kernel. Each of the
/// rounds measures both, a millisecond each, so that what disturbs one would the other.
double ratio_to_calibration(int num_runs, const std::function<void()>& run)
{
    constexpr int num_rounds = 60;
    constexpr int num_calibrations = 8;
    bench::CalibrationKernel calibration;
    double calibration_ms = std::numeric_limits<double>::infinity();
    double run_ms = std::numeric_limits<double>::infinity();
    run();
    for (int round = 0; round < num_rounds; ++round) {
        const double begin_ms = bench::thread_ms();
        for (int i = 0; i < num_calibrations; ++i) {
            sink += calibration.run();
        }
        const double middle_ms = bench::thread_ms();
        run();
        calibration_ms = std::min(calibration_ms, (middle_ms - begin_ms) / num_calibrations);
        run_ms = std::min(run_ms, (bench::thread_ms() - middle_ms) / num_runs);
    }
    EXPECT_GT(calibration_ms, 0);
    EXPECT_TRUE(std::isfinite(sink));
    ::testing::Test::RecordProperty("ratio", std::to_string(run_ms / calibration_ms));
    return run_ms / calibration_ms;
}

double ratio_of_fit(const kernels::Kernels& kernels)
{
    const RealtimeFitter fitter = make_fitter(5, kernels);
    RealtimeWorkspace workspace = fitter.make_workspace();
    FitResult result;
    const std::vector<LandmarkSet> faces = plant_faces(12);
    const double ratio = ratio_to_calibration(static_cast<int>(faces.size()), [&] {
        for (const LandmarkSet& face : faces) {
            fitter.fit(face, centre, workspace, result);
            sink += fitter.shape_of(result, workspace)(0, 0);
        }
    });
    EXPECT_EQ(workspace.num_reference_fits(), 0);
    return ratio;
}

double ratio_of_warm_step(const kernels::Kernels& kernels)
{
    const RealtimeFitter fitter = make_fitter(1, kernels);
    RealtimeWorkspace workspace = fitter.make_workspace();
    FitResult result;
    const std::vector<LandmarkSet> frames = plant_video(64);
    fitter.fit(frames[0], centre, workspace, result);
    const double ratio = ratio_to_calibration(static_cast<int>(frames.size()), [&] {
        for (const LandmarkSet& frame : frames) {
            fitter.fit(frame, centre, workspace, result, &result);
        }
        sink += static_cast<float>(result.rms_px);
    });
    EXPECT_EQ(workspace.num_reference_fits(), 0);
    return ratio;
}

JointFitter make_joint_fitter(const kernels::Kernels* kernels, bool is_one_step)
{
    JointOptions options;
    options.contour = ContourMode::front_facing;
    options.expression_set = "ekman6";
    if (is_one_step) {
        options.rounds = 1;
        options.max_iterations = 1;
        options.with_covariance = false;
    }
    return JointFitter(face_model(), "ibug68", options, kernels);
}

/// With covariance.
double ratio_of_joint_fit(const kernels::Kernels* kernels)
{
    const JointFitter fitter = make_joint_fitter(kernels, false);
    JointWorkspace workspace = fitter.make_workspace();
    JointFitResult result;
    const std::vector<LandmarkSet> faces = plant_faces(12);
    return ratio_to_calibration(static_cast<int>(faces.size()), [&] {
        for (const LandmarkSet& face : faces) {
            fitter.fit(face, centre, workspace, result);
            sink += static_cast<float>(result.fit.rms_px);
        }
    });
}

double ratio_of_joint_step(const kernels::Kernels* kernels)
{
    const JointFitter fitter = make_joint_fitter(kernels, true);
    JointWorkspace workspace = fitter.make_workspace();
    const std::vector<LandmarkSet> frames = plant_video(64);
    JointFitResult result = fitter.fit(frames[0], centre);
    return ratio_to_calibration(static_cast<int>(frames.size()), [&] {
        for (const LandmarkSet& frame : frames) {
            fitter.fit(frame, centre, workspace, result, &result.fit);
        }
        sink += static_cast<float>(result.fit.rms_px);
    });
}

TEST(RealtimeSpeed, FiveIterationsAndTheMeshTakeLittleMoreThanTheCalibrationKernel)
{
    SKIP_UNLESS_TIMES_MEAN_SOMETHING();
    EXPECT_LE(ratio_of_fit(kernels::dispatched_kernels()), max_fit_ratio);
}

TEST(RealtimeSpeed, AStepFromTheLastFrameTakesAFractionOfTheCalibrationKernel)
{
    SKIP_UNLESS_TIMES_MEAN_SOMETHING();
    EXPECT_LE(ratio_of_warm_step(kernels::dispatched_kernels()), max_step_ratio);
}

TEST(RealtimeSpeed, DoublePrecisionIsNotWithinTheBounds) // so they would notice a fit that is left to it
{
    SKIP_UNLESS_TIMES_MEAN_SOMETHING();
    const RealtimeFitter whole_fitter = make_fitter(5);
    const FaceFitter& whole = whole_fitter.reference();
    const std::vector<LandmarkSet> faces = plant_faces(2);
    EXPECT_GT(ratio_to_calibration(static_cast<int>(faces.size()),
                                   [&] {
                                       for (const LandmarkSet& face : faces) {
                                           sink += shape_of(whole.model(), whole.fit(face, centre))[0];
                                       }
                                   }),
              max_fit_ratio);
    const std::vector<LandmarkSet> frames = plant_video(8);
    const RealtimeFitter step_fitter = make_fitter(1);
    const FaceFitter& step = step_fitter.reference();
    FitResult result = step.fit(frames[0], centre);
    EXPECT_GT(ratio_to_calibration(static_cast<int>(frames.size()),
                                   [&] {
                                       for (const LandmarkSet& frame : frames) {
                                           result = step.fit(frame, centre, &result);
                                       }
                                       sink += static_cast<float>(result.rms_px);
                                   }),
              max_step_ratio);
}

TEST(JointSpeed, AFitTakesFewTimesTheCalibrationKernel)
{
    SKIP_UNLESS_TIMES_MEAN_SOMETHING();
    EXPECT_LE(ratio_of_joint_fit(&kernels::dispatched_kernels()), max_joint_fit_ratio);
}

TEST(JointSpeed, AStepFromTheLastFrameTakesAFractionOfTheCalibrationKernel)
{
    SKIP_UNLESS_TIMES_MEAN_SOMETHING();
    EXPECT_LE(ratio_of_joint_step(&kernels::dispatched_kernels()), max_joint_step_ratio);
}

TEST(JointSpeed, WithoutKernelsItIsNotWithinTheBounds)
{
    SKIP_UNLESS_TIMES_MEAN_SOMETHING();
    EXPECT_GT(ratio_of_joint_fit(nullptr), max_joint_fit_ratio);
    EXPECT_GT(ratio_of_joint_step(nullptr), max_joint_step_ratio);
}

} // namespace
} // namespace lineament
