// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Whatever the bytes, the network reader answers with a network or an IoError; a network it accepts runs, and the
// detectors take it or refuse it with an IoError. How to run it, and from what: docs/vision.md.
#include "engine.hpp"
#include "face_boxes.hpp"
#include "mesh_network.hpp"

#include "lineament/core/error.hpp"

#include <algorithm>
#include <cstdint>

namespace {

using namespace lineament;
using namespace lineament::network;

/// Multiplications of a run, about.
double work(const Network& network)
{
    double sum = 0.0;
    for (const Step& step : network.steps) {
        const double window = static_cast<double>(step.window_rows) * step.window_columns;
        const double channels = step.operation == Operation::convolution ? network.tensors[step.inputs[0]].shape[3] : 1;
        sum += window * channels * static_cast<double>(network.tensors[step.output].size());
    }
    return sum;
}

template <typename Use>
void refused_or(const Use& use)
{
    try {
        use();
    } catch (const IoError&) {
    }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    refused_or([&] {
        const Network network = parse_network({reinterpret_cast<const char*>(data), size}, "fuzz");
        // Not every network the reader accepts is small enough to run thousands of times.
        if (work(network) < 5e7) {
            make_plain_engine(network)->run();
        }
        refused_or([&] { (void)BoxDetector(network); });
        refused_or([&] { (void)MeshNetwork(network); });
    });
    return 0;
}

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

/// The graph stands behind the constants, which fill most of a file: most changes go there.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned int seed)
{
    constexpr std::size_t graph_size = 120'000;
    if (seed % 4 == 0 || size <= graph_size) {
        return LLVMFuzzerMutate(data, size, max_size);
    }
    const std::size_t part = std::min<std::size_t>(graph_size, 64 + seed / 4 % graph_size);
    std::uint8_t* const place = data + size - graph_size + (seed / 7) % (graph_size - part + 1);
    // In place: offsets behind it stay right.
    LLVMFuzzerMutate(place, part, part);
    return size;
}
