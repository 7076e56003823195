// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Wavefront OBJ: the polygonal part of the format.
#include "lineament/io/mesh_file.hpp"

#include "mesh_checks.hpp"
#include "text.hpp"

#include "lineament/core/checks.hpp"

#include <algorithm>
#include <map>

namespace lineament {

namespace {

using detail::content_error;
using detail::in_quotes;
using detail::take_token;
using detail::trimmed;

constexpr std::size_t max_line_bytes = 1 << 20;

// Lines with their continuations (a backslash at the end) joined, and the place of each piece in the file.
class LogicalLines
{
public:
    LogicalLines(std::string_view text, const std::string& path) : lines_(text), path_(path) {}

    bool next()
    {
        segments_.clear();
        if (!lines_.next()) {
            return false;
        }
        line_ = lines_.line();
        segments_.push_back({0, lines_.number()});
        if (line_.ends_with('\\')) {
            joined_.assign(line_.substr(0, line_.size() - 1));
            while (lines_.next()) {
                joined_ += ' ';
                segments_.push_back({joined_.size(), lines_.number()});
                joined_ += lines_.line();
                if (!joined_.ends_with('\\') || joined_.size() > max_line_bytes) {
                    break;
                }
                joined_.pop_back();
            }
            line_ = joined_;
        }
        if (line_.size() > max_line_bytes) {
            fail(line_, "expected lines of at most 1 MB, found more: not an OBJ file?");
        }
        line_ = line_.substr(0, line_.find('#'));
        return true;
    }

    [[nodiscard]] std::string_view line() const { return line_; }

    /// @param piece  Of line().
    [[nodiscard]] std::string place(std::string_view piece) const
    {
        const auto offset = static_cast<std::size_t>(piece.data() - line_.data());
        std::size_t i = segments_.size() - 1;
        while (segments_[i].offset > offset) {
            --i;
        }
        return std::to_string(segments_[i].line) + ":" + std::to_string(offset - segments_[i].offset + 1);
    }

    [[noreturn]] void fail(std::string_view piece, const std::string& what) const
    {
        throw content_error(path_, place(piece), what);
    }

private:
    struct Segment
    {
        std::size_t offset = 0;
        int line = 0;
    };

    detail::LineReader lines_;
    const std::string& path_;
    std::string_view line_ = {};
    std::string joined_ = {};
    std::vector<Segment> segments_ = {};
};

// Names in the order of their first use, and the name of each triangle.
class Grouping
{
public:
    void start(std::string_view name)
    {
        const std::string key(name.empty() ? "default" : name);
        current_ = indices_.emplace(key, static_cast<int>(names_.size())).first->second;
        if (current_ == static_cast<int>(names_.size())) {
            names_.push_back(key);
        }
    }

    void add_triangle()
    {
        if (names_.empty()) {
            start("default");
        }
        triangles_.push_back(current_);
    }

    [[nodiscard]] bool is_used() const { return names_.size() > 1 || (names_.size() == 1 && names_[0] != "default"); }

    void move_to(Mesh& mesh)
    {
        mesh.triangle_groups =
            Eigen::Map<const Eigen::VectorXi>(triangles_.data(), static_cast<Eigen::Index>(triangles_.size()));
        mesh.group_names = std::move(names_);
    }

private:
    std::map<std::string, int> indices_ = {};
    std::vector<std::string> names_ = {};
    std::vector<int> triangles_ = {};
    int current_ = 0;
};

class ObjParser
{
public:
    ObjParser(std::string_view text, const std::string& path) : lines_(text, path), path_(path) {}

    MeshFile run()
    {
        while (lines_.next()) {
            rest_ = lines_.line();
            const std::string_view keyword = take_token(rest_);
            if (keyword == "v") {
                read_vertex();
            } else if (keyword == "vt") {
                read_uv();
            } else if (keyword == "vn") {
                ++num_normals_;
            } else if (keyword == "f") {
                read_face();
            } else if (keyword == "g" || keyword == "o") {
                shapes_.start(trimmed(rest_));
            } else if (keyword == "usemtl") {
                materials_.start(trimmed(rest_));
            } else if (keyword == "mtllib") {
                read_material_file();
            }
        }
        return finish();
    }

private:
    struct Corner
    {
        int vertex = 0;
        int uv = -1; ///< -1: none.
    };

    float read_float(std::string_view token, const char* expected) const
    {
        const auto value = detail::parse_float(token);
        if (!value) {
            lines_.fail(token.empty() ? rest_ : token, std::string("expected ") + expected + ", found " +
                                                           (token.empty() ? "the end of the line" : in_quotes(token)) +
                                                           detail::decimal_comma_hint(token));
        }
        return *value;
    }

