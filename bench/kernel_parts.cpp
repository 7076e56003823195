// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "kernel_parts.hpp"

#include "lineament/kernels/aligned_buffer.hpp"
#include "multiply_adds.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <numeric>
#include <vector>

namespace lineament::bench {
namespace {

using kernels::AlignedBuffer;
using kernels::Kernels;

void read_limit(benchmark::State& state, const Kernels& kernels, std::int64_t num_bytes)
{
    const int num_rows = static_cast<int>(num_bytes / (4 * 64));
    AlignedBuffer<float> rows(static_cast<std::size_t>(num_rows) * 64);
    AlignedBuffer<float> factors(static_cast<std::size_t>(num_rows));
    std::fill_n(rows.data(), rows.size(), 1e-3f);
    std::fill_n(factors.data(), factors.size(), 1e-3f);
    AlignedBuffer<float> sums(64);
    for (auto _ : state) {
        kernels.add_rows(rows.data(), num_rows, 64, factors.data(), sums.data());
        benchmark::DoNotOptimize(sums.data());
    }
    state.SetLabel("reading");
    state.counters["bytes"] = benchmark::Counter(4.0 * 64 * num_rows, benchmark::Counter::kIsIterationInvariantRate,
                                                 benchmark::Counter::kIs1000);
}

void arithmetic_limit(benchmark::State& state, bench::MultiplyAdds multiply_adds, std::int64_t num_operations)
{
    for (auto _ : state) {
        benchmark::DoNotOptimize(multiply_adds(num_operations));
    }
    state.SetLabel("arithmetic");
    state.counters["flop"] =
        benchmark::Counter(static_cast<double>(num_operations), benchmark::Counter::kIsIterationInvariantRate,
                           benchmark::Counter::kIs1000);
}

constexpr int width = 64;
constexpr int num_unknowns = 60;
constexpr int num_contour_rows = 32;
constexpr int num_points = 68;

constexpr std::int64_t gram_operations = num_contour_rows * width * (width + 1); // the upper triangle
constexpr std::int64_t gram_bytes = 6 * 4 * width * (width + 1) / 2;
constexpr std::int64_t solve_operations =
    num_unknowns * num_unknowns * num_unknowns / 3 + 2 * num_unknowns * num_unknowns;
// A step of JointFitter, of alpha, six expressions and the camera:
constexpr int num_joint_rows = 2 * num_points;
constexpr int num_joint_unknowns = 72;
constexpr int joint_width = 80; // they end where rows do
constexpr int joint_begin = joint_width - num_joint_unknowns;
constexpr std::int64_t joint_gram_operations = num_joint_rows * num_joint_unknowns * (num_joint_unknowns + 1);
constexpr std::int64_t factor_and_invert_operations =
    2 * num_joint_unknowns * num_joint_unknowns * num_joint_unknowns / 3; // a triangle each

constexpr std::int64_t row_bytes = 4 * 3 * num_points * width;

void add_gram(benchmark::State& state, const Kernels& kernels)
{
    AlignedBuffer<float> rows(num_contour_rows * width);
    std::fill_n(rows.data(), rows.size(), 1e-3f);
    AlignedBuffer<float> gram(width * width);
    for (auto _ : state) {
        kernels.add_gram(rows.data(), num_contour_rows, 0, width, width, gram.data());
        benchmark::DoNotOptimize(gram.data());
    }
}

void joint_gram(benchmark::State& state, const Kernels& kernels)
{
    AlignedBuffer<float> rows(num_joint_rows * joint_width);
    std::fill_n(rows.data(), rows.size(), 1e-3f);
    AlignedBuffer<float> gram(joint_width * joint_width);
    for (auto _ : state) {
        kernels.set_gram(rows.data(), num_joint_rows, joint_begin, joint_width, joint_width, gram.data());
        benchmark::DoNotOptimize(gram.data());
    }
}

void factor_and_invert(benchmark::State& state, const Kernels& kernels)
{
    AlignedBuffer<float> matrix(num_joint_unknowns * joint_width), system(num_joint_unknowns * joint_width);
    AlignedBuffer<float> inverses(joint_width), inverse(num_joint_unknowns * joint_width);
    std::fill_n(matrix.data(), matrix.size(), 0.25f);
    for (int i = 0; i < num_joint_unknowns; ++i) {
        matrix[static_cast<std::size_t>(joint_begin + (joint_width + 1) * i)] = 8;
    }
    for (auto _ : state) {
        benchmark::DoNotOptimize(kernels.factor_and_invert_float(matrix.data(), num_joint_unknowns, joint_begin,
                                                                 joint_width, system.data(), inverses.data(),
                                                                 num_joint_unknowns, inverse.data(), joint_width));
    }
}

void reference_factor_and_invert(benchmark::State& state)
{
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Constant(num_joint_unknowns, num_joint_unknowns, 0.25);
    matrix.diagonal().setConstant(8);
    Eigen::MatrixXd inverse(num_joint_unknowns, num_joint_unknowns);
    for (auto _ : state) {
        inverse.setIdentity();
        matrix.llt().matrixL().solveInPlace(inverse);
        benchmark::DoNotOptimize(inverse.data());
    }
}

void reference_gram(benchmark::State& state, int num_columns, int num_rows)
{
    const Eigen::MatrixXd rows = Eigen::MatrixXd::Constant(num_columns, num_rows, 1e-3);
    Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(num_columns, num_columns);
    for (auto _ : state) {
        gram.selfadjointView<Eigen::Lower>().rankUpdate(rows);
        benchmark::DoNotOptimize(gram.data());
    }
}

void combine_grams(benchmark::State& state, const Kernels& kernels)
{
    const AlignedBuffer<float> grams(6 * width * width);
    AlignedBuffer<float> gram(width * width);
    const float scales[6] = {1, 2, 3, 4, 5, 6};
    for (auto _ : state) {
        kernels.combine_grams(grams.data(), width, width, scales, gram.data());
        benchmark::DoNotOptimize(gram.data());
    }
}

void solve_positive(benchmark::State& state, const Kernels& kernels)
{
    AlignedBuffer<float> system(width * width);
    AlignedBuffer<float> x(width);
    for (auto _ : state) {
        std::fill_n(system.data(), system.size(), 0.25f); // a copy of 16 kB, as small as the solve is large
        for (int i = 0; i < num_unknowns; ++i) {
            system[static_cast<std::size_t>((width + 1) * i)] = 8;
        }
        benchmark::DoNotOptimize(kernels.solve_positive(system.data(), num_unknowns, width, x.data()));
    }
}

void reference_solve_positive(benchmark::State& state)
{
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Constant(num_unknowns, num_unknowns, 0.25);
    matrix.diagonal().setConstant(8);
    const Eigen::VectorXd right = Eigen::VectorXd::Constant(num_unknowns, 0.25);
    for (auto _ : state) {
        benchmark::DoNotOptimize(matrix.llt().solve(right).eval().data());
    }
}

void multiply_rows(benchmark::State& state, const Kernels& kernels)
{
    const AlignedBuffer<float> rows(3 * num_points * width);
    const AlignedBuffer<float> x(width);
    AlignedBuffer<float> out(3 * num_points);
    std::vector<int> indices(num_points);
    std::iota(indices.begin(), indices.end(), 0);
    for (auto _ : state) {
        kernels.multiply_rows(rows.data(), width, indices.data(), num_points, x.data(), out.data());
        benchmark::DoNotOptimize(out.data());
    }
}

void reference_multiply_rows(benchmark::State& state)
{
    const Eigen::MatrixXd columns = Eigen::MatrixXd::Ones(width, 3 * num_points);
    const Eigen::VectorXd x = Eigen::VectorXd::Ones(width);
    for (auto _ : state) {
        benchmark::DoNotOptimize((columns.transpose() * x).eval().data());
    }
}

} // namespace

void add_read_limit(const std::string& name, const Kernels& kernels, std::int64_t num_bytes)
{
    add(name, [=, &kernels](benchmark::State& s) { read_limit(s, kernels, num_bytes); });
}

void add_arithmetic_limit(const std::string& name, const Kernels& kernels, std::int64_t num_operations)
{
    if (const MultiplyAdds multiply_adds = multiply_adds_of(kernels)) {
        add(name, [=](benchmark::State& s) { arithmetic_limit(s, multiply_adds, num_operations); });
    }
}

void register_kernels(const Kernels& kernels)
{
    const std::string prefix = std::string(kernels.name) + "/";
    const std::string limit = prefix + "limit/";
    const auto add_kernel = [&](const std::string& name, auto function) {
        add(prefix + name, [=, &kernels](benchmark::State& s) { function(s, kernels); });
    };
    add_kernel("add_gram", add_gram);
    add_arithmetic_limit(limit + "add_gram", kernels, gram_operations);
    add_kernel("combine_grams", combine_grams);
    add_read_limit(limit + "combine_grams", kernels, gram_bytes);
    add_kernel("solve_positive", solve_positive);
    add_arithmetic_limit(limit + "solve_positive", kernels, solve_operations);
    add_kernel("joint_gram", joint_gram);
    add_arithmetic_limit(limit + "joint_gram", kernels, joint_gram_operations);
    add_kernel("factor_and_invert", factor_and_invert);
    add_arithmetic_limit(limit + "factor_and_invert", kernels, factor_and_invert_operations);
    add_kernel("multiply_rows", multiply_rows);
    add_read_limit(limit + "multiply_rows", kernels, row_bytes);
}

void register_reference_kernels()
{
    add("reference/add_gram", [](benchmark::State& s) { reference_gram(s, width, num_contour_rows); });
    add("reference/joint_gram", [](benchmark::State& s) { reference_gram(s, num_joint_unknowns, num_joint_rows); });
    add("reference/factor_and_invert", reference_factor_and_invert);
    add("reference/solve_positive", reference_solve_positive);
    add("reference/multiply_rows", reference_multiply_rows);
}

} // namespace lineament::bench
