// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/core/checks.hpp"
#include "lineament/io/file.hpp"
#include "lineament/io/model_file.hpp"
#include "model_format.hpp"

#include <nlohmann/json.hpp>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>

namespace lineament {

namespace {

constexpr std::uint64_t any_size = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint64_t max_count = 200'000'000; // of vertices, triangles: three of them still fit an int

[[noreturn]] void fail(const std::string& file_name, const std::string& place, const std::string& what)
{
    throw IoError(IoErrorKind::content, file_name, place, what);
}

float float_at(const Tensor& tensor, std::size_t index)
{
    if (tensor.type == TensorType::float32) {
        float value = 0;
        std::memcpy(&value, tensor.elements.data() + 4 * index, 4);
        return value;
    }
    std::uint16_t bits = 0;
    std::memcpy(&bits, tensor.elements.data() + 2 * index, 2);
    return static_cast<float>(Eigen::numext::bit_cast<Eigen::half>(bits));
}

void check_finite(const Tensor& tensor, const std::string& file_name)
{
    if (tensor.type != TensorType::float32 && tensor.type != TensorType::float16) {
        return;
    }
    const bool is_noise = tensor.name.find("/noise/") != std::string::npos; // infinite: the landmark is no measurement
    for (std::size_t i = 0; i < tensor.num_elements(); ++i) {
        const float value = float_at(tensor, i);
        if (!std::isfinite(value) && !(is_noise && std::isinf(value))) {
            std::string place;
            std::size_t rest = i;
            for (std::size_t k = tensor.shape.size(); k-- > 0; rest /= tensor.shape[k]) {
                place = std::to_string(rest % tensor.shape[k]) + (place.empty() ? "" : ", ") + place;
            }
            fail(file_name, tensor.name, "entry [" + place + "] is " + to_text(value) + "; expected a finite number");
        }
    }
}

/// Takes the parts of the model out of the tensors and texts of a file, each once.
class ModelReader
{
public:
    ModelReader(const Safetensors& file, const std::string& file_name) : file_(file), file_name_(file_name) {}

    MorphableModel read(SaveModelOptions& storage)
    {
        MorphableModel model;
        model.name = text("name");
        model.license = text("license");
        model.provenance = text("provenance");
        if (text("units") != "mm") {
            fail(file_name_, "units", "is '" + text("units") + "'; expected 'mm'");
        }
        model.shape = read_pca("shape", storage.shape_storage);
        if (has("color/mean")) {
            model.color = read_pca("color", storage.color_storage);
        }
        for (const std::string& set : list("expression_sets")) {
            const std::string part = "expression/" + set;
            Blendshapes& blendshapes = model.expression_sets.emplace_back();
            blendshapes.name = set;
            blendshapes.names = list(part + "/names");
            blendshapes.offsets = basis(part + "/offsets", storage.expression_storage);
            blendshapes.standard_deviations = vector(part + "/standard_deviations");
        }
        model.triangle_group_names = list("triangle_groups");
        const Eigen::VectorXi level_sizes = indices("levels");
        for (Eigen::Index i = 0; i < level_sizes.size(); ++i) {
            model.levels.push_back(read_level("level" + std::to_string(i), level_sizes[i]));
        }
        if (has("uv/coordinates")) {
            const Tensor& uv = take("uv/coordinates", {TensorType::float32}, {any_size, 2});
            model.uv_coordinates.resize(2, static_cast<Eigen::Index>(uv.shape[0]));
            copy(uv, model.uv_coordinates.data());
        }
        for (const std::string& scheme : list("landmark_schemes")) {
            model.landmark_maps.push_back(read_landmarks(scheme));
        }
        model.contour_left = index_list("contour/left");
        model.contour_right = index_list("contour/right");
        if (has("mirror")) {
            model.mirror = indices("mirror");
        }
        for (const Tensor& tensor : file_.tensors) {
            if (tensor.name.starts_with("masks/")) {
                model.masks[tensor.name.substr(6)] = vector(tensor.name);
            }
        }
        check_nothing_is_left();
        return model;
    }

private:
    const std::string& text(const std::string& key)
    {
        taken_texts_.insert(key);
        const auto found = file_.metadata.find(key);
        if (found == file_.metadata.end()) {
            fail(file_name_, "__metadata__", "text '" + key + "' is missing");
        }
        return found->second;
    }

    std::vector<std::string> list(const std::string& key)
    {
        const nlohmann::json value = nlohmann::json::parse(text(key), nullptr, false);
        std::vector<std::string> result;
        if (value.is_array()) {
            for (const nlohmann::json& entry : value) {
                if (entry.is_string()) {
                    result.push_back(entry.get<std::string>());
                }
            }
        }
        if (!value.is_array() || result.size() != value.size()) {
            fail(file_name_, key, "is not a JSON list of texts");
        }
        return result;
    }

