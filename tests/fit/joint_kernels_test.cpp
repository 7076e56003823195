// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The joint fit on the kernels of every instruction set, against the same fit in plain double precision.
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/face_model.hpp"
#include "support/matchers.hpp"
#include "support/planted_face.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace lineament {
namespace {

struct Case
{
    const char* name;
    ContourMode contour;
    const char* expression_set;
    bool fits_focal = false;
};

void PrintTo(const Case& given, std::ostream* out)
{
    *out << given.name;
}

/// Of one person, with expressions.
std::vector<LandmarkSet> images_of(const Eigen::VectorXd& alpha, int count, Random& random)
{
    std::vector<LandmarkSet> images;
    for (int image = 0; image < count; ++image) {
        const Eigen::VectorXd psi = test::random_uniform(random, 6, -0.4, 0.8).cwiseMax(0.0);
        images.push_back(test::project_landmarks(test::face_model(), "ibug68", alpha, psi,
                                                 test::random_camera(random, 45), 1.5, random));
    }
    return images;
}

class JointKernelsTest : public testing::TestWithParam<Case>
{
protected:
    const MorphableModel& model = test::face_model();

    [[nodiscard]] JointOptions options() const
    {
        JointOptions options;
        options.contour = GetParam().contour;
        options.expression_set = GetParam().expression_set;
        if (GetParam().fits_focal) {
            options.phi_sigma_per_mm = 0.002;
        }
        return options;
    }

