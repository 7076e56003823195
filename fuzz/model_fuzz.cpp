// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Hostile model files: what is accepted has no fault and is written and read again to the same bytes. The mutator
// starts from a small valid model and enters the right checksum, so that what lies behind the checksum is reached.
#include "lineament/core/error.hpp"
#include "lineament/core/random.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/io/safetensors.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string_view>

namespace {

using namespace lineament;

std::vector<std::byte> make_seed()
{
    MorphableModel model;
    model.name = "seed";
    model.shape.mean = Eigen::VectorXf::LinSpaced(12, -5, 6);
    model.shape.basis = Eigen::MatrixXf::Identity(12, 2);
    model.shape.standard_deviations = Eigen::VectorXf::Ones(2);
    Level level;
    level.num_vertices = 4;
    level.triangles = Eigen::Matrix3Xi::Zero(3, 1);
    level.triangle_groups = Eigen::VectorXi::Zero(1);
    level.uv_triangles = level.triangles;
    model.levels = {level};
    model.triangle_group_names = {"skin"};
    model.uv_coordinates = Eigen::Matrix2Xf::Zero(2, 1);
    model.expression_sets = {{"e", {"a"}, Eigen::MatrixXf::Ones(12, 1), Eigen::VectorXf::Ones(1)}};
    LandmarkMap map;
    map.scheme = "s";
    map.names = {"1"};
    map.vertices = Eigen::Matrix3Xi::Zero(3, 1);
    map.weights = Eigen::Matrix3Xf::Constant(3, 1, 1.0f / 3);
    map.noise_mm["d"] = Eigen::VectorXf::Ones(1);
    model.landmark_maps = {map};
    model.contour_left = {0};
    model.mirror = Eigen::VectorXi::LinSpaced(4, 0, 3);
    model.masks["face"] = Eigen::VectorXf::Ones(4);
    return format_model(model);
}

void enter_checksum(std::span<std::byte> file)
{
    constexpr std::string_view key = "\"crc32c\":\"";
    const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
    const std::size_t found = text.find(key);
    if (found == std::string_view::npos || found + key.size() + 8 > file.size()) {
        return;
    }
    char* const digits = reinterpret_cast<char*>(file.data()) + found + key.size();
    std::memset(digits, '0', 8);
    char computed[9];
    std::snprintf(computed, sizeof computed, "%08x", static_cast<unsigned>(compute_crc32c(file)));
    std::memcpy(digits, computed, 8);
}

} // namespace

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned int seed)
{
    static const std::vector<std::byte> valid = make_seed();
    lineament::Random random(seed);
    if (valid.size() <= max_size && (size < 16 || random.index(50) == 0)) {
        std::memcpy(data, valid.data(), valid.size());
        size = valid.size();
    }
    if (random.index(2) == 0 && size > 0) { // a byte anywhere: keeps most of the structure
        data[random.index(static_cast<int>(size))] = static_cast<std::uint8_t>(random.bits());
    } else {
        size = LLVMFuzzerMutate(data, size, max_size);
    }
    if (random.index(10) != 0) {
        enter_checksum({reinterpret_cast<std::byte*>(data), size});
    }
    return size;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    const std::vector<std::byte> file(reinterpret_cast<const std::byte*>(data),
                                      reinterpret_cast<const std::byte*>(data) + size); // a block of exact size
    try {
        const lineament::ModelFile loaded = lineament::parse_model_file(file, "fuzz");
        if (lineament::find_model_fault(loaded.model)) {
            std::abort();
        }
        // Another writer may order tensors or choose scales otherwise; from our own writer on it must be stable.
        const auto first = lineament::format_model(loaded.model, loaded.storage);
        const lineament::ModelFile again = lineament::parse_model_file(first, "fuzz");
        if (lineament::format_model(again.model, again.storage) != first) {
            std::abort();
        }
    } catch (const lineament::IoError&) {
    }
    return 0;
}
