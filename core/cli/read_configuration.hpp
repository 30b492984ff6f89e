// SPDX-License-Identifier: Apache-2.0
//
// Reads a configuration and applies the command line's options to it.
#pragma once

#include "cli/commands.hpp"
#include "run_config/configuration.hpp"

#include <algorithm>

namespace arhost::cli {

run_config::Configuration read_configuration(const Arguments &arguments);

// As read_configuration(), of a configuration that the caller has loaded.
run_config::Configuration parse_configuration(yaml::Node &root, const Arguments &arguments);

// Calls `function` for each component that a run can start.
void for_each_component(auto &configuration, const auto &function) {
    for (auto *one : {&configuration.snapshot, &configuration.record})
        if (*one)
            function(**one);
    if (configuration.source)
        function(*configuration.source);
    if (configuration.tracker)
        function(*configuration.tracker);
    if (configuration.raytracer)
        function(*configuration.raytracer);
    std::ranges::for_each(configuration.trackers, function);
    std::ranges::for_each(configuration.raytracers, function);
    std::ranges::for_each(configuration.outputs, function);
}

} // namespace arhost::cli
