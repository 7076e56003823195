// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Whatever the bytes, the network reader answers with a network or an IoError, and a network it accepts runs.
// With clang, coverage-guided, from the project's folder:
//   clang++ -std=c++20 -g -O1 -fsanitize=fuzzer,address,undefined -Iinclude -Isrc/vision -I/usr/include/eigen3
//     fuzz/tflite_fuzz.cpp src/vision/{network_file,sha256,engine,engine_plain}.cpp -o tflite_fuzz
//   ./tflite_fuzz -max_total_time=60 -max_len=3000000 models/
// With any compiler, by random damage: the same without -fsanitize=fuzzer and with -DLINEAMENT_FUZZ_MAIN, then
//   ./tflite_fuzz SECONDS models/*.tflite
#include "engine.hpp"

#include "lineament/core/error.hpp"

#include <cstdint>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    using namespace lineament::network;
    try {
        Network network = parse_network({reinterpret_cast<const char*>(data), size}, "fuzz");
        std::size_t values = 0;
        for (const Tensor& tensor : network.tensors) {
            values += tensor.size();
        }
        // Not every network the reader accepts is small enough to run thousands of times.
        if (values < std::size_t{1} << 18) {
            make_plain_engine(std::move(network))->run();
        }
    } catch (const lineament::IoError&) {
    }
    return 0;
}

#ifdef LINEAMENT_FUZZ_MAIN

#include "lineament/core/random.hpp"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <vector>

int main(int count, char** arguments)
{
    std::vector<std::vector<std::uint8_t>> seeds;
    for (int i = 2; i < count; ++i) {
        std::ifstream file(arguments[i], std::ios::binary);
        seeds.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    }
    if (seeds.empty()) {
        std::fprintf(stderr, "usage: tflite_fuzz SECONDS FILE...\n");
        return 2;
    }
    lineament::Random random(1);
    const auto below = [&random](std::size_t limit) {
        return static_cast<std::size_t>(random.uniform() * static_cast<double>(limit));
    };
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(std::atoi(arguments[1]));
    std::size_t runs = 0;
    for (; std::chrono::steady_clock::now() < end; ++runs) {
        std::vector<std::uint8_t> bytes = seeds[runs % seeds.size()];
        const std::size_t changes = 1 + below(8);
        for (std::size_t k = 0; k < changes; ++k) {
            // The graph stands behind the constants: most changes there, in the last 120 kB.
            const std::size_t window = below(4) == 0 ? bytes.size() : std::size_t{120'000};
            const std::size_t place = bytes.size() - 1 - below(std::min(window, bytes.size()));
            constexpr std::uint8_t edges[] = {0x00, 0x01, 0x7f, 0x80, 0xff};
            bytes[place] = below(2) == 0 ? edges[below(5)] : static_cast<std::uint8_t>(below(256));
        }
        if (below(16) == 0) {
            bytes.resize(below(bytes.size()));
        }
        LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
    }
    std::printf("%zu runs\n", runs);
}

#endif
