// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The file's tables: operation codes, tensors and constants, steps in their order.
#include "network_reader.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace lineament::network {
namespace {

constexpr std::size_t max_tensors = 4096;
constexpr std::size_t max_values = std::size_t{1} << 22;     // of one tensor
constexpr std::size_t max_all_values = std::size_t{1} << 26; // of all tensors
constexpr std::size_t max_constants = std::size_t{1} << 24;

} // namespace

Network NetworkReader::read()
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

void NetworkReader::drop_unused_constants()
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

void NetworkReader::read_operation_codes(const FlatTable& model)
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

void NetworkReader::read_tensors(const FlatTable& model, const FlatTable& graph)
{
    const FlatVector buffers = model.vector(4, 4);
    const FlatVector tensors = graph.vector(0, 4);
    if (tensors.count > max_tensors) {
        bytes_.fail(graph.place(), std::to_string(tensors.count) + " tensors");
    }
    std::size_t all_values = 0;
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
        all_values += size;
        if (all_values > max_all_values) {
            bytes_.fail(entry.place(), "tensors that are too large together");
        }
        const auto type = entry.number<std::int8_t>(1, 0);
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

void NetworkReader::read_constant(const FlatVector& data, std::size_t size, Tensor& tensor, FileTensor& described)
{
    const std::size_t width = described.type == DataType::float16 ? 2 : 4;
    if (data.count != size * width) {
        bytes_.fail(data.begin, "a constant whose size is not that of its shape");
    }
    described.known = true;
    count_constants(size, data.begin);
    const char* const bytes = bytes_.range(data.begin, size * width).data();
    if (described.type == DataType::int32) {
        described.integers.resize(size);
        std::memcpy(described.integers.data(), bytes, size * width);
        return;
    }
    tensor.values.resize(size);
    if (described.type == DataType::float32) {
        std::memcpy(tensor.values.data(), bytes, size * width);
    } else {
        for (std::size_t i = 0; i < size; ++i) {
            std::uint16_t half = 0;
            std::memcpy(&half, bytes + i * width, sizeof half);
            tensor.values[i] = Eigen::half_impl::half_to_float(Eigen::half_impl::raw_uint16_to_half(half));
        }
    }
    const auto is_not_finite = [](float value) { return !std::isfinite(value); };
    const auto fault = std::find_if(tensor.values.begin(), tensor.values.end(), is_not_finite);
    if (fault != tensor.values.end()) {
        bytes_.fail(data.begin + static_cast<std::size_t>(fault - tensor.values.begin()) * width,
                    "a constant that is not finite");
    }
}

void NetworkReader::count_constants(std::size_t size, std::size_t place)
{
    num_constants_ += size;
    if (num_constants_ > max_constants) {
        bytes_.fail(place, "too many constants");
    }
}

std::vector<int> NetworkReader::indices(const FlatTable& table, int field, std::size_t place) const
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

void NetworkReader::check_float(int tensor, std::size_t place) const
{
    const bool is_float = file_[tensor].type == DataType::float32;
    if (!is_float) {
        bytes_.fail(place, "an operation on a tensor that is not float");
    }
}

void NetworkReader::read_step(const FlatTable& entry)
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

void NetworkReader::fold_dequantize(const FlatTable& entry, const Step& step)
{
    if (step.inputs.size() != 1 || network_.tensors[step.inputs[0]].values.empty() ||
        network_.tensors[step.inputs[0]].shape != network_.tensors[step.output].shape) {
        bytes_.fail(entry.place(), "DEQUANTIZE of something else than a float constant");
    }
    count_constants(network_.tensors[step.output].size(), entry.place());
    network_.tensors[step.output].values = network_.tensors[step.inputs[0]].values;
}

} // namespace lineament::network
