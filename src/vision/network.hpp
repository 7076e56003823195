// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace lineament::network {

/// What a step of a network computes; tensors are rows x columns x channels, channels fastest, behind a 1 for the
/// batch.
enum class Operation
{
    convolution,           ///< inputs: map, kernels (out x rows x columns x in), bias
    depthwise_convolution, ///< inputs: map, kernels (1 x rows x columns x channels), bias
    add,                   ///< of two maps of one shape
    multiply,              ///< by a tensor of the same shape or of one value
    relu,
    prelu,           ///< inputs: map, slope of the negative side for each channel
    max_pool,        ///< windows rows x columns
    pad,             ///< with zeros
    reshape,         ///< other shape, same memory
    concatenate,     ///< along the first axis longer than 1, so that memory is appended
    resize_bilinear, ///< pixel centres at +0.5
    region_matrix,   ///< inputs: points n x 3; 4 x 4 matrix: points' map from a crop's grid around a subset of them
    sample_region,   ///< inputs: map, 4 x 4 matrix; the crop by bilinear interpolation, 0 outside
    transform_points ///< inputs: points n x 2, 4 x 4 matrix
};

struct Tensor
{
    std::vector<int> shape = {};
    std::vector<float> values = {}; ///< Of a constant; empty if computed.

    [[nodiscard]] std::size_t size() const
    {
        std::size_t product = 1;
        for (const int length : shape) {
            product *= static_cast<std::size_t>(length);
        }
        return product;
    }
};

/// A rotated rectangle around some points of a mesh, resampled to a grid of width x height.
struct Region
{
    std::vector<int> points = {}; ///< The rectangle encloses these.
    int left_point = 0;           ///< Its x axis runs from this point ...
    int right_point = 0;          ///< ... to this one, turned by -target_rotation.
    double target_rotation = 0.0; ///< [rad]
    double scale_x = 1.0;         ///< Enlargement about the centre.
    double scale_y = 1.0;
    int width = 0;
    int height = 0;
};

/// One operation. Windows are padded by top, bottom, left, right zeros (max_pool: not taken into account).
struct Step
{
    Operation operation = Operation::relu;
    std::vector<int> inputs = {};
    int output = 0;
    int stride_rows = 1;
    int stride_columns = 1;
    int window_rows = 1;
    int window_columns = 1;
    std::array<int, 4> window_padding = {};       ///< top, bottom, left, right
    std::vector<std::array<int, 2>> padding = {}; ///< pad: before and after, for each axis.
    Region region = {};                           ///< region_matrix only.
};

/// A feed-forward network: steps in an order in which every input is known; every shape has been checked.
struct Network
{
    std::string path = {}; ///< Of its file, for messages.
    std::vector<Tensor> tensors = {};
    std::vector<Step> steps = {};
    int input = 0;
    std::vector<int> outputs = {};
};

/// Reads a TensorFlow Lite file of one float network, as far as the operations above go. Half-precision constants are
/// widened, their DEQUANTIZE steps dropped.
/// @throws IoError with the byte where the content is not what it should be; every offset, size, index and shape is
/// checked against the file and against each other.
/// @par Reference  FlatBuffers and FlexBuffers binary formats; TensorFlow Lite schema, version 3.
[[nodiscard]] Network parse_network(std::string_view bytes, const std::string& path);

enum class ShaCode
{
    fastest, ///< By the processor's instructions for it, where it has them.
    portable
};

/// SHA-256 as 64 hexadecimal digits.
/// @par Reference  FIPS 180-4.
[[nodiscard]] std::string sha256(std::string_view bytes, ShaCode code = ShaCode::fastest);

/// A network that was tested with this library: models/README.md.
struct KnownNetwork
{
    std::string_view file;
    std::string_view sha256;
};

inline constexpr KnownNetwork short_range_network = {
    "face_detection_short_range.tflite", "3bc182eb9f33925d9e58b5c8d59308a760f4adea8f282370e428c51212c26633"};
inline constexpr KnownNetwork full_range_network = {"face_detection_full_range.tflite",
                                                    "99bf9494d84f50acc6617d89873f71bf6635a841ea699c17cb3377f9507cfec3"};
inline constexpr KnownNetwork landmark_network = {"face_landmark_with_attention.tflite",
                                                  "883b7411747bac657c30c462d305d312e9dec6adbf8b85e2f5d8d722fca9455d"};

/// parse_network of a file's content.
/// @param expected_sha256  Empty: any file the reader accepts. XNNPACK aborts the process on some graphs it does not
/// like.
/// @throws IoError also if the file is missing, larger than 64 MB or of another SHA-256.
[[nodiscard]] Network load_network(const std::string& path, std::string_view expected_sha256);

/// What stands behind a network's input and outputs, for use by position.
/// @param output_sizes  Values of each output, in the order of the file.
/// @throws IoError if the network has another input shape or other outputs.
void expect_shapes(const Network& network, const std::vector<int>& input_shape,
                   const std::vector<std::size_t>& output_sizes);

} // namespace lineament::network
