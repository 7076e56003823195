// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs the command-line tool at a terminal of its own.
#pragma once

#include "apps/run_program.hpp"

#include <string>

#include <pty.h>
#include <unistd.h>

namespace lineament::test {

/// What somebody at the terminal types, once.
struct Typing
{
    std::string after; ///< Text on the terminal that is waited for.
    std::string keys;  ///< "\x03": Ctrl-C.
};

/// Runs the program through the shell inside a folder, with a terminal for standard input and standard error.
/// @param environment  Assignments before the command, "NO_COLOR=1".
/// @return `error` is all that the terminal showed.
inline Outcome run_at_terminal(const TemporaryFolder& folder, const std::string& arguments, const Typing& typing = {},
                               const std::string& environment = "")
{
    const std::string command = "cd '" + folder.path().string() + "' && " + environment +
                                " exec '" LINEAMENT_PROGRAM "' " + arguments + " > stdout.txt";
    int terminal = -1;
    const pid_t child = forkpty(&terminal, nullptr, nullptr, nullptr);
    if (child == 0) {
        execl("/bin/sh", "sh", "-c", command.c_str(), static_cast<char*>(nullptr));
        _exit(127);
    }
    Outcome outcome;
    if (child < 0) {
        ADD_FAILURE() << "no terminal can be made";
        return outcome;
    }
    bool has_typed = typing.keys.empty();
    char part[4096];
    for (ssize_t size = 0; (size = read(terminal, part, sizeof part)) > 0;) { // an error once the program has ended
        outcome.error.append(part, static_cast<std::size_t>(size));
        if (!has_typed && outcome.error.find(typing.after) != std::string::npos) {
            has_typed = write(terminal, typing.keys.data(), typing.keys.size()) > 0;
        }
    }
    EXPECT_TRUE(has_typed) << "the terminal never showed \"" << typing.after << "\":\n" << outcome.error;
    int status = 0;
    waitpid(child, &status, 0);
    close(terminal);
    outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    outcome.out = read_all(folder / "stdout.txt");
    return outcome;
}

} // namespace lineament::test
