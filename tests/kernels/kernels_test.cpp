// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Every kernel of every instruction set this machine has, against Eigen in double precision.
#include "lineament/core/random.hpp"
#include "lineament/kernels/aligned_buffer.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"
#include "lineament/kernels/scalar_kernels.hpp"

#include "support/matchers.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace lineament::kernels {
namespace {

using test::max_difference;
using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

AlignedBuffer<float> random_floats(Random& random, std::size_t size)
{
    AlignedBuffer<float> values(size);
    for (std::size_t i = 0; i < size; ++i) {
        values[i] = static_cast<float>(random.normal());
    }
    return values;
}

Eigen::MatrixXd matrix_of(const AlignedBuffer<float>& values, Eigen::Index rows, Eigen::Index columns)
{
    return Eigen::Map<const RowMajor>(values.data(), rows, columns).cast<double>();
}

double upper_difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b)
{
    return max_difference(Eigen::MatrixXd(a.triangularView<Eigen::Upper>()),
                          Eigen::MatrixXd(b.triangularView<Eigen::Upper>()));
}

class KernelsTest : public ::testing::TestWithParam<const Kernels*>
{
protected:
    const Kernels& kernels = *GetParam();
    Random random{91};
};

INSTANTIATE_TEST_SUITE_P(Sets, KernelsTest, ::testing::ValuesIn(supported_kernels()),
                         [](const auto& set) { return std::string(set.param->name); });

TEST_P(KernelsTest, CombinesPanels)
{
    const int num_panels = 3;
    const int num_columns = 7;
    const AlignedBuffer<float> base = random_floats(random, num_panels * panel_size);
    const AlignedBuffer<float> panels = random_floats(random, num_panels * num_columns * panel_size);
    const AlignedBuffer<float> factors = random_floats(random, num_columns);
    AlignedBuffer<std::int16_t> short_panels(panels.size());
    for (std::size_t i = 0; i < panels.size(); ++i) {
        short_panels[i] = static_cast<std::int16_t>(random.uniform(-32767, 32767));
    }
    AlignedBuffer<float> out(num_panels * panel_size);
    AlignedBuffer<float> short_out(num_panels * panel_size);
    kernels.combine_panels(base.data(), panels.data(), num_panels, num_columns, factors.data(), out.data());
    kernels.combine_panels_int16(base.data(), short_panels.data(), num_panels, num_columns, factors.data(),
                                 short_out.data());
    for (int p = 0; p < num_panels; ++p) {
        for (int c = 0; c < panel_size; ++c) {
            double sum = base[p * panel_size + c];
            double short_sum = sum;
            for (int j = 0; j < num_columns; ++j) {
                sum += static_cast<double>(factors[j]) * panels[(p * num_columns + j) * panel_size + c];
                short_sum += static_cast<double>(factors[j]) * short_panels[(p * num_columns + j) * panel_size + c];
            }
            ASSERT_NEAR(out[p * panel_size + c], sum, 1e-5);
            ASSERT_NEAR(short_out[p * panel_size + c], short_sum, 1e-6 * 32767 * num_columns);
        }
    }
    kernels.combine_panels(out.data(), panels.data(), num_panels, 0, factors.data(), short_out.data());
    EXPECT_EQ(matrix_of(out, 1, num_panels * panel_size), matrix_of(short_out, 1, num_panels * panel_size));
}

