// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The scheme mediapipe478 of the committed default model.
#include "lineament/fit/face_fitter.hpp"
#include "lineament/io/model_file.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <set>

namespace lineament {
namespace {

const MorphableModel& committed_model()
{
    static const MorphableModel model = load_model(LINEAMENT_SOURCE_DIR "/models/lineament-face-1.safetensors");
    return model;
}

const LandmarkMap& mesh_map()
{
    return *committed_model().find_landmark_map("mediapipe478");
}

Eigen::Matrix3Xf points_on(const std::string& scheme, const Eigen::VectorXf& shape)
{
    return committed_model().find_landmark_map(scheme)->points_on(
        Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, shape.size() / 3));
}

/// Places each of the points lies away from being the mirror image of another, mm: the largest.
float asymmetry(const Eigen::Matrix3Xf& points)
{
    float largest = 0.0f;
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
        const Eigen::Vector3f image(-points(0, i), points(1, i), points(2, i));
        largest = std::max(largest, (points.colwise() - image).colwise().norm().minCoeff());
    }
    return largest;
}

TEST(MediapipeScheme, EachPointLiesInATriangleOfTheCoarsestLevel)
{
    const LandmarkMap& map = mesh_map();
    ASSERT_EQ(map.num_landmarks(), 478);
    const Level& coarsest = committed_model().levels.front();
    std::map<std::set<int>, std::string> group_of;
    for (Eigen::Index t = 0; t < coarsest.triangles.cols(); ++t) {
        const auto corners = coarsest.triangles.col(t);
        group_of[{corners[0], corners[1], corners[2]}] =
            committed_model().triangle_group_names[static_cast<std::size_t>(coarsest.triangle_groups[t])];
    }
    for (int i = 0; i < 478; ++i) {
        EXPECT_EQ(map.names[static_cast<std::size_t>(i)], std::to_string(i));
        EXPECT_GE(map.weights.col(i).minCoeff(), 0.0f) << i;
        EXPECT_NEAR(map.weights.col(i).sum(), 1.0f, 1e-6f) << i;
        EXPECT_EQ((group_of[{map.vertices(0, i), map.vertices(1, i), map.vertices(2, i)}]), i < 468 ? "skin" : "eyes")
            << i;
    }
}

TEST(MediapipeScheme, LeftIsTheMirrorImageOfRight)
{
    const MorphableModel& model = committed_model();
    EXPECT_LE(asymmetry(points_on("mediapipe478", model.shape.mean)), 1e-3f);
    // By mirrored vertices too, so that it holds for every symmetric face: here one of a symmetric mode.
    Eigen::VectorXf symmetric = model.shape.mean;
    const Eigen::VectorXf& mode = model.shape.basis.col(0);
    for (Eigen::Index v = 0; v < model.num_vertices(); ++v) {
        const Eigen::Index partner = 3 * model.mirror[v];
        const Eigen::Vector3f image(-mode[partner], mode[partner + 1], mode[partner + 2]);
        symmetric.segment<3>(3 * v) += 200.0f * (mode.segment<3>(3 * v) + image);
    }
    EXPECT_LE(asymmetry(points_on("mediapipe478", symmetric)), 1e-2f);
    // The twin: a face turned by 2 degrees is not symmetric.
    const Eigen::Matrix3f turn = rotation_from_angles({radians(2), 0, 0}).cast<float>() *
                                 rotation_from_angles({0, 0, 0}).transpose().cast<float>();
    EXPECT_GT(asymmetry(turn * points_on("mediapipe478", model.shape.mean)), 0.5f);
}

TEST(MediapipeScheme, PointsLieWhereIbugMarksTheSame)
{
    const Eigen::Matrix3Xf mesh = points_on("mediapipe478", committed_model().shape.mean);
    const Eigen::Matrix3Xf ibug = points_on("ibug68", committed_model().shape.mean);
    const auto distance = [&](int point, int number) { return (mesh.col(point) - ibug.col(number - 1)).norm(); };
    for (const auto& [point, number] : std::vector<std::pair<int, int>>{{33, 37}, {133, 40}, {362, 43}, {263, 46}}) {
        EXPECT_LT(distance(point, number), 2.0f) << point; // eye corners
    }
    for (const auto& [point, number] :
         std::vector<std::pair<int, int>>{{61, 49}, {0, 52}, {291, 55}, {17, 58}, {4, 31}, {1, 31}, {152, 9}}) {
        EXPECT_LT(distance(point, number), 8.0f) << point; // lips, tip of the nose, chin
    }
    EXPECT_GT(distance(33, 46), 80.0f); // the twin: the subject's right is not the left
    EXPECT_LT(mesh(0, 33), 0.0f);
}