    void read_vertex()
    {
        float values[7] = {};
        int count = 0;
        while (!trimmed(rest_).empty() && count < 7) {
            values[count++] = read_float(take_token(rest_), "a finite coordinate");
        }
        if (count < 3 || count == 5 || !trimmed(rest_).empty()) {
            lines_.fail(trimmed(rest_).empty() ? lines_.line() : trimmed(rest_),
                        "expected 3 coordinates, or 3 and a weight or a colour, found " +
                            (trimmed(rest_).empty() ? std::to_string(count) + " numbers" : "more than 7 numbers"));
        }
        vertices_.insert(vertices_.end(), values, values + 3);
        if (count >= 6) {
            for (int i = count - 3; i < count; ++i) {
                colors_.push_back(std::clamp(values[i], 0.0f, 1.0f));
            }
        }
    }

    void read_uv()
    {
        const float u = read_float(take_token(rest_), "a finite u coordinate");
        const float v = trimmed(rest_).empty() ? 0.0f : read_float(take_token(rest_), "a finite v coordinate");
        uv_.insert(uv_.end(), {u, 1.0f - v});
    }

    // The zero-based position that an index of the file means.
    int read_index(std::string_view token, std::size_t count, const std::string& what) const
    {
        const auto value = detail::parse_integer(token);
        if (!value && token.find_first_not_of("+-0123456789") != std::string_view::npos) {
            lines_.fail(token, "expected a " + what + " index, found " + in_quotes(token));
        }
        const auto limit = static_cast<long long>(count);
        if (!value || *value == 0 || *value > limit || *value < -limit) {
            lines_.fail(token, what + " index " + in_quotes(token) + " is out of range; there are " +
                                   std::to_string(count) + " so far (allowed 1.." + std::to_string(count) + ", -" +
                                   std::to_string(count) + "..-1)");
        }
        return static_cast<int>(*value > 0 ? *value - 1 : limit + *value);
    }

    Corner read_corner(std::string_view token) const
    {
        std::string_view parts[3] = {};
        int count = 0;
        for (std::string_view left = token; count < 3; ++count) {
            const std::size_t slash = left.find('/');
            parts[count] = left.substr(0, slash);
            if (slash == std::string_view::npos) {
                ++count;
                left = {};
                break;
            }
            left.remove_prefix(slash + 1);
            if (count == 2) {
                lines_.fail(token, "expected vertex/uv/normal, found " + in_quotes(token));
            }
        }
        Corner corner;
        corner.vertex = read_index(parts[0], vertices_.size() / 3, "vertex");
        if (count >= 2 && !(count == 3 && parts[1].empty())) {
            corner.uv = read_index(parts[1], uv_.size() / 2, "uv");
        }
        if (count == 3) {
            (void)read_index(parts[2], num_normals_, "normal");
        }
        return corner;
    }

    void read_face()
    {
        corners_.clear();
        for (std::string_view token = take_token(rest_); !token.empty(); token = take_token(rest_)) {
            corners_.push_back(read_corner(token));
        }
        if (corners_.size() < 3) {
            lines_.fail(lines_.line(),
                        "expected a face of at least 3 corners, found " + std::to_string(corners_.size()));
        }
        for (std::size_t i = 2; i < corners_.size(); ++i) {
            for (const Corner& corner : {corners_[0], corners_[i - 1], corners_[i]}) {
                triangles_.push_back(corner.vertex);
                uv_triangles_.push_back(corner.uv);
            }
            shapes_.add_triangle();
            materials_.add_triangle();
        }
    }

    void read_material_file()
    {
        const std::string_view name = trimmed(rest_);
        if (name.empty() || name == "." || name == ".." || name.find_first_of("/\\:") != std::string_view::npos) {
            warnings_.push_back("line " + lines_.place(name) + ": the material file " + in_quotes(name) +
                                " is not in the folder of the mesh; ignored");
            return;
        }
        material_file_ = name;
    }

    void set_uv(Mesh& mesh)
    {
        if (std::all_of(uv_triangles_.begin(), uv_triangles_.end(), [](int index) { return index < 0; })) {
            return;
        }
        // Corners without uv share one more point.
        const auto extra = static_cast<int>(uv_.size() / 2);
        const auto missing = std::count(uv_triangles_.begin(), uv_triangles_.end(), -1);
        if (missing > 0) {
            std::replace(uv_triangles_.begin(), uv_triangles_.end(), -1, extra);
            uv_.insert(uv_.end(), {0.0f, 0.0f});
            warnings_.push_back(std::to_string(missing) + " corners of faces have no uv; they get uv (0, 0)");
        }
        mesh.uv_coordinates =
            Eigen::Map<const Eigen::Matrix2Xf>(uv_.data(), 2, static_cast<Eigen::Index>(uv_.size() / 2));
        mesh.uv_triangles = Eigen::Map<const Eigen::Matrix3Xi>(uv_triangles_.data(), 3,
                                                               static_cast<Eigen::Index>(triangles_.size() / 3));
    }

