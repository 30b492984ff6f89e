// SPDX-License-Identifier: Apache-2.0
//
// Reads a configuration and applies the command line's options to it.
#pragma once

#include "cli/commands.hpp"
#include "run_config/configuration.hpp"

namespace arhost::cli {

run_config::Configuration read_configuration(const Arguments &arguments);

// As read_configuration(), of a configuration that the caller has loaded.
run_config::Configuration parse_configuration(yaml::Node &root, const Arguments &arguments);

} // namespace arhost::cli
