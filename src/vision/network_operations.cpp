// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What each operation needs of its inputs and options, and the shape of its output.
#include "network_reader.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace lineament::network {

void NetworkReader::expect(bool condition, const FlatTable& entry, const char* otherwise) const
{
    if (!condition) {
        bytes_.fail(entry.place(), otherwise);
    }
}

void NetworkReader::count_inputs(const FlatTable& entry, const Step& step, std::size_t count) const
{
    expect(step.inputs.size() == count, entry, "an operation with another number of inputs");
}

void NetworkReader::expect_map(const FlatTable& entry, const Step& step) const
{
    expect(!step.inputs.empty() && shape(step.inputs[0]).size() == 4 && shape(step.inputs[0])[0] == 1, entry,
           "an operation on something else than one map of rows x columns x channels");
}

std::vector<int> NetworkReader::describe(const FlatTable& entry, const OperationCode& operation, Step& step)
{
    std::optional<FlatTable> options;
    if (entry.has(4)) {
        options = entry.table(4);
    }
    switch (operation.number) {
    case code::convolution:
    case code::depthwise:
        return describe_convolution(entry, options, operation.number == code::depthwise, step);
    case code::max_pool:
        return describe_pool(entry, options, step);
    case code::add:
    case code::multiply:
        count_inputs(entry, step, 2);
        expect(option<std::int8_t>(options, 0, 0) == 0, entry, "a fused activation");
        step.operation = operation.number == code::add ? Operation::add : Operation::multiply;
        expect(shape(step.inputs[0]) == shape(step.inputs[1]) ||
                   (operation.number == code::multiply && network_.tensors[step.inputs[1]].size() == 1),
               entry, "an operation on two shapes that differ");
        return shape(step.inputs[0]);
    case code::relu:
        count_inputs(entry, step, 1);
        expect_map(entry, step);
        step.operation = Operation::relu;
        return shape(step.inputs[0]);
    case code::prelu:
        count_inputs(entry, step, 2);
        expect_map(entry, step);
        step.operation = Operation::prelu;
        expect(is_constant(step.inputs[1]) &&
                   network_.tensors[step.inputs[1]].size() == static_cast<std::size_t>(shape(step.inputs[0])[3]),
               entry, "PRELU with other than one slope for each channel");
        return shape(step.inputs[0]);
    case code::pad:
        return describe_pad(entry, step);
    case code::reshape:
        expect(step.inputs.size() == 1 || step.inputs.size() == 2, entry, "RESHAPE with several inputs");
        step.inputs.resize(1);
        step.operation = Operation::reshape;
        expect(network_.tensors[step.inputs[0]].size() == network_.tensors[step.output].size(), entry,
               "RESHAPE to another size");
        return shape(step.output);
    case code::concatenation:
        return describe_concatenation(entry, options, step);
    case code::resize_bilinear:
        return describe_resize(entry, options, step);
    case code::strided_slice: {
        // Only as an identity, whatever the bounds: the whole tensor, step 1.
        count_inputs(entry, step, 4);
        const std::vector<int>& begin = file_[step.inputs[1]].integers;
        const std::vector<int>& stride = file_[step.inputs[3]].integers;
        const auto is = [](int value) { return [value](int x) { return x == value; }; };
        expect(std::all_of(begin.begin(), begin.end(), is(0)) && std::all_of(stride.begin(), stride.end(), is(1)) &&
                   !begin.empty() && !stride.empty(),
               entry, "STRIDED_SLICE that is no identity");
        step.inputs.resize(1);
        step.operation = Operation::reshape;
        return shape(step.inputs[0]);
    }
    case code::custom:
        expect(operation.version == 2, entry, "a custom operation of another version than 2");
        return describe_custom(entry, operation.name, step);
    default:
        bytes_.fail(entry.place(), "operation " + std::to_string(operation.number) + ", which is not supported");
    }
}

int NetworkReader::window(const FlatTable& entry, bool same, int length, int extent, int stride, int* padding) const
{
    expect(stride >= 1 && stride <= 16 && extent >= 1 && extent <= 64, entry, "a stride or window out of range");
    if (!same) {
        expect(length >= extent, entry, "a window larger than its map");
        return (length - extent) / stride + 1;
    }
    const int count = (length + stride - 1) / stride;
    const int total = std::max((count - 1) * stride + extent - length, 0);
    padding[0] = total / 2;
    padding[1] = total - total / 2;
    return count;
}

