// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/core/procrustes.hpp"

#include "lineament/core/random.hpp"
#include "support/matchers.hpp"

#include <Eigen/Geometry>

namespace lineament {
namespace {

Eigen::Matrix3Xd random_points(Random& random, int count)
{
    Eigen::Matrix3Xd points(3, count);
    for (int i = 0; i < count; ++i) {
        points.col(i) << random.normal(), random.normal(), random.normal();
    }
    return points;
}

TEST(AlignPoints, RecoversAPlantedSimilarity)
{
    Random random(5);
    for (int i = 0; i < 50; ++i) {
        const Eigen::Vector3d axis = random_points(random, 1).col(0).normalized();
        const Similarity truth{random.uniform(0.2, 5.0),
                               Eigen::AngleAxisd(random.uniform(-3.1, 3.1), axis).toRotationMatrix(),
                               Eigen::Vector3d(random_points(random, 1).col(0))};
        const Eigen::Matrix3Xd points = random_points(random, 10);
        const Similarity found = align_points(points, truth * points);
        EXPECT_NEAR(found.scale, truth.scale, 1e-10);
        EXPECT_THAT(found.rotation, test::IsNear(truth.rotation, 1e-10));
        EXPECT_THAT(found.translation, test::IsNear(truth.translation, 1e-10));
    }
}

TEST(AlignPoints, NeverReflects)
{
    Random random(6);
    const Eigen::Matrix3Xd points = random_points(random, 10);
    Eigen::Matrix3Xd mirrored = points;
    mirrored.row(0) *= -1.0;
    EXPECT_NEAR(align_points(points, mirrored).rotation.determinant(), 1.0, 1e-12);
}

TEST(AlignPoints, NoSmallChangeImprovesTheFit)
{
    Random random(7);
    const Eigen::Matrix3Xd source = random_points(random, 12);
    const Eigen::Matrix3Xd target = random_points(random, 12);
    const Similarity best = align_points(source, target);
    const double error = (target - best * source).squaredNorm();
    for (int i = 0; i < 200; ++i) {
        Similarity other = best;
        other.scale *= 1.0 + 1e-3 * random.normal();
        other.translation += 1e-3 * random_points(random, 1).col(0);
        other.rotation = Eigen::AngleAxisd(1e-3, random_points(random, 1).col(0).normalized()) * best.rotation;
        EXPECT_GT((target - other * source).squaredNorm(), error);
    }
}

TEST(AlignPoints, FixedScaleStaysOne)
{
    Random random(8);
    const Eigen::Matrix3Xd points = random_points(random, 10);
    EXPECT_EQ(align_points(points, 2.0 * points, AlignmentScale::fixed).scale, 1.0);
}

TEST(AlignPoints, RefusesDifferentCounts)
{
    EXPECT_TRUE(test::throws<InvalidArgument>(
        [] { (void)align_points(Eigen::Matrix3Xd::Zero(3, 4), Eigen::Matrix3Xd::Zero(3, 5)); }, "target"));
}

} // namespace
} // namespace lineament
