// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// PLY 1.0: ascii, binary little-endian, binary big-endian.
#include "lineament/io/mesh_file.hpp"

#include "mesh_checks.hpp"
#include "ply_values.hpp"
#include "text.hpp"

#include "lineament/core/checks.hpp"
#include "lineament/core/image.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>

namespace lineament {

namespace {

using detail::content_error;
using detail::in_quotes;
using detail::take_token;
using detail::trimmed;
using namespace ply;

class PlyParser
{
public:
    PlyParser(std::string_view bytes, const std::string& path) : bytes_(bytes), path_(path) {}

    MeshFile run()
    {
        read_header();
        Values values(bytes_, at_, line_number_, encoding_, path_);
        for (const Element& element : elements_) {
            if (element.name == "vertex") {
                read_vertices(element, values);
            } else if (element.name == "face") {
                read_faces(element, values);
            } else {
                skip(element, values);
            }
        }
        if (mesh_.num_vertices() == 0) {
            throw content_error(path_, "", "expected a mesh, found no vertices");
        }
        MeshFile file;
        mesh_.triangles =
            Eigen::Map<const Eigen::Matrix3Xi>(triangles_.data(), 3, static_cast<Eigen::Index>(triangles_.size() / 3));
        check_indices();
        file.mesh = std::move(mesh_);
        if (file.mesh.num_triangles() == 0) {
            file.warnings.push_back("the file has no faces");
        }
        if (const Eigen::Index count = detail::count_degenerate(file.mesh.triangles); count > 0) {
            file.warnings.push_back(std::to_string(count) + " triangles use a vertex twice");
        }
        if (values.has_rest()) {
            file.warnings.push_back("there are bytes after the last element; ignored");
        }
        return file;
    }

private:
    [[noreturn]] void fail(const std::string& what) const
    {
        throw content_error(path_, std::to_string(line_number_), what);
    }

    bool next_line()
    {
        if (at_ >= bytes_.size()) {
            return false;
        }
        const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
        line_ = bytes_.substr(at_, end - at_);
        if (line_.ends_with('\r')) {
            line_.remove_suffix(1);
        }
        at_ = std::min(end + 1, bytes_.size());
        ++line_number_;
        return true;
    }

    void read_header()
    {
        if (!next_line() || line_ != "ply") {
            throw content_error(path_, "1", "expected \"ply\", found " + in_quotes(line_));
        }
        bool has_format = false;
        while (true) {
            if (!next_line() || line_number_ > 10000) {
                fail("expected \"end_header\", found the end of the file: cut short?");
            }
            std::string_view rest = line_;
            const std::string_view keyword = take_token(rest);
            if (keyword == "end_header") {
                break;
            }
            if (keyword == "format") {
                read_format(rest);
                has_format = true;
            } else if (keyword == "element") {
                read_element(rest);
            } else if (keyword == "property") {
                read_property(rest);
            } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
                fail("expected format, element, property, comment or end_header, found " + in_quotes(line_));
            }
        }
        if (!has_format) {
            fail("expected a line \"format ... 1.0\" in the header, found none");
        }
        check_counts();
    }

    void read_format(std::string_view rest)
    {
        const std::string_view name = take_token(rest);
        const std::string_view version = take_token(rest);
        if (name == "ascii") {
            encoding_ = Encoding::ascii;
        } else if (name == "binary_little_endian") {
            encoding_ = Encoding::little;
        } else if (name == "binary_big_endian") {
            encoding_ = Encoding::big;
        } else {
            fail("expected format ascii, binary_little_endian or binary_big_endian, found " + in_quotes(name));
        }
        if (version != "1.0") {
            fail("expected format version 1.0, found " + in_quotes(version));
        }
    }

    void read_element(std::string_view rest)
    {
        Element element;
        element.name = take_token(rest);
        element.place = std::to_string(line_number_);
        const std::string_view token = take_token(rest);
        const auto count = detail::parse_integer(token);
        if (element.name.empty() || !count || *count < 0 || *count > std::numeric_limits<int>::max() / 4) {
            fail("expected \"element NAME COUNT\" with a count in 0 to 536870911, found " + in_quotes(line_));
        }
        for (const Element& other : elements_) {
            if (other.name == element.name) {
                fail("the element " + in_quotes(element.name) + " stands twice in the header");
            }
        }
        element.count = static_cast<std::size_t>(*count);
        elements_.push_back(std::move(element));
    }