void NetworkReader::read_strides(const FlatTable& entry, const std::optional<FlatTable>& options,
                                 const std::vector<int>& map, std::vector<int>& result, Step& step) const
{
    const bool same = option<std::int8_t>(options, 0, 0) == 0;
    step.stride_columns = option<std::int32_t>(options, 1, 0);
    step.stride_rows = option<std::int32_t>(options, 2, 0);
    result = map;
    result[1] = window(entry, same, map[1], step.window_rows, step.stride_rows, &step.window_padding[0]);
    result[2] = window(entry, same, map[2], step.window_columns, step.stride_columns, &step.window_padding[2]);
}

std::vector<int> NetworkReader::describe_convolution(const FlatTable& entry, const std::optional<FlatTable>& options,
                                                     bool depthwise, Step& step) const
{
    count_inputs(entry, step, 3);
    expect_map(entry, step);
    const std::vector<int>& map = shape(step.inputs[0]);
    const std::vector<int>& kernel = shape(step.inputs[1]);
    const std::vector<int>& bias = shape(step.inputs[2]);
    expect(is_constant(step.inputs[1]) && is_constant(step.inputs[2]) && kernel.size() == 4 && bias.size() == 1, entry,
           "a convolution without constant kernel and bias");
    const int channels = depthwise ? kernel[3] : kernel[0];
    expect(bias[0] == channels && kernel[3] == map[3] && (!depthwise || kernel[0] == 1), entry,
           "a convolution whose channels do not agree");
    const int activation = depthwise ? 4 : 3;
    expect(option<std::int8_t>(options, activation, 0) == 0, entry, "a fused activation");
    expect(option<std::int32_t>(options, activation + 1, 1) == 1 &&
               option<std::int32_t>(options, activation + 2, 1) == 1 &&
               (!depthwise || option<std::int32_t>(options, 3, 1) == 1),
           entry, "a dilation or depth multiplier");
    step.operation = depthwise ? Operation::depthwise_convolution : Operation::convolution;
    step.window_rows = kernel[1];
    step.window_columns = kernel[2];
    std::vector<int> result;
    read_strides(entry, options, map, result, step);
    result[3] = channels;
    // The plain engine lays the windows of one row side by side.
    constexpr std::int64_t max_windows = std::int64_t{1} << 24;
    const std::int64_t row = std::int64_t{result[2]} * kernel[1] * kernel[2];
    expect(row <= max_windows && row * kernel[3] <= max_windows, entry, "a convolution that is too large");
    return result;
}

std::vector<int> NetworkReader::describe_pool(const FlatTable& entry, const std::optional<FlatTable>& options,
                                              Step& step) const
{
    count_inputs(entry, step, 1);
    expect_map(entry, step);
    step.operation = Operation::max_pool;
    step.window_columns = option<std::int32_t>(options, 3, 0);
    step.window_rows = option<std::int32_t>(options, 4, 0);
    expect(option<std::int8_t>(options, 5, 0) == 0, entry, "a fused activation");
    const auto in_range = [](int extent) { return extent >= 1 && extent <= 64; };
    expect(in_range(step.window_rows) && in_range(step.window_columns) && step.window_rows * step.window_columns > 1,
           entry, "a pooling window out of range");
    std::vector<int> result;
    read_strides(entry, options, shape(step.inputs[0]), result, step);
    return result;
}

std::vector<int> NetworkReader::describe_pad(const FlatTable& entry, Step& step) const
{
    count_inputs(entry, step, 2);
    std::vector<int> result = shape(step.inputs[0]);
    const std::vector<int>& amounts = file_[step.inputs[1]].integers;
    expect(amounts.size() == 2 * result.size() && result.size() == 4, entry, "PAD without constant amounts");
    for (std::size_t axis = 0; axis < result.size(); ++axis) {
        const int before = amounts[2 * axis];
        const int after = amounts[2 * axis + 1];
        expect(before >= 0 && after >= 0 && before <= max_length && after <= max_length, entry, "PAD out of range");
        result[axis] += before + after;
        step.padding.push_back({before, after});
    }
    step.inputs.resize(1);
    step.operation = Operation::pad;
    return result;
}

