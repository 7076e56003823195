// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Based on: TensorFlow Lite schema, version 3 (numbers of tables, fields and operations).
#include "flexbuffer.hpp"
#include "network.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>

namespace lineament::network {
namespace {

constexpr std::size_t max_tensors = 4096;
constexpr std::size_t max_values = std::size_t{1} << 22; // of one tensor
constexpr std::size_t max_constants = std::size_t{1} << 24;
constexpr int max_length = 1 << 16; // of one axis
constexpr std::size_t max_file_size = std::size_t{64} << 20;

enum class DataType
{
    float32 = 0,
    float16 = 1,
    int32 = 2,
};

/// Numbers of the operations in the schema.
namespace code {
constexpr int add = 0, concatenation = 2, convolution = 3, depthwise = 4, dequantize = 6, max_pool = 17, multiply = 18,
              relu = 19, reshape = 22, resize_bilinear = 23, custom = 32, pad = 34, strided_slice = 45, prelu = 54;
}

struct OperationCode
{
    int number = 0;
    std::string name = {}; ///< Of a custom operation.
    int version = 1;
};

/// What the file says of a tensor beside shape and constant.
struct FileTensor
{
    DataType type = DataType::float32;
    std::vector<int> integers = {}; ///< Of an int32 constant.
    bool known = false;             ///< A constant, the input, or computed by a step so far.
};

class Reader
{
public:
    Reader(std::string_view content, const std::string& path) : bytes_(content, path) {}

    Network read()
    {
        if (bytes_.size() < 8 || bytes_.range(4, 4) != "TFL3") {
            bytes_.fail(4, "another kind of file");
        }
        const FlatTable model(bytes_, bytes_.read<std::uint32_t>(0));
        if (model.number<std::uint32_t>(0, 0) != 3) {
            bytes_.fail(model.place(), "version " + std::to_string(model.number<std::uint32_t>(0, 0)));
        }
        const FlatVector graphs = model.vector(2, 4);
        if (graphs.count != 1) {
            bytes_.fail(model.place(), std::to_string(graphs.count) + " subgraphs");
        }
        const FlatTable graph = model.element(graphs, 0);
        read_operation_codes(model);
        read_tensors(model, graph);

        const std::vector<int> inputs = indices(graph, 1, graph.place());
        if (inputs.size() != 1 || file_[inputs[0]].known) {
            bytes_.fail(graph.place(), "other than one input");
        }
        network_.input = inputs[0];
        check_float(inputs[0], graph.place());
        file_[inputs[0]].known = true;
        const FlatVector steps = graph.vector(3, 4);
        for (std::size_t i = 0; i < steps.count; ++i) {
            read_step(graph.element(steps, i));
        }
        network_.outputs = indices(graph, 2, graph.place());
        for (const int output : network_.outputs) {
            if (!file_[output].known || is_constant(output) || file_[output].type != DataType::float32) {
                bytes_.fail(graph.place(), "an output that no operation computes");
            }
        }
        drop_unused_constants();
        return std::move(network_);
    }

private:
    /// Of a DEQUANTIZE step its output is used, not its input.
    void drop_unused_constants()
    {
        std::vector<char> used(network_.tensors.size(), 0);
        for (const Step& step : network_.steps) {
            for (const int input : step.inputs) {
                used[input] = 1;
            }
        }
        for (std::size_t i = 0; i < used.size(); ++i) {
            if (used[i] == 0) {
                std::vector<float>().swap(network_.tensors[i].values);
            }
        }
    }

    void read_operation_codes(const FlatTable& model)
    {
        const FlatVector codes = model.vector(1, 4);
        for (std::size_t i = 0; i < codes.count; ++i) {
            const FlatTable entry = model.element(codes, i);
            OperationCode operation;
            // Two fields: the first, of 8 bits, came too short; the larger one counts.
            operation.number = std::max<int>(entry.number<std::int8_t>(0, 0), entry.number<std::int32_t>(3, 0));
            operation.version = entry.number<std::int32_t>(2, 1);
            const FlatVector name = entry.vector(1, 1);
            operation.name = bytes_.range(name.begin, name.count);
            codes_.push_back(operation);
        }
    }