    void read_property(std::string_view rest)
    {
        if (elements_.empty()) {
            fail("expected an element before its properties");
        }
        Property property;
        property.place = std::to_string(line_number_);
        std::string_view token = take_token(rest);
        if (token == "list") {
            token = take_token(rest);
            property.count_type = type_of(token);
            if (!property.count_type || !is_integer(*property.count_type)) {
                fail("expected an integer type for the count of a list, found " + in_quotes(token));
            }
            token = take_token(rest);
        }
        const auto type = type_of(token);
        if (!type) {
            fail("expected a PLY type (char, uchar, short, ushort, int, uint, float, double), found " +
                 in_quotes(token));
        }
        property.type = *type;
        property.name = take_token(rest);
        if (property.name.empty() || !trimmed(rest).empty()) {
            fail("expected one property name, found " + in_quotes(line_));
        }
        for (const Property& other : elements_.back().properties) {
            if (other.name == property.name) {
                fail("the property " + in_quotes(property.name) + " stands twice in one element");
            }
        }
        elements_.back().properties.push_back(std::move(property));
    }

    // Counts against what is left of the file, before anything is allocated.
    void check_counts() const
    {
        const std::size_t left = bytes_.size() - at_;
        for (const Element& element : elements_) {
            std::size_t row_size = 0;
            for (const Property& property : element.properties) {
                row_size += encoding_ == Encoding::ascii
                                ? 2
                                : type_sizes[static_cast<std::size_t>(property.count_type.value_or(property.type))];
            }
            if (element.count > 0 && (row_size == 0 || element.count > (left + 1) / row_size)) {
                throw content_error(path_, element.place,
                                    "the header announces " + std::to_string(element.count) + " of element " +
                                        in_quotes(element.name) + ", but only " + std::to_string(left) +
                                        " bytes follow: cut short?");
            }
        }
    }

    static int find(const Element& element, std::initializer_list<std::string_view> names)
    {
        for (std::size_t i = 0; i < element.properties.size(); ++i) {
            if (std::find(names.begin(), names.end(), element.properties[i].name) != names.end()) {
                return static_cast<int>(i);
            }
        }
        return -1;
    }

    static double color_scale(Type type)
    {
        return type == Type::u8 ? 1.0 / 255.0 : type == Type::u16 ? 1.0 / 65535.0 : 1.0;
    }

    void read_vertices(const Element& element, Values& values)
    {
        std::array<int, 6> slots = {find(element, {"x"}),
                                    find(element, {"y"}),
                                    find(element, {"z"}),
                                    find(element, {"red", "diffuse_red"}),
                                    find(element, {"green", "diffuse_green"}),
                                    find(element, {"blue", "diffuse_blue"})};
        for (int i = 0; i < 3; ++i) {
            if (slots[i] < 0 || element.properties[slots[i]].count_type) {
                throw content_error(path_, element.place, "expected the properties x, y and z of element \"vertex\"");
            }
        }
        const bool has_color = *std::min_element(slots.begin() + 3, slots.end()) >= 0;
        std::vector<float> row(element.properties.size());
        mesh_.vertices.resize(3, static_cast<Eigen::Index>(element.count));
        mesh_.colors.resize(3, has_color ? static_cast<Eigen::Index>(element.count) : 0);
        for (std::size_t v = 0; v < element.count; ++v) {
            values.start_row(element, v);
            for (std::size_t i = 0; i < row.size(); ++i) {
                row[i] = read_property_value(element.properties[i], values);
            }
            values.end_row();
            for (int i = 0; i < 3; ++i) {
                if (!std::isfinite(row[slots[i]])) {
                    values.fail("expected finite coordinates for " + values.what() + ", found " +
                                to_text(row[slots[i]]));
                }
                mesh_.vertices(i, static_cast<Eigen::Index>(v)) = row[slots[i]];
                if (has_color) {
                    const Property& property = element.properties[slots[3 + i]];
                    const float value = row[slots[3 + i]] * static_cast<float>(color_scale(property.type));
                    mesh_.colors(i, static_cast<Eigen::Index>(v)) = value >= 0.0f ? std::min(value, 1.0f) : 0.0f;
                }
            }
        }
    }

    // The value of a scalar property as float (out of its range: infinite); a list is skipped.
    static float read_property_value(const Property& property, Values& values)
    {
        if (!property.count_type) {
            const double value = values.next(property.type);
            return std::abs(value) <= std::numeric_limits<float>::max() ? static_cast<float>(value)
                                                                        : std::numeric_limits<float>::infinity();
        }
        for (auto left = static_cast<long long>(read_count(property, values)); left > 0; --left) {
            (void)values.next(property.type);
        }
        return 0.0f;
    }

    static double read_count(const Property& property, Values& values)
    {
        const double count = values.next(*property.count_type);
        if (count < 0.0 || count > 1e9) {
            values.fail("expected a list count >= 0 for " + values.what() + ", found " + to_text(count));
        }
        return count;
    }

