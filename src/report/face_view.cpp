// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/report/face_view.hpp"

#include "report/html.hpp"
#include "report/viewer_data.hpp"

#include <cmath>
#include <map>
#include <utility>

namespace lineament {

FaceView make_face_view(const MorphableModel& model, const FitResult& fit, const ImageU8& texture)
{
    FaceView view;
    view.neutral = model.mesh_of(model.shape.instance(fit.shape_coefficients));
    view.texture = texture;
    if (fit.expression_set.empty()) {
        return view;
    }
    const Blendshapes* expressions = model.find_expression_set(fit.expression_set);
    require(expressions != nullptr, "make_face_view", "fit.expression_set", "a set of the model", fit.expression_set);
    require(fit.expression_coefficients.size() <= expressions->num_coefficients(), "make_face_view",
            "fit.expression_coefficients", "at most " + std::to_string(expressions->num_coefficients()),
            std::to_string(fit.expression_coefficients.size()));
    view.expressions = *expressions;
    view.expression_values = Eigen::VectorXd::Zero(expressions->num_coefficients());
    view.expression_values.head(fit.expression_coefficients.size()) = fit.expression_coefficients;
    return view;
}

namespace html {

namespace {

// The vertices a renderer needs: one for each different pair of vertex and uv point, so that seams keep both sides.
struct RenderVertices
{
    std::vector<std::uint32_t> vertex_of = {};
    std::vector<float> uv = {};
    std::vector<std::uint32_t> triangles = {};
};

RenderVertices split_at_seams(const Mesh& mesh)
{
    const bool has_uv = mesh.uv_triangles.cols() > 0;
    RenderVertices result;
    std::map<std::pair<int, int>, std::uint32_t> known;
    for (Eigen::Index t = 0; t < mesh.num_triangles(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            const int vertex = mesh.triangles(corner, t);
            const int uv = has_uv ? mesh.uv_triangles(corner, t) : 0;
            const auto [entry, is_new] =
                known.try_emplace({vertex, uv}, static_cast<std::uint32_t>(result.vertex_of.size()));
            if (is_new) {
                result.vertex_of.push_back(static_cast<std::uint32_t>(vertex));
                result.uv.push_back(has_uv ? mesh.uv_coordinates(0, uv) : 0.0f);
                result.uv.push_back(has_uv ? mesh.uv_coordinates(1, uv) : 0.0f);
            }
            result.triangles.push_back(entry->second);
        }
    }
    return result;
}

void check(const FaceView& view)
{
    const char* const function = "viewer_json";
    const Mesh& mesh = view.neutral;
    const auto require_indices = [&](const Eigen::Matrix3Xi& indices, Eigen::Index count, const char* name) {
        require(indices.size() == 0 || (indices.minCoeff() >= 0 && indices.maxCoeff() < count), function, name,
                "indices from 0 to " + std::to_string(count - 1), "another");
    };
    require_finite(mesh.vertices, function, "neutral.vertices");
    require_finite(mesh.uv_coordinates, function, "neutral.uv_coordinates");
    require_indices(mesh.triangles, mesh.num_vertices(), "neutral.triangles");
    require_indices(mesh.uv_triangles, mesh.uv_coordinates.cols(), "neutral.uv_triangles");
    require(mesh.uv_triangles.cols() == 0 || mesh.uv_triangles.cols() == mesh.num_triangles(), function,
            "neutral.uv_triangles", "none or one a triangle", std::to_string(mesh.uv_triangles.cols()));
    const Eigen::Index count = view.expressions.num_coefficients();
    require(count == 0 || view.expressions.offsets.rows() == 3 * mesh.num_vertices(), function, "expressions.offsets",
            std::to_string(3 * mesh.num_vertices()) + " rows", std::to_string(view.expressions.offsets.rows()));
    require(static_cast<Eigen::Index>(view.expressions.names.size()) == count, function, "expressions.names",
            std::to_string(count) + " names", std::to_string(view.expressions.names.size()));
    require_size(view.expression_values.size(), count, function, "expression_values");
    require_finite(view.expressions.offsets, function, "expressions.offsets");
    require_finite(view.expression_values, function, "expression_values");
}

template <typename Sequence, typename Write>
std::string json_list(const Sequence& sequence, Write write)
{
    std::string text = "[";
    for (std::size_t i = 0; i < static_cast<std::size_t>(sequence.size()); ++i) {
        if (i > 0) {
            text += ',';
        }
        text += write(i);
    }
    return text + "]";
}

std::string morph_targets_json(const Blendshapes& expressions, const Eigen::VectorXd& values)
{
    return json_list(expressions.names, [&](std::size_t k) {
        const auto offsets = expressions.offsets.col(static_cast<Eigen::Index>(k));
        const float scale = offsets.size() > 0 ? offsets.cwiseAbs().maxCoeff() / 32767.0f : 0.0f;
        std::vector<std::int16_t> steps;
        steps.reserve(static_cast<std::size_t>(offsets.size()));
        for (const float offset : offsets) {
            steps.push_back(scale > 0 ? static_cast<std::int16_t>(std::lround(offset / scale)) : std::int16_t{0});
        }
        return "{\"name\":" + json_string(expressions.names[k]) +
               ",\"value\":" + json_number(static_cast<float>(values[static_cast<Eigen::Index>(k)])) +
               ",\"scale\":" + json_number(scale) + ",\"offsets\":\"" + base64_int16(steps) + "\"}";
    });
}

std::string playback_json(const Playback& playback)
{
    std::vector<float> expressions;
    for (const std::vector<float>& values : playback.expressions) {
        expressions.insert(expressions.end(), values.begin(), values.end());
    }
    return "{\"times\":\"" + base64_floats(playback.times_s) + "\",\"rotations\":\"" +
           base64_floats(playback.rotations) + "\",\"expressions\":\"" + base64_floats(expressions) +
           "\",\"statuses\":" +
           json_list(playback.statuses, [&](std::size_t i) { return json_string(playback.statuses[i]); }) + "}";
}

} // namespace

std::string viewer_json(const FaceView& view, const Eigen::Matrix3d& rotation_of_view, const Playback& playback)
{
    check(view);
    const Mesh& mesh = view.neutral;
    const RenderVertices split = split_at_seams(mesh);
    std::string json = "{\"vertices\":\"" +
                       base64_floats({mesh.vertices.data(), static_cast<std::size_t>(mesh.vertices.size())}) +
                       "\",\"vertexOf\":\"" + base64_uint32(split.vertex_of) + "\",\"uv\":\"" +
                       base64_floats(split.uv) + "\",\"triangles\":\"" + base64_uint32(split.triangles) + "\"";
    if (mesh.colors.cols() == mesh.num_vertices() && mesh.num_vertices() > 0) {
        json +=
            ",\"colors\":\"" + base64_floats({mesh.colors.data(), static_cast<std::size_t>(mesh.colors.size())}) + "\"";
    }
    json += ",\"targets\":" + morph_targets_json(view.expressions, view.expression_values);
    json += ",\"pose\":" + json_list(rotation_of_view.reshaped<Eigen::RowMajor>(), [&](std::size_t i) {
                return json_number(
                    static_cast<float>(rotation_of_view.reshaped<Eigen::RowMajor>()(static_cast<Eigen::Index>(i))));
            });
    if (!view.texture.empty()) {
        const std::string address = image_address(view.texture, 1024);
        json += ",\"texture\":\"" + address + "\"";
    }
    if (!playback.times_s.empty()) {
        json += ",\"playback\":" + playback_json(playback);
    }
    return json + "}";
}

} // namespace html

} // namespace lineament
