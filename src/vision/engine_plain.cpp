// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "engine.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <limits>

namespace lineament::network {
namespace {

using Map = Eigen::Map<const Eigen::ArrayXf>;
using MutableMap = Eigen::Map<Eigen::ArrayXf>;
using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

class PlainEngine final : public Engine
{
public:
    explicit PlainEngine(Network network) : Engine(std::move(network))
    {
        allocate(network_.input);
        std::size_t columns = 0;
        for (const Step& step : network_.steps) {
            allocate(step.output);
            if (step.operation == Operation::convolution) {
                const std::vector<int>& kernel = network_.tensors[step.inputs[1]].shape;
                const std::vector<int>& out = network_.tensors[step.output].shape;
                columns = std::max(columns, static_cast<std::size_t>(kernel[1]) * kernel[2] * kernel[3] * out[2]);
            }
        }
        windows_.resize(columns);
    }

    void run() override
    {
        for (const Step& step : network_.steps) {
            if (is_small(step.operation)) {
                run_small(step);
            } else {
                run_map(step);
            }
        }
    }

private:
    [[nodiscard]] const std::vector<int>& shape(int tensor) const { return network_.tensors[tensor].shape; }

    /// The channels of one pixel of a map.
    [[nodiscard]] static Map pixel(const float* map, const std::vector<int>& shape, int row, int column)
    {
        return {map + (static_cast<std::ptrdiff_t>(row) * shape[2] + column) * shape[3], shape[3]};
    }

    void run_map(const Step& step)
    {
        const std::vector<int>& in_shape = shape(step.inputs[0]);
        const std::vector<int>& out_shape = shape(step.output);
        const float* const in = data(step.inputs[0]);
        float* const out = buffers_[step.output].data();
        const auto size = static_cast<Eigen::Index>(size_of(step.output));
        switch (step.operation) {
        case Operation::convolution:
            convolve(step, in, in_shape, out, out_shape);
            break;
        case Operation::depthwise_convolution:
        case Operation::max_pool:
            for (int i = 0; i < out_shape[1]; ++i) {
                for (int j = 0; j < out_shape[2]; ++j) {
                    MutableMap value(out + (static_cast<std::ptrdiff_t>(i) * out_shape[2] + j) * out_shape[3],
                                     out_shape[3]);
                    fold_window(step, in, in_shape, i, j, value);
                }
            }
            break;
        case Operation::add:
            MutableMap(out, size) = Map(in, size) + Map(data(step.inputs[1]), size);
            break;
        case Operation::relu:
            MutableMap(out, size) = Map(in, size).max(0.0f);
            break;
        case Operation::prelu: {
            const Map slope(data(step.inputs[1]), in_shape[3]);
            for (Eigen::Index k = 0; k < size; k += in_shape[3]) {
                const Map value(in + k, in_shape[3]);
                MutableMap(out + k, in_shape[3]) = value.max(0.0f) + slope * value.min(0.0f);
            }
            break;
        }
        case Operation::pad:
            MutableMap(out, size).setZero();
            for (int i = 0; i < in_shape[1]; ++i) {
                for (int j = 0; j < in_shape[2]; ++j) {
                    const std::ptrdiff_t place = (i + step.padding[1][0]) * out_shape[2] + j + step.padding[2][0];
                    MutableMap(out + place * out_shape[3] + step.padding[3][0], in_shape[3]) =
                        pixel(in, in_shape, i, j);
                }
            }
            break;
        case Operation::resize_bilinear:
            resize(in, in_shape, out, out_shape);
            break;
        default:
            break;
        }
    }