    void read_faces(const Element& element, Values& values)
    {
        const int slot = find(element, {"vertex_indices", "vertex_index"});
        if (slot < 0 || !element.properties[slot].count_type || !is_integer(element.properties[slot].type)) {
            throw content_error(path_, slot < 0 ? element.place : element.properties[slot].place,
                                "expected a list of integers vertex_indices for element \"face\"");
        }
        std::vector<int> corners;
        for (std::size_t f = 0; f < element.count; ++f) {
            values.start_row(element, f);
            for (std::size_t i = 0; i < element.properties.size(); ++i) {
                if (static_cast<int>(i) != slot) {
                    (void)read_property_value(element.properties[i], values);
                    continue;
                }
                corners.clear();
                const double count = read_count(element.properties[i], values);
                for (double k = 0; k < count; ++k) {
                    corners.push_back(read_index(element.properties[i], values));
                }
            }
            values.end_row();
            if (corners.size() < 3) {
                values.fail("expected at least 3 corners for " + values.what() + ", found " +
                            std::to_string(corners.size()));
            }
            for (std::size_t i = 2; i < corners.size(); ++i) {
                triangles_.insert(triangles_.end(), {corners[0], corners[i - 1], corners[i]});
            }
        }
    }

    int read_index(const Property& property, Values& values) const
    {
        const double index = values.next(property.type);
        const double limit = static_cast<double>(num_vertices_announced());
        if (!(index >= 0 && index < limit)) {
            values.fail("vertex index " + to_text(index) + " of " + values.what() + " is out of range; there are " +
                        to_text(limit) + " vertices (allowed 0.." + to_text(limit - 1) + ")");
        }
        return static_cast<int>(index);
    }

    [[nodiscard]] std::size_t num_vertices_announced() const
    {
        for (const Element& element : elements_) {
            if (element.name == "vertex") {
                return element.count;
            }
        }
        return 0;
    }

    void check_indices() const
    {
        LINEAMENT_ASSERT(mesh_.triangles.cols() == 0 || mesh_.triangles.maxCoeff() < mesh_.num_vertices());
    }

    static void skip(const Element& element, Values& values)
    {
        for (std::size_t row = 0; row < element.count; ++row) {
            values.start_row(element, row);
            for (const Property& property : element.properties) {
                (void)read_property_value(property, values);
            }
            values.end_row();
        }
    }

    std::string_view bytes_;
    const std::string& path_;
    std::size_t at_ = 0;
    int line_number_ = 0;
    std::string_view line_ = {};
    Encoding encoding_ = Encoding::ascii;
    std::vector<Element> elements_ = {};
    Mesh mesh_ = {};
    std::vector<int> triangles_ = {};
};

template <typename Number>
void append_little_endian(std::string& bytes, Number value)
{
    std::uint32_t bits = 0;
    static_assert(sizeof value == sizeof bits);
    std::memcpy(&bits, &value, sizeof bits);
    for (int i = 0; i < 4; ++i) {
        bytes += static_cast<char>(bits >> (8 * i) & 0xff);
    }
}

} // namespace

MeshFile parse_ply(std::string_view bytes, const std::string& path)
{
    return PlyParser(bytes, path).run();
}

std::string format_ply(const Mesh& mesh, PlyEncoding encoding)
{
    detail::check_mesh(mesh, "format_ply");
    const bool is_ascii = encoding == PlyEncoding::ascii;
    const bool has_color = mesh.colors.cols() > 0;
    std::string bytes =
        std::string("ply\nformat ") + (is_ascii ? "ascii" : "binary_little_endian") +
        " 1.0\ncomment Lineament; millimetres, x to the subject's left, y up, z out of the face\n"
        "element vertex " +
        std::to_string(mesh.num_vertices()) + "\nproperty float x\nproperty float y\nproperty float z\n" +
        (has_color ? "property uchar red\nproperty uchar green\nproperty uchar blue\n" : "") + "element face " +
        std::to_string(mesh.num_triangles()) + "\nproperty list uchar int vertex_indices\nend_header\n";
    for (Eigen::Index v = 0; v < mesh.num_vertices(); ++v) {
        for (int i = 0; i < 3; ++i) {
            if (is_ascii) {
                bytes += i > 0 ? " " : "";
                detail::append_number(bytes, mesh.vertices(i, v));
            } else {
                append_little_endian(bytes, mesh.vertices(i, v));
            }
        }
        for (int i = 0; has_color && i < 3; ++i) {
            const std::uint8_t value = to_u8(mesh.colors(i, v));
            if (is_ascii) {
                bytes += ' ';
                bytes += std::to_string(value);
            } else {
                bytes += static_cast<char>(value);
            }
        }
        bytes += is_ascii ? "\n" : "";
    }
    for (Eigen::Index t = 0; t < mesh.num_triangles(); ++t) {
        bytes += is_ascii ? "3" : "\3";
        for (int i = 0; i < 3; ++i) {
            if (is_ascii) {
                bytes += ' ';
                bytes += std::to_string(mesh.triangles(i, t));
            } else {
                append_little_endian(bytes, mesh.triangles(i, t));
            }
        }
        bytes += is_ascii ? "\n" : "";
    }
    return bytes;
}

} // namespace lineament
