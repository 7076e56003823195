// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "json.hpp"

#include <Eigen/Core>

#include <string>

namespace lineament::detail {

/// Whether an accessor states the smallest and largest value of each component.
enum class GlbBounds
{
    written,
    omitted,
};

/// The binary chunk of a GLB file with its buffer views and accessors. Each `add_` returns the index of the accessor
/// (`add_bytes`: of the buffer view).
class GlbBuffer
{
public:
    /// One vertex attribute, a column a vertex.
    int add_attribute(const Eigen::Ref<const Eigen::MatrixXf>& values, GlbBounds bounds);

    /// The offsets of a morph target; sparse where that takes fewer bytes.
    int add_offsets(const Eigen::Matrix3Xf& offsets);

    /// Triangle corners, as 16-bit numbers where they fit.
    int add_indices(const Eigen::Matrix3Xi& triangles, Eigen::Index num_vertices);

    /// Times or values of an animation, a column a keyframe.
    /// @param type  "SCALAR" (each entry is an element of its own), "VEC3" or "VEC4".
    int add_track(const Eigen::Ref<const Eigen::MatrixXf>& values, const char* type, GlbBounds bounds);

    int add_bytes(const std::string& bytes);

    /// The file: header, JSON chunk (with buffer, buffer views and accessors added) and binary chunk.
    [[nodiscard]] std::string to_glb(Json json) &&;

private:
    int add_view(const std::string& bytes, int target);
    int add_accessor(Json accessor);
    void append_index(std::string& bytes, int index, bool is_short) const;

    std::string bytes_ = {};
    Json views_ = Json::array();
    Json accessors_ = Json::array();
};

} // namespace lineament::detail
