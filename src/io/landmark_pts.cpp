// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "landmark_formats.hpp"
#include "text.hpp"

#include <cctype>

namespace lineament::detail {

namespace {

class PtsParser
{
public:
    PtsParser(std::string_view text, const std::string& path, const LandmarkFileOptions& options)
        : lines_(text), path_(path), options_(options)
    {}

    LandmarkFile run()
    {
        if (!next_line()) {
            throw content_error(path_, "", "expected \"version: 1\", found only blank lines");
        }
        if (line_.starts_with("Version ")) {
            fail(line_, "this is an IDAV Landmark file of named 3D points, which has the same ending; expected a .pts "
                        "file of 2D face landmarks, which starts with \"version: 1\"");
        }
        const bool has_header = !std::isdigit(static_cast<unsigned char>(line_[0])) && line_[0] != '-';
        if (has_header) {
            read_header();
        } else if (options_.pts_header == PtsHeader::required) {
            fail(line_, "expected \"version: 1\", found " + in_quotes(line_) +
                            ": a .pts file without its header; allow it by the option for headerless files");
        }
        read_points(has_header);
        return finish();
    }

private:
    bool next_line() // The next line that is not blank.
    {
        while (lines_.next()) {
            line_ = trimmed(lines_.line());
            if (!line_.empty()) {
                return true;
            }
        }
        line_ = {};
        return false;
    }

    [[noreturn]] void fail(std::string_view piece, const std::string& what) const
    {
        throw content_error(path_, lines_.place(piece), what);
    }

    // The value of a line "key: value".
    std::string_view read_value(std::string_view key)
    {
        if (!line_.starts_with(key) || line_.find(':') == std::string_view::npos ||
            !trimmed(line_.substr(key.size(), line_.find(':') - key.size())).empty()) {
            fail(line_, "expected \"" + std::string(key) + ": ...\", found " + in_quotes(line_));
        }
        return trimmed(line_.substr(line_.find(':') + 1));
    }

    void require_line(const char* expected)
    {
        if (!next_line()) {
            throw content_error(path_, std::to_string(lines_.number()),
                                std::string("expected ") + expected + ", found the end of the file: cut short?");
        }
    }

    void read_header()
    {
        const std::string_view version = read_value("version");
        if (parse_number(version) != 1.0) {
            fail(line_, "expected version 1, found " + in_quotes(version));
        }
        require_line("\"n_points: 68\"");
        const std::string_view count = read_value("n_points");
        const auto number = parse_integer(count);
        if (number != 68 && number != 51) {
            fail(line_, "expected n_points 68 (or 51: the points 18 to 68), found " + in_quotes(count));
        }
        num_announced_ = static_cast<int>(*number);
        require_line("\"{\"");
        if (line_ != "{") {
            fail(line_, "expected \"{\", found " + in_quotes(line_));
        }
    }

    void read_points(bool has_header)
    {
        bool is_inside = has_header ? next_line() : true;
        while (is_inside && line_ != "}") {
            read_point();
            is_inside = next_line();
        }
        if (!has_header) {
            if (is_inside) {
                fail(line_, "expected no \"}\" in a file without header");
            }
            return;
        }
        if (!is_inside) {
            throw content_error(path_, std::to_string(lines_.number()),
                                "expected \"}\" after " + std::to_string(num_announced_) +
                                    " points, found the end of the file after " + std::to_string(points_.size()) +
                                    ": cut short?");
        }
        if (static_cast<int>(points_.size()) != num_announced_) {
            fail(line_, "n_points says " + std::to_string(num_announced_) + ", but there are " +
                            std::to_string(points_.size()) + " points");
        }
        if (next_line()) {
            fail(line_, "expected nothing after \"}\", found " + in_quotes(line_));
        }
    }

    void read_point()
    {
        std::string_view rest = line_;
        double coordinates[2] = {0.0, 0.0};
        for (double& coordinate : coordinates) {
            const std::string_view token = take_token(rest);
            const auto value = parse_number(token);
            if (!value || !is_coordinate(*value)) {
                fail(token.empty() ? line_ : token, "expected two numbers within +-1e7, found " +
                                                        in_quotes(token.empty() ? line_ : token) +
                                                        decimal_comma_hint(token));
            }
            coordinate = *value;
        }
        if (!trimmed(rest).empty()) {
            fail(trimmed(rest), "expected two numbers, found a third entry " + in_quotes(trimmed(rest)));
        }
        if (points_.size() >= 68) {
            fail(line_, "expected at most 68 points, found more");
        }
        points_.emplace_back(coordinates[0], coordinates[1]);
    }

    LandmarkFile finish() const
    {
        if (points_.size() != 68 && points_.size() != 51) {
            throw content_error(path_, std::to_string(lines_.number()),
                                "expected 68 points (or 51: the points 18 to 68), found " +
                                    std::to_string(points_.size()));
        }
        const double shift = options_.pts_origin == PtsOrigin::one_based ? -0.5 : 0.5;
        const std::size_t first = 69 - points_.size();
        LandmarkFrame frame;
        for (std::size_t i = 0; i < points_.size(); ++i) {
            const Eigen::Vector2d& point = points_[i];
            if (point.x() == -1.0 && point.y() == -1.0) {
                continue; // missing
            }
            frame.set.landmarks.push_back(
                {std::to_string(first + i), to_image_space(point.x(), point.y(), shift, options_)});
        }
        LandmarkFile file;
        file.format = LandmarkFormat::pts;
        file.frames.push_back(std::move(frame));
        return file;
    }

    LineReader lines_;
    const std::string& path_;
    const LandmarkFileOptions& options_;
    std::string_view line_ = {};
    int num_announced_ = 0;
    std::vector<Eigen::Vector2d> points_ = {};
};

} // namespace

LandmarkFile parse_pts(std::string_view text, const std::string& path, const LandmarkFileOptions& options)
{
    return PtsParser(text, path, options).run();
}

} // namespace lineament::detail