TEST_P(KernelsTest, CombinesBlocks)
{
    const std::vector<SparseColumns::Run> runs = {{0, 1}, {1, 2}, {3, 1}};
    const std::vector<int> offsets = {32, 16, 48, 0};
    const std::vector<std::uint16_t> columns = {4, 0, 1, 3, 4};
    const AlignedBuffer<float> base = random_floats(random, 64);
    const AlignedBuffer<float> values = random_floats(random, columns.size() * block_size);
    const AlignedBuffer<float> coefficients = random_floats(random, 5);
    const SparseColumns sparse = {runs.data(), static_cast<int>(runs.size()), offsets.data(), columns.data(),
                                  values.data()};
    AlignedBuffer<float> panel(5 * panel_size); // the same with its zeros
    const std::vector<int> offset_of_column = {16, 48, 0, 0, 0};
    for (std::size_t i = 0; i < columns.size(); ++i) {
        std::copy_n(values.data() + i * block_size, block_size,
                    panel.data() + columns[i] * panel_size + offset_of_column[i]);
    }
    AlignedBuffer<float> out(64), plain(64), expected(64);
    kernels.combine_blocks(base.data(), sparse, coefficients.data(), out.data());
    scalar::combine_blocks(base.data(), sparse, coefficients.data(), plain.data());
    kernels.combine_panels(base.data(), panel.data(), 1, 5, coefficients.data(), expected.data());
    EXPECT_EQ(matrix_of(out, 1, 64), matrix_of(expected, 1, 64));
    EXPECT_LE(max_difference(matrix_of(plain, 1, 64), matrix_of(expected, 1, 64)), 1e-5);
    kernels.combine_blocks(out.data(), sparse, coefficients.data(), out.data());
    kernels.combine_panels(expected.data(), panel.data(), 1, 5, coefficients.data(), expected.data());
    EXPECT_EQ(matrix_of(out, 1, 64), matrix_of(expected, 1, 64));
}

TEST_P(KernelsTest, MultipliesPanels)
{
    for (const int num_panels : {1, 3}) {
        for (const int num_columns : {0, 1, 7}) {
            const AlignedBuffer<float> panels = random_floats(random, num_panels * num_columns * panel_size);
            const AlignedBuffer<float> x = random_floats(random, num_panels * panel_size);
            AlignedBuffer<float> out(num_columns), plain(num_columns);
            kernels.multiply_panels(panels.data(), num_panels, num_columns, x.data(), out.data());
            scalar::multiply_panels(panels.data(), num_panels, num_columns, x.data(), plain.data());
            for (int j = 0; j < num_columns; ++j) {
                double expected = 0;
                for (int p = 0; p < num_panels; ++p) {
                    const int at = (p * num_columns + j) * panel_size;
                    expected += Eigen::Map<const Eigen::VectorXf>(panels.data() + at, panel_size)
                                    .cast<double>()
                                    .dot(Eigen::Map<const Eigen::VectorXf>(x.data() + p * panel_size, panel_size)
                                             .cast<double>());
                }
                EXPECT_NEAR(out[j], expected, 2e-5);
                EXPECT_NEAR(plain[j], expected, 2e-5);
            }
        }
    }
}

TEST_P(KernelsTest, CombinesGramMatrices)
{
    for (const int width : {16, 48, 64}) {
        const AlignedBuffer<float> grams = random_floats(random, 6 * width * width);
        const AlignedBuffer<float> scales = random_floats(random, 6);
        AlignedBuffer<float> gram(width * width);
        AlignedBuffer<float> leading_gram(width * width);
        const int num_columns = width - 11;
        kernels.combine_grams(grams.data(), width, width, scales.data(), gram.data());
        kernels.combine_grams(grams.data(), num_columns, width, scales.data(), leading_gram.data());
        Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(width, width);
        for (int g = 0; g < 6; ++g) {
            expected +=
                scales[g] * Eigen::Map<const RowMajor>(grams.data() + g * width * width, width, width).cast<double>();
        }
        EXPECT_LE(upper_difference(matrix_of(gram, width, width), expected), 1e-5) << width;
        EXPECT_LE(upper_difference(matrix_of(leading_gram, width, width).topLeftCorner(num_columns, num_columns),
                                   expected.topLeftCorner(num_columns, num_columns)),
                  1e-5)
            << width;
    }
}