    /// Faces turned to either side.
    [[nodiscard]] std::vector<LandmarkSet> faces() const
    {
        Random random(711);
        std::vector<LandmarkSet> sets;
        for (int face = 0; face < 6; ++face) {
            const Eigen::VectorXd alpha = test::random_normal(random, model.shape.num_coefficients());
            const Eigen::VectorXd psi = test::random_uniform(random, 6, -0.4, 0.8).cwiseMax(0.0);
            sets.push_back(
                test::project_landmarks(model, "ibug68", alpha, psi, test::random_camera(random, 45), 1.5, random));
        }
        return sets;
    }
};

void expect_alike(const JointFramesResult& result, const JointFramesResult& expected, double covariance_tolerance,
                  const char* set)
{
    EXPECT_LT((result.landmark_bias_mm - expected.landmark_bias_mm).cwiseAbs().maxCoeff(), 1e-3) << set;
    for (std::size_t f = 0; f < expected.frames.size(); ++f) {
        const JointFitResult &fit = result.frames[f], &plain = expected.frames[f];
        EXPECT_LT(1000 * test::largest_vertex_distance_mm(test::face_model(), fit.fit, plain.fit), 1) << set;
        EXPECT_NEAR(fit.scale_strength, plain.scale_strength, 1e-4 * plain.scale_strength) << set;
        const double largest = plain.covariance.cwiseAbs().maxCoeff();
        EXPECT_LT((fit.covariance - plain.covariance).cwiseAbs().maxCoeff(), covariance_tolerance * largest) << set;
        EXPECT_LT((fit.expression_deviations - plain.expression_deviations).cwiseAbs().maxCoeff(), 1e-4) << set;
    }
}

/// Of several images, by the kernels of every instruction set.
void expect_face_of_double_precision(const std::vector<LandmarkSet>& images, const JointOptions& options,
                                     FitStatus status = FitStatus::success)
{
    const MorphableModel& model = test::face_model();
    const JointFramesResult expected = JointFitter(model, "ibug68", options).fit_frames(images, {320, 240});
    ASSERT_EQ(expected.status, status) << expected.reason;
    EXPECT_EQ(expected.landmark_bias_mm.norm() > 1, options.bias_sigma_mm > 0);
    for (const kernels::Kernels* set : kernels::supported_kernels()) {
        const JointFramesResult result = JointFitter(model, "ibug68", options, set).fit_frames(images, {320, 240});
        ASSERT_EQ(result.status, status) << set->name << ": " << result.reason;
        expect_alike(result, expected, 3e-4, set->name);
    }
}

TEST_P(JointKernelsTest, GiveTheFaceOfPlainDoublePrecision)
{
    const JointFitter plain(model, "ibug68", options());
    for (const kernels::Kernels* set : kernels::supported_kernels()) {
        const JointFitter fitter(model, "ibug68", options(), set);
        for (const LandmarkSet& landmarks : faces()) {
            const JointFitResult expected = plain.fit(landmarks, {320, 240});
            const JointFitResult result = fitter.fit(landmarks, {320, 240});
            ASSERT_EQ(result.fit.status, FitStatus::success) << set->name << ": " << result.fit.reason;
            EXPECT_LT(1000 * test::largest_vertex_distance_mm(model, result.fit, expected.fit), 1) << set->name;
            EXPECT_NEAR(result.energies.back().energy, expected.energies.back().energy,
                        5e-6 * std::abs(expected.energies.back().energy)) // of n_f times log s
                << set->name;
            const double largest = expected.covariance.cwiseAbs().maxCoeff();
            EXPECT_LT((result.covariance - expected.covariance).cwiseAbs().maxCoeff(), 1e-4 * largest) << set->name;
            EXPECT_LT((result.expression_deviations - expected.expression_deviations).cwiseAbs().maxCoeff(), 1e-4)
                << set->name;
        }
    }
}

TEST_P(JointKernelsTest, GiveTheFaceOfPlainDoublePrecisionForAKnownIdentity)
{
    const JointFitter plain(model, "ibug68", options());
    const Eigen::VectorXd identity = plain.fit(faces()[0], {320, 240}).fit.shape_coefficients;
    for (const kernels::Kernels* set : kernels::supported_kernels()) {
        const JointFitter fitter(model, "ibug68", options(), set);
        for (const LandmarkSet& landmarks : faces()) { // also of persons it is not
            const JointFitResult expected = plain.fit_pose_and_expression(landmarks, {320, 240}, identity);
            const JointFitResult result = fitter.fit_pose_and_expression(landmarks, {320, 240}, identity);
            ASSERT_EQ(result.fit.status, expected.fit.status) << set->name << ": " << result.fit.reason;
            EXPECT_EQ(result.fit.shape_coefficients, identity);
            EXPECT_LT(1000 * test::largest_vertex_distance_mm(model, result.fit, expected.fit), 1) << set->name;
            const double largest = expected.covariance.cwiseAbs().maxCoeff();
            EXPECT_LT((result.covariance - expected.covariance).cwiseAbs().maxCoeff(), 1e-4 * largest) << set->name;
            EXPECT_EQ(result.scale_strength, 0) << set->name; // the face says nothing more of its size
        }
    }
}

TEST_P(JointKernelsTest, GiveTheFaceOfPlainDoublePrecisionOfSeveralImages)
{
    Random random(712);
    const Eigen::VectorXd alpha = test::random_normal(random, model.shape.num_coefficients());
    const std::vector<LandmarkSet> whole = images_of(alpha, 5, random);
    std::vector<LandmarkSet> images = whole;
    images[1].landmarks.resize(40); // biases of the others have no point there
    expect_face_of_double_precision(images, options());
    JointOptions given = options();
    given.phi_sigma_per_mm = 0.002;
    expect_face_of_double_precision(images, given);
    given = options();
    given.bias_sigma_mm = 0.0;
    expect_face_of_double_precision(images, given);
    given = options();
    given.contour = ContourMode::fixed; // every point has a bias
    expect_face_of_double_precision(images, given);
    given = options();
    given.max_coefficient = 1.0; // some are held there
    expect_face_of_double_precision(images, given, FitStatus::implausible);
    images = whole;
    std::erase_if(images[0].landmarks, [](const Landmark& landmark) { return landmark.name == "36"; });
    expect_face_of_double_precision(images, options()); // a bias whose first point is in the second image
}

TEST(JointKernels, GiveTheFaceOfPlainDoublePrecisionOfManyImages)
{
    // So many that they are eliminated one by one, with their landmark biases, and some expressions held.
    Random random(713);
    const MorphableModel& model = test::face_model();
    const Eigen::VectorXd alpha = test::random_normal(random, model.shape.num_coefficients());
    const std::vector<LandmarkSet> images = images_of(alpha, 40, random);
    JointOptions options;
    options.contour = ContourMode::front_facing;
    const JointFramesResult expected = JointFitter(model, "ibug68", options).fit_frames(images, {320, 240});
    const JointFramesResult result =
        JointFitter(model, "ibug68", options, &kernels::dispatched_kernels()).fit_frames(images, {320, 240});
    ASSERT_EQ(expected.status, FitStatus::success) << expected.reason;
    ASSERT_EQ(result.status, FitStatus::success) << result.reason;
    expect_alike(result, expected, 5e-4, "the machine's"); // their rounding is 3e-4
    int num_held = 0;
    for (const JointFitResult& frame : result.frames) {
        num_held += (frame.fit.expression_coefficients.array() == 0).any();
    }
    EXPECT_GT(num_held, 10);
}

TEST(JointKernels, ManyImagesWhoseMatrixIsLostInTheRoundingAreAsSureAsOtherwise)
{
    // Landmarks a hundred times as far off as they are said to be: the matrix is summed and inverted anew in double.
    Random random(715);
    const MorphableModel& model = test::face_model();
    const Eigen::VectorXd alpha = test::random_normal(random, model.shape.num_coefficients());
    const std::vector<LandmarkSet> images = images_of(alpha, 12, random);
    JointOptions options;
    options.contour = ContourMode::fixed;
    options.landmark_sigma_mm = 0.01;
    options.contour_sigma_mm = 0.01;
    options.bias_sigma_mm = 0.0;
    const JointFramesResult result =
        JointFitter(model, "ibug68", options, &kernels::dispatched_kernels()).fit_frames(images, {320, 240});
    EXPECT_EQ(result.status, FitStatus::not_converged) << result.reason;
    for (const JointFitResult& frame : result.frames) {
        EXPECT_EQ(frame.covariance.rows(), model.shape.num_coefficients() + 6);
        EXPECT_TRUE(frame.covariance.allFinite());
        EXPECT_EQ(frame.expression_deviations.size(), 6);
        EXPECT_TRUE(frame.expression_deviations.allFinite());
    }
}

TEST(JointKernels, FitImagesWithoutShapeCoefficients)
{
    Random random(714);
    const MorphableModel& model = test::face_model();
    std::vector<LandmarkSet> images;
    for (int image = 0; image < 2; ++image) {
        images.push_back(test::project_landmarks(model, "ibug68", Eigen::VectorXd::Zero(60), Eigen::VectorXd::Zero(6),
                                                 test::random_camera(random, 30), 1.0, random));
    }
    JointOptions options;
    options.num_shape_coefficients = 0;
    const JointFramesResult expected = JointFitter(model, "ibug68", options).fit_frames(images, {320, 240});
    const JointFramesResult result =
        JointFitter(model, "ibug68", options, &kernels::dispatched_kernels()).fit_frames(images, {320, 240});
    EXPECT_EQ(result.status, FitStatus::success) << result.reason;
    for (std::size_t f = 0; f < images.size(); ++f) {
        EXPECT_LT((result.frames[f].fit.expression_coefficients - expected.frames[f].fit.expression_coefficients)
                      .cwiseAbs()
                      .maxCoeff(),
                  1e-4);
    }
}

TEST_P(JointKernelsTest, GiveTheMeshOfPlainSums)
{
    FitResult fit = JointFitter(model, "ibug68", options()).fit(faces()[0], {320, 240}).fit;
    const Eigen::VectorXf expected = shape_of(model, fit), neutral = neutral_shape_of(model, fit);
    ASSERT_GT((expected - neutral).cwiseAbs().maxCoeff(), 0.1);
    for (const kernels::Kernels* set : kernels::supported_kernels()) {
        EXPECT_LT((shape_of(model, fit, set) - expected).cwiseAbs().maxCoeff(), 2e-4) << set->name;
        EXPECT_LT((neutral_shape_of(model, fit, set) - neutral).cwiseAbs().maxCoeff(), 2e-4) << set->name;
    }
    fit.shape_coefficients.conservativeResize(1000);
    for (const kernels::Kernels* set :
         {static_cast<const kernels::Kernels*>(nullptr), &kernels::dispatched_kernels()}) {
        EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)shape_of(model, fit, set); }, "fit.shape_coefficients"));
    }
}

