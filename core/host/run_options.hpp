// SPDX-License-Identifier: Apache-2.0
//
// Options of the command line that arhost and arhost-inprocess share.
#pragma once

#include "base/command_line.hpp"
#include "host/commands.hpp"

namespace arhost::host {

void add_configuration_options(base::CommandLine &command, Arguments &arguments); // --set, --verbose
// Adds all options of a run and returns the option --config.
base::Option add_run_options(base::CommandLine &command, Arguments &arguments);

} // namespace arhost::host
