// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The single precision fit against FaceFitter, the same answer by plain double precision. A program of its own, because
// it counts allocations.
#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/count_allocations.hpp"
#include "support/face_model.hpp"
#include "support/matchers.hpp"
#include "support/planted_face.hpp"

#include <limits>
#include <thread>

namespace lineament {
namespace {

using test::face_model;

/// A small one with odd numbers of everything.
const MorphableModel& small_model()
{
    static const MorphableModel model = [] {
        test::SyntheticFaceOptions options;
        options.num_shape_coefficients = 13;
        options.num_expressions = 5;
        return test::make_synthetic_face(options);
    }();
    return model;
}

struct Planted
{
    Camera camera;
    LandmarkSet landmarks;
};

Planted plant(const MorphableModel& model, Random& random, double noise_px = 1.5, double max_yaw_deg = 45,
              const std::string& scheme = "ibug68")
{
    Planted planted;
    const Eigen::VectorXd alpha = test::random_normal(random, model.shape.num_coefficients());
    const Eigen::VectorXd psi =
        test::random_uniform(random, model.expression_sets.front().num_coefficients(), -0.4, 0.8).cwiseMax(0.0);
    planted.camera = test::random_camera(random, max_yaw_deg);
    planted.landmarks = test::project_landmarks(model, scheme, alpha, psi, planted.camera, noise_px, random);
    return planted;
}

/// Largest distance of a vertex between two fits [um].
double distance_um(const MorphableModel& model, const FitResult& a, const FitResult& b)
{
    return 1000 * test::largest_vertex_distance_mm(model, a, b);
}

/// Everything but timing, as one list of numbers.
std::vector<double> numbers_of(const FitResult& fit)
{
    std::vector<double> numbers(fit.shape_coefficients.begin(), fit.shape_coefficients.end());
    numbers.insert(numbers.end(), fit.expression_coefficients.begin(), fit.expression_coefficients.end());
    numbers.insert(numbers.end(), fit.camera.camera_from_model.data(), fit.camera.camera_from_model.data() + 9);
    numbers.insert(numbers.end(), {fit.camera.scale_px_per_mm, fit.rms_px, fit.chi_square});
    for (const FittedLandmark& landmark : fit.landmarks) {
        numbers.insert(numbers.end(), {landmark.fitted_px.x(), landmark.fitted_px.y(), landmark.weight});
    }
    return numbers;
}

void expect_same(const FitResult& got, const FitResult& reference, const MorphableModel& model, double tolerance_um)
{
    ASSERT_EQ(got.status, reference.status) << got.reason << " | " << reference.reason;
    EXPECT_EQ(got.reason, reference.reason);
    EXPECT_EQ(got.iterations, reference.iterations);
    EXPECT_EQ(got.expression_set, reference.expression_set);
    EXPECT_EQ(got.expression_names, reference.expression_names);
    EXPECT_EQ(got.degrees_of_freedom, reference.degrees_of_freedom);
    EXPECT_LE(distance_um(model, got, reference), tolerance_um);
    const double relative = 1e-5 * tolerance_um;
    EXPECT_THAT(got.camera.camera_from_model, test::IsNear(reference.camera.camera_from_model, relative));
    EXPECT_THAT(got.camera.translation_mm, test::IsNear(reference.camera.translation_mm, 100 * relative));
    EXPECT_NEAR(got.camera.scale_px_per_mm, reference.camera.scale_px_per_mm, relative);
    EXPECT_NEAR(got.rms_px, reference.rms_px, 100 * relative);
    EXPECT_NEAR(got.chi_square, reference.chi_square, 100 * relative * (1 + reference.chi_square));
    ASSERT_EQ(got.landmarks.size(), reference.landmarks.size());
    for (std::size_t l = 0; l < got.landmarks.size(); ++l) {
        EXPECT_EQ(got.landmarks[l].name, reference.landmarks[l].name);
        EXPECT_EQ(got.landmarks[l].point_px, reference.landmarks[l].point_px);
        EXPECT_THAT(got.landmarks[l].fitted_px, test::IsNear(reference.landmarks[l].fitted_px, 200 * relative));
        EXPECT_NEAR(got.landmarks[l].weight, reference.landmarks[l].weight, 1e-12);
    }
}

FitOptions with_contour(ContourMode mode, const std::string& expression_set = "ekman6")
{
    FitOptions options;
    options.contour = mode;
    options.expression_set = expression_set;
    return options;
}

/// One fitter, its reference and a workspace.
struct Bench
{
    RealtimeFitter fitter;
    RealtimeWorkspace workspace;
    FitResult result = {};

