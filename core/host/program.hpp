// SPDX-License-Identifier: Apache-2.0
//
// Parts of the command line that arhost and arhost-inprocess share.
#pragma once

#include "base/command_line.hpp"
#include "host/commands.hpp"

#include <functional>
#include <string>

namespace arhost::host {

void add_configuration_options(base::CommandLine &command, Arguments &arguments); // --set, --verbose
// Adds all options of a run and returns the option --config.
base::Option add_run_options(base::CommandLine &command, Arguments &arguments);

// Prints the error as a single line, even if a file name in it contains a line break. Returns `exit_status`.
int print_error(const std::string &why, int exit_status);
// Returns the exit status of `command`. Prints the exception that it throws, if any.
int exit_status_of(const std::function<int()> &command);

} // namespace arhost::host