TEST_P(JointKernelsTest, KeepAPriorOfExpressionsThatIsFarBelowTheRounding)
{
    JointOptions weak = options();
    weak.expression_sigma = 2000;
    const JointFitter plain(model, "ibug68", weak);
    LandmarkSet landmarks = faces()[0];
    landmarks.landmarks.resize(48); // without the mouth some expressions are seen by none
    const JointFitResult expected = plain.fit(landmarks, {320, 240});
    ASSERT_EQ(expected.fit.status, FitStatus::success);
    for (const kernels::Kernels* set : kernels::supported_kernels()) {
        const JointFitResult result = JointFitter(model, "ibug68", weak, set).fit(landmarks, {320, 240});
        EXPECT_EQ(result.fit.status, FitStatus::success) << set->name << " " << result.fit.reason;
        EXPECT_NEAR(result.scale_strength, expected.scale_strength, 0.01) << set->name;
    }
}

TEST_P(JointKernelsTest, ANoiseOfAHundredthMoreIsFarBeyondTheirRounding)
{
    JointOptions other = options();
    other.landmark_sigma_mm *= 1.01;
    other.contour_sigma_mm *= 1.01;
    const JointFitter fitter(model, "ibug68", options());
    const JointFitter moved(model, "ibug68", other);
    for (const LandmarkSet& landmarks : faces()) {
        EXPECT_GT(1000 * test::largest_vertex_distance_mm(model, fitter.fit(landmarks, {320, 240}).fit,
                                                          moved.fit(landmarks, {320, 240}).fit),
                  3);
    }
}

INSTANTIATE_TEST_SUITE_P(All, JointKernelsTest,
                         testing::Values(Case{"facing", ContourMode::front_facing, "ekman6"},
                                         Case{"facing_arkit", ContourMode::front_facing, "arkit47"},
                                         Case{"facing_focal", ContourMode::front_facing, "ekman6", true},
                                         Case{"facing_arkit_focal", ContourMode::front_facing, "arkit47", true},
                                         Case{"both", ContourMode::both, "ekman6"},
                                         Case{"both_arkit", ContourMode::both, "arkit47"}),
                         [](const auto& info) { return std::string(info.param.name); });

} // namespace
} // namespace lineament
