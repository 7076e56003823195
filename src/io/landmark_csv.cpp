// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "landmark_formats.hpp"
#include "text.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace lineament::detail {

namespace {

constexpr std::size_t max_columns = 65536;

struct Cell
{
    std::string text = {};
    int line = 1;
    int column = 1;
};

// Records of cells (RFC 4180: quoted cells may hold separators, line ends and doubled quotes).
class CsvReader
{
public:
    CsvReader(std::string_view text, const std::string& path, char separator)
        : text_(text), path_(path), separator_(separator)
    {}

    // The next record that is not a blank line; false at the end.
    bool next(std::vector<Cell>& record)
    {
        do {
            record.clear();
            if (at_ >= text_.size()) {
                return false;
            }
            read_record(record);
        } while (record.size() == 1 && trimmed(record[0].text).empty());
        return true;
    }

private:
    void read_record(std::vector<Cell>& record)
    {
        record.push_back({{}, line_, column_});
        while (at_ < text_.size()) {
            const char c = text_[at_];
            if (c == '\n' || c == '\r') {
                end_line();
                return;
            }
            if (c == separator_) {
                advance();
                if (record.size() >= max_columns) {
                    throw IoError(IoErrorKind::limit, path_, place(), "expected at most 65536 columns, found more");
                }
                record.push_back({{}, line_, column_});
            } else if (c == '"' && trimmed(record.back().text).empty()) {
                record.back().text.clear();
                read_quoted(record.back());
            } else {
                record.back().text += c;
                advance();
            }
        }
    }

    void read_quoted(Cell& cell)
    {
        const std::string start = place();
        for (advance(); at_ < text_.size(); advance()) {
            if (text_[at_] == '"') {
                advance();
                if (at_ >= text_.size() || text_[at_] != '"') {
                    return;
                }
            }
            if (text_[at_] == '\n') {
                ++line_;
                column_ = 0;
            }
            cell.text += text_[at_];
        }
        throw content_error(path_, start, "expected a closing quotation mark, found the end of the file");
    }

    void end_line()
    {
        at_ += text_[at_] == '\r' && at_ + 1 < text_.size() && text_[at_ + 1] == '\n' ? 2 : 1;
        ++line_;
        column_ = 1;
    }

    void advance()
    {
        ++at_;
        ++column_;
    }

    [[nodiscard]] std::string place() const { return std::to_string(line_) + ":" + std::to_string(column_); }

    std::string_view text_;
    const std::string& path_;
    char separator_;
    std::size_t at_ = 0;
    int line_ = 1;
    int column_ = 1;
};

// Names of columns hold none of these characters, so the header tells the separator.
char separator_of(std::string_view header)
{
    for (const char separator : {',', ';', '\t'}) {
        if (header.find(separator) != std::string_view::npos) {
            return separator;
        }
    }
    return ',';
}

const char* name_of(char separator)
{
    return separator == ',' ? "comma" : separator == ';' ? "semicolon" : "tab";
}

class CsvLandmarks
{
public:
    CsvLandmarks(std::string_view text, const std::string& path, const LandmarkFileOptions& options)
        : separator_(separator_of(first_line(text))), reader_(text, path, separator_), path_(path), options_(options)
    {}

    LandmarkFile run()
    {
        std::vector<Cell> record;
        if (!reader_.next(record)) {
            throw content_error(path_, "", "expected a header line, found only blank lines");
        }
        read_header(record);
        LandmarkFile file;
        file.format = LandmarkFormat::csv;
        while (reader_.next(record)) {
            if (record.size() != num_columns_) {
                fail(record.back(), "expected " + std::to_string(num_columns_) +
                                        " cells as in the header (separator: " + name_of(separator_) + "), found " +
                                        std::to_string(record.size()));
            }
            file.frames.push_back(read_frame(record));
        }
        if (file.frames.empty()) {
            throw content_error(path_, "2:1", "expected a row of landmarks after the header, found none");
        }
        return file;
    }

private:
    static std::string_view first_line(std::string_view text)
    {
        const std::size_t first = std::min(text.find_first_not_of(" \r\n"), text.size());
        return text.substr(first, text.find_first_of("\r\n", first) - first);
    }

    [[noreturn]] void fail(const Cell& cell, const std::string& what) const
    {
        throw content_error(path_, std::to_string(cell.line) + ":" + std::to_string(cell.column), what);
    }

