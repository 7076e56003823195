// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "network.hpp"

#include <memory>
#include <span>
#include <vector>

namespace lineament::network {

/// Runs one network, again and again, on one thread. After construction nothing is allocated.
class Engine
{
public:
    virtual ~Engine() = default;
    Engine(const Engine&) = delete;
    Engine& operator=(const Engine&) = delete;

    /// Where the input is to be written before run.
    [[nodiscard]] std::span<float> input() { return {buffers_[network_.input].data(), size_of(network_.input)}; }
    [[nodiscard]] std::size_t num_outputs() const { return network_.outputs.size(); }
    /// In the order of the file; valid until the next run.
    [[nodiscard]] std::span<const float> output(std::size_t i) const
    {
        const int tensor = network_.outputs.at(i);
        return {buffers_[tensor].data(), size_of(tensor)};
    }
    [[nodiscard]] const Network& network() const { return network_; }

    virtual void run() = 0;

protected:
    explicit Engine(Network network) : network_(std::move(network)), buffers_(network_.tensors.size()) {}

    [[nodiscard]] std::size_t size_of(int tensor) const { return network_.tensors[tensor].size(); }
    [[nodiscard]] const float* data(int tensor) const
    {
        return network_.tensors[tensor].values.empty() ? buffers_[tensor].data()
                                                       : network_.tensors[tensor].values.data();
    }
    /// Makes room for a tensor; a vector kernel may read a few values beyond its end.
    void allocate(int tensor) { buffers_[tensor].resize(size_of(tensor) + 4); }

    /// Runs a step that moves or maps few values: multiply, reshape, concatenate and those on regions.
    void run_small(const Step& step);
    [[nodiscard]] static bool is_small(Operation operation);

    Network network_;
    std::vector<std::vector<float>> buffers_; ///< By tensor; empty where the engine needs none.
};

/// The engine in plain Eigen: the reference, and what runs where XNNPACK is not available.
[[nodiscard]] std::unique_ptr<Engine> make_plain_engine(Network network);

/// Whether the library was built with XNNPACK and this computer has what XNNPACK needs.
[[nodiscard]] bool xnnpack_starts();

/// The fast engine on XNNPACK, or nothing if the library was built without it.
/// @throws IoError (system) if XNNPACK cannot start on this computer or take the network.
[[nodiscard]] std::unique_ptr<Engine> make_xnnpack_engine(Network network);

/// The engine on XNNPACK where that starts, else the plain one.
[[nodiscard]] std::unique_ptr<Engine> make_engine(Network network);

} // namespace lineament::network