    explicit Bench(const MorphableModel& model, const FitOptions& options = {},
                   const kernels::Kernels& kernels = kernels::dispatched_kernels(),
                   MeshStorage storage = MeshStorage::float32, const std::string& scheme = "ibug68")
        : fitter(model, scheme, options, kernels, storage), workspace(fitter.make_workspace())
    {}
    const FitResult& fit(const Planted& planted, const FitResult* start = nullptr)
    {
        fitter.fit(planted.landmarks, planted.camera.principal_point_px, workspace, result, start);
        return result;
    }
    [[nodiscard]] FitResult reference(const Planted& planted, const FitResult* start = nullptr) const
    {
        return fitter.reference().fit(planted.landmarks, planted.camera.principal_point_px, start);
    }
};

TEST(RealtimeFitter, AgreesWithFaceFitterWithinOneMicrometreAtGivenCorrespondences)
{
    Random random(71);
    double largest_um = 0;
    for (const kernels::Kernels* kernels : kernels::supported_kernels()) {
        for (const char* set : {"ekman6", "arkit47", ""}) {
            for (const ContourMode mode : {ContourMode::fixed, ContourMode::ignored}) {
                Bench bench(face_model(), with_contour(mode, set), *kernels);
                for (int trial = 0; trial < 25; ++trial) {
                    const Planted planted = plant(face_model(), random);
                    const FitResult reference = bench.reference(planted);
                    expect_same(bench.fit(planted), reference, face_model(), 1.0);
                    largest_um = std::max(largest_um, distance_um(face_model(), bench.result, reference));
                    ASSERT_FALSE(HasFailure()) << kernels->name << " " << set << " trial " << trial;
                }
                EXPECT_EQ(bench.workspace.num_reference_fits(), 0);
            }
        }
    }
    RecordProperty("largest_distance_um", std::to_string(largest_um));
    std::printf("largest distance: %.3f um\n", largest_um);
    // The twin: one iteration fewer is another answer.
    FitOptions shorter = with_contour(ContourMode::fixed);
    shorter.iterations = 4;
    Bench bench(face_model(), shorter);
    const Planted planted = plant(face_model(), random);
    const FitResult longer =
        fit_face(face_model(), planted.landmarks, planted.camera.principal_point_px, with_contour(ContourMode::fixed));
    EXPECT_GT(distance_um(face_model(), bench.fit(planted), longer), 10.0);
}

TEST(RealtimeFitter, AgreesWithFaceFitterAtOtherSizesAndOptions)
{
    Random random(72);
    FitOptions published = FitOptions::published_prior();
    published.contour = ContourMode::fixed;
    FitOptions few = with_contour(ContourMode::fixed);
    few.num_shape_coefficients = 7;
    FitOptions none = with_contour(ContourMode::ignored);
    none.num_shape_coefficients = 0;
    for (const FitOptions& options : {with_contour(ContourMode::fixed), published, few, none}) {
        Bench bench(small_model(), options);
        for (int trial = 0; trial < 20; ++trial) {
            const Planted planted = plant(small_model(), random);
            // Without coefficients FaceFitter::fit has Eigen multiply empty matrices, which sanitizers dislike.
            const FitResult reference = options.num_shape_coefficients == 0
                                            ? bench.fitter.reference().fit_pose_and_expression(
                                                  planted.landmarks, planted.camera.principal_point_px, {})
                                            : bench.reference(planted);
            expect_same(bench.fit(planted), reference, small_model(), 1.0);
        }
    }
}

TEST(RealtimeFitter, AgreesWithFaceFitterWhereContourDecisionsDo)
{
    Random random(73);
    for (const OccludingMatch match :
         {OccludingMatch::landmark_to_silhouette, OccludingMatch::silhouette_to_landmark}) {
        for (const ContourMode mode : {ContourMode::front_facing, ContourMode::both}) {
            FitOptions options = with_contour(mode);
            options.contour_matching.occluding_match = match;
            Bench bench(face_model(), options);
            int num_flipped = 0;
            const int num_trials = 100;
            for (int trial = 0; trial < num_trials; ++trial) {
                const Planted planted = plant(face_model(), random, 1.5, 60);
                const FitResult reference = bench.reference(planted);
                const FitResult& got = bench.fit(planted);
                ASSERT_EQ(got.status, reference.status) << got.reason << " | " << reference.reason;
                if (distance_um(face_model(), got, reference) > 1.0) {
                    ++num_flipped;
                } else {
                    expect_same(got, reference, face_model(), 1.0);
                }
            }
            std::printf("contour mode %d, match %d: %d of %d fits beyond 1 um\n", static_cast<int>(mode),
                        static_cast<int>(match), num_flipped, num_trials);
            EXPECT_LE(num_flipped, 3);
            EXPECT_EQ(bench.workspace.num_reference_fits(), 0);
        }
    }
}

TEST(RealtimeFitter, DropsWhatTheHeadHidesAsFaceFitterDoes)
{
    Random random(74);
    FitOptions options = with_contour(ContourMode::both);
    options.contour_matching.occlusion_depth_mm = 5; // much is hidden then, and whole sides of the outline
    options.contour_matching.max_distance_mm = 1e9;
    options.iterations = 2;
    Bench bench(face_model(), options);
    options.contour_matching.occlusion_depth_mm = 1000;
    Bench seeing_through(face_model(), options);
    int num_with_hidden = 0;
    int num_flipped = 0;
    for (int trial = 0; trial < 100; ++trial) {
        const Planted planted = plant(face_model(), random, 1.5, 60);
        const FitResult& got = bench.fit(planted);
        num_with_hidden += distance_um(face_model(), got, seeing_through.fit(planted)) > 1.0;
        num_flipped += distance_um(face_model(), bench.result, bench.reference(planted)) > 1.0;
    }
    std::printf("hidden points change %d of 100 fits, %d differ from the reference\n", num_with_hidden, num_flipped);
    EXPECT_GE(num_with_hidden, 25);
    EXPECT_LE(num_flipped, 3);
}

TEST(RealtimeFitter, AgreesWithFaceFitterOnMissingAndUncertainLandmarks)
{
    Random random(74);
    for (const MorphableModel* model : {&face_model(), &small_model()}) {
        Bench bench(*model, with_contour(ContourMode::fixed));
        for (int trial = 0; trial < 20; ++trial) {
            Planted planted = plant(*model, random);
            for (Landmark& landmark : planted.landmarks.landmarks) {
                landmark.confidence = random.uniform(0, 1) < 0.2 ? 0.0 : random.uniform(0.1, 1.0);
            }
            planted.landmarks.landmarks.erase(planted.landmarks.landmarks.begin() + trial);
            planted.landmarks.landmarks.push_back({"antenna", {1, 2}, 1.0});
            const FitResult reference = bench.reference(planted);
            expect_same(bench.fit(planted), reference, *model, 1.0);
        }
    }
}

TEST(RealtimeFitter, AgreesWithFaceFitterOn478PointsWithNoiseOfTheirOwn)
{
    Random random(75);
    Bench bench(face_model(), {}, kernels::dispatched_kernels(), MeshStorage::float32, "mediapipe478");
    for (int trial = 0; trial < 20; ++trial) {
        const Planted planted = plant(face_model(), random, 1.5, 45, "mediapipe478");
        const FitResult reference = bench.reference(planted);
        expect_same(bench.fit(planted), reference, face_model(), 1.0);
    }
}

TEST(RealtimeFitter, AgreesWithFaceFitterOnPointsWithDepth)
{
    Random random(751);
    for (const auto& [scheme, mode] : {std::pair("ibug68", ContourMode::fixed), std::pair("ibug68", ContourMode::both),
                                       std::pair("mediapipe478", ContourMode::fixed)}) {
        Bench bench(face_model(), with_contour(mode), kernels::dispatched_kernels(), MeshStorage::float32, scheme);
        for (int trial = 0; trial < 20; ++trial) {
            Planted planted = plant(face_model(), random, 1.5, 45, scheme);
            const FitResult flat = bench.reference(planted);
            test::add_depth(face_model(), planted.camera, -80, planted.landmarks);
            for (std::size_t l = 0; trial % 2 == 0 && l < 17; ++l) { // of the outline other depths than of the rest
                *planted.landmarks.landmarks[l].depth_px += random.uniform(-30, 30);
            }
            const FitResult reference = bench.reference(planted);
            expect_same(bench.fit(planted), reference, face_model(), 1.0);
            EXPECT_THAT(reference.camera.camera_from_model,
                        ::testing::Not(test::IsNear(flat.camera.camera_from_model, 1e-5)));
        }
    }
}

TEST(RealtimeFitter, AFitDoesNotDependOnTheLandmarksBefore)
{
    const RealtimeFitter fitter(face_model(), "ibug68", with_contour(ContourMode::front_facing),
                                kernels::dispatched_kernels()); // which read more than they count
    RealtimeWorkspace used = fitter.make_workspace();
    Random random(331);
    const Eigen::Vector2d centre(320, 240);
    std::vector<LandmarkSet> sets(8);
    for (LandmarkSet& set : sets) {
        set = plant(face_model(), random).landmarks;
    }
    sets[1].landmarks[30].confidence = 0.5;
    sets[2].landmarks.erase(sets[2].landmarks.begin() + 40);
    std::swap(sets[3].landmarks[20], sets[3].landmarks[50]);
    sets[4].landmarks[33].depth_px = 5.0;
    sets[5].landmarks[3].name = "no such landmark";
    sets[6].landmarks[5].confidence = 0;
    for (int pair = 0; pair < 64; ++pair) { // each after each
        for (const std::size_t which : {static_cast<std::size_t>(pair / 8), static_cast<std::size_t>(pair % 8)}) {
            RealtimeWorkspace fresh = fitter.make_workspace();
            FitResult result, expected;
            fitter.fit(sets[which], centre, used, result);
            fitter.fit(sets[which], centre, fresh, expected);
            EXPECT_EQ(numbers_of(result), numbers_of(expected)) << pair;
            EXPECT_EQ(result.status, expected.status) << pair;
        }
    }
    FitResult far_away;
    fitter.fit(sets[0], centre, used, far_away);
    for (const double factor : {1e3, 1e10, 1e40, 1e200}) { // numbers that no float holds
        FitResult start = far_away, result, expected;
        start.expression_coefficients.setConstant(factor);
        start.shape_coefficients *= factor;
        RealtimeWorkspace fresh = fitter.make_workspace();
        fitter.fit(sets[1], centre, used, result, &start);
        fitter.fit(sets[2], centre, used, result);
        fitter.fit(sets[2], centre, fresh, expected);
        EXPECT_EQ(numbers_of(result), numbers_of(expected)) << factor;
    }
    LandmarkSet moved = sets[0]; // its places are read anew
    for (Landmark& landmark : moved.landmarks) {
        landmark.point_px.x() += 10;
    }
    FitResult first, second;
    fitter.fit(sets[0], centre, used, first);
    fitter.fit(moved, centre, used, second);
    EXPECT_NEAR((second.camera.translation_mm - first.camera.translation_mm).x() * first.camera.scale_px_per_mm, 10,
                1e-3);
    LandmarkSet broken = sets[0];
    broken.landmarks[60].point_px.y() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { fitter.fit(broken, centre, used, first); }, "landmark"));
    fitter.fit(sets[0], centre, used, second);
    RealtimeWorkspace fresh = fitter.make_workspace();
    fitter.fit(sets[0], centre, fresh, first);
    EXPECT_EQ(numbers_of(first), numbers_of(second));
}

