// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The kernels in double precision of every instruction set this machine has, against Eigen.
#include "lineament/core/random.hpp"
#include "lineament/kernels/aligned_buffer.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/matchers.hpp"

#include <Eigen/Cholesky>

#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

namespace lineament::kernels {
namespace {

using test::IsNear;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

AlignedBuffer<double> random_doubles(Random& random, std::size_t size)
{
    AlignedBuffer<double> values(size);
    for (std::size_t i = 0; i < size; ++i) {
        values[i] = random.normal();
    }
    return values;
}

Eigen::MatrixXd matrix_of(const AlignedBuffer<double>& values, Eigen::Index rows, Eigen::Index columns)
{
    return Eigen::Map<const RowMajor>(values.data(), rows, columns);
}

class DoubleKernelsTest : public ::testing::TestWithParam<const Kernels*>
{
protected:
    const Kernels& kernels = *GetParam();
    Random random{92};
};

INSTANTIATE_TEST_SUITE_P(Sets, DoubleKernelsTest, ::testing::ValuesIn(supported_kernels()),
                         [](const auto& set) { return std::string(set.param->name); });

TEST_P(DoubleKernelsTest, MultipliesRowsAndTheirTranspose)
{
    for (const int width : {8, 40, 72}) {
        for (const int num_rows : {0, 1, 7, 24}) {
            const AlignedBuffer<double> rows = random_doubles(random, static_cast<std::size_t>(num_rows) * width);
            const AlignedBuffer<double> x = random_doubles(random, width);
            const AlignedBuffer<double> factors = random_doubles(random, num_rows);
            AlignedBuffer<double> product(num_rows);
            AlignedBuffer<double> sums = random_doubles(random, width);
            const Eigen::MatrixXd before = matrix_of(sums, width, 1);
            kernels.multiply_double_rows(rows.data(), num_rows, width, x.data(), product.data());
            kernels.add_double_rows(rows.data(), num_rows, width, factors.data(), sums.data());
            const Eigen::MatrixXd matrix = matrix_of(rows, num_rows, width);
            EXPECT_THAT(matrix_of(product, num_rows, 1), IsNear(matrix * matrix_of(x, width, 1), 1e-13));
            EXPECT_THAT(matrix_of(sums, width, 1),
                        IsNear(before + matrix.transpose() * matrix_of(factors, num_rows, 1), 1e-13));
        }
    }
}

TEST_P(DoubleKernelsTest, ProjectsPointsEachByItsJacobian)
{
    const int width = 24, out_width = 32, num_points = 5;
    const AlignedBuffer<double> rows = random_doubles(random, 3 * num_points * width);
    const AlignedBuffer<double> jacobians = random_doubles(random, 6 * num_points);
    AlignedBuffer<float> out(2 * num_points * out_width);
    kernels.project_points(rows.data(), width, num_points, jacobians.data(), out.data(), out_width);
    Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(2 * num_points, out_width); // the other columns are left alone
    for (int i = 0; i < num_points; ++i) {
        expected.block(2 * i, 0, 2, width) = matrix_of(jacobians, 2 * num_points, 3).middleRows(2 * i, 2) *
                                             matrix_of(rows, 3 * num_points, width).middleRows(3 * i, 3);
    }
    const Eigen::MatrixXd projected =
        Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
            out.data(), 2 * num_points, out_width)
            .cast<double>();
    EXPECT_THAT(projected, IsNear(expected, 1e-6));
}

TEST_P(DoubleKernelsTest, AddsGramMatrixOfLowerTriangle)
{
    for (const int n : {1, 8, 21, 40, 70}) {
        const int width = round_up(n, double_step);
        AlignedBuffer<double> lower = random_doubles(random, n * width);
        Eigen::Map<RowMajor>(lower.data(), n, width).triangularView<Eigen::StrictlyUpper>().setZero();
        AlignedBuffer<double> gram = random_doubles(random, width * width);
        const Eigen::MatrixXd before = matrix_of(gram, width, width);
        kernels.add_lower_gram(lower.data(), n, width, gram.data());
        const Eigen::MatrixXd matrix = matrix_of(lower, n, width);
        const Eigen::MatrixXd expected = before + matrix.transpose() * matrix;
        EXPECT_THAT(Eigen::MatrixXd(matrix_of(gram, width, width).triangularView<Eigen::Upper>()),
                    IsNear(Eigen::MatrixXd(expected.triangularView<Eigen::Upper>()), 1e-12));
    }
}

TEST_P(DoubleKernelsTest, FactorsAndSolves)
{
    for (const int n : {1, 3, 4, 8, 15, 16, 47, 72}) {
        const int num_more = 5; // further columns
        const int width = round_up(n + num_more, double_step);
        const Eigen::MatrixXd rows = matrix_of(random_doubles(random, 2 * n * n), 2 * n, n);
        const Eigen::MatrixXd a = rows.transpose() * rows + Eigen::MatrixXd::Identity(n, n);
        const Eigen::MatrixXd more = matrix_of(random_doubles(random, n * num_more), n, num_more);
        const Eigen::VectorXd expected = matrix_of(random_doubles(random, n), n, 1);
        AlignedBuffer<double> system(n * width);
        Eigen::Map<RowMajor> in_place(system.data(), n, width);
        in_place.leftCols(n) = a.triangularView<Eigen::Upper>();
        in_place.triangularView<Eigen::StrictlyLower>().setConstant(std::numeric_limits<double>::quiet_NaN());
        in_place.middleCols(n, num_more) = more;
        AlignedBuffer<double> x(round_up(n, double_step));
        Eigen::Map<Eigen::VectorXd>(x.data(), n) = a * expected;
        const double pivot = kernels.factor_positive(system.data(), n, width);
        kernels.solve_factored(system.data(), n, width, x.data());

        const Eigen::MatrixXd u = Eigen::MatrixXd(in_place.leftCols(n).triangularView<Eigen::Upper>());
        const Eigen::LLT<Eigen::MatrixXd> cholesky(a);
        EXPECT_THAT(u, IsNear(Eigen::MatrixXd(cholesky.matrixU()), 1e-12 * n)) << n;
        EXPECT_THAT(Eigen::MatrixXd(in_place.middleCols(n, num_more)),
                    IsNear(Eigen::MatrixXd(cholesky.matrixL().solve(more)), 1e-12 * n));
        EXPECT_THAT(Eigen::VectorXd(Eigen::Map<Eigen::VectorXd>(x.data(), n)), IsNear(expected, 1e-10)) << n;
        for (const int leading : {n, (n + 1) / 2}) {
            const int inverse_width = round_up(leading, double_step);
            AlignedBuffer<double> inverse = random_doubles(random, static_cast<std::size_t>(leading) * inverse_width);
            kernels.invert_factor(system.data(), leading, width, inverse.data(), inverse_width);
            const Eigen::MatrixXd all = matrix_of(inverse, leading, inverse_width);
            const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(leading, inverse_width);
            EXPECT_THAT(Eigen::MatrixXd(u.topLeftCorner(leading, leading).transpose() * all), IsNear(identity, 1e-11))
                << n << " " << leading;
            EXPECT_EQ(Eigen::MatrixXd(all.triangularView<Eigen::StrictlyUpper>()).norm(), 0);
        }
        EXPECT_NEAR(pivot, u.diagonal().cwiseAbs2().cwiseQuotient(a.diagonal()).minCoeff(), 1e-12);
    }
}

TEST(AlignedBuffer, CopiesAndMoves)
{
    Random random(93);
    AlignedBuffer<double> from = random_doubles(random, 21);
    const double* const data = from.data();
    AlignedBuffer<double> copy = from;
    EXPECT_EQ(matrix_of(copy, 21, 1), matrix_of(from, 21, 1));
    EXPECT_NE(copy.data(), data);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(copy.data()) % 64, 0);
    copy[3] += 1; // its own
    EXPECT_NE(copy[3], from[3]);
    AlignedBuffer<double> other(2);
    other = from;
    EXPECT_EQ(matrix_of(other, 21, 1), matrix_of(from, 21, 1));
    other = std::move(from);
    EXPECT_EQ(other.data(), data);
    EXPECT_EQ(from.size(), 0);
    EXPECT_EQ(AlignedBuffer<double>(AlignedBuffer<double>()).size(), 0);
}

TEST_P(DoubleKernelsTest, NotPositiveDefiniteIsTold)
{
    for (const int n : {4, 6, 11}) {
        for (int bad = 0; bad < n; ++bad) {
            const int width = round_up(n, double_step);
            AlignedBuffer<double> system(n * width);
            for (int i = 0; i < n; ++i) {
                system[i * width + i] = i == bad ? -1 : 1;
            }
            EXPECT_FALSE(kernels.factor_positive(system.data(), n, width) > 0) << n << " " << bad;
            for (int i = 0; i < n; ++i) {
                system[i * width + i] = i == bad ? std::numeric_limits<double>::quiet_NaN() : 1;
            }
            EXPECT_FALSE(kernels.factor_positive(system.data(), n, width) > 0) << n << " " << bad;
        }
    }
}

} // namespace
} // namespace lineament::kernels