    /// One row of the output at a time: its windows side by side, times the kernels.
    void convolve(const Step& step, const float* in, const std::vector<int>& in_shape, float* out,
                  const std::vector<int>& out_shape)
    {
        const int channels = in_shape[3];
        const Eigen::Index window = static_cast<Eigen::Index>(step.window_rows) * step.window_columns * channels;
        const Eigen::Map<const Rows> kernels(data(step.inputs[1]), out_shape[3], window);
        const Eigen::Map<const Eigen::RowVectorXf> bias(data(step.inputs[2]), out_shape[3]);
        for (int i = 0; i < out_shape[1]; ++i) {
            float* to = windows_.data();
            for (int j = 0; j < out_shape[2]; ++j) {
                for (int k = 0; k < step.window_rows; ++k) {
                    for (int l = 0; l < step.window_columns; ++l, to += channels) {
                        const int row = i * step.stride_rows + k - step.window_padding[0];
                        const int column = j * step.stride_columns + l - step.window_padding[2];
                        if (row < 0 || column < 0 || row >= in_shape[1] || column >= in_shape[2]) {
                            std::fill_n(to, channels, 0.0f);
                        } else {
                            std::copy_n(pixel(in, in_shape, row, column).data(), channels, to);
                        }
                    }
                }
            }
            const Eigen::Map<const Rows> windows(windows_.data(), out_shape[2], window);
            Eigen::Map<Rows> result(out + static_cast<std::ptrdiff_t>(i) * out_shape[2] * out_shape[3], out_shape[2],
                                    out_shape[3]);
            result.noalias() = windows * kernels.transpose();
            result.rowwise() += bias;
        }
    }

    /// Depthwise convolution or maximum over one window.
    void fold_window(const Step& step, const float* in, const std::vector<int>& in_shape, int i, int j,
                     MutableMap& value) const
    {
        const bool maximum = step.operation == Operation::max_pool;
        if (maximum) {
            value.setConstant(-std::numeric_limits<float>::infinity());
        } else {
            value = Map(data(step.inputs[2]), value.size());
        }
        for (int k = 0; k < step.window_rows; ++k) {
            for (int l = 0; l < step.window_columns; ++l) {
                const int row = i * step.stride_rows + k - step.window_padding[0];
                const int column = j * step.stride_columns + l - step.window_padding[2];
                if (row < 0 || column < 0 || row >= in_shape[1] || column >= in_shape[2]) {
                    continue;
                }
                if (maximum) {
                    value = value.max(pixel(in, in_shape, row, column));
                } else {
                    value += pixel(in, in_shape, row, column) *
                             Map(data(step.inputs[1]) + (k * step.window_columns + l) * value.size(), value.size());
                }
            }
        }
    }

    static void resize(const float* in, const std::vector<int>& in_shape, float* out, const std::vector<int>& out_shape)
    {
        const auto source = [](int i, int from, int to) {
            const float place = (static_cast<float>(i) + 0.5f) * static_cast<float>(from) / static_cast<float>(to);
            return std::clamp(place - 0.5f, 0.0f, static_cast<float>(from - 1));
        };
        for (int i = 0; i < out_shape[1]; ++i) {
            const float y = source(i, in_shape[1], out_shape[1]);
            const int top = static_cast<int>(y);
            const int bottom = std::min(top + 1, in_shape[1] - 1);
            const float b = y - static_cast<float>(top);
            for (int j = 0; j < out_shape[2]; ++j, out += out_shape[3]) {
                const float x = source(j, in_shape[2], out_shape[2]);
                const int left = static_cast<int>(x);
                const int right = std::min(left + 1, in_shape[2] - 1);
                const float a = x - static_cast<float>(left);
                MutableMap(out, out_shape[3]) =
                    (1 - b) * ((1 - a) * pixel(in, in_shape, top, left) + a * pixel(in, in_shape, top, right)) +
                    b * ((1 - a) * pixel(in, in_shape, bottom, left) + a * pixel(in, in_shape, bottom, right));
            }
        }
    }

    std::vector<float> windows_ = {};
};

} // namespace

std::unique_ptr<Engine> make_plain_engine(Network network)
{
    return std::make_unique<PlainEngine>(std::move(network));
}

} // namespace lineament::network