TEST(RealtimeFitter, FollowsAFaceFromItsOwnLastResult)
{
    Random random(76);
    FitOptions options = with_contour(ContourMode::fixed);
    options.iterations = 1;
    Bench bench(face_model(), options);
    Planted planted = plant(face_model(), random);
    FitResult reference = bench.reference(planted);
    bench.fit(planted);
    for (int frame = 0; frame < 20; ++frame) {
        for (Landmark& landmark : planted.landmarks.landmarks) {
            landmark.point_px += 0.5 * Eigen::Vector2d{random.normal(), random.normal()};
        }
        reference = bench.reference(planted, &reference);
        expect_same(bench.fit(planted, &bench.result), reference, face_model(), 2.0);
    }
}

TEST(RealtimeFitter, FitsPoseAndExpressionOfAFrozenIdentity)
{
    Random random(77);
    for (const char* set : {"ekman6", "arkit47"}) {
        for (const ContourMode mode : {ContourMode::fixed, ContourMode::both}) {
            FitOptions options = with_contour(mode, set);
            options.iterations = 2;
            Bench bench(face_model(), options);
            int num_flipped = 0;
            for (int trial = 0; trial < 20; ++trial) {
                const Planted planted = plant(face_model(), random);
                const Eigen::VectorXd alpha = 0.7 * test::random_normal(random, 20);
                const FrozenIdentity frozen = bench.fitter.freeze(alpha);
                const Eigen::Vector2d centre = planted.camera.principal_point_px;
                const FitResult reference =
                    bench.fitter.reference().fit_pose_and_expression(planted.landmarks, centre, alpha);
                bench.fitter.fit_pose_and_expression(planted.landmarks, centre, frozen, bench.workspace, bench.result);
                if (mode == ContourMode::both && distance_um(face_model(), bench.result, reference) > 1.0) {
                    ++num_flipped;
                    continue;
                }
                expect_same(bench.result, reference, face_model(), 1.0);
                const Eigen::VectorXf shape = shape_of(face_model(), reference);
                const Eigen::Map<const Eigen::Matrix3Xf> expected(shape.data(), 3, face_model().num_vertices());
                EXPECT_THAT(bench.fitter.shape_of(frozen, bench.result, bench.workspace), test::IsNear(expected, 2e-3));
            }
            EXPECT_LE(num_flipped, 1);
        }
    }
    const RealtimeFitter other(small_model());
    Bench bench(face_model());
    const Planted planted = plant(face_model(), random);
    EXPECT_TRUE(test::throws<InvalidArgument>(
        [&] {
            bench.fitter.fit_pose_and_expression(planted.landmarks, {0, 0}, other.freeze({}), bench.workspace,
                                                 bench.result);
        },
        "identity"));
}