std::vector<int> NetworkReader::describe_concatenation(const FlatTable& entry, const std::optional<FlatTable>& options,
                                                       Step& step) const
{
    const int axis = option<std::int32_t>(options, 0, 0);
    expect(!step.inputs.empty() && option<std::int8_t>(options, 1, 0) == 0, entry, "CONCATENATION of nothing");
    std::vector<int> result = shape(step.inputs[0]);
    expect(axis >= 0 && axis < static_cast<int>(result.size()) &&
               std::all_of(result.begin(), result.begin() + axis, [](int length) { return length == 1; }),
           entry, "CONCATENATION along another axis than the first");
    result[axis] = 0;
    std::int64_t sum = 0;
    for (const int input : step.inputs) {
        std::vector<int> other = shape(input);
        expect(other.size() == result.size(), entry, "CONCATENATION of shapes that differ");
        sum += other[axis];
        other[axis] = 0;
        expect(other == result && sum <= max_length, entry, "CONCATENATION of shapes that differ");
    }
    result[axis] = static_cast<int>(sum);
    step.operation = Operation::concatenate;
    return result;
}

std::vector<int> NetworkReader::describe_resize(const FlatTable& entry, const std::optional<FlatTable>& options,
                                                Step& step) const
{
    count_inputs(entry, step, 2);
    expect_map(entry, step);
    const std::vector<int>& size = file_[step.inputs[1]].integers;
    expect(option<std::int8_t>(options, 2, 0) == 0 && option<std::int8_t>(options, 3, 0) == 1 && size.size() == 2,
           entry, "RESIZE_BILINEAR without half-pixel centres");
    step.operation = Operation::resize_bilinear;
    std::vector<int> result = shape(step.inputs[0]);
    result[1] = size[0];
    result[2] = size[1];
    step.inputs.resize(1);
    return result;
}

std::vector<int> NetworkReader::describe_custom(const FlatTable& entry, const std::string& name, Step& step) const
{
    const auto is_matrix = [&](int tensor) { return shape(tensor) == std::vector<int>{1, 4, 4}; };
    if (name == "TransformLandmarks") {
        count_inputs(entry, step, 2);
        const std::vector<int>& points = shape(step.inputs[0]);
        expect(points.size() == 3 && points[0] == 1 && points[2] == 2 && is_matrix(step.inputs[1]), entry,
               "TransformLandmarks of something else than points and a matrix");
        step.operation = Operation::transform_points;
        return points;
    }
    if (name == "TransformTensorBilinear") {
        count_inputs(entry, step, 2);
        expect_map(entry, step);
        expect(is_matrix(step.inputs[1]), entry, "TransformTensorBilinear without a matrix");
        const FlexMap options = custom_options(entry);
        step.operation = Operation::sample_region;
        return {1, whole(entry, options, "output_height", max_length),
                whole(entry, options, "output_width", max_length), shape(step.inputs[0])[3]};
    }
    expect(name == "Landmarks2TransformMatrix", entry, "a custom operation that is not supported");
    count_inputs(entry, step, 1);
    const std::vector<int>& points = shape(step.inputs[0]);
    expect(points.size() == 3 && points[0] == 1 && points[2] == 3, entry,
           "Landmarks2TransformMatrix of something else than points");
    const FlexMap options = custom_options(entry);
    step.operation = Operation::region_matrix;
    Region& region = step.region;
    region.left_point = whole(entry, options, "left_rotation_idx", points[1] - 1);
    region.right_point = whole(entry, options, "right_rotation_idx", points[1] - 1);
    region.width = whole(entry, options, "output_width", max_length);
    region.height = whole(entry, options, "output_height", max_length);
    region.scale_x = options.number("scale_x");
    region.scale_y = options.number("scale_y");
    region.target_rotation = options.number("target_rotation_radians");
    expect(region.width > 0 && region.height > 0 && region.scale_x > 0.0 && region.scale_x < 1e6 &&
               region.scale_y > 0.0 && region.scale_y < 1e6 && std::abs(region.target_rotation) < 10.0,
           entry, "Landmarks2TransformMatrix with an option out of range");
    for (const std::int64_t index : options.integers("subset_idxs")) {
        expect(index >= 0 && index < points[1], entry, "Landmarks2TransformMatrix with a point out of range");
        region.points.push_back(static_cast<int>(index));
    }
    expect(!region.points.empty(), entry, "Landmarks2TransformMatrix without points");
    return {1, 4, 4};
}

FlexMap NetworkReader::custom_options(const FlatTable& entry) const
{
    const FlatVector options = entry.vector(5, 1);
    return {bytes_, options.begin, options.count};
}

int NetworkReader::whole(const FlatTable& entry, const FlexMap& options, std::string_view name, int largest) const
{
    const double value = options.number(name);
    expect(value >= 0.0 && value <= largest && value == std::floor(value), entry, "an option out of range");
    return static_cast<int>(value);
}

} // namespace lineament::network
