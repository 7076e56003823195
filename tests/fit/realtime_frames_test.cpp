// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// RealtimeFitter::fit_frames against lineament::fit_frames, the same answer from all rows stacked in double precision.
#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/count_allocations.hpp"
#include "support/face_model.hpp"
#include "support/matchers.hpp"
#include "support/planted_face.hpp"

#include <limits>

namespace lineament {
namespace {

using test::face_model;

const Eigen::Vector2d centre(320, 240);

/// Images of one person, each with its own camera and expression.
std::vector<LandmarkSet> plant_images(Random& random, int num_images, double max_yaw_deg = 45,
                                      const std::string& scheme = "ibug68", double depth_offset_px = 0)
{
    const MorphableModel& model = face_model();
    const Eigen::VectorXd alpha = test::random_normal(random, model.shape.num_coefficients());
    std::vector<LandmarkSet> images;
    for (int f = 0; f < num_images; ++f) {
        Camera camera = test::random_camera(random, max_yaw_deg);
        camera.principal_point_px = centre;
        const Eigen::VectorXd psi = test::random_uniform(random, 6, -0.4, 0.8).cwiseMax(0.0);
        images.push_back(test::project_landmarks(model, scheme, alpha, psi, camera, 1.5, random));
        if (depth_offset_px != 0) {
            test::add_depth(model, camera, depth_offset_px, images.back());
        }
    }
    return images;
}

struct Frames
{
    RealtimeFitter fitter;
    RealtimeWorkspace workspace;
    MultiFrameResult result = {};