TEST(RealtimeFitter, GivesTheMeshOfAFit)
{
    Random random(78);
    for (const kernels::Kernels* kernels : kernels::supported_kernels()) {
        for (const char* set : {"ekman6", "arkit47", ""}) {
            Bench exact(face_model(), with_contour(ContourMode::fixed, set), *kernels);
            Bench compact(face_model(), with_contour(ContourMode::fixed, set), *kernels, MeshStorage::int16);
            const Planted planted = plant(face_model(), random);
            const FitResult& fit = exact.fit(planted);
            const Eigen::VectorXd expected =
                shape_of(face_model(), fit).cast<double>(); // float itself: good to 1e-4 mm
            const Eigen::Map<const Eigen::Matrix3Xd> points(expected.data(), 3, face_model().num_vertices());
            EXPECT_THAT(exact.fitter.shape_of(fit, exact.workspace), test::IsNear(points, 2e-4)) << kernels->name;
            EXPECT_THAT(compact.fitter.shape_of(fit, compact.workspace), test::IsNear(points, 5e-3)) << kernels->name;
        }
    }
    Bench bench(face_model());
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)bench.fitter.shape_of(FitResult{}, bench.workspace); },
                                              "fit.shape_coefficients"));
}

TEST(RealtimeFitter, GivesTheMeshesOfManyFitsAtOnce)
{
    Random random(781);
    for (const MeshStorage storage : {MeshStorage::float32, MeshStorage::int16}) {
        for (const char* set : {"ekman6", "arkit47", ""}) {
            Bench bench(face_model(), with_contour(ContourMode::fixed, set), kernels::dispatched_kernels(), storage);
            std::vector<FitResult> fits; // more than are done in one go
            for (int f = 0; f < 40; ++f) {
                fits.push_back(bench.fit(plant(face_model(), random)));
            }
            Eigen::MatrixXf shapes;
            bench.fitter.shapes_of(fits, bench.workspace, shapes);
            ASSERT_EQ(shapes.cols(), 40);
            for (std::size_t f = 0; f < fits.size(); ++f) {
                const Eigen::Map<const Eigen::Matrix3Xf> alone = bench.fitter.shape_of(fits[f], bench.workspace);
                EXPECT_EQ(shapes.col(static_cast<Eigen::Index>(f)), alone.reshaped()) << f;
            }
            EXPECT_NE(shapes.col(0), shapes.col(39)); // the twin
            fits[33].expression_coefficients.conservativeResize(99);
            const Eigen::MatrixXf before = shapes;
            EXPECT_TRUE(test::throws<InvalidArgument>([&] { bench.fitter.shapes_of(fits, bench.workspace, shapes); },
                                                      "fit.expression_coefficients"));
            EXPECT_EQ(shapes, before);
        }
    }
}

