// SPDX-License-Identifier: Apache-2.0
//
// Runs a configuration.
#pragma once

#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "run_config/configuration.hpp"
#include "supervise/process.hpp"

namespace arhost::cli {

supervise::Context make_context(ipc::Reactor &reactor, supervise::Starter &launcher, Console &console);
void show_warnings(const run_config::Configuration &configuration, Console &console);

// Returns the exit status.
int run(const run_config::Configuration &configuration, const Arguments &arguments, supervise::Starter &launcher);

} // namespace arhost::cli
