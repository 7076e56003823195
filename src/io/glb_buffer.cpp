// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "glb_buffer.hpp"

#include "lineament/core/error.hpp"

#include <bit>
#include <cstdint>

namespace lineament::detail {

namespace {

constexpr int type_u16 = 5123;
constexpr int type_u32 = 5125;
constexpr int type_f32 = 5126;
constexpr int target_vertices = 34962;
constexpr int target_indices = 34963;
constexpr int no_target = 0;

void append_u32(std::string& bytes, std::uint32_t value)
{
    for (int i = 0; i < 4; ++i) {
        bytes += static_cast<char>(value >> (8 * i) & 0xff);
    }
}

std::string bytes_of(const Eigen::Ref<const Eigen::MatrixXf>& values)
{
    std::string bytes;
    bytes.reserve(static_cast<std::size_t>(values.size()) * 4);
    for (Eigen::Index column = 0; column < values.cols(); ++column) {
        for (Eigen::Index row = 0; row < values.rows(); ++row) {
            append_u32(bytes, std::bit_cast<std::uint32_t>(values(row, column)));
        }
    }
    return bytes;
}

void append_bounds(Json& accessor, const Eigen::Ref<const Eigen::MatrixXf>& values)
{
    accessor["min"] = Json::array();
    accessor["max"] = Json::array();
    for (Eigen::Index row = 0; row < values.rows(); ++row) {
        accessor["min"].push_back(values.row(row).minCoeff());
        accessor["max"].push_back(values.row(row).maxCoeff());
    }
}

void pad(std::string& bytes, char filler)
{
    bytes.append((4 - bytes.size() % 4) % 4, filler);
}

} // namespace

int GlbBuffer::add_view(const std::string& bytes, int target)
{
    pad(bytes_, '\0');
    Json view = {{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", bytes.size()}};
    if (target != no_target) {
        view["target"] = target;
    }
    bytes_ += bytes;
    views_.push_back(std::move(view));
    return static_cast<int>(views_.size()) - 1;
}

int GlbBuffer::add_accessor(Json accessor)
{
    accessors_.push_back(std::move(accessor));
    return static_cast<int>(accessors_.size()) - 1;
}

int GlbBuffer::add_attribute(const Eigen::Ref<const Eigen::MatrixXf>& values, GlbBounds bounds)
{
    Json accessor = {{"bufferView", add_view(bytes_of(values), target_vertices)},
                     {"componentType", type_f32},
                     {"count", values.cols()},
                     {"type", values.rows() == 2 ? "VEC2" : "VEC3"}};
    if (bounds == GlbBounds::written) {
        append_bounds(accessor, values);
    }
    return add_accessor(std::move(accessor));
}

void GlbBuffer::append_index(std::string& bytes, int index, bool is_short) const
{
    bytes += static_cast<char>(index & 0xff);
    bytes += static_cast<char>(index >> 8 & 0xff);
    if (!is_short) {
        bytes += static_cast<char>(index >> 16 & 0xff);
        bytes += static_cast<char>(index >> 24 & 0xff);
    }
}

int GlbBuffer::add_offsets(const Eigen::Matrix3Xf& offsets)
{
    std::vector<int> moved;
    for (Eigen::Index v = 0; v < offsets.cols(); ++v) {
        if (!offsets.col(v).isZero(0.0f)) {
            moved.push_back(static_cast<int>(v));
        }
    }
    const bool is_short = offsets.cols() <= 65535;
    const std::size_t sparse_size = moved.size() * (is_short ? 14 : 16);
    if (sparse_size >= static_cast<std::size_t>(offsets.cols()) * 12) {
        return add_attribute(offsets, GlbBounds::written);
    }
    // Without a buffer view the accessor is zero except where the sparse part says otherwise.
    Json accessor = {{"componentType", type_f32}, {"count", offsets.cols()}, {"type", "VEC3"}};
    append_bounds(accessor, offsets);
    if (!moved.empty()) {
        std::string indices;
        Eigen::Matrix3Xf values(3, static_cast<Eigen::Index>(moved.size()));
        for (std::size_t i = 0; i < moved.size(); ++i) {
            append_index(indices, moved[i], is_short);
            values.col(static_cast<Eigen::Index>(i)) = offsets.col(moved[i]);
        }
        const int index_view = add_view(indices, no_target);
        const int value_view = add_view(bytes_of(values), no_target);
        accessor["sparse"] = {
            {"count", moved.size()},
            {"indices", {{"bufferView", index_view}, {"componentType", is_short ? type_u16 : type_u32}}},
            {"values", {{"bufferView", value_view}}}};
    }
    return add_accessor(std::move(accessor));
}

int GlbBuffer::add_indices(const Eigen::Matrix3Xi& triangles, Eigen::Index num_vertices)
{
    const bool is_short = num_vertices <= 65535; // 65535 itself may not be an index
    std::string bytes;
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            append_index(bytes, triangles(corner, t), is_short);
        }
    }
    return add_accessor({{"bufferView", add_view(bytes, target_indices)},
                         {"componentType", is_short ? type_u16 : type_u32},
                         {"count", triangles.size()},
                         {"type", "SCALAR"}});
}

int GlbBuffer::add_track(const Eigen::Ref<const Eigen::MatrixXf>& values, const char* type, GlbBounds bounds)
{
    const bool is_scalar = std::string_view(type) == "SCALAR";
    Json accessor = {{"bufferView", add_view(bytes_of(values), no_target)},
                     {"componentType", type_f32},
                     {"count", is_scalar ? values.size() : values.cols()},
                     {"type", type}};
    if (bounds == GlbBounds::written) {
        append_bounds(accessor, values);
    }
    return add_accessor(std::move(accessor));
}

int GlbBuffer::add_bytes(const std::string& bytes)
{
    return add_view(bytes, no_target);
}

std::string GlbBuffer::to_glb(Json json) &&
{
    pad(bytes_, '\0');
    json["buffers"] = Json::array({{{"byteLength", bytes_.size()}}});
    json["bufferViews"] = std::move(views_);
    json["accessors"] = std::move(accessors_);
    std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
    pad(text, ' ');
    const std::size_t size = 12 + 8 + text.size() + 8 + bytes_.size();
    if (size > UINT32_MAX) {
        throw InvalidArgument("format_glb", "scene", "at most 4 GB", std::to_string(size) + " bytes");
    }
    std::string glb = "glTF";
    append_u32(glb, 2);
    append_u32(glb, static_cast<std::uint32_t>(size));
    append_u32(glb, static_cast<std::uint32_t>(text.size()));
    glb += "JSON";
    glb += text;
    append_u32(glb, static_cast<std::uint32_t>(bytes_.size()));
    glb += std::string("BIN\0", 4);
    glb += bytes_;
    return glb;
}

} // namespace lineament::detail