TEST_P(KernelsTest, ProjectsAndMultipliesRows)
{
    for (const int width : {16, 48, 64}) {
        const int num_points = 9;
        const AlignedBuffer<float> rows = random_floats(random, 3 * num_points * width);
        const AlignedBuffer<float> jacobian = random_floats(random, 6);
        const std::vector<int> indices = {8, 0, 3, 3};
        const std::vector<float> roots = {0.5f, 2.0f, 0.0f, 1.0f};
        AlignedBuffer<float> out(2 * indices.size() * width);
        kernels.project_rows(rows.data(), width, indices.data(), 4, jacobian.data(), roots.data(), out.data());
        const Eigen::MatrixXd j = matrix_of(jacobian, 2, 3);
        for (int i = 0; i < 4; ++i) {
            const Eigen::MatrixXd expected =
                roots[i] * j * matrix_of(rows, 3 * num_points, width).middleRows(3 * indices[i], 3);
            EXPECT_LE(max_difference(matrix_of(out, 8, width).middleRows(2 * i, 2), expected), 1e-5);
        }
        const AlignedBuffer<float> x = random_floats(random, width);
        kernels.multiply_rows(rows.data(), width, indices.data(), 4, x.data(), out.data());
        for (int i = 0; i < 4; ++i) {
            const Eigen::MatrixXd expected =
                matrix_of(x, 1, width) *
                matrix_of(rows, 3 * num_points, width).middleRows(3 * indices[i], 3).transpose();
            EXPECT_LE(max_difference(matrix_of(out, 1, 12).middleCols(3 * i, 3), expected), 2e-5);
        }
    }
}

TEST_P(KernelsTest, AddsGramMatrixAndRows)
{
    for (const int width : {16, 32, 48, 64, 80}) {
        for (const int num_rows : {0, 1, 6, 33}) {
            const AlignedBuffer<float> rows = random_floats(random, num_rows * width);
            const AlignedBuffer<float> factors = random_floats(random, num_rows);
            AlignedBuffer<float> gram = random_floats(random, width * width);
            AlignedBuffer<float> part(width * width);
            std::copy_n(gram.data(), gram.size(), part.data());
            const int begin = 4, end = width - 5;
            AlignedBuffer<float> sums = random_floats(random, width);
            const Eigen::MatrixXd r = matrix_of(rows, num_rows, width);
            const Eigen::MatrixXd expected_gram = matrix_of(gram, width, width) + r.transpose() * r;
            const Eigen::MatrixXd expected_sums = matrix_of(sums, 1, width) + matrix_of(factors, 1, num_rows) * r;
            kernels.add_gram(rows.data(), num_rows, 0, width, width, gram.data());
            kernels.add_gram(rows.data(), num_rows, begin, end, width, part.data());
            kernels.add_rows(rows.data(), num_rows, width, factors.data(), sums.data());
            EXPECT_LE(upper_difference(matrix_of(gram, width, width), expected_gram), 1e-4) << width << " " << num_rows;
            Eigen::MatrixXd in_part = matrix_of(part, width, width);
            in_part.topRows(begin) = expected_gram.topRows(begin);
            in_part.bottomRows(width - end) = expected_gram.bottomRows(width - end);
            EXPECT_LE(upper_difference(in_part, expected_gram), 1e-4) << width << " " << num_rows;
            AlignedBuffer<float> alone = random_floats(random, width * width); // not added to
            kernels.set_gram(rows.data(), num_rows, 0, width, width, alone.data());
            EXPECT_LE(upper_difference(matrix_of(alone, width, width), r.transpose() * r), 1e-4)
                << width << " " << num_rows;
            EXPECT_LE(max_difference(matrix_of(sums, 1, width), expected_sums), 1e-4) << width << " " << num_rows;
        }
    }
}