    MeshFile finish()
    {
        if (vertices_.empty()) {
            throw content_error(path_, "",
                                "expected an OBJ or PLY mesh, found no vertices (no line that starts with \"v\")");
        }
        MeshFile file;
        Mesh& mesh = file.mesh;
        mesh.vertices =
            Eigen::Map<const Eigen::Matrix3Xf>(vertices_.data(), 3, static_cast<Eigen::Index>(vertices_.size() / 3));
        if (colors_.size() == vertices_.size()) {
            mesh.colors =
                Eigen::Map<const Eigen::Matrix3Xf>(colors_.data(), 3, static_cast<Eigen::Index>(colors_.size() / 3));
        } else if (!colors_.empty()) {
            warnings_.push_back("only " + std::to_string(colors_.size() / 3) + " of " +
                                std::to_string(vertices_.size() / 3) + " vertices have a colour; colours ignored");
        }
        mesh.triangles =
            Eigen::Map<const Eigen::Matrix3Xi>(triangles_.data(), 3, static_cast<Eigen::Index>(triangles_.size() / 3));
        set_uv(mesh);
        if (!triangles_.empty()) {
            if (shapes_.is_used()) {
                shapes_.move_to(mesh);
            } else if (materials_.is_used()) {
                materials_.move_to(mesh);
            }
        }
        if (triangles_.empty()) {
            warnings_.push_back("the file has no faces");
        }
        if (const Eigen::Index count = detail::count_degenerate(mesh.triangles); count > 0) {
            warnings_.push_back(std::to_string(count) + " triangles use a vertex twice");
        }
        file.material_file = std::move(material_file_);
        file.warnings = std::move(warnings_);
        return file;
    }

    LogicalLines lines_;
    const std::string& path_;
    std::string_view rest_ = {};
    std::vector<float> vertices_ = {};
    std::vector<float> colors_ = {};
    std::vector<float> uv_ = {};
    std::vector<int> triangles_ = {};
    std::vector<int> uv_triangles_ = {};
    std::vector<Corner> corners_ = {};
    std::size_t num_normals_ = 0;
    Grouping shapes_ = {};
    Grouping materials_ = {};
    std::string material_file_ = {};
    std::vector<std::string> warnings_ = {};
};

template <typename Column>
void append_numbers(std::string& text, const Column& values)
{
    for (const float value : values) {
        text += ' ';
        detail::append_number(text, value);
    }
}

// A group name on one line, without the characters that would end or comment it.
std::string group_name(const Mesh& mesh, int group)
{
    std::string name = mesh.group_names[group];
    std::replace_if(
        name.begin(), name.end(), [](char c) { return static_cast<unsigned char>(c) <= ' ' || c == '#' || c == '\\'; },
        '_');
    return name.empty() ? "default" : name;
}

} // namespace

MeshFile parse_obj(std::string_view bytes, const std::string& path)
{
    return ObjParser(detail::checked_text(bytes, path, "an OBJ or PLY mesh"), path).run();
}

std::string format_obj(const Mesh& mesh, const ObjOptions& options)
{
    detail::check_mesh(mesh, "format_obj");
    require(options.material_file.find_first_of("/\\\r\n#") == std::string::npos, "format_obj", "options.material_file",
            "a plain file name", detail::in_quotes(options.material_file));
    std::string text = "# Lineament; millimetres, x to the subject's left, y up, z out of the face\n";
    if (!options.material_file.empty()) {
        text += "mtllib " + options.material_file + "\n";
    }
    for (Eigen::Index v = 0; v < mesh.num_vertices(); ++v) {
        text += 'v';
        append_numbers(text, Eigen::Vector3f(mesh.vertices.col(v)));
        if (mesh.colors.cols() > 0) {
            append_numbers(text, Eigen::Vector3f(mesh.colors.col(v)));
        }
        text += '\n';
    }
    const bool has_uv = mesh.uv_triangles.cols() > 0;
    for (Eigen::Index u = 0; has_uv && u < mesh.uv_coordinates.cols(); ++u) {
        text += "vt";
        append_numbers(text, Eigen::Vector2f(mesh.uv_coordinates(0, u), 1.0f - mesh.uv_coordinates(1, u)));
        text += '\n';
    }
    if (!options.material_file.empty()) {
        text += "usemtl face\n";
    }
    int group = -1;
    for (Eigen::Index t = 0; t < mesh.num_triangles(); ++t) {
        if (mesh.triangle_groups.size() > 0 && mesh.triangle_groups[t] != group) {
            group = mesh.triangle_groups[t];
            text += "g " + group_name(mesh, group) + "\n";
        }
        text += 'f';
        for (int corner = 0; corner < 3; ++corner) {
            text += ' ';
            text += std::to_string(mesh.triangles(corner, t) + 1);
            if (has_uv) {
                text += '/';
                text += std::to_string(mesh.uv_triangles(corner, t) + 1);
            }
        }
        text += '\n';
    }
    return text;
}

std::string format_mtl(const std::string& texture_file)
{
    require(texture_file.find_first_of("\r\n") == std::string::npos, "format_mtl", "texture_file", "one line",
            detail::in_quotes(texture_file));
    std::string text = "# Lineament\nnewmtl face\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nillum 1\n";
    if (!texture_file.empty()) {
        text += "map_Kd " + texture_file + "\n";
    }
    return text;
}

} // namespace lineament
