// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

namespace CLI {
class App;
}

namespace lineament::cli {

/// What a command does once its options are parsed; returns the exit code.
using Action = std::function<int()>;

/// parent.add_subcommand, in one file: each file that constructs a CLI::App compiles nearly all of CLI11.
CLI::App* add_command(CLI::App& parent, const std::string& name, const std::string& description);

// Each function adds one command with its options to the program, and sets `action` when that command is given.
void add_fit_command(CLI::App& program, Action& action);
void add_track_command(CLI::App& program, Action& action);
void add_model_command(CLI::App& program, Action& action);
void add_doctor_command(CLI::App& program, Action& action);

} // namespace lineament::cli