    [[nodiscard]] bool has(const std::string& name) const { return file_.find(name) != nullptr; }

    /// The tensor, after its type and shape are checked; `any_size` matches every size.
    const Tensor& take(const std::string& name, const std::vector<TensorType>& types,
                       const std::vector<std::uint64_t>& shape)
    {
        taken_tensors_.insert(name);
        const Tensor* const tensor = file_.find(name);
        if (tensor == nullptr) {
            fail(file_name_, name, "the tensor is missing");
        }
        if (std::find(types.begin(), types.end(), tensor->type) == types.end()) {
            fail(file_name_, name, "has the wrong element type");
        }
        bool matches = tensor->shape.size() == shape.size();
        for (std::size_t i = 0; matches && i < shape.size(); ++i) {
            matches = tensor->shape[i] <= max_count && (shape[i] == any_size || tensor->shape[i] == shape[i]);
        }
        if (!matches) {
            fail(file_name_, name, "has the shape " + shape_text(tensor->shape) + "; expected " + shape_text(shape));
        }
        return *tensor;
    }

    static std::string shape_text(const std::vector<std::uint64_t>& shape)
    {
        std::string result;
        for (const std::uint64_t size : shape) {
            result += (result.empty() ? "" : ", ") + (size == any_size ? "n" : std::to_string(size));
        }
        return "[" + result + "]";
    }

    template <typename Number>
    static void copy(const Tensor& tensor, Number* target)
    {
        if (!tensor.elements.empty()) {
            std::memcpy(target, tensor.elements.data(), tensor.elements.size());
        }
    }

    Eigen::VectorXf vector(const std::string& name)
    {
        const Tensor& tensor = take(name, {TensorType::float32}, {any_size});
        Eigen::VectorXf result(static_cast<Eigen::Index>(tensor.shape[0]));
        copy(tensor, result.data());
        return result;
    }

    Eigen::VectorXi indices(const std::string& name)
    {
        const Tensor& tensor = take(name, {TensorType::int32}, {any_size});
        Eigen::VectorXi result(static_cast<Eigen::Index>(tensor.shape[0]));
        copy(tensor, result.data());
        return result;
    }

    std::vector<int> index_list(const std::string& name)
    {
        if (!has(name)) {
            return {};
        }
        const Eigen::VectorXi values = indices(name);
        return {values.begin(), values.end()};
    }

    Eigen::Matrix3Xi triples(const std::string& name)
    {
        const Tensor& tensor = take(name, {TensorType::int32}, {any_size, 3});
        Eigen::Matrix3Xi result(3, static_cast<Eigen::Index>(tensor.shape[0]));
        copy(tensor, result.data());
        return result;
    }

    /// A tensor [m, V, 3] as a 3V x m matrix.
    Eigen::MatrixXf basis(const std::string& name, StorageType& storage)
    {
        const Tensor& tensor =
            take(name, {TensorType::float32, TensorType::float16, TensorType::int16}, {any_size, any_size, 3});
        const auto num_modes = static_cast<Eigen::Index>(tensor.shape[0]);
        Eigen::MatrixXf result(3 * static_cast<Eigen::Index>(tensor.shape[1]), num_modes);
        if (tensor.type == TensorType::float32) {
            storage = StorageType::float32;
            copy(tensor, result.data());
        } else if (tensor.type == TensorType::float16) {
            storage = StorageType::float16;
            for (Eigen::Index i = 0; i < result.size(); ++i) {
                result.data()[i] = float_at(tensor, static_cast<std::size_t>(i));
            }
        } else {
            storage = StorageType::int16;
            const Eigen::VectorXf scales = vector(name + "_scale");
            if (scales.size() != num_modes) {
                fail(file_name_, name + "_scale",
                     "has " + std::to_string(scales.size()) + " numbers; expected " + std::to_string(num_modes) +
                         ", one a mode");
            }
            const std::byte* source = tensor.elements.data();
            for (Eigen::Index mode = 0; mode < num_modes; ++mode) {
                if (!(scales[mode] > 0)) {
                    fail(file_name_, name + "_scale",
                         "number " + std::to_string(mode) + " is " + to_text(scales[mode]) + "; expected a number > 0");
                }
                for (Eigen::Index row = 0; row < result.rows(); ++row, source += 2) {
                    std::int16_t word = 0;
                    std::memcpy(&word, source, 2);
                    result(row, mode) = static_cast<float>(word) * scales[mode];
                }
            }
        }
        return result;
    }

    PcaModel read_pca(const std::string& part, StorageType& storage)
    {
        PcaModel pca;
        const Tensor& mean = take(part + "/mean", {TensorType::float32}, {any_size, 3});
        pca.mean.resize(3 * static_cast<Eigen::Index>(mean.shape[0]));
        copy(mean, pca.mean.data());
        pca.basis = basis(part + "/basis", storage);
        pca.standard_deviations = vector(part + "/standard_deviations");
        return pca;
    }