    void read_tensors(const FlatTable& model, const FlatTable& graph)
    {
        const FlatVector buffers = model.vector(4, 4);
        const FlatVector tensors = graph.vector(0, 4);
        if (tensors.count > max_tensors) {
            bytes_.fail(graph.place(), std::to_string(tensors.count) + " tensors");
        }
        for (std::size_t i = 0; i < tensors.count; ++i) {
            const FlatTable entry = graph.element(tensors, i);
            Tensor tensor;
            FileTensor described;
            const FlatVector shape = entry.vector(0, 4);
            std::size_t size = 1;
            for (std::size_t k = 0; k < shape.count; ++k) {
                const int length = bytes_.read<std::int32_t>(shape.begin + 4 * k);
                if (length < 1 || length > max_length || k >= 4 || size * length > max_values) {
                    bytes_.fail(entry.place(), "a tensor that is empty or too large");
                }
                size *= static_cast<std::size_t>(length);
                tensor.shape.push_back(length);
            }
            const int type = entry.number<std::int8_t>(1, 0);
            if (type < 0 || type > 2 || entry.has(6)) {
                bytes_.fail(entry.place(), "a tensor of type " + std::to_string(type) + " or sparse");
            }
            described.type = static_cast<DataType>(type);
            const std::uint32_t buffer = entry.number<std::uint32_t>(2, 0);
            if (buffer >= buffers.count) {
                bytes_.fail(entry.place(), "a buffer number beyond the list");
            }
            const FlatVector data = model.element(buffers, buffer).vector(0, 1);
            if (data.count > 0) {
                read_constant(data, size, tensor, described);
            }
            network_.tensors.push_back(std::move(tensor));
            file_.push_back(std::move(described));
        }
    }

    void read_constant(const FlatVector& data, std::size_t size, Tensor& tensor, FileTensor& described)
    {
        const std::size_t width = described.type == DataType::float16 ? 2 : 4;
        if (data.count != size * width) {
            bytes_.fail(data.begin, "a constant whose size is not that of its shape");
        }
        described.known = true;
        count_constants(size, data.begin);
        for (std::size_t i = 0; i < size; ++i) {
            const std::size_t at = data.begin + i * width;
            float value = 0.0f;
            switch (described.type) {
            case DataType::int32:
                described.integers.push_back(bytes_.read<std::int32_t>(at));
                continue;
            case DataType::float16:
                value = Eigen::half_impl::half_to_float(
                    Eigen::half_impl::raw_uint16_to_half(bytes_.read<std::uint16_t>(at)));
                break;
            case DataType::float32:
                value = bytes_.read<float>(at);
                break;
            }
            if (!std::isfinite(value)) {
                bytes_.fail(at, "a constant that is not finite");
            }
            tensor.values.push_back(value);
        }
    }

    /// Many tensors may name one buffer, so that a small file could ask for much memory.
    void count_constants(std::size_t size, std::size_t place)
    {
        num_constants_ += size;
        if (num_constants_ > max_constants) {
            bytes_.fail(place, "too many constants");
        }
    }

    std::vector<int> indices(const FlatTable& table, int field, std::size_t place) const
    {
        const FlatVector list = table.vector(field, 4);
        std::vector<int> result;
        for (std::size_t i = 0; i < list.count; ++i) {
            const int index = bytes_.read<std::int32_t>(list.begin + 4 * i);
            if (index < 0 || static_cast<std::size_t>(index) >= network_.tensors.size()) {
                bytes_.fail(place, "tensor number " + std::to_string(index));
            }
            result.push_back(index);
        }
        return result;
    }

    void check_float(int tensor, std::size_t place) const
    {
        const bool is_float = file_[tensor].type == DataType::float32;
        if (!is_float) {
            bytes_.fail(place, "an operation on a tensor that is not float");
        }
    }