TEST_P(KernelsTest, SolvesPositiveDefiniteSystems)
{
    for (const int n : {0, 1, 3, 4, 5, 16, 30, 47, 60, 63, 64}) {
        const int width = round_up(n + 1, width_step);
        const AlignedBuffer<float> factor = random_floats(random, (n + 5) * n);
        const Eigen::MatrixXd f = matrix_of(factor, n + 5, n);
        const Eigen::MatrixXd a = f.transpose() * f + Eigen::MatrixXd::Identity(n, n);
        AlignedBuffer<float> system(width * width);
        Eigen::Map<RowMajor> view(system.data(), width, width);
        view.topLeftCorner(n, n) = a.cast<float>();
        view.topLeftCorner(n, n).triangularView<Eigen::StrictlyLower>().setConstant(77.0f); // not to be read
        Eigen::VectorXd b(n);
        for (int i = 0; i < n; ++i) {
            b[i] = random.normal();
            view(i, n) = static_cast<float>(b[i]);
        }
        AlignedBuffer<float> x(width);
        x[width - 1] = 5; // to be set to 0
        const float pivot = kernels.solve_positive(system.data(), n, width, x.data());
        EXPECT_GT(pivot, 0.0f) << n;
        EXPECT_LE(pivot, 1.0f) << n;
        const Eigen::VectorXd expected = a.llt().solve(b);
        const Eigen::MatrixXd got = matrix_of(x, 1, width);
        EXPECT_LE(max_difference(got.leftCols(n).transpose(), expected), 1e-4 * (1 + expected.norm())) << n;
        EXPECT_EQ(got.rightCols(width - n).norm(), 0.0) << n;
    }
}

TEST_P(KernelsTest, RefusesIndefiniteSystems)
{
    for (const double last : {-1.0, 0.0, std::nan("")}) {
        AlignedBuffer<float> system(16 * 16);
        for (int i = 0; i < 6; ++i) {
            system[17 * i] = i == 5 ? static_cast<float>(last) : 1.0f;
        }
        AlignedBuffer<float> x(16);
        EXPECT_FALSE(kernels.solve_positive(system.data(), 6, 16, x.data()) > 0) << last;
    }
    AlignedBuffer<float> system(16 * 16); // [1 1; 1 1 + 1e-4]: what is left of the second pivot is told
    system[0] = system[1] = 1;
    system[17] = 1.0001f;
    AlignedBuffer<float> x(16);
    EXPECT_NEAR(kernels.solve_positive(system.data(), 2, 16, x.data()), 1e-4, 1e-5);
}

/// Of few unknowns, with a positive definite matrix.
struct FewUnknowns
{
    static constexpr int width = 16;
    AlignedBuffer<float> matrix = AlignedBuffer<float>(max_few * width);
    AlignedBuffer<float> right_side = AlignedBuffer<float>(width), is_free = AlignedBuffer<float>(width);
    AlignedBuffer<float> x = AlignedBuffer<float>(width), residual = AlignedBuffer<float>(width);

    FewUnknowns(Random& random, int n)
    {
        const Eigen::MatrixXd f = matrix_of(random_floats(random, (n + 2) * n), n + 2, n);
        Eigen::Map<RowMajor>(matrix.data(), max_few, width).topLeftCorner(n, n) =
            (f.transpose() * f + Eigen::MatrixXd::Identity(n, n)).cast<float>();
        for (int i = 0; i < n; ++i) {
            right_side[i] = static_cast<float>(random.normal());
            x[i] = static_cast<float>(random.normal());
        }
    }
    float solve(const Kernels& kernels, int n)
    {
        return kernels.solve_few(matrix.data(), n, width, right_side.data(), is_free.data(), x.data(), residual.data());
    }
};

TEST_P(KernelsTest, SolvesForTheFreeOfFewUnknowns)
{
    for (int n = 1; n <= max_few; ++n) {
        for (int set = 0; set < 1 << n; ++set) { // every set of free ones
            FewUnknowns few(random, n);
            std::vector<int> free, held;
            for (int i = 0; i < n; ++i) {
                few.is_free[i] = (set >> i & 1) != 0 ? 1.0f : 0.0f;
                ((set >> i & 1) != 0 ? free : held).push_back(i);
            }
            const Eigen::MatrixXd a = matrix_of(few.matrix, max_few, FewUnknowns::width).topLeftCorner(n, n);
            const Eigen::VectorXd b = matrix_of(few.right_side, FewUnknowns::width, 1).topRows(n);
            Eigen::VectorXd expected = matrix_of(few.x, FewUnknowns::width, 1).topRows(n);
            double least = 1;
            if (!free.empty()) {
                const Eigen::MatrixXd of_free = a(free, free);
                Eigen::VectorXd rest = b(free);
                for (const int j : held) {
                    rest -= a(free, j) * expected[j];
                }
                expected(free) = of_free.llt().solve(rest).eval();
                const Eigen::VectorXd roots = Eigen::MatrixXd(of_free.llt().matrixL()).diagonal();
                least = (roots.array().square() / of_free.diagonal().array()).minCoeff();
            }
            EXPECT_NEAR(few.solve(kernels, n), least, 1e-4) << n << " " << set;
            const double tolerance = 1e-4 * (1 + expected.norm());
            EXPECT_LE(max_difference(matrix_of(few.x, FewUnknowns::width, 1).topRows(n), expected), tolerance);
            EXPECT_LE(max_difference(matrix_of(few.residual, FewUnknowns::width, 1).topRows(n), b - a * expected),
                      tolerance * a.norm());
        }
    }
}