TEST(RealtimeFitter, HasTheStatusesOfFaceFitterWhereThereIsNoAnswer)
{
    Random random(79);
    for (const ContourMode mode : {ContourMode::fixed, ContourMode::both}) {
        Bench bench(face_model(), with_contour(mode));
        const Planted good = plant(face_model(), random, 1.0, 20);
        std::vector<Planted> inputs(6, good);
        inputs[0].landmarks.landmarks.resize(3);
        inputs[1].landmarks.landmarks.clear();
        for (Landmark& landmark : inputs[2].landmarks.landmarks) {
            landmark.point_px = {300, 200};
        }
        for (Landmark& landmark : inputs[3].landmarks.landmarks) {
            landmark.point_px.y() = 2 * landmark.point_px.x() + 5;
        }
        for (Landmark& landmark : inputs[4].landmarks.landmarks) { // mirrored: it looks away
            landmark.point_px.x() = 640 - landmark.point_px.x();
        }
        inputs[5].landmarks.landmarks.push_back(
            inputs[5].landmarks.landmarks[30]); // twice is once with twice the weight
        const FitStatus expected[] = {FitStatus::too_few_correspondences,
                                      FitStatus::too_few_correspondences,
                                      FitStatus::degenerate,
                                      FitStatus::degenerate,
                                      FitStatus::implausible,
                                      FitStatus::success};
        for (std::size_t i = 0; i < inputs.size(); ++i) {
            const FitResult reference = bench.reference(inputs[i]);
            EXPECT_EQ(reference.status, expected[i]) << i;
            const FitResult& got = bench.fit(inputs[i]);
            EXPECT_EQ(got.reason, reference.reason);
            EXPECT_EQ(numbers_of(got), numbers_of(reference)) << i;
            EXPECT_EQ(bench.workspace.num_reference_fits(), static_cast<long>(i) + 1);
        }
        expect_same(bench.fit(good), bench.reference(good), face_model(), 1.0); // nothing is left behind
    }
}