TEST(MediapipeScheme, LipsAndLidsMoveWithTheirSide)
{
    const MorphableModel& model = committed_model();
    const Blendshapes& set = *model.find_expression_set("arkit47");
    const auto rise = [&](const std::string& name, int point) {
        const auto k = std::find(set.names.begin(), set.names.end(), name) - set.names.begin();
        const Eigen::VectorXf moved = model.shape.mean + set.offsets.col(k);
        return points_on("mediapipe478", moved)(1, point) - points_on("mediapipe478", model.shape.mean)(1, point);
    };
    for (const int point : {81, 82, 13, 312, 311}) {
        EXPECT_GT(rise("jawOpen", point), -3.0f) << point; // upper lip, inner edge
    }
    for (const int point : {178, 87, 14, 317, 402}) {
        EXPECT_LT(rise("jawOpen", point), -20.0f) << point; // lower lip, inner edge
    }
    EXPECT_LT(rise("eyeBlinkRight", 159), -5.0f);
    EXPECT_GT(rise("eyeBlinkRight", 145), -1.0f);
    EXPECT_GT(rise("eyeBlinkLeft", 159), -0.1f);
}

TEST(MediapipeScheme, NoiseIsPositiveSymmetricAndInfiniteForTheIrises)
{
    const Eigen::VectorXf& noise = mesh_map().noise_mm.at("mediapipe");
    ASSERT_EQ(noise.size(), 478);
    EXPECT_GT(noise.head<468>().minCoeff(), 1.0f);
    EXPECT_LT(noise.head<468>().maxCoeff(), 20.0f);
    EXPECT_TRUE(noise.tail<10>().array().isInf().all());
    EXPECT_EQ(noise[33], noise[263]);
    EXPECT_LT(noise[33], noise[127]); // eye corner against oval
}

TEST(MediapipeScheme, FitsPlantedFacesNearerThanTheMean)
{
    const MorphableModel& model = committed_model();
    const FaceFitter fitter(model, "mediapipe478"); // default options: there is no outline to match
    FitOptions trusting; // of points that err together the map says more noise than these have
    trusting.regularization = 0.02;
    trusting.iterations = 20;
    const FaceFitter trusting_fitter(model, "mediapipe478", trusting);
    Random random(61);
    double fitted = 0.0;
    double fitted_trusting = 0.0;
    double unfitted = 0.0;
    for (int trial = 0; trial < 5; ++trial) {
        const Eigen::VectorXd alpha = test::random_normal(random, model.shape.num_coefficients());
        const Eigen::VectorXd psi = test::random_uniform(random, 6, 0.0, 0.5);
        const Camera camera = test::random_camera(random, 30);
        LandmarkSet landmarks = test::project_landmarks(model, "mediapipe478", alpha, psi, camera, 1.0, random);
        const FitResult fit = fitter.fit(landmarks, camera.principal_point_px);
        EXPECT_NE(fit.status, FitStatus::degenerate) << fit.reason;
        EXPECT_LT(fit.rms_px, 4.0);
        EXPECT_EQ(fit.landmarks[470].weight, 0.0); // an iris
        EXPECT_GT(fit.landmarks[127].weight, 0.0); // the oval
        const Eigen::Matrix3Xf truth = points_on("mediapipe478", model.shape.instance(alpha));
        fitted += (points_on("mediapipe478", neutral_shape_of(model, fit)) - truth).colwise().norm().mean();
        const FitResult nearer = trusting_fitter.fit(landmarks, camera.principal_point_px);
        fitted_trusting += (points_on("mediapipe478", neutral_shape_of(model, nearer)) - truth).colwise().norm().mean();
        unfitted += (points_on("mediapipe478", model.shape.mean) - truth).colwise().norm().mean();
        // The twin: numbers of another order are no face.
        for (std::size_t i = 0; i < 468; ++i) {
            landmarks.landmarks[i].name = std::to_string((i * 7) % 468);
        }
        EXPECT_GT(fitter.fit(landmarks, camera.principal_point_px).rms_px, 20.0);
    }
    EXPECT_LT(fitted, 0.8 * unfitted);
    EXPECT_LT(fitted_trusting, 0.65 * unfitted);
}

} // namespace
} // namespace lineament
