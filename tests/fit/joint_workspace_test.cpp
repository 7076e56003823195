// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Joint fits in memory of the caller's: the same bits as without, and nothing allocated.
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/count_allocations.hpp"
#include "support/face_model.hpp"
#include "support/synthetic_face.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace lineament {
namespace {

const Eigen::Vector2d centre(320, 240);

std::vector<LandmarkSet> draw_faces(int count, double max_yaw_deg, int seed, bool has_depth = false)
{
    Random random(seed);
    std::vector<LandmarkSet> sets;
    for (int face = 0; face < count; ++face) {
        const Eigen::VectorXd alpha = test::random_normal(random, test::face_model().shape.num_coefficients());
        const Eigen::VectorXd psi = test::random_uniform(random, 6, -0.4, 0.8).cwiseMax(0.0);
        const Camera camera = test::random_camera(random, max_yaw_deg);
        sets.push_back(test::project_landmarks(test::face_model(), "ibug68", alpha, psi, camera, 1.5, random));
        if (has_depth) {
            test::add_depth(test::face_model(), camera, 0, sets.back());
        }
    }
    return sets;
}

/// Everything but timing.
void expect_same(const JointFitResult& result, const JointFitResult& expected)
{
    EXPECT_EQ(result.fit.status, expected.fit.status);
    EXPECT_EQ(result.fit.reason, expected.fit.reason);
    EXPECT_EQ(result.fit.method, expected.fit.method);
    EXPECT_EQ(result.fit.camera.camera_from_model, expected.fit.camera.camera_from_model);
    EXPECT_EQ(result.fit.camera.translation_mm, expected.fit.camera.translation_mm);
    EXPECT_EQ(result.fit.camera.scale_px_per_mm, expected.fit.camera.scale_px_per_mm);
    EXPECT_EQ(result.fit.camera.phi_per_mm, expected.fit.camera.phi_per_mm);
    EXPECT_EQ(result.fit.shape_coefficients, expected.fit.shape_coefficients);
    EXPECT_EQ(result.fit.expression_set, expected.fit.expression_set);
    EXPECT_EQ(result.fit.expression_names, expected.fit.expression_names);
    EXPECT_EQ(result.fit.expression_coefficients, expected.fit.expression_coefficients);
    EXPECT_EQ(result.fit.rms_px, expected.fit.rms_px);
    EXPECT_EQ(result.fit.chi_square, expected.fit.chi_square);
    EXPECT_EQ(result.fit.degrees_of_freedom, expected.fit.degrees_of_freedom);
    EXPECT_EQ(result.fit.iterations, expected.fit.iterations);
    EXPECT_EQ(result.fit.contour_view, expected.fit.contour_view);
    ASSERT_EQ(result.fit.landmarks.size(), expected.fit.landmarks.size());
    for (std::size_t l = 0; l < expected.fit.landmarks.size(); ++l) {
        EXPECT_EQ(result.fit.landmarks[l].name, expected.fit.landmarks[l].name);
        EXPECT_EQ(result.fit.landmarks[l].point_px, expected.fit.landmarks[l].point_px);
        EXPECT_EQ(result.fit.landmarks[l].fitted_px, expected.fit.landmarks[l].fitted_px);
        EXPECT_EQ(result.fit.landmarks[l].weight, expected.fit.landmarks[l].weight);
    }
    EXPECT_EQ(result.covariance, expected.covariance);
    EXPECT_EQ(result.expression_deviations, expected.expression_deviations);
    EXPECT_EQ(result.unobservable_expressions, expected.unobservable_expressions);
    EXPECT_EQ(result.minimum_camera.camera_from_model, expected.minimum_camera.camera_from_model);
    EXPECT_EQ(result.minimum_camera.translation_mm, expected.minimum_camera.translation_mm);
    EXPECT_EQ(result.minimum_camera.scale_px_per_mm, expected.minimum_camera.scale_px_per_mm);
    EXPECT_EQ(result.minimum_camera.phi_per_mm, expected.minimum_camera.phi_per_mm);
    EXPECT_EQ(result.minimum_expression, expected.minimum_expression);
    EXPECT_EQ(result.matched_scale_px_per_mm, expected.matched_scale_px_per_mm);
    EXPECT_EQ(result.scale_strength, expected.scale_strength);
    ASSERT_EQ(result.energies.size(), expected.energies.size());
    for (std::size_t i = 0; i < expected.energies.size(); ++i) {
        EXPECT_EQ(result.energies[i].round, expected.energies[i].round);
        EXPECT_EQ(result.energies[i].energy, expected.energies[i].energy);
    }
}

TEST(JointWorkspace, HoldsNothingThatTheNextFitWouldSee)
{
    for (const kernels::Kernels* set :
         {static_cast<const kernels::Kernels*>(nullptr), &kernels::dispatched_kernels()}) {
        for (const bool has_focal : {false, true}) {
            JointOptions options;
            if (has_focal) {
                options.phi_sigma_per_mm = 0.002;
            }
            const JointFitter fitter(test::face_model(), "ibug68", options, set);
            std::vector<LandmarkSet> faces = draw_faces(4, 50, 921);
            faces[1].landmarks.resize(20);                                      // fewer
            std::reverse(faces[2].landmarks.begin(), faces[2].landmarks.end()); // in another order
            faces.push_back(faces[0]);
            faces.back().landmarks.resize(3); // too few
            faces.push_back(faces[0]);
            faces.back().landmarks[40].point_px.x() += 300; // a wild one
            faces.push_back(faces[3]);
            const std::vector<LandmarkSet> with_depth = draw_faces(3, 30, 926, true);
            faces.insert(faces.end(), with_depth.begin(), with_depth.end());
            const KnownIdentity identity = fitter.freeze(fitter.fit(faces[0], centre).fit.shape_coefficients);
            JointWorkspace workspace = fitter.make_workspace();
            JointFitResult result;
            for (const LandmarkSet& face : faces) {
                fitter.fit(face, centre, workspace, result);
                expect_same(result, fitter.fit(face, centre));
                const JointFitResult start = result;
                fitter.fit_pose_and_expression(face, centre, identity, workspace, result, &result.fit);
                expect_same(result,
                            fitter.fit_pose_and_expression(face, centre, identity.shape_coefficients(), &start.fit));
                ASSERT_FALSE(HasFailure()) << (set != nullptr ? set->name : "Eigen");
            }
        }
    }
}

TEST(JointWorkspace, TakesImagesInAnyNumber)
{
    const JointFitter fitter(test::face_model(), "ibug68", {}, &kernels::dispatched_kernels());
    std::vector<LandmarkSet> faces = draw_faces(5, 40, 924);
    faces[1].landmarks.resize(3); // of no use
    JointWorkspace workspace = fitter.make_workspace();
    JointFramesResult result;
    for (const std::size_t count : {3, 5, 1, 2, 4}) {
        const std::span<const LandmarkSet> images(faces.data(), count);
        fitter.fit_frames(images, centre, workspace, result);
        const JointFramesResult expected = fitter.fit_frames(images, centre);
        EXPECT_EQ(result.status, expected.status);
        EXPECT_EQ(result.reason, expected.reason);
        EXPECT_EQ(result.num_used_frames, expected.num_used_frames);
        EXPECT_EQ(result.shape_coefficients, expected.shape_coefficients);
        EXPECT_EQ(result.shape_covariance, expected.shape_covariance);
        EXPECT_EQ(result.landmark_bias_mm, expected.landmark_bias_mm);
        EXPECT_EQ(result.chi_square, expected.chi_square);
        EXPECT_EQ(result.degrees_of_freedom, expected.degrees_of_freedom);
        ASSERT_EQ(result.frames.size(), count);
        for (std::size_t f = 0; f < count; ++f) {
            expect_same(result.frames[f], expected.frames[f]);
        }
    }
}

TEST(JointWorkspace, SaysNothingThatAnotherFitterHasSaid)
{
    const std::vector<LandmarkSet> faces = draw_faces(2, 30, 927);
    JointOptions options;
    const JointFitter sure(test::face_model(), "ibug68", options, &kernels::dispatched_kernels());
    options.with_covariance = false;
    const JointFitter other(test::face_model(), "ibug68", options, &kernels::dispatched_kernels());
    JointWorkspace workspace = sure.make_workspace(), workspace_of_other = other.make_workspace();
    JointFitResult result;
    sure.fit(faces[0], centre, workspace, result);
    EXPECT_GT(result.covariance.size(), 0); // the twin
    for (const LandmarkSet& face : {faces[0], faces[1], faces[0]}) {
        other.fit(face, centre, workspace_of_other, result);
        expect_same(result, other.fit(face, centre));
    }
    JointFramesResult person;
    sure.fit_frames(faces, centre, workspace, person);
    EXPECT_GT(person.shape_covariance.size(), 0);
    other.fit_frames(faces, centre, workspace_of_other, person);
    EXPECT_EQ(person.shape_covariance.size(), 0);
    EXPECT_EQ(person.frames[1].covariance.size(), 0);
    EXPECT_EQ(person.frames[1].expression_deviations.size(), 0);
}

TEST(JointWorkspace, LeavesTheResultWhereInputIsRefused)
{
    const JointFitter fitter(test::face_model(), "ibug68", {}, &kernels::dispatched_kernels());
    std::vector<LandmarkSet> faces = draw_faces(2, 30, 922);
    JointWorkspace workspace = fitter.make_workspace();
    JointFitResult result;
    fitter.fit(faces[0], centre, workspace, result);
    const JointFitResult before = result;
    faces[1].landmarks[7].point_px.x() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(fitter.fit(faces[1], centre, workspace, result), InvalidArgument);
    expect_same(result, before);
    EXPECT_THROW((void)fitter.freeze(Eigen::VectorXd::Zero(61)), InvalidArgument);
    EXPECT_THROW((void)fitter.freeze(Eigen::VectorXd::Constant(2, NAN)), InvalidArgument);
    fitter.fit(faces[0], centre, workspace, result); // what was thrown has spoilt nothing
    expect_same(result, before);
}

TEST(JointWorkspace, AllocatesNothingForSingleSteps)
{
    JointOptions options;
    options.contour = ContourMode::front_facing;
    options.with_covariance = false;
    options.rounds = 1;
    options.max_iterations = 1;
    const JointFitter fitter(test::face_model(), "ibug68", options, &kernels::dispatched_kernels());
    const std::vector<LandmarkSet> faces = draw_faces(10, 40, 925);
    JointWorkspace workspace = fitter.make_workspace();
    JointFitResult result;
    long before = 0;
    int num_unsettled = 0;
    for (int pass = 0; pass < 3; ++pass) {
        before = test::num_allocations();
        for (const LandmarkSet& face : faces) {
            fitter.fit(face, centre, workspace, result, pass > 0 ? &result.fit : nullptr);
            num_unsettled += result.fit.status == FitStatus::not_converged;
        }
    }
    EXPECT_EQ(test::num_allocations() - before, 0);
    EXPECT_EQ(num_unsettled, 30);
    EXPECT_EQ(result.fit.reason, "the joint fit did not settle in 1 steps"); // in words
}

TEST(JointWorkspace, AllocatesNothingOnceItIsWarm)
{
    const std::vector<LandmarkSet> faces = draw_faces(30, 60, 923);
    for (const char* expression_set : {"ekman6", "arkit47"}) {
        for (const ContourMode mode : {ContourMode::fixed, ContourMode::front_facing}) {
            for (const bool with_covariance : {false, true}) {
                JointOptions options;
                options.contour = mode;
                options.expression_set = expression_set;
                options.with_covariance = with_covariance;
                const JointFitter fitter(test::face_model(), "ibug68", options, &kernels::dispatched_kernels());
                const KnownIdentity identity = fitter.freeze(Eigen::VectorXd::Constant(60, 0.3));
                JointWorkspace workspace = fitter.make_workspace();
                JointFitResult result;
                int num_successes = 0;
                long num_long_names = 0; // of unobservable expressions, for which a string asks for memory
                const auto fit_all = [&] {
                    num_long_names = 0;
                    const auto count_names = [&] {
                        num_long_names += std::count_if(result.unobservable_expressions.begin(),
                                                        result.unobservable_expressions.end(),
                                                        [](const std::string& name) { return name.size() > 15; });
                    };
                    for (const LandmarkSet& face : faces) {
                        fitter.fit(face, centre, workspace, result);
                        num_successes += result.fit.status == FitStatus::success;
                        count_names();
                        fitter.fit(face, centre, workspace, result, &result.fit);
                        count_names();
                        fitter.fit_pose_and_expression(face, centre, identity, workspace, result, &result.fit);
                        count_names();
                    }
                };
                fit_all();
                const long before = test::num_allocations();
                fit_all();
                const long num_allocations = test::num_allocations() - before;
                EXPECT_LE(num_allocations, num_long_names)
                    << expression_set << ", contour " << static_cast<int>(mode) << ", covariance " << with_covariance;
                EXPECT_TRUE(num_long_names == 0 || (with_covariance && options.expression_set == "arkit47"));
                EXPECT_GE(num_successes, 50);
                // The twin: a workspace of its own is seen.
                const long before_own = test::num_allocations();
                (void)fitter.fit(faces[0], centre);
                EXPECT_GT(test::num_allocations() - before_own, 50);
            }
        }
    }
}

} // namespace
} // namespace lineament