TEST(RealtimeFitter, HoldsCoefficientsAtTheirBounds)
{
    Random random(80);
    Bench bench(face_model(), with_contour(ContourMode::fixed));
    int num_implausible = 0;
    for (int trial = 0; trial < 10; ++trial) {
        Planted planted = plant(face_model(), random, 1.0, 20);
        for (Landmark& landmark : planted.landmarks.landmarks) { // a face no one has
            landmark.point_px += 25 * Eigen::Vector2d{random.normal(), random.normal()};
        }
        const FitResult reference = bench.reference(planted);
        expect_same(bench.fit(planted), reference, face_model(), 10.0);
        num_implausible += reference.status == FitStatus::implausible;
    }
    EXPECT_GT(num_implausible, 3);
    EXPECT_GT(bench.workspace.num_reference_solves(), 0);
}

TEST(RealtimeFitter, RefusesWhatFaceFitterRefuses)
{
    Random random(81);
    Bench bench(small_model());
    const Planted good = plant(small_model(), random);
    const FitResult before = bench.fit(good);
    Planted bad = good;
    bad.landmarks.landmarks[30].point_px.x() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { bench.fit(bad); }, "landmark \"31\"", "nan"));
    bad = good;
    bad.landmarks.landmarks[0].confidence = 1.5;
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { bench.fit(bad); }, "confidence"));
    bad = good;
    bad.landmarks.scheme = "other";
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { bench.fit(bad); }, "scheme"));
    bad = good;
    bad.camera.principal_point_px.x() = std::numeric_limits<double>::infinity();
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { bench.fit(bad); }, "principal_point_px"));
    FitResult start = before;
    start.shape_coefficients.conservativeResize(3);
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { bench.fit(good, &start); }, "start->shape_coefficients"));
    start = before;
    start.expression_coefficients[0] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { bench.fit(good, &start); }, "start->expression_coefficients"));
    EXPECT_EQ(numbers_of(bench.result), numbers_of(before)) << "a refused fit leaves the result alone";

    FitOptions perspective;
    perspective.focal_length_px = 500;
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { RealtimeFitter(small_model(), "ibug68", perspective); },
                                              "focal_length_px", "500"));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)bench.fitter.freeze(Eigen::VectorXd::Zero(99)); },
                                              "shape_coefficients"));
}

