// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The only file that includes XNNPACK; its interface differs between versions.
#include "engine.hpp"

#include "lineament/core/error.hpp"

#ifdef LINEAMENT_WITH_XNNPACK

#include <xnnpack.h>

#include <algorithm>
#include <limits>

namespace lineament::network {
namespace {

void check(xnn_status status, const char* what)
{
    if (status != xnn_status_success) {
        throw IoError(IoErrorKind::system, "XNNPACK", "", std::string("expected success, found failure to ") + what);
    }
}

/// Steps run in stages: those on maps, as one XNNPACK runtime, in even ones; small steps between them in odd ones.
class XnnpackEngine final : public Engine
{
public:
    explicit XnnpackEngine(Network network) : Engine(std::move(network))
    {
        check(xnn_initialize(nullptr), "start on this computer");
        assign_stages();
        for (std::size_t stage = 0; stage < stages_.size(); stage += 2) {
            if (!stages_[stage].steps.empty()) {
                build(stages_[stage], static_cast<int>(stage));
            }
        }
    }

    ~XnnpackEngine() override
    {
        for (const Stage& stage : stages_) {
            if (stage.runtime != nullptr) {
                xnn_delete_runtime(stage.runtime);
            }
        }
    }

    void run() override
    {
        for (const Stage& stage : stages_) {
            if (stage.runtime != nullptr) {
                check(xnn_invoke_runtime(stage.runtime), "run");
                continue;
            }
            for (const int step : stage.steps) {
                run_small(network_.steps[step]);
            }
        }
    }

private:
    struct Stage
    {
        std::vector<int> steps = {};
        xnn_runtime_t runtime = nullptr;
    };

    void assign_stages()
    {
        made_in_.assign(network_.tensors.size(), -1); // constants and the input
        outside_.assign(network_.tensors.size(), 0);
        outside_[network_.input] = 1;
        for (const int output : network_.outputs) {
            outside_[output] = 1;
        }
        for (std::size_t i = 0; i < network_.steps.size(); ++i) {
            const Step& step = network_.steps[i];
            const int parity = is_small(step.operation) ? 1 : 0;
            int stage = 0;
            for (const int input : step.inputs) {
                stage = std::max(stage, made_in_[input]);
            }
            stage += (stage ^ parity) & 1;
            made_in_[step.output] = stage;
            if (stage >= static_cast<int>(stages_.size())) {
                stages_.resize(stage + 1);
            }
            stages_[stage].steps.push_back(static_cast<int>(i));
            for (const int input : step.inputs) {
                outside_[input] |= made_in_[input] != stage || parity == 1;
            }
            outside_[step.output] |= parity == 1;
        }
        for (std::size_t tensor = 0; tensor < outside_.size(); ++tensor) {
            if (outside_[tensor] != 0 && network_.tensors[tensor].values.empty()) {
                allocate(static_cast<int>(tensor));
            }
        }
    }

    /// An XNNPACK graph under construction, and the values of it that live in our buffers.
    struct Graph
    {
        xnn_subgraph_t subgraph = nullptr;
        std::vector<std::uint32_t> ids = {}; ///< By tensor.
        std::vector<xnn_external_value> external = {};

        ~Graph() { xnn_delete_subgraph(subgraph); }
    };

    void build(Stage& stage, int number)
    {
        Graph graph;
        graph.ids.assign(network_.tensors.size(), XNN_INVALID_VALUE_ID);
        check(xnn_create_subgraph(static_cast<std::uint32_t>(network_.tensors.size()), 0, &graph.subgraph),
              "create a graph");
        for (const int index : stage.steps) {
            const Step& step = network_.steps[index];
            for (const int input : step.inputs) {
                define_value(graph, input, XNN_VALUE_FLAG_EXTERNAL_INPUT, number);
            }
            define_value(graph, step.output, XNN_VALUE_FLAG_EXTERNAL_OUTPUT, number);
            define_step(graph, step);
        }
        check(xnn_create_runtime_v2(graph.subgraph, nullptr, 0, &stage.runtime), "create a runtime");
        check(xnn_setup_runtime(stage.runtime, graph.external.size(), graph.external.data()), "bind the buffers");
    }

