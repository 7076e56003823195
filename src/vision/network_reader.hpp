// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Based on: TensorFlow Lite schema, version 3 (numbers of tables, fields and operations).
#pragma once

#include "flexbuffer.hpp"
#include "network.hpp"

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace lineament::network {

inline constexpr int max_length = 1 << 16; // of one axis

enum class DataType
{
    float32 = 0,
    float16 = 1,
    int32 = 2,
};

/// Numbers of the operations in the schema.
namespace code {
inline constexpr int add = 0, concatenation = 2, convolution = 3, depthwise = 4, dequantize = 6, max_pool = 17,
                     multiply = 18, relu = 19, reshape = 22, resize_bilinear = 23, custom = 32, pad = 34,
                     strided_slice = 45, prelu = 54;
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

/// Reads a .tflite file into a Network, checking every number before its use.
class NetworkReader
{
public:
    NetworkReader(std::string_view content, const std::string& path) : bytes_(content, path) {}

    /// The whole file; once.
    [[nodiscard]] Network read();

private:
    /// Of a DEQUANTIZE step its output is used, not its input.
    void drop_unused_constants();
    void read_operation_codes(const FlatTable& model);
    void read_tensors(const FlatTable& model, const FlatTable& graph);
    void read_constant(const FlatVector& data, std::size_t size, Tensor& tensor, FileTensor& described);
    /// Many tensors may name one buffer, so that a small file could ask for much memory.
    void count_constants(std::size_t size, std::size_t place);
    std::vector<int> indices(const FlatTable& table, int field, std::size_t place) const;
    void check_float(int tensor, std::size_t place) const;
    void read_step(const FlatTable& entry);
    void fold_dequantize(const FlatTable& entry, const Step& step);

    const std::vector<int>& shape(int tensor) const { return network_.tensors[tensor].shape; }
    bool is_constant(int tensor) const { return !network_.tensors[tensor].values.empty(); }
    /// Options of the operation; an absent table has all defaults.
    template <typename Number>
    static Number option(const std::optional<FlatTable>& options, int field, Number otherwise)
    {
        return options ? options->number<Number>(field, otherwise) : otherwise;
    }

    void expect(bool condition, const FlatTable& entry, const char* otherwise) const;
    void count_inputs(const FlatTable& entry, const Step& step, std::size_t count) const;
    void expect_map(const FlatTable& entry, const Step& step) const;

    /// Fills in the step and returns the shape of its output.
    std::vector<int> describe(const FlatTable& entry, const OperationCode& operation, Step& step);
    /// Output rows or columns of a window, and the zeros in front and behind.
    int window(const FlatTable& entry, bool same, int length, int extent, int stride, int* padding) const;
    void read_strides(const FlatTable& entry, const std::optional<FlatTable>& options, const std::vector<int>& map,
                      std::vector<int>& result, Step& step) const;
    std::vector<int> describe_convolution(const FlatTable& entry, const std::optional<FlatTable>& options,
                                          bool depthwise, Step& step) const;
    std::vector<int> describe_pool(const FlatTable& entry, const std::optional<FlatTable>& options, Step& step) const;
    std::vector<int> describe_pad(const FlatTable& entry, Step& step) const;
    std::vector<int> describe_concatenation(const FlatTable& entry, const std::optional<FlatTable>& options,
                                            Step& step) const;
    std::vector<int> describe_resize(const FlatTable& entry, const std::optional<FlatTable>& options, Step& step) const;
    std::vector<int> describe_custom(const FlatTable& entry, const std::string& name, Step& step) const;
    FlexMap custom_options(const FlatTable& entry) const;
    int whole(const FlatTable& entry, const FlexMap& options, std::string_view name, int largest) const;

    CheckedBytes bytes_;
    Network network_ = {};
    std::vector<OperationCode> codes_ = {};
    std::vector<FileTensor> file_ = {};
    std::size_t num_constants_ = 0;
};

} // namespace lineament::network