    void read_step(const FlatTable& entry)
    {
        const std::uint32_t code_index = entry.number<std::uint32_t>(0, 0);
        if (code_index >= codes_.size()) {
            bytes_.fail(entry.place(), "an operation number beyond the list");
        }
        const OperationCode& operation = codes_[code_index];
        Step step;
        step.inputs = indices(entry, 1, entry.place());
        const std::vector<int> outputs = indices(entry, 2, entry.place());
        if (outputs.size() != 1 || file_[outputs[0]].known || file_[outputs[0]].type != DataType::float32) {
            bytes_.fail(entry.place(), "an operation without its own float output");
        }
        step.output = outputs[0];
        for (const int input : step.inputs) {
            if (!file_[input].known) {
                bytes_.fail(entry.place(), "an operation before its input");
            }
        }
        file_[step.output].known = true;
        if (operation.number == code::dequantize) {
            fold_dequantize(entry, step);
            return;
        }
        std::vector<int> expected = describe(entry, operation, step);
        for (const int input : step.inputs) {
            check_float(input, entry.place());
        }
        if (expected != network_.tensors[step.output].shape) {
            bytes_.fail(entry.place(), "an output of another shape than its operation gives");
        }
        network_.steps.push_back(std::move(step));
    }

    void fold_dequantize(const FlatTable& entry, const Step& step)
    {
        if (step.inputs.size() != 1 || network_.tensors[step.inputs[0]].values.empty() ||
            network_.tensors[step.inputs[0]].shape != network_.tensors[step.output].shape) {
            bytes_.fail(entry.place(), "DEQUANTIZE of something else than a float constant");
        }
        count_constants(network_.tensors[step.output].size(), entry.place());
        network_.tensors[step.output].values = network_.tensors[step.inputs[0]].values;
    }

    const std::vector<int>& shape(int tensor) const { return network_.tensors[tensor].shape; }
    bool is_constant(int tensor) const { return !network_.tensors[tensor].values.empty(); }

    /// Options of the operation; an absent table has all defaults.
    template <typename Number>
    static Number option(const std::optional<FlatTable>& options, int field, Number otherwise)
    {
        return options ? options->number<Number>(field, otherwise) : otherwise;
    }

    void expect(bool condition, const FlatTable& entry, const char* otherwise) const
    {
        if (!condition) {
            bytes_.fail(entry.place(), otherwise);
        }
    }

    void count_inputs(const FlatTable& entry, const Step& step, std::size_t count) const
    {
        expect(step.inputs.size() == count, entry, "an operation with another number of inputs");
    }

    void expect_map(const FlatTable& entry, const Step& step) const
    {
        expect(!step.inputs.empty() && shape(step.inputs[0]).size() == 4 && shape(step.inputs[0])[0] == 1, entry,
               "an operation on something else than one map of rows x columns x channels");
    }

    /// Fills in the step and returns the shape of its output.
    std::vector<int> describe(const FlatTable& entry, const OperationCode& operation, Step& step)
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

    /// Output rows or columns of a window, and the zeros in front and behind.
    int window(const FlatTable& entry, bool same, int length, int extent, int stride, int* padding) const
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

    void read_strides(const FlatTable& entry, const std::optional<FlatTable>& options, const std::vector<int>& map,
                      std::vector<int>& result, Step& step) const
    {
        const bool same = option<std::int8_t>(options, 0, 0) == 0;
        step.stride_columns = option<std::int32_t>(options, 1, 0);
        step.stride_rows = option<std::int32_t>(options, 2, 0);
        result = map;
        result[1] = window(entry, same, map[1], step.window_rows, step.stride_rows, &step.window_padding[0]);
        result[2] = window(entry, same, map[2], step.window_columns, step.stride_columns, &step.window_padding[2]);
    }