TEST_P(KernelsTest, RefusesIndefiniteRowsOfFewUnknowns)
{
    for (int n = 1; n <= max_few; ++n) {
        for (int i = 0; i < n; ++i) {
            for (const float diagonal : {-1.0f, 0.0f, std::nanf("")}) {
                FewUnknowns few(random, n);
                few.matrix[i * FewUnknowns::width + i] = diagonal;
                std::fill_n(few.is_free.data(), n, 1.0f);
                EXPECT_FALSE(few.solve(kernels, n) > 0) << n << " " << i << " " << diagonal;
            }
            FewUnknowns few(random, n); // the twin: a row that is not free may be anything but NaN
            few.matrix[i * FewUnknowns::width + i] = -1;
            std::fill_n(few.is_free.data(), n, 1.0f);
            few.is_free[i] = 0;
            EXPECT_GT(few.solve(kernels, n), 0.0f) << n << " " << i;
        }
    }
}

TEST_P(KernelsTest, AddsRowsOfPoints)
{
    for (const int width : {16, 48, 64, 80}) {
        const AlignedBuffer<float> rows = random_floats(random, 3 * 9 * width);
        const std::vector<int> indices = {8, 0, 3, 3, 5};
        for (int count = 0; count <= static_cast<int>(indices.size()); ++count) {
            const AlignedBuffer<float> factors = random_floats(random, 15);
            AlignedBuffer<float> sums = random_floats(random, width);
            Eigen::MatrixXd expected = matrix_of(sums, 1, width);
            for (int i = 0; i < count; ++i) {
                for (int a = 0; a < 3; ++a) {
                    expected += static_cast<double>(factors[3 * i + a]) *
                                matrix_of(rows, 27, width).row(3 * indices[static_cast<std::size_t>(i)] + a);
                }
            }
            kernels.add_point_rows(rows.data(), width, indices.data(), count, factors.data(), sums.data());
            EXPECT_LE(max_difference(matrix_of(sums, 1, width), expected), 1e-5) << width << " " << count;
        }
    }
}

TEST_P(KernelsTest, WidensIntegers)
{
    AlignedBuffer<std::int16_t> integers(2 * panel_size);
    AlignedBuffer<float> widened(integers.size());
    for (std::size_t i = 0; i < integers.size(); ++i) {
        integers[i] = static_cast<std::int16_t>(random.uniform(-32768, 32768));
    }
    integers[0] = std::numeric_limits<std::int16_t>::min();
    integers[panel_size - 1] = std::numeric_limits<std::int16_t>::max();
    widened[64] = 5; // to be left alone
    kernels.widen(integers.data(), panel_size, widened.data());
    for (std::size_t i = 0; i < panel_size; ++i) {
        EXPECT_EQ(widened[i], integers[i]) << i;
    }
    EXPECT_EQ(widened[64], 5);
}

