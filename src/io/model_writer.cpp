// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/core/checks.hpp"
#include "lineament/io/file.hpp"
#include "lineament/io/model_file.hpp"
#include "model_format.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <deque>

namespace lineament {

namespace {

static_assert(std::endian::native == std::endian::little, "the file is little-endian, and so are its tensors here");

using Shape = std::vector<std::uint64_t>;

/// The smallest power of two with largest / scale < 32767.5. A power of two makes q * scale exact in float, so that a
/// model that was read is written with the same numbers.
float quantisation_scale(float largest)
{
    if (largest == 0.0f) {
        return 1.0f;
    }
    int exponent = std::max(std::ilogb(largest) - 15, -149);
    while (std::ldexp(static_cast<double>(largest), -exponent) >= 32767.5) {
        ++exponent;
    }
    return std::ldexp(1.0f, exponent);
}

/// Collects metadata and tensors in the order of the file.
class ModelWriter
{
public:
    void text(const std::string& key, const std::string& value) { metadata_.emplace_back(key, value); }
    void list(const std::string& key, const std::vector<std::string>& values)
    {
        for (const std::string& value : values) {
            nlohmann::json(value).dump(); // throws on text that is not UTF-8
        }
        text(key, nlohmann::json(values).dump());
    }
    void floats(const std::string& name, const float* values, const Shape& shape)
    {
        add(name, TensorType::float32, values, shape);
    }
    void ints(const std::string& name, const int* values, const Shape& shape)
    {
        add(name, TensorType::int32, values, shape);
    }
    void vector(const std::string& name, const Eigen::VectorXf& values)
    {
        floats(name, values.data(), {static_cast<std::uint64_t>(values.size())});
    }

    /// The columns of a 3V x m matrix as a tensor [m, V, 3]. 16-bit tensors go to the end of the file, so that the
    /// others stay aligned.
    void basis(const std::string& name, const Eigen::MatrixXf& values, StorageType storage)
    {
        const auto num_modes = static_cast<std::uint64_t>(values.cols());
        const Shape shape = {num_modes, static_cast<std::uint64_t>(values.rows() / 3), 3};
        if (storage == StorageType::float32) {
            floats(name, values.data(), shape);
            return;
        }
        std::vector<std::int16_t>& words = words_.emplace_back(static_cast<std::size_t>(values.size()));
        if (storage == StorageType::float16) {
            for (Eigen::Index i = 0; i < values.size(); ++i) {
                const float value = values.data()[i];
                require(std::abs(value) < 65520.0f, "format_model", name.c_str(), "numbers a float16 can hold",
                        to_text(value));
                words[static_cast<std::size_t>(i)] = std::bit_cast<std::int16_t>(Eigen::half(value).x);
            }
        } else {
            std::vector<float>& scales = scales_.emplace_back();
            std::size_t i = 0;
            for (const auto& column : values.colwise()) {
                const float scale = quantisation_scale(values.rows() > 0 ? column.cwiseAbs().maxCoeff() : 0.0f);
                scales.push_back(scale);
                for (const float value : column) {
                    words[i++] = static_cast<std::int16_t>(std::lround(static_cast<double>(value) / scale));
                }
            }
            floats(name + "_scale", scales.data(), {num_modes});
        }
        last_tensors_.push_back({name, storage == StorageType::int16 ? TensorType::int16 : TensorType::float16, shape,
                                 std::as_bytes(std::span(words))});
    }

    std::vector<std::byte> finish()
    {
        tensors_.insert(tensors_.end(), last_tensors_.begin(), last_tensors_.end());
        std::vector<std::byte> file = format_safetensors(metadata_, tensors_);
        const std::size_t position = model_format::find_checksum(file).value();
        const std::string checksum = model_format::compute_checksum(file, position);
        std::memcpy(file.data() + position, checksum.data(), checksum.size());
        return file;
    }

private:
    template <typename Number>
    void add(const std::string& name, TensorType type, const Number* values, const Shape& shape)
    {
        std::size_t count = 1;
        for (const std::uint64_t size : shape) {
            count *= size;
        }
        tensors_.push_back({name, type, shape, std::as_bytes(std::span(values, count))});
    }

