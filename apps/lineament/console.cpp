// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "console.hpp"

#include "lineament/core/error.hpp"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <new>

#include <unistd.h>

namespace lineament::cli {

namespace {

bool quiet = false;
bool strict = false;
volatile std::sig_atomic_t caught_signal = 0;

void on_signal(int signal_number)
{
    const bool was_caught = caught_signal != 0;
    caught_signal = signal_number == SIGHUP ? SIGTERM : signal_number;
    if (was_caught) {
        _exit(128 + caught_signal);
    }
}

void print_message(const char* kind, const char* color, const std::string& message)
{
    const bool colored = isatty(STDERR_FILENO) != 0 && std::getenv("NO_COLOR") == nullptr;
    std::fprintf(stderr, "lineament: %s%s:%s %s\n", colored ? color : "", kind, colored ? "\033[0m" : "",
                 printable(message).c_str());
}

/// Length of the valid UTF-8 sequence at `position`, or 0.
std::size_t utf8_length(const std::string& text, std::size_t position)
{
    const auto byte = [&](std::size_t i) {
        return i < text.size() ? static_cast<unsigned>(static_cast<unsigned char>(text[i])) : 0U;
    };
    const unsigned lead = byte(position);
    const std::size_t length = lead < 0x80                   ? 1
                               : lead >= 0xc2 && lead < 0xe0 ? 2
                               : lead >= 0xe0 && lead < 0xf0 ? 3
                               : lead >= 0xf0 && lead < 0xf5 ? 4
                                                             : 0;
    unsigned code = length == 1 ? lead : lead & (0x7fU >> length);
    for (std::size_t i = 1; i < length; ++i) {
        if ((byte(position + i) & 0xc0U) != 0x80U) {
            return 0;
        }
        code = (code << 6) | (byte(position + i) & 0x3fU);
    }
    const bool is_control = code < 0x20 || (code >= 0x7f && code < 0xa0) || (code >= 0x202a && code <= 0x202e) ||
                            (code >= 0x2066 && code <= 0x2069); // C0, C1, and marks that reverse the writing direction
    return is_control ? 0 : length;
}

} // namespace

Failure current_failure()
{
    try {
        throw;
    } catch (const Failure& failure) {
        return failure;
    } catch (const IoError& error) {
        switch (error.kind()) {
        case IoErrorKind::content:
            return {bad_input, error.what()};
        case IoErrorKind::system:
            return {system_failed, error.what()};
        case IoErrorKind::limit:
            return {over_limit, error.what()};
        }
        return {bad_input, error.what()};
    } catch (const InvalidArgument& error) {
        return {bad_input, error.what()};
    } catch (const std::bad_alloc&) {
        return {over_limit, "not enough memory"};
    } catch (const std::exception& error) {
        return {bad_input, error.what()};
    }
}

std::string printable(const std::string& text)
{
    std::string result;
    for (std::size_t i = 0; i < text.size();) {
        const std::size_t length = utf8_length(text, i);
        if (length > 0) {
            result.append(text, i, length);
            i += length;
        } else {
            char escaped[8];
            std::snprintf(escaped, sizeof escaped, "\\x%02x",
                          static_cast<unsigned>(static_cast<unsigned char>(text[i])));
            result += escaped;
            ++i;
        }
    }
    return result;
}

void print_error(const std::string& message)
{
    print_message("error", "\033[31m", message);
}

void warn_of_input(const std::string& message)
{
    if (strict) {
        throw Failure(bad_input, message + " (an error because of --strict)");
    }
    print_message("warning", "\033[33m", message);
}

void print_note(const std::string& message)
{
    if (!quiet) {
        std::fprintf(stderr, "%s\n", printable(message).c_str());
    }
}

void print_data(const std::string& line)
{
    if (std::fwrite(line.data(), 1, line.size(), stdout) != line.size() || std::fputc('\n', stdout) == EOF ||
        std::fflush(stdout) != 0) {
        throw Failure(system_failed, "standard output cannot be written");
    }
}

void be_quiet()
{
    quiet = true;
}

void be_strict()
{
    strict = true;
}

ProgressBar::ProgressBar(std::string label, std::size_t total)
    : label_(std::move(label)), total_(total), visible_(!quiet && isatty(STDERR_FILENO) != 0)
{}

ProgressBar::~ProgressBar()
{
    if (visible_ && last_shown_s_ >= 0.0) {
        std::fprintf(stderr, "\r\033[K");
    }
}

void ProgressBar::show(std::size_t done, const std::string& text)
{
    if (!visible_) {
        return;
    }
    const double now = std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    if (last_shown_s_ >= 0.0 && now - last_shown_s_ < 0.1) {
        return;
    }
    last_shown_s_ = now;
    constexpr std::size_t width = 28;
    if (total_ > 0) {
        const std::size_t filled = std::min(width, done * width / total_);
        std::fprintf(stderr, "\r\033[K%s [%s%s] %zu/%zu %s", label_.c_str(), std::string(filled, '#').c_str(),
                     std::string(width - filled, '.').c_str(), done, total_, printable(text).c_str());
    } else {
        std::fprintf(stderr, "\r\033[K%s %zu %s", label_.c_str(), done, printable(text).c_str());
    }
}

void catch_signals()
{
    struct sigaction action = {};
    action.sa_handler = on_signal;
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    struct sigaction of_hangup = {};
    if (sigaction(SIGHUP, nullptr, &of_hangup) == 0 && of_hangup.sa_handler != SIG_IGN) {
        sigaction(SIGHUP, &action, nullptr);
    }
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);
}

int signal_exit_code()
{
    return caught_signal == 0 ? 0 : 128 + caught_signal;
}

} // namespace lineament::cli
