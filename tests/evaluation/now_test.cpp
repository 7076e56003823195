// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/evaluation/now.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <Eigen/Geometry>

namespace lineament {
namespace {

struct Face
{
    Eigen::Matrix3Xd vertices;
    Eigen::Matrix3Xi triangles;
    NowPoints points;
};

Face make_face()
{
    const MorphableModel model = test::make_synthetic_face();
    Face face;
    const Mesh mesh = model.mesh_of(model.shape.mean);
    face.vertices = mesh.vertices.cast<double>();
    face.triangles = mesh.triangles;
    const LandmarkMap& map = *model.find_landmark_map("ibug68");
    for (int i = 0; i < 7; ++i) {
        face.points.col(i) =
            face.vertices.col(map.vertices(0, map.index_of(now_point_names[static_cast<std::size_t>(i)])));
    }
    return face;
}

double largest(const std::vector<double>& values)
{
    return *std::max_element(values.begin(), values.end());
}

TEST(Now, IdenticalFacesAreZeroApartWhateverTheirPose)
{
    const Face face = make_face();
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    const Similarity moved{1.3, rotation, Eigen::Vector3d(10, 20, 30)};
    const NowResult result = evaluate_now(face.vertices, face.points, moved * face.vertices, face.triangles,
                                          moved * Eigen::Matrix3Xd(face.points));
    EXPECT_LE(largest(result.distances_mm), 1e-6);
    EXPECT_NEAR(result.scan_from_prediction.scale, 1 / 1.3, 1e-9);
}

TEST(Now, MetricalEvaluationSeesAWrongSize)
{
    const Face face = make_face();
    const NowResult metrical = evaluate_now(face.vertices, face.points, 1.1 * face.vertices, face.triangles,
                                            1.1 * face.points, AlignmentScale::fixed);
    EXPECT_EQ(metrical.scan_from_prediction.scale, 1.0);
    EXPECT_GT(largest(metrical.distances_mm), 1.0);
}

TEST(Now, ARaisedPointIsAsFarAsItWasRaised)
{
    Face face = make_face();
    Face raised = face;
    int nearest = 0;
    (face.vertices.colwise() - Eigen::Vector3d(face.points.col(4))).colwise().norm().minCoeff(&nearest);
    raised.vertices.col(nearest) += Eigen::Vector3d(0, 0, 5.0); // one scan vertex of hundreds: the pose hardly moves
    const NowResult result = evaluate_now(raised.vertices, face.points, face.vertices, face.triangles, face.points);
    EXPECT_GT(largest(result.distances_mm), 3.0);
    EXPECT_LE(largest(result.distances_mm), 5.2);
}

TEST(Now, RefusesAScanWithoutVerticesInTheCrop)
{
    const Face face = make_face();
    const Eigen::Matrix3Xd far = face.vertices.array() + 1e5;
    EXPECT_TRUE(test::throws<InvalidArgument>(
        [&] { (void)evaluate_now(far, face.points, face.vertices, face.triangles, face.points); }, "crop"));
}

} // namespace
} // namespace lineament
