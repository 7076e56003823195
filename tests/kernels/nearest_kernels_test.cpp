// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The kernels that find what is nearest, the same of every instruction set.
#include "lineament/core/random.hpp"
#include "lineament/kernels/aligned_buffer.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"
#include "lineament/kernels/scalar_kernels.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace lineament::kernels {
namespace {

class NearestKernelsTest : public ::testing::TestWithParam<const Kernels*>
{
protected:
    const Kernels& kernels = *GetParam();
    Random random{91};
};

INSTANTIATE_TEST_SUITE_P(Sets, NearestKernelsTest, ::testing::ValuesIn(supported_kernels()),
                         [](const auto& set) { return std::string(set.param->name); });

TEST_P(NearestKernelsTest, FindsTheFirstNearestPoint)
{
    constexpr double infinity = std::numeric_limits<double>::infinity();
    for (const int count : {1, 2, 7, 8, 9, 21, 104}) {
        AlignedBuffer<double> u(round_up(count, 8));
        AlignedBuffer<double> v(u.size());
        AlignedBuffer<double> squared(u.size());
        AlignedBuffer<double> expected(u.size());
        std::fill_n(u.data(), u.size(), infinity);
        std::fill_n(v.data(), v.size(), infinity);
        for (int i = 0; i < count; ++i) { // whole numbers, so that many distances are equal
            u[i] = std::round(random.uniform(-3, 3));
            v[i] = std::round(random.uniform(-3, 3));
        }
        for (int trial = 0; trial < 20; ++trial) {
            const double to_u = trial % 2 == 0 ? std::round(random.uniform(-3, 3)) : random.normal();
            const double to_v = trial % 2 == 0 ? std::round(random.uniform(-3, 3)) : random.normal();
            const int nearest = kernels.nearest_point(u.data(), v.data(), count, to_u, to_v, squared.data());
            EXPECT_EQ(nearest, scalar::nearest_point(u.data(), v.data(), count, to_u, to_v, expected.data()));
            EXPECT_EQ(squared[nearest], expected[nearest]);
            EXPECT_EQ(squared[nearest], *std::min_element(expected.data(), expected.data() + count));
            EXPECT_EQ(nearest, std::min_element(expected.data(), expected.data() + count) - expected.data());
        }
        std::fill_n(u.data(), count, infinity); // none is left
        EXPECT_EQ(squared[kernels.nearest_point(u.data(), v.data(), count, 1, 2, squared.data())], infinity);
    }
}

TEST_P(NearestKernelsTest, FindsTheFirstNearestPointOfEach)
{
    for (const int count : {1, 2, 7, 8, 9, 21, 104}) {
        for (const int num_to : {1, 2, 7, 8, 11}) {
            AlignedBuffer<double> u(count), v(count), to_u(round_up(num_to, 8)), to_v(round_up(num_to, 8));
            for (AlignedBuffer<double>* values : {&u, &v, &to_u, &to_v}) { // whole numbers: many distances are equal
                std::generate_n(values->data(), values->size(), [&] { return std::round(random.uniform(-3, 3)); });
            }
            std::vector<int> nearest(num_to, -1);
            std::vector<int> plain(num_to, -1);
            kernels.nearest_points(u.data(), v.data(), count, to_u.data(), to_v.data(), num_to, nearest.data());
            scalar::nearest_points(u.data(), v.data(), count, to_u.data(), to_v.data(), num_to, plain.data());
            EXPECT_EQ(nearest, plain);
            AlignedBuffer<double> squared(count);
            for (int j = 0; j < num_to; ++j) {
                EXPECT_EQ(nearest[j],
                          scalar::nearest_point(u.data(), v.data(), count, to_u[j], to_v[j], squared.data()));
            }
        }
    }
}

TEST_P(NearestKernelsTest, FindsTheFirstNearestSegmentOfEach)
{
    for (const int count : {1, 2, 9, 33}) {
        for (const int num_to : {1, 7, 8, 11}) {
            // Corners at whole numbers: many distances are equal, and some segments have no length.
            Eigen::MatrixX2d corners(count + 1, 2);
            AlignedBuffer<double> segments(5 * count), to_u(round_up(num_to, 8)), to_v(round_up(num_to, 8));
            for (double& corner : corners.reshaped()) {
                corner = std::round(random.uniform(-3, 3));
            }
            Eigen::Map<Eigen::MatrixXd> columns(segments.data(), count, 5);
            columns.leftCols<2>() = corners.topRows(count);
            columns.middleCols<2>(2) = corners.bottomRows(count) - corners.topRows(count);
            columns.col(4) = (columns.middleCols<2>(2).rowwise().squaredNorm().array() > 0)
                                 .select(columns.middleCols<2>(2).rowwise().squaredNorm().cwiseInverse(), 0.0);
            for (AlignedBuffer<double>* values : {&to_u, &to_v}) {
                std::generate_n(values->data(), values->size(), [&] { return std::round(random.uniform(-3, 3)); });
            }
            std::vector<int> nearest(num_to, -1), plain(num_to, -1);
            kernels.nearest_segments(segments.data(), count, count, to_u.data(), to_v.data(), num_to, nearest.data());
            scalar::nearest_segments(segments.data(), count, count, to_u.data(), to_v.data(), num_to, plain.data());
            EXPECT_EQ(nearest, plain);
            for (int j = 0; j < num_to; ++j) { // against points all along each segment
                const auto distance_to = [&](int segment) {
                    const Eigen::RowVector2d to(to_u[j], to_v[j]);
                    const Eigen::RowVector2d along = columns.block<1, 2>(segment, 2);
                    double least = std::numeric_limits<double>::infinity();
                    for (int k = 0; k <= 5040; ++k) {
                        least = std::min(least, (corners.row(segment) + k / 5040.0 * along - to).norm());
                    }
                    return least;
                };
                for (int i = 0; i < count; ++i) {
                    const double difference = distance_to(i) - distance_to(nearest[j]);
                    EXPECT_GT(difference, i < nearest[j] ? 1e-9 : -1e-3) << i << " before " << nearest[j];
                }
            }
        }
    }
}

} // namespace
} // namespace lineament::kernels
