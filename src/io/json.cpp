// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "json.hpp"

#include "text.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

namespace lineament::detail {

namespace {

constexpr std::size_t max_depth = 64;

std::string place_of(std::string_view text, std::size_t byte)
{
    const std::string_view before = text.substr(0, std::min(byte, text.size()));
    const std::size_t line_start = before.rfind('\n') + 1; // npos + 1 is 0
    return std::to_string(std::count(before.begin(), before.end(), '\n') + 1) + ":" +
           std::to_string(before.size() - line_start + 1);
}

// Nesting is checked before the document is built, without recursion. Strings are skipped here; that they are well
// formed is left to the parser proper.
class StructureCheck
{
public:
    StructureCheck(std::string_view text, const std::string& path) : text_(text), path_(path) {}

    void run()
    {
        for (std::size_t i = 0; i < text_.size(); ++i) {
            const char c = text_[i];
            if (c == '{' || c == '[') {
                if (++depth_ > max_depth) {
                    throw content_error(path_, place_of(text_, i), "expected at most 64 levels of nesting, found more");
                }
            } else if (c == '}' || c == ']') {
                depth_ -= depth_ > 0 ? 1 : 0;
            } else if (c == '"') {
                i = end_of_string(i);
            }
        }
    }

private:
    std::size_t end_of_string(std::size_t i) const
    {
        for (++i; i < text_.size() && text_[i] != '"'; ++i) {
            i += text_[i] == '\\' ? 1 : 0;
        }
        return i;
    }

    std::string_view text_;
    const std::string& path_;
    std::size_t depth_ = 0;
};

// Follows the parser through a document: where it stands, and whether a key stands twice in one object.
class ParserPlace
{
public:
    /// @return False if the event is a key that its object has already.
    bool follow(Json::parse_event_t event, const Json& parsed)
    {
        switch (event) {
        case Json::parse_event_t::object_start:
        case Json::parse_event_t::array_start:
            levels_.push_back({event == Json::parse_event_t::array_start});
            return true;
        case Json::parse_event_t::object_end:
        case Json::parse_event_t::array_end:
            levels_.pop_back();
            break;
        case Json::parse_event_t::key:
            levels_.back().key = parsed.get<std::string>();
            return levels_.back().keys.insert(levels_.back().key).second;
        case Json::parse_event_t::value:
            break;
        }
        if (!levels_.empty()) {
            ++levels_.back().index; // of an array: the element that comes next
        }
        return true;
    }

    /// JSON pointer of the value that comes next, or of the key just read.
    [[nodiscard]] std::string pointer() const
    {
        Json::json_pointer pointer;
        for (const Level& level : levels_) {
            pointer.push_back(level.is_array ? std::to_string(level.index) : level.key);
        }
        return pointer.to_string();
    }

private:
    struct Level
    {
        bool is_array = false;
        std::size_t index = 0;
        std::string key = {};
        std::set<std::string> keys = {};
    };
    std::vector<Level> levels_;
};

bool is_flat(const Json& value)
{
    return std::none_of(value.begin(), value.end(), [](const Json& item) {
        return item.is_object() || (item.is_array() && std::any_of(item.begin(), item.end(), [](const Json& inner) {
                                        return inner.is_structured();
                                    }));
    });
}

void append_json(std::string& out, const Json& value, const std::string& indent)
{
    if (!value.is_structured() || value.empty() || (value.is_array() && is_flat(value)) ||
        (value.is_object() && value.size() <= 8 && !indent.empty() && is_flat(value))) {
        out += value.dump(-1, ' ', false, Json::error_handler_t::replace);
        return;
    }
    const std::string inner = indent + " ";
    out += value.is_object() ? "{" : "[";
    const char* separator = "\n";
    for (const auto& [key, item] : value.items()) {
        out += separator + inner;
        if (value.is_object()) {
            out += Json(key).dump(-1, ' ', false, Json::error_handler_t::replace) + ": ";
        }
        append_json(out, item, inner);
        separator = ",\n";
    }
    out += "\n" + indent + (value.is_object() ? "}" : "]");
}

} // namespace

Json parse_json(std::string_view bytes, const std::string& path)
{
    const std::string_view text = checked_text(bytes, path, "JSON text");
    StructureCheck(text, path).run();
    ParserPlace place;
    const auto callback = [&](int, Json::parse_event_t event, Json& parsed) {
        if (!place.follow(event, parsed)) {
            throw content_error(path, place.pointer(),
                                "the key " + in_quotes(parsed.get<std::string>()) + " stands twice in one object");
        }
        return true;
    };
    try {
        return Json::parse(text.begin(), text.end(), callback);
    } catch (const Json::parse_error& error) {
        const std::size_t byte = error.byte > 0 ? error.byte - 1 : 0;
        const std::string found = byte < text.size() ? in_quotes(text.substr(byte, 20)) : "the end of the file";
        throw content_error(path, place_of(text, byte), "not valid JSON: found " + found);
    } catch (const Json::exception& error) {
        throw content_error(path, place.pointer(), "not valid JSON: a number is too large");
    }
}

std::string format_json(const Json& value)
{
    std::string out;
    append_json(out, value, "");
    return out + "\n";
}

bool JsonReader::has(const char* key) const
{
    return value_->is_object() && value_->contains(key);
}

JsonReader JsonReader::member(const std::string& key) const
{
    if (!value_->is_object()) {
        fail("an object");
    }
    const auto found = value_->find(key);
    if (found == value_->end()) {
        throw content_error(*path_, pointer_ + "/" + key, "expected this member, found none");
    }
    return {*found, *path_, pointer_ + "/" + key};
}

std::size_t JsonReader::size() const
{
    if (!value_->is_array()) {
        fail("an array");
    }
    return value_->size();
}

JsonReader JsonReader::element(std::size_t index) const
{
    if (index >= size()) {
        fail("at least " + std::to_string(index + 1) + " elements");
    }
    return {(*value_)[index], *path_, pointer_ + "/" + std::to_string(index)};
}

double JsonReader::number() const
{
    if (!value_->is_number() || !std::isfinite(value_->get<double>())) {
        fail("a number");
    }
    return value_->get<double>();
}

int JsonReader::integer(int low, int high) const
{
    const std::string expected = "an integer in " + std::to_string(low) + " to " + std::to_string(high);
    if (!value_->is_number_integer()) {
        fail(expected);
    }
    const double value = value_->get<double>();
    if (value < low || value > high) {
        fail(expected);
    }
    return static_cast<int>(value);
}

std::string JsonReader::text() const
{
    if (!value_->is_string()) {
        fail("a text");
    }
    return value_->get<std::string>();
}

void JsonReader::fail(const std::string& expected) const
{
    std::string found = "an object";
    if (value_->is_array()) {
        found = "an array of " + std::to_string(value_->size()) + " elements";
    } else if (!value_->is_object()) {
        found = in_quotes(value_->dump(-1, ' ', false, Json::error_handler_t::replace));
    }
    throw content_error(*path_, pointer_.empty() ? "/" : pointer_, "expected " + expected + ", found " + found);
}

} // namespace lineament::detail
