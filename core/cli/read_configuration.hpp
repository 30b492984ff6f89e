// SPDX-License-Identifier: Apache-2.0
//
// Reads a configuration and applies the command line's options to it.
#pragma once

#include "cli/commands.hpp"
#include "run_config/configuration.hpp"

namespace arhost::cli {

run_config::Configuration read_configuration(const Arguments &arguments);

// As read_configuration(), in two steps, of a configuration that the caller has loaded: applies `--set` and other
// options to its values; parses it.
void override_settings(yaml::Node &root, const Arguments &arguments);
run_config::Configuration parse_configuration(const yaml::Node &root, const Arguments &arguments);

} // namespace arhost::cli
