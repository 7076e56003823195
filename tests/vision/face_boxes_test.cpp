// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "face_boxes.hpp"

#include "support/matchers.hpp"

namespace lineament {
namespace {

/// A square of side 10, the eyes at 3 and 7 of it.
BoxedFace face(double left, double top, double score)
{
    return {.box = {Eigen::Vector2d(left, top), Eigen::Vector2d(left + 10, top + 10)},
            .right_eye = {left + 3, top + 4},
            .left_eye = {left + 7, top + 4},
            .score = score};
}

TEST(IntersectionOverUnion, IsSharedAreaOverJointArea)
{
    const Eigen::AlignedBox2d box = face(0, 0, 1).box;
    EXPECT_EQ(intersection_over_union(box, box), 1.0);
    EXPECT_DOUBLE_EQ(intersection_over_union(box, face(5, 5, 1).box), 25.0 / 175.0);
    EXPECT_EQ(intersection_over_union(box, face(10, 0, 1).box), 0.0);
    EXPECT_EQ(intersection_over_union(box, face(30, 0, 1).box), 0.0);
    EXPECT_DOUBLE_EQ(intersection_over_union(box, {Eigen::Vector2d(2, 2), Eigen::Vector2d(4, 7)}), 0.1);
}

TEST(BlendOverlapping, GivesTheMeanWeightedByScoreWithTheBestScore)
{
    // Overlaps with the best one: 90 of 110, and none.
    std::vector<BoxedFace> faces = {face(1, 0, 0.4), face(100, 50, 0.9), face(0, 0, 0.8)};
    blend_overlapping(faces);
    ASSERT_EQ(faces.size(), 2u);
    EXPECT_THAT(faces[0].box.min(), test::IsNear(Eigen::Vector2d(100, 50), 1e-12));
    EXPECT_EQ(faces[0].score, 0.9);
    EXPECT_THAT(faces[1].box.min(), test::IsNear(Eigen::Vector2d(1.0 / 3.0, 0), 1e-12)); // (0.8 * 0 + 0.4 * 1) / 1.2
    EXPECT_THAT(faces[1].box.max(), test::IsNear(Eigen::Vector2d(10.0 + 1.0 / 3.0, 10), 1e-12));
    EXPECT_THAT(faces[1].right_eye, test::IsNear(Eigen::Vector2d(3.0 + 1.0 / 3.0, 4), 1e-12));
    EXPECT_THAT(faces[1].left_eye, test::IsNear(Eigen::Vector2d(7.0 + 1.0 / 3.0, 4), 1e-12));
    EXPECT_EQ(faces[1].score, 0.8);
}

TEST(BlendOverlapping, GroupsAroundTheBestBoxOnlyAndOnlyAbove3Tenths)
{
    // The middle one overlaps both others by 6 / 14; these overlap each other by 2 / 18.
    std::vector<BoxedFace> faces = {face(0, 0, 0.9), face(4, 0, 0.5), face(8, 0, 0.7)};
    blend_overlapping(faces);
    ASSERT_EQ(faces.size(), 2u);
    EXPECT_NEAR(faces[0].box.min().x(), 4 * 0.5 / 1.4, 1e-12);
    EXPECT_EQ(faces[1].box.min().x(), 8.0);
    // Below and above 0.3: 4.5 / 15.5 = 0.290, 4.7 / 15.3 = 0.307.
    faces = {face(0, 0, 0.9), face(5.5, 0, 0.5)};
    blend_overlapping(faces);
    EXPECT_EQ(faces.size(), 2u);
    faces = {face(0, 0, 0.9), face(5.3, 0, 0.5)};
    blend_overlapping(faces);
    EXPECT_EQ(faces.size(), 1u);
    faces.clear();
    blend_overlapping(faces);
    EXPECT_TRUE(faces.empty());
}

TEST(MergeFaces, AddsNewOnesAndReplacesThoseOfLowerScore)
{
    std::vector<BoxedFace> faces = {face(0, 0, 0.6), face(50, 0, 0.8)};
    std::vector<BoxedFace> other = {face(1, 0, 0.7), face(51, 0, 0.7), face(90, 0, 0.5)};
    merge_faces(faces, other);
    ASSERT_EQ(faces.size(), 3u);
    EXPECT_EQ(faces[0].box.min().x(), 1.0); // better than the one it overlaps
    EXPECT_EQ(faces[0].score, 0.7);
    EXPECT_EQ(faces[1].box.min().x(), 50.0); // worse: dropped
    EXPECT_EQ(faces[2].box.min().x(), 90.0); // overlaps none: added
    ASSERT_EQ(other.size(), 2u);             // the losers
    EXPECT_EQ(other[0].box.min().x(), 0.0);
    EXPECT_EQ(other[1].box.min().x(), 51.0);
}

TEST(MakeAnchors, AreTheCentresOfTheCellsRowByRow)
{
    const std::vector<Eigen::Vector2d> near = make_anchors(128);
    ASSERT_EQ(near.size(), 896u);
    // 16 x 16 cells of 8 px, two anchors in each; then 8 x 8 cells of 16 px, six in each.
    for (const auto& [i, x, y] : {std::tuple(0, 4, 4),
                                  {1, 4, 4},
                                  {2, 12, 4},
                                  {31, 124, 4},
                                  {32, 4, 12},
                                  {511, 124, 124},
                                  {512, 8, 8},
                                  {517, 8, 8},
                                  {518, 24, 8},
                                  {560, 8, 24},
                                  {895, 120, 120}}) {
        EXPECT_EQ(near[static_cast<std::size_t>(i)], Eigen::Vector2d(x, y)) << i;
    }
    const std::vector<Eigen::Vector2d> far = make_anchors(192);
    ASSERT_EQ(far.size(), 2304u); // 48 x 48 cells of 4 px
    for (const auto& [i, x, y] : {std::tuple(0, 2, 2), {1, 6, 2}, {47, 190, 2}, {48, 2, 6}, {2303, 190, 190}}) {
        EXPECT_EQ(far[static_cast<std::size_t>(i)], Eigen::Vector2d(x, y)) << i;
    }
}

} // namespace
} // namespace lineament