    explicit Frames(const FitOptions& options, const std::string& scheme = "ibug68",
                    const kernels::Kernels& kernels = kernels::dispatched_kernels())
        : fitter(face_model(), scheme, options, kernels), workspace(fitter.make_workspace())
    {}
    const MultiFrameResult& fit(const std::vector<LandmarkSet>& images, PriorCount prior_count = PriorCount::once)
    {
        fitter.fit_frames(images, centre, workspace, result, prior_count);
        return result;
    }
    [[nodiscard]] MultiFrameResult reference(const std::vector<LandmarkSet>& images,
                                             PriorCount prior_count = PriorCount::once) const
    {
        return fit_frames(fitter.reference(), images, centre, prior_count);
    }
};

FitOptions with_contour(ContourMode mode, const std::string& expression_set = "ekman6")
{
    FitOptions options;
    options.contour = mode;
    options.expression_set = expression_set;
    return options;
}

double largest_distance_um(const MultiFrameResult& a, const MultiFrameResult& b)
{
    double largest = 0;
    for (std::size_t f = 0; f < a.frames.size(); ++f) {
        largest = std::max(largest, 1000 * test::largest_vertex_distance_mm(face_model(), a.frames[f], b.frames[f]));
    }
    return largest;
}

void expect_same(const MultiFrameResult& got, const MultiFrameResult& reference)
{
    EXPECT_EQ(got.status, reference.status) << got.reason << " | " << reference.reason;
    EXPECT_EQ(got.num_used_frames, reference.num_used_frames);
    ASSERT_EQ(got.frames.size(), reference.frames.size());
    EXPECT_LE(largest_distance_um(got, reference), 1.0);
    for (std::size_t f = 0; f < got.frames.size(); ++f) {
        EXPECT_EQ(got.frames[f].status, reference.frames[f].status) << f;
        EXPECT_EQ(got.frames[f].shape_coefficients, got.shape_coefficients);
        EXPECT_NEAR(got.frames[f].rms_px, reference.frames[f].rms_px, 1e-3);
        EXPECT_NEAR(got.frames[f].chi_square, reference.frames[f].chi_square,
                    1e-4 * (1 + reference.frames[f].chi_square));
        EXPECT_THAT(got.frames[f].camera.camera_from_model,
                    test::IsNear(reference.frames[f].camera.camera_from_model, 1e-5));
    }
}

TEST(RealtimeFrames, AgreeWithFitFramesAtGivenCorrespondences)
{
    Random random(91);
    double largest_um = 0;
    for (const kernels::Kernels* kernels : kernels::supported_kernels()) {
        for (const char* set : {"ekman6", ""}) {
            for (const ContourMode mode : {ContourMode::fixed, ContourMode::ignored}) {
                Frames frames(with_contour(mode, set), "ibug68", *kernels);
                for (const int num_images : {1, 3, 10}) {
                    const std::vector<LandmarkSet> images = plant_images(random, num_images);
                    for (const PriorCount prior_count : {PriorCount::once, PriorCount::per_frame}) {
                        const MultiFrameResult reference = frames.reference(images, prior_count);
                        expect_same(frames.fit(images, prior_count), reference);
                        largest_um = std::max(largest_um, largest_distance_um(frames.result, reference));
                    }
                    ASSERT_FALSE(HasFailure()) << kernels->name << " " << set << " " << num_images;
                }
                EXPECT_EQ(frames.workspace.num_reference_fits(), 0);
            }
        }
    }
    std::printf("largest distance: %.3f um\n", largest_um);
    // The twin: the other count of the prior is another answer.
    Frames frames(with_contour(ContourMode::fixed));
    const std::vector<LandmarkSet> images = plant_images(random, 3);
    EXPECT_GT(largest_distance_um(frames.fit(images), frames.reference(images, PriorCount::per_frame)), 100.0);
}

TEST(RealtimeFrames, OneImageIsFit)
{
    Random random(92);
    for (const ContourMode mode : {ContourMode::front_facing, ContourMode::both}) {
        Frames frames(with_contour(mode));
        const std::vector<LandmarkSet> images = plant_images(random, 1);
        FitResult one;
        frames.fitter.fit(images[0], centre, frames.workspace, one);
        EXPECT_LT(1000 * test::largest_vertex_distance_mm(face_model(), frames.fit(images).frames[0], one), 1.0);
    }
}

TEST(RealtimeFrames, AgreeWithFitFramesWhereContourDecisionsDo)
{
    Random random(93);
    for (const ContourMode mode : {ContourMode::front_facing, ContourMode::both}) {
        Frames frames(with_contour(mode));
        int num_flipped = 0;
        const int num_trials = 20;
        for (int trial = 0; trial < num_trials; ++trial) {
            const std::vector<LandmarkSet> images = plant_images(random, 5, 60);
            const MultiFrameResult reference = frames.reference(images);
            frames.fit(images);
            if (largest_distance_um(frames.result, reference) > 1.0) {
                ++num_flipped;
            } else {
                expect_same(frames.result, reference);
            }
        }
        std::printf("contour mode %d: %d of %d beyond 1 um\n", static_cast<int>(mode), num_flipped, num_trials);
        EXPECT_LE(num_flipped, 1);
        EXPECT_EQ(frames.workspace.num_reference_fits(), 0);
    }
}

TEST(RealtimeFrames, AgreeOnMissingLandmarksDepthAndManyPoints)
{
    Random random(94);
    Frames frames(with_contour(ContourMode::front_facing));
    std::vector<LandmarkSet> images = plant_images(random, 6);
    for (std::size_t f = 0; f < images.size(); f += 2) { // the others stay whole
        for (Landmark& landmark : images[f].landmarks) {
            landmark.confidence = random.uniform(0, 1) < 0.2 ? 0.0 : random.uniform(0.1, 1.0);
        }
        images[f].landmarks.erase(images[f].landmarks.begin() + 30);
    }
    expect_same(frames.fit(images), frames.reference(images));
    EXPECT_EQ(frames.workspace.num_reference_fits(), 0);
    images = plant_images(random, 4);
    expect_same(frames.fit(images), frames.reference(images)); // nothing is left of the last ones

    Frames dense({}, "mediapipe478");
    const std::vector<LandmarkSet> meshes = plant_images(random, 4, 45, "mediapipe478", -80);
    expect_same(dense.fit(meshes), dense.reference(meshes));
    EXPECT_EQ(dense.workspace.num_reference_fits(), 0);
}

TEST(RealtimeFrames, LeaveTheRareToTheReference)
{
    Random random(95);
    Frames frames(with_contour(ContourMode::fixed));
    std::vector<LandmarkSet> images = plant_images(random, 3);
    const Eigen::VectorXd before = frames.fit(images).shape_coefficients;
    images[1].landmarks.resize(3);
    EXPECT_EQ(frames.fit(images).num_used_frames, 2);
    EXPECT_EQ(frames.result.frames[1].status, FitStatus::too_few_correspondences);
    EXPECT_EQ(frames.result.shape_coefficients, frames.reference(images).shape_coefficients);
    EXPECT_EQ(frames.workspace.num_reference_fits(), 1);
    EXPECT_EQ(frames.fit({}).status, FitStatus::too_few_correspondences);

    for (LandmarkSet& image : images) { // a face no one has
        image = images[0];
        for (Landmark& landmark : image.landmarks) {
            landmark.point_px += 40 * Eigen::Vector2d{std::sin(landmark.point_px.x()), std::cos(landmark.point_px.y())};
        }
    }
    const MultiFrameResult reference = frames.reference(images);
    EXPECT_EQ(frames.fit(images).status, reference.status);
    EXPECT_EQ(frames.result.reason, reference.reason);

    images = plant_images(random, 3);
    const Eigen::VectorXd kept = frames.fit(images).shape_coefficients;
    EXPECT_NE(kept, before);
    images[2].landmarks[5].point_px.x() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { frames.fit(images); }, "landmark \"6\"", "nan"));
    EXPECT_EQ(frames.result.shape_coefficients, kept) << "a refused fit leaves the result alone";
}

TEST(RealtimeFrames, AllocateNothingOncePrepared)
{
    Random random(96);
    for (const ContourMode mode : {ContourMode::fixed, ContourMode::both}) {
        Frames frames(with_contour(mode));
        const std::vector<LandmarkSet> images = plant_images(random, 8);
        frames.fit(images);
        const long before = test::num_allocations();
        frames.fit(images);
        const long num_allocations = test::num_allocations() - before;
        EXPECT_EQ(frames.workspace.num_reference_fits(), 0);
        EXPECT_EQ(frames.workspace.num_reference_solves(), 0);
        EXPECT_EQ(num_allocations, 0);
    }
}

} // namespace
} // namespace lineament