    void define_value(Graph& graph, int tensor, std::uint32_t direction, int stage)
    {
        if (graph.ids[tensor] != XNN_INVALID_VALUE_ID) {
            return;
        }
        const Tensor& described = network_.tensors[tensor];
        std::vector<std::size_t> shape(described.shape.begin(), described.shape.end());
        const bool constant = !described.values.empty();
        if (constant) {
            // A slope for each channel comes as 1 x 1 x channels; XNNPACK wants it flat.
            while (shape.size() > 1 && shape.size() < 4 && shape.front() == 1) {
                shape.erase(shape.begin());
            }
        }
        const bool external = !constant && (outside_[tensor] != 0 || made_in_[tensor] != stage);
        check(xnn_define_tensor_value(graph.subgraph, xnn_datatype_fp32, shape.size(), shape.data(),
                                      constant ? described.values.data() : nullptr,
                                      external ? static_cast<std::uint32_t>(tensor) : XNN_INVALID_VALUE_ID,
                                      external ? direction : 0, &graph.ids[tensor]),
              "define a value");
        if (external) {
            graph.external.push_back({graph.ids[tensor], buffers_[tensor].data()});
        }
    }

    void define_step(const Graph& graph, const Step& step) const
    {
        const std::vector<int>& in = network_.tensors[step.inputs[0]].shape;
        const std::vector<int>& out = network_.tensors[step.output].shape;
        const auto unsigned_of = [](int value) { return static_cast<std::uint32_t>(value); };
        const auto id = [&](std::size_t i) { return graph.ids[step.inputs[i]]; };
        const std::uint32_t result = graph.ids[step.output];
        const std::uint32_t top = unsigned_of(step.window_padding[0]);
        const std::uint32_t bottom = unsigned_of(step.window_padding[1]);
        const std::uint32_t left = unsigned_of(step.window_padding[2]);
        const std::uint32_t right = unsigned_of(step.window_padding[3]);
        const std::uint32_t rows = unsigned_of(step.window_rows);
        const std::uint32_t columns = unsigned_of(step.window_columns);
        const std::uint32_t row_stride = unsigned_of(step.stride_rows);
        const std::uint32_t column_stride = unsigned_of(step.stride_columns);
        constexpr float infinity = std::numeric_limits<float>::infinity();
        switch (step.operation) {
        case Operation::convolution:
            check(xnn_define_convolution_2d(graph.subgraph, top, right, bottom, left, rows, columns, row_stride,
                                            column_stride, 1, 1, 1, unsigned_of(in[3]), unsigned_of(out[3]), -infinity,
                                            infinity, id(0), id(1), id(2), result, 0),
                  "define a convolution");
            break;
        case Operation::depthwise_convolution:
            check(xnn_define_depthwise_convolution_2d(graph.subgraph, top, right, bottom, left, rows, columns,
                                                      row_stride, column_stride, 1, 1, 1, unsigned_of(in[3]), -infinity,
                                                      infinity, id(0), id(1), id(2), result, 0),
                  "define a depthwise convolution");
            break;
        case Operation::max_pool:
            check(xnn_define_max_pooling_2d(graph.subgraph, top, right, bottom, left, rows, columns, row_stride,
                                            column_stride, 1, 1, -infinity, infinity, id(0), result, 0),
                  "define max pooling");
            break;
        case Operation::add:
            check(xnn_define_add2(graph.subgraph, -infinity, infinity, id(0), id(1), result, 0), "define a sum");
            break;
        case Operation::relu:
            check(xnn_define_clamp(graph.subgraph, 0.0f, infinity, id(0), result, 0), "define a rectifier");
            break;
        case Operation::prelu:
            check(xnn_define_prelu(graph.subgraph, id(0), id(1), result, 0), "define a parametric rectifier");
            break;
        case Operation::pad: {
            std::array<std::size_t, 4> before = {};
            std::array<std::size_t, 4> after = {};
            for (std::size_t axis = 0; axis < 4; ++axis) {
                before[axis] = static_cast<std::size_t>(step.padding[axis][0]);
                after[axis] = static_cast<std::size_t>(step.padding[axis][1]);
            }
            check(xnn_define_static_constant_pad(graph.subgraph, before.data(), after.data(), 0.0f, id(0), result, 0),
                  "define padding");
            break;
        }
        case Operation::resize_bilinear:
            check(xnn_define_static_resize_bilinear_2d(graph.subgraph, unsigned_of(out[1]), unsigned_of(out[2]), id(0),
                                                       result, 0),
                  "define resizing");
            break;
        default:
            break;
        }
    }

    std::vector<Stage> stages_ = {};
    std::vector<int> made_in_ = {};  ///< By tensor: the stage that computes it; -1: known before.
    std::vector<char> outside_ = {}; ///< By tensor: whether it lives in our buffer.
};

} // namespace

bool xnnpack_starts()
{
    return xnn_initialize(nullptr) == xnn_status_success;
}

std::unique_ptr<Engine> make_xnnpack_engine(Network network)
{
    return std::make_unique<XnnpackEngine>(std::move(network));
}

} // namespace lineament::network

#else

namespace lineament::network {

bool xnnpack_starts()
{
    return false;
}

std::unique_ptr<Engine> make_xnnpack_engine(Network)
{
    return nullptr;
}

} // namespace lineament::network

#endif
