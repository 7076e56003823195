// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace lineament::cli {

/// What a command does once its options are parsed; returns the exit code.
using Action = std::function<int()>;

// Each function adds one command with its options to the program, and sets `action` when that command is given.
void add_fit_command(CLI::App& program, Action& action);
void add_track_command(CLI::App& program, Action& action);
void add_model_command(CLI::App& program, Action& action);
void add_doctor_command(CLI::App& program, Action& action);

} // namespace lineament::cli