    Level read_level(const std::string& part, int num_vertices)
    {
        Level level;
        level.num_vertices = num_vertices;
        level.triangles = triples(part + "/triangles");
        if (has(part + "/triangle_groups")) {
            level.triangle_groups = indices(part + "/triangle_groups");
        }
        if (has(part + "/uv_triangles")) {
            level.uv_triangles = triples(part + "/uv_triangles");
        }
        return level;
    }

    LandmarkMap read_landmarks(const std::string& scheme)
    {
        const std::string part = "landmarks/" + scheme;
        LandmarkMap map;
        map.scheme = scheme;
        map.names = list(part + "/names");
        map.vertices = triples(part + "/vertices");
        const Tensor& weights = take(part + "/weights", {TensorType::float32}, {any_size, 3});
        map.weights.resize(3, static_cast<Eigen::Index>(weights.shape[0]));
        copy(weights, map.weights.data());
        for (const Tensor& tensor : file_.tensors) {
            const std::string prefix = part + "/noise/";
            if (tensor.name.starts_with(prefix)) {
                map.noise_mm[tensor.name.substr(prefix.size())] = vector(tensor.name);
            }
        }
        return map;
    }

    void check_nothing_is_left()
    {
        for (const Tensor& tensor : file_.tensors) {
            if (!taken_tensors_.contains(tensor.name)) {
                fail(file_name_, tensor.name,
                     "tensor of unknown meaning; this program reads version " + std::to_string(model_format::version) +
                         " of the format");
            }
        }
        for (const auto& [key, unused] : file_.metadata) {
            if (!taken_texts_.contains(key) && key != "format" && key != "format_version" && key != "crc32c") {
                fail(file_name_, "__metadata__", "text '" + key + "' of unknown meaning");
            }
        }
    }

    const Safetensors& file_;
    const std::string& file_name_;
    std::set<std::string> taken_tensors_;
    std::set<std::string> taken_texts_;
};

/// The stored checksum, after it is compared with the computed one.
std::string check_checksum(std::span<const std::byte> bytes, const Safetensors& file, const std::string& file_name)
{
    const std::optional<std::size_t> position = model_format::find_checksum(bytes);
    const auto stored = file.metadata.find("crc32c");
    const auto format = file.metadata.find("format");
    if (stored == file.metadata.end() &&
        (format == file.metadata.end() || format->second != model_format::format_name)) {
        fail(file_name, "",
             "is a safetensors file, but not a Lineament model (no format '" + std::string(model_format::format_name) +
                 "' in its metadata)");
    }
    if (!position || stored == file.metadata.end() || stored->second.size() != model_format::checksum_digits) {
        fail(file_name, "__metadata__", "the file's checksum 'crc32c' (8 digits, written without blanks) is missing");
    }
    const std::string computed = model_format::compute_checksum(bytes, *position);
    if (stored->second != computed) {
        fail(file_name, "",
             "file checksum differs (stored " + stored->second + ", computed " + computed + "); download again?");
    }
    return computed;
}

void check_version(const Safetensors& file, const std::string& file_name)
{
    const auto text = [&](const char* key) {
        const auto found = file.metadata.find(key);
        return found == file.metadata.end() ? std::string() : found->second;
    };
    if (text("format") != model_format::format_name) {
        fail(file_name, "",
             "is a safetensors file of the format '" + text("format") + "', not '" + model_format::format_name + "'");
    }
    if (text("format_version") != std::to_string(model_format::version)) {
        fail(file_name, "",
             "has format version '" + text("format_version") + "'; this program reads version " +
                 std::to_string(model_format::version) + "; update the program or convert the model");
    }
}

ModelFile parse_checked(std::span<const std::byte> bytes, const std::string& name)
{
    const Safetensors file = parse_safetensors(bytes, name);
    for (const Tensor& tensor : file.tensors) {
        check_finite(tensor, name);
    }
    ModelFile result;
    result.crc32c = check_checksum(bytes, file, name);
    check_version(file, name);
    result.num_bytes = bytes.size();
    result.model = ModelReader(file, name).read(result.storage);
    if (const std::optional<ModelFault> fault = find_model_fault(result.model)) {
        fail(name, fault->part, fault->what);
    }
    return result;
}

} // namespace

ModelFile parse_model_file(std::span<const std::byte> bytes, const std::string& name)
{
    ModelFile file = parse_checked(bytes, name);
    file.warnings = find_model_warnings(file.model);
    return file;
}

MorphableModel parse_model(std::span<const std::byte> bytes, const std::string& name)
{
    return parse_checked(bytes, name).model;
}

ModelFile load_model_file(const std::filesystem::path& path)
{
    return parse_model_file(read_file(path), path.string());
}

MorphableModel load_model(const std::filesystem::path& path)
{
    return parse_model(read_file(path), path.string());
}

} // namespace lineament