    void read_header(const std::vector<Cell>& header)
    {
        num_columns_ = header.size();
        std::map<std::string, std::size_t, std::less<>> columns;
        for (std::size_t i = 0; i < header.size(); ++i) {
            const std::string name(trimmed(header[i].text));
            if (parse_number(name) || !decimal_comma_hint(name).empty()) {
                fail(header[i],
                     "expected a header line with columns x_0, y_0, ..., found the number " + in_quotes(name));
            }
            if (!columns.emplace(name, i).second && !name.empty()) {
                fail(header[i], "the column " + in_quotes(name) + " stands twice in the header");
            }
        }
        for (const auto& [name, column] : columns) {
            check_label(name, header[column], columns);
        }
        if (points_.empty()) {
            fail(header[0], "expected columns x_0, y_0, ... (separator: " + std::string(name_of(separator_)) +
                                "), found none among " + std::to_string(header.size()) + " columns");
        }
        std::sort(points_.begin(), points_.end(),
                  [](const PointColumns& a, const PointColumns& b) { return a.number < b.number; });
        find(columns, "frame", frame_column_);
        find(columns, "timestamp", time_column_);
        find(columns, "confidence", confidence_column_);
        find(columns, "success", success_column_);
        find(columns, "face_id", face_column_);
        if (!face_column_) {
            find(columns, "face", face_column_);
        }
    }

    void check_label(const std::string& name, const Cell& cell,
                     const std::map<std::string, std::size_t, std::less<>>& columns)
    {
        if (!name.starts_with("x_") && !name.starts_with("y_")) {
            return;
        }
        const auto number = parse_integer(name.substr(2));
        if (!number || *number < 0 || *number > 67 || name.substr(2) != std::to_string(*number)) {
            fail(cell,
                 "unknown landmark column " + in_quotes(name) + "; the scheme ibug68 has x_0 to x_67, y_0 to y_67");
        }
        const std::string partner = (name[0] == 'x' ? "y_" : "x_") + name.substr(2);
        const auto found = columns.find(partner);
        if (found == columns.end()) {
            fail(cell, "expected a column " + in_quotes(partner) + " beside " + in_quotes(name) + ", found none");
        }
        if (name[0] == 'x') {
            points_.push_back({static_cast<int>(*number), columns.find(name)->second, found->second});
        }
    }

    static void find(const std::map<std::string, std::size_t, std::less<>>& columns, const char* name,
                     std::optional<std::size_t>& column)
    {
        const auto found = columns.find(name);
        if (found != columns.end()) {
            column = found->second;
        }
    }

    std::optional<double> read_number(const Cell& cell) const
    {
        const std::string_view token = trimmed(cell.text);
        if (token.empty()) {
            return std::nullopt;
        }
        const auto value = parse_number(token);
        if (!value || !is_coordinate(*value)) {
            fail(cell,
                 "expected a number within +-1e7 or an empty cell (separator: " + std::string(name_of(separator_)) +
                     "), found " + in_quotes(token) + decimal_comma_hint(token));
        }
        return value;
    }

    std::optional<int> read_integer(const Cell& cell) const
    {
        const auto value = read_number(cell);
        if (value && *value != std::floor(*value)) {
            fail(cell, "expected an integer, found " + in_quotes(cell.text));
        }
        return value ? std::optional<int>(static_cast<int>(*value)) : std::nullopt;
    }

    LandmarkFrame read_frame(const std::vector<Cell>& record) const
    {
        LandmarkFrame frame;
        frame.frame = frame_column_ ? read_integer(record[*frame_column_]) : std::nullopt;
        frame.face_id = face_column_ ? read_integer(record[*face_column_]) : std::nullopt;
        frame.time_s = time_column_ ? read_number(record[*time_column_]) : std::nullopt;
        const auto confidence = confidence_column_ ? read_number(record[*confidence_column_]) : std::nullopt;
        const auto success = success_column_ ? read_number(record[*success_column_]) : std::nullopt;
        for (const PointColumns& columns : points_) {
            const auto x = read_number(record[columns.x]);
            const auto y = read_number(record[columns.y]);
            if (x.has_value() != y.has_value()) {
                fail(record[x ? columns.y : columns.x], "expected both coordinates or neither, found one empty cell");
            }
            if (x && success != 0.0) {
                frame.set.landmarks.push_back({std::to_string(columns.number + 1),
                                               to_image_space(*x, *y, 0.5, options_),
                                               std::clamp(confidence.value_or(1.0), 0.0, 1.0)});
            }
        }
        return frame;
    }

    struct PointColumns
    {
        int number = 0; ///< From 0, as in the file.
        std::size_t x = 0;
        std::size_t y = 0;
    };

    char separator_;
    CsvReader reader_;
    const std::string& path_;
    const LandmarkFileOptions& options_;
    std::size_t num_columns_ = 0;
    std::vector<PointColumns> points_ = {};
    std::optional<std::size_t> frame_column_ = {};
    std::optional<std::size_t> face_column_ = {};
    std::optional<std::size_t> time_column_ = {};
    std::optional<std::size_t> confidence_column_ = {};
    std::optional<std::size_t> success_column_ = {};
};

} // namespace

LandmarkFile parse_landmark_csv(std::string_view text, const std::string& path, const LandmarkFileOptions& options)
{
    return CsvLandmarks(text, path, options).run();
}

} // namespace lineament::detail
