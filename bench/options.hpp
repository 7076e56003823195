// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <system_error>

namespace lineament::bench {

/// The options of a program's command line, each with a value. The names are those of the usage, as in
/// "fit_study [--model FILE] [--subjects N]"; anything else ends the program with status 2 and the usage.
class Options
{
public:
    Options(int argc, char** argv, const std::string& usage, int num_positional = 0) : usage_(usage)
    {
        bool is_usage = argc > num_positional;
        for (int i = 1 + num_positional; i < argc && is_usage; i += 2) {
            is_usage = i + 1 < argc && usage.find(std::string("[") + argv[i] + " ") != std::string::npos;
            if (is_usage) {
                values_[argv[i]] = argv[i + 1];
            }
        }
        if (!is_usage) {
            refuse();
        }
    }

    [[nodiscard]] std::string text(const std::string& name, const std::string& otherwise) const
    {
        const auto found = values_.find(name);
        return found == values_.end() ? otherwise : found->second;
    }

    /// A whole number, at least `least`; anything else ends the program likewise.
    [[nodiscard]] int count(const std::string& name, int otherwise, int least) const
    {
        const std::string digits = text(name, std::to_string(otherwise));
        int value = 0;
        const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
        if (error != std::errc() || end != digits.data() + digits.size() || value < least) {
            std::fprintf(stderr, "%s: expected a whole number >= %d, found %s\n", name.c_str(), least, digits.c_str());
            refuse();
        }
        return value;
    }

private:
    [[noreturn]] void refuse() const
    {
        std::fprintf(stderr, "usage: %s\n", usage_.c_str());
        std::exit(2);
    }

    std::string usage_;
    std::map<std::string, std::string> values_ = {};
};

} // namespace lineament::bench
