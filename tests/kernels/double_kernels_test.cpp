// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The kernels in double precision of every instruction set this machine has, against Eigen.
#include "lineament/core/random.hpp"
#include "lineament/kernels/aligned_buffer.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/matchers.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

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

AlignedBuffer<float> random_floats(Random& random, std::size_t size)
{
    AlignedBuffer<float> values(size);
    for (std::size_t i = 0; i < size; ++i) {
        values[i] = static_cast<float>(random.normal());
    }
    return values;
}

template <typename T>
Eigen::MatrixXd matrix_of(const AlignedBuffer<T>& values, Eigen::Index rows, Eigen::Index columns)
{
    return Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(values.data(), rows,
                                                                                               columns)
        .template cast<double>();
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
    for (const int width : {0, 8, 40, 72}) {
        for (const int num_rows : {0, 1, 7, 24}) {
            const AlignedBuffer<float> rows = random_floats(random, static_cast<std::size_t>(num_rows) * width);
            const AlignedBuffer<double> x = random_doubles(random, width);
            const AlignedBuffer<double> factors = random_doubles(random, num_rows);
            AlignedBuffer<double> product(num_rows);
            AlignedBuffer<double> sums = random_doubles(random, width);
            const Eigen::MatrixXd before = matrix_of(sums, width, 1);
            kernels.multiply_wide(rows.data(), num_rows, width, x.data(), product.data());
            kernels.add_wide(rows.data(), num_rows, width, factors.data(), sums.data());
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
    const AlignedBuffer<float> rows = random_floats(random, 3 * num_points * width);
    const AlignedBuffer<double> jacobians = random_doubles(random, 6 * num_points);
    AlignedBuffer<float> out(2 * num_points * out_width);
    kernels.project_points(rows.data(), width, num_points, jacobians.data(), 0.5, out.data(), out_width);
    Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(2 * num_points, out_width); // the other columns are left alone
    for (int i = 0; i < num_points; ++i) {
        const Eigen::Matrix<double, 6, 1> entries = matrix_of(jacobians, 6, num_points).col(i);
        Eigen::Matrix<double, 2, 3> jacobian;
        jacobian << entries.head<3>().transpose(), entries.tail<3>().transpose();
        expected.block(2 * i, 0, 2, width) =
            0.5 * jacobian * matrix_of(rows, 3 * num_points, width).middleRows(3 * i, 3);
    }
    const Eigen::MatrixXd projected =
        Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
            out.data(), 2 * num_points, out_width)
            .cast<double>();
    EXPECT_THAT(projected, IsNear(expected, 1e-6));
}

TEST_P(DoubleKernelsTest, PullsPoints)
{
    for (const int count : {1, 8, 68, 69}) {
        const AlignedBuffer<double> residuals = random_doubles(random, 2 * static_cast<std::size_t>(count));
        const AlignedBuffer<double> jacobians = random_doubles(random, 6 * static_cast<std::size_t>(count));
        AlignedBuffer<double> pulls(3 * static_cast<std::size_t>(count));
        kernels.pull_points(residuals.data(), jacobians.data(), count, pulls.data());
        const Eigen::MatrixXd entries = matrix_of(jacobians, 6, count), of_residuals = matrix_of(residuals, 2, count);
        for (int i = 0; i < count; ++i) {
            const Eigen::Vector3d expected =
                entries.col(i).head<3>() * of_residuals(0, i) + entries.col(i).tail<3>() * of_residuals(1, i);
            EXPECT_THAT(Eigen::Vector3d(Eigen::Map<Eigen::Vector3d>(pulls.data() + 3 * i)), IsNear(expected, 1e-14));
        }
    }
}

TEST_P(DoubleKernelsTest, BlendsRows)
{
    const AlignedBuffer<float> first = random_floats(random, 24), second = random_floats(random, 24);
    AlignedBuffer<float> out(24);
    kernels.blend_rows(first.data(), second.data(), 0.25f, 24, out.data());
    EXPECT_THAT(matrix_of(out, 24, 1), IsNear(0.75 * matrix_of(first, 24, 1) + 0.25 * matrix_of(second, 24, 1), 1e-6));
}

TEST_P(DoubleKernelsTest, TurnsColumnsIntoRows)
{
    for (const int count : {1, 4, 9, 68}) {
        for (const int num_columns : {1, 4, 6, 7}) {
            const int out_step = num_columns + 3;
            const AlignedBuffer<double> columns = random_doubles(random, static_cast<std::size_t>(count) * num_columns);
            AlignedBuffer<float> out(static_cast<std::size_t>(count) * out_step);
            kernels.turn_columns(columns.data(), count, num_columns, out.data(), out_step);
            Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(count, out_step); // the other columns are left alone
            expected.leftCols(num_columns) = matrix_of(columns, num_columns, count).transpose();
            EXPECT_THAT(matrix_of(out, count, out_step), IsNear(expected, 1e-6)) << count << " " << num_columns;
        }
    }
}

TEST_P(DoubleKernelsTest, AddsPointsEachTurnedToItsTarget)
{
    const int width = 24, out_width = 32, num_points = 4, num_targets = 3;
    const int targets[num_points] = {2, -1, 0, 2}; // one takes two points, one none
    const AlignedBuffer<float> rows = random_floats(random, 3 * num_points * width);
    const AlignedBuffer<double> matrices = random_doubles(random, 9 * num_points);
    AlignedBuffer<float> out = random_floats(random, 3 * num_targets * out_width);
    Eigen::MatrixXd expected = matrix_of(out, 3 * num_targets, out_width); // the other columns are left alone
    kernels.add_turned_points(rows.data(), width, num_points, matrices.data(), targets, out.data(), out_width);
    for (int i = 0; i < num_points; ++i) {
        if (targets[i] >= 0) {
            expected.block(3 * targets[i], 0, 3, width) += matrix_of(matrices, 3 * num_points, 3).middleRows(3 * i, 3) *
                                                           matrix_of(rows, 3 * num_points, width).middleRows(3 * i, 3);
        }
    }
    EXPECT_THAT(matrix_of(out, 3 * num_targets, out_width), IsNear(expected, 1e-5));
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

TEST_P(DoubleKernelsTest, AddsRowsOfAGramMatrix)
{
    for (const int width : {8, 24, 32, 72}) {
        for (const int num_rows : {0, 1, 6, 33}) {
            for (const auto& [begin, end] : {std::pair(0, width), std::pair(4, width - 1)}) {
                const AlignedBuffer<double> rows = random_doubles(random, num_rows * width);
                AlignedBuffer<double> gram = random_doubles(random, width * width);
                const Eigen::MatrixXd r = matrix_of(rows, num_rows, width);
                const Eigen::MatrixXd before = matrix_of(gram, width, width), expected = before + r.transpose() * r;
                kernels.add_gram_double(rows.data(), num_rows, begin, end, width, gram.data());
                const Eigen::MatrixXd found = matrix_of(gram, width, width).triangularView<Eigen::Upper>();
                const Eigen::MatrixXd upper = expected.triangularView<Eigen::Upper>();
                EXPECT_THAT(Eigen::MatrixXd(found.middleRows(begin, end - begin)),
                            IsNear(Eigen::MatrixXd(upper.middleRows(begin, end - begin)), 1e-12));
                EXPECT_EQ(matrix_of(gram, width, width).topRows(begin), before.topRows(begin));
            }
        }
    }
}

TEST_P(DoubleKernelsTest, FactorsAndSolves)
{
    for (const int n : {1, 3, 4, 8, 15, 16, 47, 72}) {
        const int num_more = 5;               // further columns
        const int begin = n % 2 == 1 ? 4 : 0; // what lies before counts for nothing
        const int width = round_up(begin + n + num_more, double_step);
        const Eigen::MatrixXd rows = matrix_of(random_doubles(random, 2 * n * n), 2 * n, n);
        const Eigen::MatrixXd a = rows.transpose() * rows + Eigen::MatrixXd::Identity(n, n);
        const Eigen::MatrixXd more = matrix_of(random_doubles(random, n * num_more), n, num_more);
        const Eigen::MatrixXd expected = matrix_of(random_doubles(random, n * num_right_sides), n, num_right_sides);
        AlignedBuffer<double> system(n * width);
        Eigen::Map<RowMajor> in_place(system.data(), n, width);
        auto in_columns = in_place.middleCols(begin, n);
        in_place.leftCols(begin).setConstant(std::numeric_limits<double>::quiet_NaN());
        in_columns = a.triangularView<Eigen::Upper>();
        in_columns.triangularView<Eigen::StrictlyLower>().setConstant(std::numeric_limits<double>::quiet_NaN());
        in_place.middleCols(begin + n, num_more) = more;
        AlignedBuffer<double> x(n * num_right_sides);
        Eigen::Map<RowMajor>(x.data(), n, num_right_sides) = a * expected;
        AlignedBuffer<double> inverse_diagonal(n);
        const double pivot =
            kernels.factor_positive(system.data(), n, begin, width, system.data(), inverse_diagonal.data());
        kernels.solve_factored(system.data() + begin, n, width, inverse_diagonal.data(), x.data());

        const Eigen::MatrixXd u = Eigen::MatrixXd(in_columns.triangularView<Eigen::Upper>());
        const Eigen::LLT<Eigen::MatrixXd> cholesky(a);
        EXPECT_THAT(u, IsNear(Eigen::MatrixXd(cholesky.matrixU()), 1e-12 * n)) << n;
        EXPECT_THAT(Eigen::VectorXd(Eigen::Map<Eigen::VectorXd>(inverse_diagonal.data(), n)),
                    IsNear(Eigen::VectorXd(u.diagonal().cwiseInverse()), 1e-12));
        EXPECT_THAT(Eigen::MatrixXd(in_place.middleCols(begin + n, num_more)),
                    IsNear(Eigen::MatrixXd(cholesky.matrixL().solve(more)), 1e-12 * n));
        EXPECT_THAT(matrix_of(x, n, num_right_sides), IsNear(expected, 1e-10)) << n;
        for (const int leading : {n, (n + 1) / 2}) {
            const int inverse_width = round_up(leading, double_step);
            AlignedBuffer<double> inverse = random_doubles(random, static_cast<std::size_t>(leading) * inverse_width);
            kernels.invert_factor(system.data() + begin, leading, width, inverse_diagonal.data(), inverse.data(),
                                  inverse_width);
            const Eigen::MatrixXd all = matrix_of(inverse, leading, inverse_width);
            const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(leading, inverse_width);
            EXPECT_THAT(Eigen::MatrixXd(u.topLeftCorner(leading, leading).transpose() * all), IsNear(identity, 1e-11))
                << n << " " << leading;
            EXPECT_EQ(Eigen::MatrixXd(all.triangularView<Eigen::StrictlyUpper>()).norm(), 0);
        }
        EXPECT_NEAR(pivot, u.diagonal().cwiseAbs2().cwiseQuotient(a.diagonal()).minCoeff(), 1e-12);
    }
}

/// What camera_residuals and the test's differences share.
struct SeenProblem
{
    PerspectiveCamera camera = {};
    Eigen::Matrix3Xd points = {}, offsets = {};
    Eigen::Matrix2Xd landmarks = {};
    Eigen::MatrixX3d roots = {};

    SeenProblem(Random& random, int count) : points(3, count), offsets(3, count), landmarks(2, count), roots(count, 3)
    {
        const Eigen::Matrix3d turn =
            Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal())
                .normalized()
                .toRotationMatrix();
        Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(camera.turn) = turn;
        camera.translation[0] = 3;
        camera.translation[1] = -2;
        camera.scale = 1.3;
        camera.phi = 2e-3;
        camera.centre[0] = 320;
        camera.centre[1] = 240;
        for (int i = 0; i < count; ++i) {
            for (int axis = 0; axis < 3; ++axis) {
                points(axis, i) = 50 * random.normal();
                offsets(axis, i) = random.normal();
                roots(i, axis) = 1 + 0.1 * random.normal();
            }
            landmarks.col(i) << 320 + 60 * random.normal(), 240 + 60 * random.normal();
        }
    }

    [[nodiscard]] Eigen::Matrix3d turn() const
    {
        return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(camera.turn);
    }

    /// As kernels.hpp has it.
    [[nodiscard]] Eigen::Vector2d residual(const PerspectiveCamera& by, const Eigen::Matrix3d& by_turn,
                                           const Eigen::Vector3d& point, int i) const
    {
        const Eigen::Vector3d p = by_turn * point;
        const Eigen::Vector2d seen =
            Eigen::Vector2d(by.centre[0], by.centre[1]) +
            by.scale / (1 + by.phi * p.z()) * (p.head<2>() + Eigen::Vector2d(by.translation[0], by.translation[1]));
        Eigen::Matrix2d root;
        root << roots(i, 0), roots(i, 1), 0, roots(i, 2);
        return root * (seen - landmarks.col(i));
    }
};

TEST_P(DoubleKernelsTest, SeesWeightedResiduals)
{
    for (const int count : {0, 1, 2, 7, 8, 13, 68}) {
        const SeenProblem problem(random, count);
        AlignedBuffer<double> residuals(2 * count + 1);
        residuals[2 * count] = 7;
        kernels.camera_residuals(problem.camera, problem.points.data(), problem.landmarks.data(), problem.roots.data(),
                                 count, residuals.data());
        for (int i = 0; i < count; ++i) {
            EXPECT_THAT(Eigen::Vector2d(residuals[i], residuals[count + i]),
                        IsNear(problem.residual(problem.camera, problem.turn(), problem.points.col(i), i), 1e-11));
        }
        EXPECT_EQ(residuals[2 * count], 7); // and nothing beyond
    }
}

TEST_P(DoubleKernelsTest, WeighsByStudentT)
{
    for (const int count : {1, 2, 7, 8, 19}) {
        const double least = count == 7 ? 1.0 : 0.1;
        AlignedBuffer<double> residuals(2 * count), dimensions(count), roots(count + 1), weighted(2 * count + 1);
        for (int i = 0; i < count; ++i) {
            residuals[i] = 3 * random.normal();
            residuals[count + i] = 3 * random.normal();
            dimensions[i] = 1 + i % 2;
        }
        roots[count] = weighted[2 * count] = 7;
        kernels.weigh_by_student_t(residuals.data(), dimensions.data(), 4.0, least, count, roots.data(),
                                   weighted.data());
        for (int i = 0; i < count; ++i) {
            // rho = (nu + D) log(1 + u / nu) by differences.
            const auto slope_at = [&](double u) {
                const double step = 1e-4 * (1 + u);
                const auto loss = [&](double at) { return (4 + dimensions[i]) * std::log1p(at / 4); };
                return (loss(u + step) - loss(u - step)) / (2 * step);
            };
            const Eigen::Vector2d given(residuals[i], residuals[count + i]);
            const double u = given.squaredNorm(), step = 1e-3 * (1 + u), weight = slope_at(u);
            const double second = (slope_at(u + step) - slope_at(u - step)) / (2 * step);
            const double curvature = std::max(least * weight, weight + 2 / dimensions[i] * u * second);
            EXPECT_NEAR(roots[i] * roots[i], curvature, 1e-5);
            EXPECT_THAT(Eigen::Vector2d(weighted[i], weighted[count + i]),
                        IsNear(Eigen::Vector2d(weight / std::sqrt(curvature) * given), 1e-4));
        }
        EXPECT_EQ(roots[count], 7); // and nothing beyond
        EXPECT_EQ(weighted[2 * count], 7);
    }
}

TEST_P(DoubleKernelsTest, DerivesWeightedResiduals)
{
    for (const int count : {1, 7, 8, 19}) {
        const SeenProblem problem(random, count);
        const AlignedBuffer<double> factors = random_doubles(random, count);
        AlignedBuffer<double> derivatives(20 * count + 1);
        derivatives[20 * count] = 7;
        kernels.camera_derivatives(problem.camera, problem.points.data(), problem.offsets.data(), problem.roots.data(),
                                   factors.data(), count, derivatives.data());
        EXPECT_EQ(derivatives[20 * count], 7);
        for (int i = 0; i < count; ++i) {
            // Half the difference of the residuals after a step of one unknown and after its opposite.
            const auto at = [&](int unknown, double step) {
                PerspectiveCamera camera = problem.camera;
                Eigen::Matrix3d turn = problem.turn();
                Eigen::Vector3d point = problem.points.col(i);
                if (unknown < 3) {
                    point[unknown] += step;
                } else if (unknown < 6) {
                    turn = Eigen::AngleAxisd(step, Eigen::Vector3d::Unit(unknown - 3)).toRotationMatrix() * turn;
                } else if (unknown == 6) { // with the scale go phi and, the other way, the offset
                    camera.scale *= std::exp(step);
                    camera.phi *= std::exp(step);
                    point += (std::exp(-step) - 1) * problem.offsets.col(i);
                } else if (unknown < 9) {
                    camera.translation[unknown - 7] += step;
                } else {
                    camera.phi += step;
                }
                return problem.residual(camera, turn, point, i);
            };
            const double steps[10] = {1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6, 1e-6, 1e-4, 1e-4, 1e-7};
            for (int unknown = 0; unknown < 10; ++unknown) {
                const double step = steps[unknown];
                const Eigen::Vector2d expected = factors[i] * (at(unknown, step) - at(unknown, -step)) / (2 * step);
                const int first = unknown < 3 ? unknown : unknown < 9 ? 3 + unknown : 18;
                const int second = unknown < 3 ? 3 + unknown : unknown < 9 ? 9 + unknown : 19;
                EXPECT_THAT(Eigen::Vector2d(derivatives[first * count + i], derivatives[second * count + i]),
                            IsNear(expected, 1e-6 * (1 + expected.norm())))
                    << "unknown " << unknown;
            }
        }
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

TEST_P(DoubleKernelsTest, FactorsAndSolvesInSinglePrecision)
{
    for (const int n : {1, 3, 4, 16, 33, 72, 520}) {
        const int begin = n % 2 == 1 ? 4 : 8; // what lies before counts for nothing
        const int width = round_up(begin + n, width_step);
        const Eigen::MatrixXd rows = matrix_of(random_doubles(random, 2 * n * n), 2 * n, n);
        const Eigen::MatrixXd a = rows.transpose() * rows / n + Eigen::MatrixXd::Identity(n, n);
        const Eigen::MatrixXd expected = matrix_of(random_floats(random, n * num_right_sides), n, num_right_sides);
        using Floats = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
        AlignedBuffer<float> system(n * width), inverses(n), x(n * num_right_sides);
        Eigen::Map<Floats> in_place(system.data(), n, width);
        auto in_columns = in_place.middleCols(begin, n);
        in_place.leftCols(begin).setConstant(std::numeric_limits<float>::quiet_NaN());
        in_columns = a.cast<float>().triangularView<Eigen::Upper>();
        in_columns.triangularView<Eigen::StrictlyLower>().setConstant(std::numeric_limits<float>::quiet_NaN());
        AlignedBuffer<float> x_of_one(width);
        std::fill_n(x_of_one.data(), width, 7.0f);
        Eigen::Map<Eigen::VectorXf>(x_of_one.data() + begin, n) = (a * expected.col(0)).cast<float>();
        Eigen::Map<Floats>(x.data(), n, num_right_sides) = (a * expected).cast<float>();
        AlignedBuffer<float> lower(n * num_right_sides); // begins with zeros
        Eigen::Map<Floats>(lower.data(), n, num_right_sides).bottomRows((n + 1) / 2).setOnes();
        const Eigen::MatrixXd lower_right_side = matrix_of(lower, n, num_right_sides);
        AlignedBuffer<float> matrix(n * width); // another than the factor's
        std::copy_n(system.data(), system.size(), matrix.data());
        const float pivot =
            kernels.factor_positive_float(matrix.data(), n, begin, width, system.data(), inverses.data());
        kernels.solve_lower_float(system.data() + begin, n, width, inverses.data(), lower.data());
        kernels.solve_factored_float(system.data() + begin, n, width, inverses.data(), x.data());
        kernels.solve_for_one_float(system.data(), n, begin, width, inverses.data(), x_of_one.data());
        const Eigen::MatrixXd u = in_columns.cast<double>().triangularView<Eigen::Upper>();
        EXPECT_THAT(u, IsNear(Eigen::MatrixXd(Eigen::LLT<Eigen::MatrixXd>(a).matrixU()), 1e-5)) << n;
        EXPECT_THAT(matrix_of(x, n, num_right_sides), IsNear(expected, 1e-4)) << n;
        const Eigen::VectorXd of_one = matrix_of(x_of_one, width, 1);
        EXPECT_THAT(Eigen::VectorXd(of_one.segment(begin, n)), IsNear(expected.col(0), 1e-4)) << n;
        EXPECT_EQ(of_one.head(begin).norm() + of_one.tail(width - begin - n).norm(), 0) << n;
        EXPECT_THAT(Eigen::MatrixXd(u.transpose() * matrix_of(lower, n, num_right_sides)),
                    IsNear(lower_right_side, 1e-4))
            << n;
        EXPECT_NEAR(pivot, u.diagonal().cwiseAbs2().cwiseQuotient(a.diagonal()).minCoeff(), 1e-5);
        AlignedBuffer<float> inverse = random_floats(random, static_cast<std::size_t>(n) * width);
        kernels.invert_factor_float(system.data() + begin, n, width, inverses.data(), inverse.data(), width);
        EXPECT_THAT(Eigen::MatrixXd(u.transpose() * matrix_of(inverse, n, width)),
                    IsNear(Eigen::MatrixXd(Eigen::MatrixXd::Identity(n, width)), 1e-4))
            << n;
        const int num_inverted = (n + 1) / 2;
        AlignedBuffer<float> other(n * width), same = random_floats(random, static_cast<std::size_t>(n + 3) * width);
        EXPECT_EQ(kernels.factor_and_invert_float(matrix.data(), n, begin, width, other.data(), inverses.data(),
                                                  num_inverted, same.data(), width),
                  pivot);
        EXPECT_THAT(matrix_of(same, num_inverted, width), IsNear(matrix_of(inverse, num_inverted, width), 1e-4)) << n;
        const double squares = matrix_of(inverse, n, width).squaredNorm();
        EXPECT_NEAR(kernels.sum_squares_float(inverse.data(), n * width), squares, 1e-5 * squares) << n;
    }
}

TEST_P(DoubleKernelsTest, NotPositiveDefiniteIsTold)
{
    for (const int n : {4, 6, 11}) {
        for (int bad = 0; bad < n; ++bad) {
            const int width = round_up(n, double_step);
            AlignedBuffer<double> system(n * width), inverse_diagonal(n);
            for (int i = 0; i < n; ++i) {
                system[i * width + i] = i == bad ? -1 : 1;
            }
            EXPECT_FALSE(kernels.factor_positive(system.data(), n, 0, width, system.data(), inverse_diagonal.data()) >
                         0)
                << n << " " << bad;
            const int single_width = round_up(n, width_step);
            AlignedBuffer<float> single(n * single_width), other(single.size()), inverses(n),
                inverse(16 * single_width);
            for (int i = 0; i < n; ++i) {
                single[i * single_width + i] = i == bad ? -1 : 1;
            }
            EXPECT_FALSE(kernels.factor_and_invert_float(single.data(), n, 0, single_width, other.data(),
                                                         inverses.data(), n, inverse.data(), single_width) > 0)
                << n << " " << bad;
            for (int i = 0; i < n; ++i) {
                system[i * width + i] = i == bad ? std::numeric_limits<double>::quiet_NaN() : 1;
            }
            EXPECT_FALSE(kernels.factor_positive(system.data(), n, 0, width, system.data(), inverse_diagonal.data()) >
                         0)
                << n << " " << bad;
        }
    }
}

} // namespace
} // namespace lineament::kernels
