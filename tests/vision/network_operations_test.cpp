// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Both engines run these operations by the same code, so they are held against values computed by hand.
#include "engine.hpp"

#include "support/matchers.hpp"

namespace lineament::network {
namespace {

/// The values of a network of one step: tensor 0 is its input, further ones are constants, the last is its output.
Eigen::VectorXf run(Step step, const Tensor& input, const std::vector<Tensor>& constants,
                    const std::vector<int>& output_shape)
{
    Network network;
    network.tensors.push_back({.shape = input.shape});
    network.tensors.insert(network.tensors.end(), constants.begin(), constants.end());
    for (std::size_t i = 0; i < network.tensors.size(); ++i) {
        step.inputs.push_back(static_cast<int>(i));
    }
    step.output = static_cast<int>(network.tensors.size());
    network.outputs = {step.output};
    network.tensors.push_back({.shape = output_shape});
    network.steps = {step};
    const std::unique_ptr<Engine> engine = make_plain_engine(network);
    std::copy(input.values.begin(), input.values.end(), engine->input().begin());
    engine->run();
    const std::span<const float> values = engine->output(0);
    const Eigen::VectorXf result =
        Eigen::Map<const Eigen::VectorXf>(values.data(), static_cast<Eigen::Index>(values.size()));
    if (const std::unique_ptr<Engine> fast = make_engine(network)) {
        std::copy(input.values.begin(), input.values.end(), fast->input().begin());
        fast->run();
        const std::span<const float> others = fast->output(0);
        EXPECT_TRUE(std::equal(values.begin(), values.end(), others.begin(), others.end()));
    }
    return result;
}

template <typename... Numbers>
Eigen::VectorXf vector(Numbers... numbers)
{
    const std::array<float, sizeof...(numbers)> values = {static_cast<float>(numbers)...};
    return Eigen::Map<const Eigen::VectorXf>(values.data(), sizeof...(numbers));
}

Tensor identity_matrix()
{
    return {.shape = {1, 4, 4}, .values = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
}

/// 2 rows x 3 columns x 2 channels: 10 row + column, and 100 more.
Tensor small_map()
{
    return {.shape = {1, 2, 3, 2}, .values = {0, 100, 1, 101, 2, 102, 10, 110, 11, 111, 12, 112}};
}

TEST(NetworkOperation, MultiplyIsByValuesOfOneShapeOrByOneValue)
{
    const Tensor input = {.shape = {1, 3}, .values = {1, -2, 3}};
    const Step step = {.operation = Operation::multiply};
    EXPECT_THAT(run(step, input, {{.shape = {1, 3}, .values = {4, 5, -6}}}, {1, 3}),
                test::IsNear(vector(4, -10, -18), 0));
    EXPECT_THAT(run(step, input, {{.shape = {1}, .values = {0.5}}}, {1, 3}), test::IsNear(vector(0.5, -1, 1.5), 0));
}

TEST(NetworkOperation, ReshapeKeepsTheMemoryAndConcatenateAppendsIt)
{
    const Tensor input = {.shape = {1, 2, 2}, .values = {1, 2, 3, 4}};
    EXPECT_THAT(run({.operation = Operation::reshape}, input, {}, {1, 4}), test::IsNear(vector(1, 2, 3, 4), 0));
    EXPECT_THAT(run({.operation = Operation::concatenate}, input,
                    {{.shape = {1, 1, 2}, .values = {5, 6}}, {.shape = {1, 2, 2}, .values = {7, 8, 9, 0}}}, {1, 5, 2}),
                test::IsNear(vector(1, 2, 3, 4, 5, 6, 7, 8, 9, 0), 0));
}

TEST(NetworkOperation, TransformPointsUsesTheTwoUpperRowsOfTheMatrix)
{
    const Tensor matrix = {.shape = {1, 4, 4}, .values = {2, -1, 9, 3, 0.5, 4, 9, -2, 9, 9, 9, 9, 9, 9, 9, 9}};
    EXPECT_THAT(run({.operation = Operation::transform_points}, {.shape = {1, 2, 2}, .values = {5, 7, 0, 0}}, {matrix},
                    {1, 2, 2}),
                test::IsNear(vector(6, 28.5, 3, -2), 0)); // 10 - 7 + 3, 2.5 + 28 - 2
}

TEST(NetworkOperation, SampleRegionIsBilinearBetweenPixelCentresAndZeroBeyondThem)
{
    const Step step = {.operation = Operation::sample_region};
    EXPECT_THAT(run(step, small_map(), {identity_matrix()}, {1, 2, 3, 2}),
                test::IsNear(vector(0, 100, 1, 101, 2, 102, 10, 110, 11, 111, 12, 112), 0));
    Tensor shifted = identity_matrix();
    shifted.values[3] = 0.5f;  // columns; the third one falls half a pixel beyond the last centre
    shifted.values[7] = 0.25f; // rows; likewise the second row
    EXPECT_THAT(run(step, small_map(), {shifted}, {1, 2, 3, 2}),
                test::IsNear(vector(3, 103, 4, 104, 0, 0, 0, 0, 0, 0, 0, 0), 1e-5)); // 0.5 + 0.25 * 10
    // A quarter turn: grid x runs down the map's rows, grid y from its right to its left; x = 3 - v, y = u.
    const Tensor turned = {.shape = {1, 4, 4}, .values = {0, -1, 0, 3, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
    EXPECT_THAT(run(step, small_map(), {turned}, {1, 3, 2, 2}),
                test::IsNear(vector(2, 102, 12, 112, 1, 101, 11, 111, 0, 100, 10, 110), 1e-5));
}

TEST(NetworkOperation, RegionMatrixEnclosesThePointsInAxesAlongTwoOfThem)
{
    // Upright: the points span 20 x 40 around (20, 40), enlarged 1.5 and 2 times, on a grid of 10 x 5.
    Step step = {.operation = Operation::region_matrix};
    step.region = {
        .points = {0, 2}, .left_point = 0, .right_point = 1, .scale_x = 1.5, .scale_y = 2, .width = 10, .height = 5};
    EXPECT_THAT(run(step, {.shape = {1, 3, 3}, .values = {10, 20, 7, 500, 20, 7, 30, 60, 7}}, {}, {1, 4, 4}),
                test::IsNear(vector(3, 0, 0, 5, 0, 16, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1), 1e-4));
    // Turned by 90 degrees: x axis of the grid down, so that its corner is the upper right one, (4, 0).
    step.region = {.points = {0, 1, 2}, .left_point = 0, .right_point = 1, .width = 5, .height = 2};
    const Tensor points = {.shape = {1, 3, 3}, .values = {0, 0, 0, 0, 10, 0, 4, 5, 0}};
    EXPECT_THAT(run(step, points, {}, {1, 4, 4}),
                test::IsNear(vector(0, -2, 0, 4, 2, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1), 1e-5));
    // The same 90 degrees as the target: upright again, the rectangle's corner at (0, 0).
    step.region.target_rotation = 1.5707963267948966;
    EXPECT_THAT(run(step, points, {}, {1, 4, 4}),
                test::IsNear(vector(0.8, 0, 0, 0, 0, 5, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1), 1e-5));
}

} // namespace
} // namespace lineament::network