TEST_P(KernelsTest, TransformsPoints)
{
    const int step = 64;
    const int count = 37;
    const AlignedBuffer<float> points = random_floats(random, 3 * step);
    const AlignedBuffer<float> m = random_floats(random, 12);
    AlignedBuffer<float> out(3 * 48);
    kernels.transform_points(points.data(), step, count, m.data(), out.data(), 48);
    const Eigen::MatrixXd transform = matrix_of(m, 3, 4);
    const Eigen::MatrixXd expected = (transform.leftCols(3) * matrix_of(points, 3, step)).colwise() + transform.col(3);
    EXPECT_LE(max_difference(matrix_of(out, 3, 48).leftCols(count), expected.leftCols(count)), 1e-5);
}

TEST_P(KernelsTest, AddsPoseMoments)
{
    for (const int count : {1, 8, 51}) {
        const int padded = round_up(count, 8);
        const AlignedBuffer<float> points = random_floats(random, 3 * padded);
        AlignedBuffer<double> u(padded), v(padded), w(padded);
        for (AlignedBuffer<double>* values : {&u, &v, &w}) {
            std::generate_n(values->data(), values->size(), [&] { return random.normal(); });
        }
        std::fill(w.data() + count, w.data() + padded, 0.0);
        double moments[num_pose_moments];
        double plain[num_pose_moments];
        for (int t = 0; t < num_pose_moments; ++t) {
            moments[t] = plain[t] = t; // they are added to
        }
        kernels.add_pose_moments(points.data(), u.data(), v.data(), w.data(), count, moments);
        scalar::add_pose_moments(points.data(), u.data(), v.data(), w.data(), count, plain);
        Eigen::Matrix<double, 6, Eigen::Dynamic> p(6, count); // 1, x, y, z, u, v of each point
        p.row(0).setOnes();
        p.middleRows<3>(1) = Eigen::Map<const Eigen::Matrix3Xf>(points.data(), 3, count).cast<double>();
        p.row(4) = Eigen::Map<const Eigen::RowVectorXd>(u.data(), count);
        p.row(5) = Eigen::Map<const Eigen::RowVectorXd>(v.data(), count);
        const Eigen::Matrix<double, 6, 6> sums =
            p * Eigen::Map<const Eigen::VectorXd>(w.data(), count).asDiagonal() * p.transpose();
        const double expected[num_pose_moments] = {
            sums(0, 0), sums(0, 1), sums(0, 2), sums(0, 3), sums(0, 4), sums(0, 5), sums(1, 1), sums(1, 2), sums(1, 3),
            sums(2, 2), sums(2, 3), sums(3, 3), sums(4, 1), sums(4, 2), sums(4, 3), sums(5, 1), sums(5, 2), sums(5, 3)};
        for (int t = 0; t < num_pose_moments; ++t) {
            EXPECT_NEAR(moments[t], t + expected[t], 1e-11) << t;
            EXPECT_NEAR(plain[t], t + expected[t], 1e-11) << t;
        }
    }
}

TEST_P(KernelsTest, MakesFactorsOfResiduals)
{
    for (const int count : {1, 5, 8, 51}) {
        const int padded = round_up(count, 8);
        const AlignedBuffer<float> points = random_floats(random, 3 * padded);
        AlignedBuffer<double> u(padded), v(padded), w(padded), m(8);
        for (AlignedBuffer<double>* values : {&u, &v, &w, &m}) {
            std::generate_n(values->data(), values->size(), [&] { return random.normal(); });
        }
        AlignedBuffer<float> factors(3 * padded);
        AlignedBuffer<float> plain(3 * padded);
        const double scale = 0.7;
        kernels.residual_factors(points.data(), u.data(), v.data(), w.data(), scale, count, m.data(), factors.data());
        scalar::residual_factors(points.data(), u.data(), v.data(), w.data(), scale, count, m.data(), plain.data());
        const Eigen::Map<const Eigen::Matrix<double, 2, 4, Eigen::RowMajor>> camera(m.data());
        for (int i = 0; i < count; ++i) {
            const Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3f>(points.data() + 3 * i).cast<double>();
            const Eigen::Vector2d residual = Eigen::Vector2d(u[i], v[i]) - camera.leftCols<3>() * point - camera.col(3);
            const Eigen::Vector3d expected = scale * w[i] * camera.leftCols<3>().transpose() * residual;
            for (int a = 0; a < 3; ++a) {
                EXPECT_NEAR(factors[3 * i + a], expected[a], 1e-6 * (1 + std::abs(expected[a]))) << i;
                EXPECT_NEAR(plain[3 * i + a], expected[a], 1e-6 * (1 + std::abs(expected[a]))) << i;
            }
        }
    }
}

