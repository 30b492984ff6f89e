// SPDX-License-Identifier: Apache-2.0
//
// The commands of `arhost` that run a configuration. Each returns the exit status (docs/config.md).
#pragma once

#include "command_line/command_line.hpp"
#include "supervise/launcher.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace arhost::cli {

// Command-line options of the subcommands that read a configuration.
struct Arguments {
    std::string file;
    std::vector<std::string> settings; // "key.path=value"
    std::optional<std::uint64_t> frames;
    std::optional<int> ar, rt;
    std::optional<double> g1, g2;
    double axis1[3] = {0, 0, 0}, axis2[3] = {0, 0, 0};
    bool verbose = false;
    bool allow_no_target = false; // a run in which the tracker sees no marker succeeds
    bool debug_view = false;      // set the option `debug_view` of each output that has this option
    bool watch = false;           // apply edits of the configuration and of the scene while the video runs
    bool in_process = false;      // run the plugins in the host's process, without timeouts and sandbox
};

// Command-line options of `arhost replay`.
struct ReplayArguments {
    std::string session, trajectory, scene, tracker, raytracer, output, stats, timeline; // "" if not given
    std::optional<std::uint32_t> width, height;                                          // px
    std::vector<std::string> allow{}; // permissions, files and folders (session_grants.hpp)
    bool with_pipeline = false;
};

void add_configuration_options(command_line::CommandLine &command, Arguments &arguments); // --set, --verbose
// Adds all options of a run and returns the option --config.
command_line::Option add_run_options(command_line::CommandLine &command, Arguments &arguments);

int run(const Arguments &arguments, supervise::Starter &launcher);
// Measures the time from the camera's lens to the display of the configuration's outputs.
int latency(Arguments arguments, supervise::Starter &launcher);
int replay(const Arguments &arguments, const ReplayArguments &replay, supervise::Starter &launcher);
// Checks a configuration. If `open`, also starts source, tracker, ray tracer and outputs as a run does, processes
// `arguments.frames` frames, if given, and prints the findings. Outputs then write to a temporary folder.
int check(const Arguments &arguments, bool open, supervise::Starter &launcher);

} // namespace arhost::cli