TEST(RealtimeFitter, AllocatesNothingOncePrepared)
{
    Random random(82);
    for (const char* set : {"ekman6", "arkit47"}) {
        for (const ContourMode mode : {ContourMode::fixed, ContourMode::front_facing, ContourMode::both}) {
            Bench bench(face_model(), with_contour(mode, set));
            std::vector<Planted> faces;
            for (int trial = 0; trial < 30; ++trial) {
                faces.push_back(plant(face_model(), random, 1.0, 60));
                test::add_depth(face_model(), faces.back().camera, 0, faces.back().landmarks);
            }
            const FrozenIdentity frozen = bench.fitter.freeze(0.5 * test::random_normal(random, 60));
            const std::vector<FitResult> results(50, bench.fit(faces[0]));
            Eigen::MatrixXf shapes(3 * face_model().num_vertices(), 50);
            const long before = test::num_allocations();
            double sum = 0;
            for (const Planted& face : faces) {
                bench.fit(face);
                bench.fit(face, &bench.result);
                sum += bench.fitter.shape_of(bench.result, bench.workspace)(0, 0);
                bench.fitter.fit_pose_and_expression(face.landmarks, face.camera.principal_point_px, frozen,
                                                     bench.workspace, bench.result);
                sum += bench.fitter.shape_of(frozen, bench.result, bench.workspace)(0, 0);
            }
            bench.fitter.shapes_of(results, bench.workspace, shapes);
            const long num_fits_allocations = test::num_allocations() - before;
            EXPECT_EQ(bench.workspace.num_reference_fits(), 0);
            EXPECT_EQ(bench.workspace.num_reference_solves(), 0);
            EXPECT_EQ(num_fits_allocations, 0) << set << " " << static_cast<int>(mode);
            EXPECT_TRUE(std::isfinite(sum));
            // The twin: the reference does allocate, and it is seen.
            const long before_reference = test::num_allocations();
            (void)bench.reference(faces[0]);
            EXPECT_GT(test::num_allocations() - before_reference, 100);
        }
    }
}

TEST(RealtimeFitter, GivesTheSameBitsInAnyNumberOfThreads)
{
    Random random(83);
    const RealtimeFitter fitter(face_model(), "ibug68", {}, kernels::dispatched_kernels());
    std::vector<Planted> faces;
    for (int trial = 0; trial < 20; ++trial) {
        faces.push_back(plant(face_model(), random, 1.0, 60));
    }
    const auto fit_share = [&](std::vector<FitResult>& results, std::size_t first, std::size_t step) {
        RealtimeWorkspace workspace = fitter.make_workspace();
        for (std::size_t i = first; i < faces.size(); i += step) {
            fitter.fit(faces[i].landmarks, faces[i].camera.principal_point_px, workspace, results[i]);
        }
    };
    std::vector<FitResult> alone(faces.size());
    std::vector<FitResult> together(faces.size());
    fit_share(alone, 0, 1);
    std::thread even([&] { fit_share(together, 0, 2); });
    std::thread odd([&] { fit_share(together, 1, 2); });
    even.join();
    odd.join();
    for (std::size_t i = 0; i < faces.size(); ++i) {
        EXPECT_EQ(numbers_of(alone[i]), numbers_of(together[i])) << i;
    }
}

} // namespace
} // namespace lineament