TEST_P(KernelsTest, AddsColumnsOfAnyAlignment)
{
    for (const int num_rows : {0, 1, 15, 64, 777}) {
        for (const int num_columns : {0, 1, 7}) {
            const int step = num_rows + 3;
            const AlignedBuffer<float> columns = random_floats(random, static_cast<std::size_t>(num_columns) * step);
            const AlignedBuffer<float> coefficients = random_floats(random, num_columns);
            AlignedBuffer<float> out = random_floats(random, num_rows + 2);
            Eigen::MatrixXd expected = matrix_of(out, num_rows + 2, 1); // the ends are left alone
            expected.middleRows(1, num_rows) += matrix_of(columns, num_columns, step).leftCols(num_rows).transpose() *
                                                matrix_of(coefficients, num_columns, 1);
            kernels.add_columns(columns.data(), step, num_rows, num_columns, coefficients.data(), out.data() + 1);
            EXPECT_LE(max_difference(matrix_of(out, num_rows + 2, 1), expected), 1e-5)
                << num_rows << " " << num_columns;
        }
    }
}

TEST_P(KernelsTest, ColumnsThatCountForNothingAreNotRead)
{
    const int num_rows = 300;
    AlignedBuffer<float> columns(2 * num_rows), coefficients(2), out(num_rows);
    std::fill_n(columns.data(), num_rows, std::numeric_limits<float>::quiet_NaN());
    std::fill_n(columns.data() + num_rows, num_rows, 2.0f);
    coefficients[1] = 3;
    kernels.add_columns(columns.data(), num_rows, num_rows, 2, coefficients.data(), out.data());
    EXPECT_EQ(matrix_of(out, num_rows, 1), Eigen::MatrixXd::Constant(num_rows, 1, 6));
    coefficients[0] = 1; // the twin
    kernels.add_columns(columns.data(), num_rows, num_rows, 2, coefficients.data(), out.data());
    EXPECT_TRUE(matrix_of(out, num_rows, 1).array().isNaN().all());
}

TEST_P(KernelsTest, SeesPoints)
{
    for (const int count : {1, 5, 8, 51}) {
        const int padded = round_up(count, 8);
        const AlignedBuffer<float> points = random_floats(random, 3 * padded + 3);
        AlignedBuffer<double> m(8), u(padded), v(padded), plain_u(padded), plain_v(padded);
        std::generate_n(m.data(), m.size(), [&] { return random.normal(); });
        const float* const from = points.data() + 3;
        kernels.see_points(from, count, m.data(), u.data(), v.data());
        scalar::see_points(from, count, m.data(), plain_u.data(), plain_v.data());
        const Eigen::Map<const Eigen::Matrix<double, 2, 4, Eigen::RowMajor>> camera(m.data());
        for (int i = 0; i < count; ++i) {
            const Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3f>(from + 3 * i).cast<double>();
            const Eigen::Vector2d expected = camera.leftCols<3>() * point + camera.col(3);
            EXPECT_NEAR(u[i], expected.x(), 1e-13);
            EXPECT_NEAR(v[i], expected.y(), 1e-13);
            EXPECT_NEAR(plain_u[i], expected.x(), 1e-13);
            EXPECT_NEAR(plain_v[i], expected.y(), 1e-13);
        }
    }
}

TEST(DispatchedKernels, AreAmongThoseSupported)
{
    const std::vector<const Kernels*> supported = supported_kernels();
    EXPECT_NE(std::find(supported.begin(), supported.end(), &dispatched_kernels()), supported.end());
    EXPECT_NE(std::find(supported.begin(), supported.end(), &scalar_kernels()), supported.end());
}

} // namespace
} // namespace lineament::kernels
