// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/model/morphable_model.hpp"

#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

namespace lineament {
namespace {

using test::IsNear;

const MorphableModel& model()
{
    static const MorphableModel face = test::make_synthetic_face();
    return face;
}

TEST(PcaModel, CoefficientsInvertInstance)
{
    Random random(1);
    for (const int level : {0, 1}) {
        const PcaModel shape = model().at_level(level).shape;
        const Eigen::VectorXd alpha = test::random_normal(random, shape.num_coefficients());
        EXPECT_THAT(shape.coefficients(shape.instance(alpha)), IsNear(alpha, 1e-4)); // float vertices
    }
}

TEST(PcaModel, InstanceIsTheMeanPlusTheRescaledBasis)
{
    Random random(2);
    const PcaModel& shape = model().shape;
    const Eigen::VectorXd alpha = test::random_normal(random, shape.num_coefficients());
    const Eigen::VectorXd expected = shape.mean.cast<double>() + shape.rescaled_basis().cast<double>() * alpha;
    EXPECT_THAT(shape.instance(alpha), IsNear(expected, 1e-3));
    EXPECT_EQ(shape.instance(Eigen::VectorXd()), shape.mean);
}

TEST(PcaModel, MissingTrailingCoefficientsAreZero)
{
    Random random(3);
    const PcaModel& shape = model().shape;
    const Eigen::VectorXd few = test::random_normal(random, 3);
    Eigen::VectorXd padded = Eigen::VectorXd::Zero(shape.num_coefficients());
    padded.head(3) = few;
    EXPECT_THAT(shape.instance(few), IsNear(shape.instance(padded), 1e-4));
    EXPECT_THAT(shape.truncate(3).instance(few), IsNear(shape.instance(few), 1e-4));
    EXPECT_EQ(shape.truncate(3).num_coefficients(), 3);
}

TEST(PcaModel, BrokenInputThrows)
{
    const PcaModel& shape = model().shape;
    Eigen::VectorXd alpha = Eigen::VectorXd::Zero(13);
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)shape.instance(alpha); }, "at most 12", "13"));
    alpha = Eigen::VectorXd::Constant(2, std::nan(""));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)shape.instance(alpha); }, "nan"));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)shape.truncate(13); }, "count"));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)shape.truncate(-1); }, "count"));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)shape.first_vertices(99999); }, "count"));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)shape.coefficients(Eigen::VectorXf::Zero(5)); }, "vector"));
}

TEST(Blendshapes, DisplacementIsLinear)
{
    const Blendshapes& set = model().expression_sets[0];
    const Eigen::VectorXd one = Eigen::Vector4d(0.2, 0, 0.5, 1);
    const Eigen::VectorXd other = Eigen::Vector4d(0.1, 0.3, 0, 0);
    EXPECT_THAT(set.displacement(one + 2 * other),
                IsNear(Eigen::VectorXf(set.displacement(one) + 2 * set.displacement(other)), 1e-4));
    EXPECT_THAT(set.displacement(Eigen::VectorXd::Unit(4, 2)), IsNear(Eigen::VectorXf(set.offsets.col(2)), 0.0));
    EXPECT_TRUE(set.displacement(Eigen::VectorXd()).isZero(0));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)set.displacement(Eigen::VectorXd::Zero(5)); }, "at most 4"));
}

TEST(MorphableModel, ACoarserLevelIsTheLeadingVerticesOfTheWhole)
{
    Random random(4);
    const MorphableModel coarse = model().at_level(0);
    const Eigen::VectorXd alpha = test::random_normal(random, 12);
    const Eigen::Index count = coarse.num_vertices();
    ASSERT_LT(count, model().num_vertices());
    EXPECT_THAT(coarse.shape.instance(alpha),
                IsNear(Eigen::VectorXf(model().shape.instance(alpha).head(3 * count)), 1e-4));
    EXPECT_EQ(coarse.levels.size(), 1u);
    EXPECT_EQ(coarse.mirror.size(), count);
    EXPECT_EQ(coarse.masks.at("face").size(), count);
    EXPECT_EQ(coarse.color->num_vertices(), count);
    EXPECT_EQ(coarse.expression_sets[0].offsets.rows(), 3 * count);
    EXPECT_LT(coarse.levels.back().triangles.maxCoeff(), count);
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)model().at_level(2); }, "level"));
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)model().at_level(-1); }, "level"));
}

TEST(MorphableModel, FinestLevelIsTheModelItself)
{
    const MorphableModel same = model().at_level(1);
    EXPECT_EQ(same.shape.mean, model().shape.mean);
    EXPECT_EQ(same.levels.size(), model().levels.size());
}

TEST(MorphableModel, LandmarksAreTheSameAtEveryLevel)
{
    const MorphableModel coarse = model().at_level(0);
    const LandmarkMap& map = model().landmark_maps[0];
    const auto points = [&](const MorphableModel& face) {
        return map.points_on(face.mesh_of(face.shape.mean).vertices);
    };
    EXPECT_EQ(points(coarse), points(model()));
}

TEST(LandmarkMap, PointsAreBarycentric)
{
    LandmarkMap map;
    map.vertices.resize(3, 1);
    map.vertices.col(0) = Eigen::Vector3i(0, 1, 2);
    map.weights.resize(3, 1);
    map.weights.col(0) = Eigen::Vector3f(0.5f, 0.25f, 0.25f);
    Eigen::Matrix3Xf vertices(3, 3);
    vertices << 4, 0, 8, 0, 4, 0, 0, 0, 8;
    EXPECT_THAT(map.points_on(vertices), IsNear(Eigen::Vector3f(4, 1, 2), 1e-6));
    EXPECT_EQ(map.index_of("1"), -1);
    EXPECT_EQ(model().landmark_maps[0].index_of("68"), 67);
}

TEST(MorphableModel, MeshOfRejectsAnotherSize)
{
    EXPECT_TRUE(
        test::throws<InvalidArgument>([&] { (void)model().mesh_of(Eigen::VectorXf::Zero(3)); }, "shape_vector"));
    EXPECT_EQ(model().find_expression_set("none"), nullptr);
    EXPECT_EQ(model().find_landmark_map("none"), nullptr);
}

} // namespace
} // namespace lineament