    std::vector<int> describe_convolution(const FlatTable& entry, const std::optional<FlatTable>& options,
                                          bool depthwise, Step& step) const
    {
        count_inputs(entry, step, 3);
        expect_map(entry, step);
        const std::vector<int>& map = shape(step.inputs[0]);
        const std::vector<int>& kernel = shape(step.inputs[1]);
        const std::vector<int>& bias = shape(step.inputs[2]);
        expect(is_constant(step.inputs[1]) && is_constant(step.inputs[2]) && kernel.size() == 4 && bias.size() == 1,
               entry, "a convolution without constant kernel and bias");
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
        return result;
    }

    std::vector<int> describe_pool(const FlatTable& entry, const std::optional<FlatTable>& options, Step& step) const
    {
        count_inputs(entry, step, 1);
        expect_map(entry, step);
        step.operation = Operation::max_pool;
        step.window_columns = option<std::int32_t>(options, 3, 0);
        step.window_rows = option<std::int32_t>(options, 4, 0);
        expect(option<std::int8_t>(options, 5, 0) == 0, entry, "a fused activation");
        const auto in_range = [](int extent) { return extent >= 1 && extent <= 64; };
        expect(in_range(step.window_rows) && in_range(step.window_columns) &&
                   step.window_rows * step.window_columns > 1,
               entry, "a pooling window out of range");
        std::vector<int> result;
        read_strides(entry, options, shape(step.inputs[0]), result, step);
        return result;
    }

    std::vector<int> describe_pad(const FlatTable& entry, Step& step) const
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

    std::vector<int> describe_concatenation(const FlatTable& entry, const std::optional<FlatTable>& options,
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

    std::vector<int> describe_resize(const FlatTable& entry, const std::optional<FlatTable>& options, Step& step) const
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

    std::vector<int> describe_custom(const FlatTable& entry, const std::string& name, Step& step) const
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

    FlexMap custom_options(const FlatTable& entry) const
    {
        const FlatVector options = entry.vector(5, 1);
        return {bytes_, options.begin, options.count};
    }

    int whole(const FlatTable& entry, const FlexMap& options, std::string_view name, int largest) const
    {
        const double value = options.number(name);
        expect(value >= 0.0 && value <= largest && value == std::floor(value), entry, "an option out of range");
        return static_cast<int>(value);
    }

    CheckedBytes bytes_;
    Network network_ = {};
    std::vector<OperationCode> codes_ = {};
    std::vector<FileTensor> file_ = {};
    std::size_t num_constants_ = 0;
};

} // namespace

Network parse_network(std::string_view bytes, const std::string& path)
{
    return Reader(bytes, path).read();
}

Network load_network(const std::string& path, NetworkTrust trust)
{
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(path, error);
    std::ifstream file(path, std::ios::binary);
    if (error || !file) {
        throw IoError(IoErrorKind::system, path, "", "network not found or not readable; see models/README.md");
    }
    if (size > max_file_size) {
        throw IoError(IoErrorKind::limit, path, "", "expected a network of at most 64 MB");
    }
    std::string bytes(static_cast<std::size_t>(size), '\0');
    file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    if (static_cast<std::uintmax_t>(file.gcount()) != size) {
        throw IoError(IoErrorKind::system, path, "", "reading failed");
    }
    // face_detection_short_range, face_detection_full_range, face_landmark_with_attention: models/README.md
    static constexpr std::array<std::string_view, 3> known = {
        "3bc182eb9f33925d9e58b5c8d59308a760f4adea8f282370e428c51212c26633",
        "99bf9494d84f50acc6617d89873f71bf6635a841ea699c17cb3377f9507cfec3",
        "883b7411747bac657c30c462d305d312e9dec6adbf8b85e2f5d8d722fca9455d"};
    if (trust == NetworkTrust::known_only && std::find(known.begin(), known.end(), sha256(bytes)) == known.end()) {
        throw IoError(IoErrorKind::content, path, "",
                      "expected one of the networks listed in models/README.md, found a file of another SHA-256");
    }
    return parse_network(bytes, path);
}

} // namespace lineament::network
