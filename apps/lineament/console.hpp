// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <exception>
#include <string>

namespace lineament::cli {

/// The exit codes of the program; a contract with the user (README.md, "Exit codes").
enum ExitCode
{
    all_done = 0,
    some_failed = 1,   ///< Several inputs, some or all of them failed.
    wrong_use = 2,     ///< The command line is wrong.
    bad_input = 3,     ///< A file is not what it should be.
    system_failed = 4, ///< A file or device failed: missing, denied, full, read-only.
    over_limit = 5,    ///< A stated limit was exceeded.
    no_answer = 6, ///< The input is valid, but there is no trustworthy answer in it (no face, degenerate landmarks).
    interrupted_by_user = 130,
    terminated = 143,
};

/// A failure with its exit code and message; thrown inside the commands.
class Failure : public std::exception
{
public:
    Failure(int exit_code, std::string message) : exit_code_(exit_code), message_(std::move(message)) {}
    [[nodiscard]] int exit_code() const noexcept { return exit_code_; }
    [[nodiscard]] const char* what() const noexcept override { return message_.c_str(); }

private:
    int exit_code_;
    std::string message_;
};

/// The exit code and the message of the exception being handled.
[[nodiscard]] Failure current_failure();

/// "lineament: error: MESSAGE" on stderr, red on a terminal unless NO_COLOR is set; control characters are escaped.
void print_error(const std::string& message);
/// "lineament: warning: MESSAGE" on stderr: an input is unusual, and taken all the same.
/// @throws Failure(bad_input) with the message instead, if --strict was given.
void warn_of_input(const std::string& message);
/// A message on stderr; nothing if --quiet was given.
void print_note(const std::string& message);
/// A line of data on stdout. @throws Failure(system_failed) if stdout is full or closed.
void print_data(const std::string& line);
/// No notes and no progress bar from now on.
void be_quiet();
/// Warnings about inputs are errors from now on.
void be_strict();

/// The text with control characters and invalid UTF-8 replaced by \xNN, so that a file name cannot steer a terminal.
[[nodiscard]] std::string printable(const std::string& text);

/// A progress bar on stderr; silent unless stderr is a terminal.
class ProgressBar
{
public:
    /// @param total  Steps; 0 if unknown.
    ProgressBar(std::string label, std::size_t total);
    ~ProgressBar();
    ProgressBar(const ProgressBar&) = delete;
    ProgressBar& operator=(const ProgressBar&) = delete;
    void show(std::size_t done, const std::string& text = {});

private:
    std::string label_;
    std::size_t total_;
    bool visible_;
    double last_shown_s_ = -1.0;
};

/// From now on SIGINT, SIGTERM and SIGHUP, which counts as SIGTERM unless it was ignored (nohup), only set a flag (a
/// second one ends the program at once); a broken pipe and a file larger than allowed are errors of the write.
void catch_signals();
/// 0, or interrupted_by_user / terminated after such a signal.
[[nodiscard]] int signal_exit_code();

} // namespace lineament::cli