    std::vector<std::pair<std::string, std::string>> metadata_;
    std::vector<Tensor> tensors_;
    std::vector<Tensor> last_tensors_;
    std::deque<std::vector<std::int16_t>> words_; // deques: the tensors refer to them
    std::deque<std::vector<float>> scales_;
};

void write_pca(ModelWriter& writer, const std::string& part, const PcaModel& pca, StorageType storage)
{
    writer.floats(part + "/mean", pca.mean.data(), {static_cast<std::uint64_t>(pca.num_vertices()), 3});
    writer.basis(part + "/basis", pca.basis, storage);
    writer.vector(part + "/standard_deviations", pca.standard_deviations);
}

void write_level(ModelWriter& writer, const std::string& part, const Level& level)
{
    const auto count = static_cast<std::uint64_t>(level.triangles.cols());
    writer.ints(part + "/triangles", level.triangles.data(), {count, 3});
    if (level.triangle_groups.size() > 0) {
        writer.ints(part + "/triangle_groups", level.triangle_groups.data(), {count});
    }
    if (level.uv_triangles.size() > 0) {
        writer.ints(part + "/uv_triangles", level.uv_triangles.data(), {count, 3});
    }
}

void write_landmarks(ModelWriter& writer, const LandmarkMap& map)
{
    const std::string part = "landmarks/" + map.scheme;
    const auto count = static_cast<std::uint64_t>(map.num_landmarks());
    writer.ints(part + "/vertices", map.vertices.data(), {count, 3});
    writer.floats(part + "/weights", map.weights.data(), {count, 3});
    for (const auto& [detector, noise] : map.noise_mm) {
        writer.vector(part + "/noise/" + detector, noise);
    }
}

void write_texts(ModelWriter& writer, const MorphableModel& model)
{
    writer.text("format", model_format::format_name);
    writer.text("format_version", std::to_string(model_format::version));
    writer.text("crc32c", std::string(model_format::checksum_digits, '0'));
    writer.text("name", model.name);
    writer.text("license", model.license);
    writer.text("provenance", model.provenance);
    writer.text("units", "mm");
    std::vector<std::string> sets;
    for (const Blendshapes& set : model.expression_sets) {
        sets.push_back(set.name);
    }
    writer.list("expression_sets", sets);
    for (const Blendshapes& set : model.expression_sets) {
        writer.list("expression/" + set.name + "/names", set.names);
    }
    writer.list("triangle_groups", model.triangle_group_names);
    std::vector<std::string> schemes;
    for (const LandmarkMap& map : model.landmark_maps) {
        schemes.push_back(map.scheme);
    }
    writer.list("landmark_schemes", schemes);
    for (const LandmarkMap& map : model.landmark_maps) {
        writer.list("landmarks/" + map.scheme + "/names", map.names);
    }
}

} // namespace

std::vector<std::byte> format_model(const MorphableModel& model, const SaveModelOptions& options)
{
    if (const std::optional<ModelFault> fault = find_model_fault(model)) {
        throw InvalidArgument("format_model", "model", "a model without fault", fault->part + ": " + fault->what);
    }
    ModelWriter writer;
    try {
        write_texts(writer, model);
    } catch (const nlohmann::json::exception&) {
        throw InvalidArgument("format_model", "model", "names in UTF-8", "other bytes");
    }
    write_pca(writer, "shape", model.shape, options.shape_storage);
    if (model.color) {
        write_pca(writer, "color", *model.color, options.color_storage);
    }
    for (const Blendshapes& set : model.expression_sets) {
        writer.basis("expression/" + set.name + "/offsets", set.offsets, options.expression_storage);
        writer.vector("expression/" + set.name + "/standard_deviations", set.standard_deviations);
    }
    std::vector<int> level_sizes;
    for (const Level& level : model.levels) {
        level_sizes.push_back(level.num_vertices);
    }
    writer.ints("levels", level_sizes.data(), {level_sizes.size()});
    for (std::size_t i = 0; i < model.levels.size(); ++i) {
        write_level(writer, "level" + std::to_string(i), model.levels[i]);
    }
    if (model.uv_coordinates.size() > 0) {
        writer.floats("uv/coordinates", model.uv_coordinates.data(),
                      {static_cast<std::uint64_t>(model.uv_coordinates.cols()), 2});
    }
    for (const LandmarkMap& map : model.landmark_maps) {
        write_landmarks(writer, map);
    }
    if (!model.contour_left.empty()) {
        writer.ints("contour/left", model.contour_left.data(), {model.contour_left.size()});
    }
    if (!model.contour_right.empty()) {
        writer.ints("contour/right", model.contour_right.data(), {model.contour_right.size()});
    }
    if (model.mirror.size() > 0) {
        writer.ints("mirror", model.mirror.data(), {static_cast<std::uint64_t>(model.mirror.size())});
    }
    for (const auto& [region, weights] : model.masks) {
        writer.vector("masks/" + region, weights);
    }
    return writer.finish();
}

void save_model(const std::filesystem::path& path, const MorphableModel& model, const SaveModelOptions& options)
{
    write_file(path, format_model(model, options));
}

} // namespace lineament
