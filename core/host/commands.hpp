// SPDX-License-Identifier: Apache-2.0
//
// The subcommands of `arhost`. Each returns the exit status (docs/config.md).
#pragma once

#include "supervise/launcher.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace arhost::host {

enum ExitStatus { success = 0, run_failed = 1, bad_configuration = 2, interrupted = 130 };

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
    bool debug_view = false;      // set the option of this name of every output that has it
    bool watch = false;           // apply edits of the configuration and of the scene while the video runs
    bool in_process = false;      // run the plugins in the host's process, without timeouts and sandbox
};

// Command-line options of `arhost replay`.
struct ReplayArguments {
    std::string session, trajectory, scene, tracker, raytracer, output, stats, timeline; // "" if not given
    std::optional<std::uint32_t> width, height;                                          // px
    bool with_pipeline = false;
};

// Command-line options of `arhost plugins`.
struct PluginsArguments {
    bool with_options = false;
    std::vector<std::string> plugins; // names; empty: all plugins
    std::vector<std::filesystem::path> reads;
};

// Command-line options of `arhost devices`.
struct DevicesArguments {
    bool as_json = false;
    std::vector<std::string> plugins; // names; empty: all plugins
    std::vector<std::filesystem::path> reads;
};

int run(const Arguments &arguments, supervise::Starter &launcher);
// Measures the time from the camera's lens to the display of the configuration's outputs.
int latency(Arguments arguments, supervise::Starter &launcher);
int replay(const Arguments &arguments, const ReplayArguments &replay, supervise::Starter &launcher);
// Checks a configuration. If `open`, also starts source, tracker, ray tracer and outputs as a run does, processes
// `arguments.frames` frames, if given, and prints what it found; outputs then write to a temporary folder.
int check(const Arguments &arguments, bool open, supervise::Starter &launcher);
int list_plugins(const Arguments &arguments, const PluginsArguments &plugins, supervise::Starter &launcher);
int devices(const Arguments &arguments, const DevicesArguments &options, supervise::Starter &launcher);
int print_schema(bool markdown);
// Replaces this process with another program of arhost (exec): arhost-conform, because the host process never loads a
// plugin itself, or arhost-calibrate, arhost-map and arhost-marker, because it links no OpenCV.
int run_program(const char *name, std::vector<std::string> arguments);

// own_folder() is the folder of this executable, which also contains the programs that arhost starts. own_prefix() is
// the folder above it: the executable is <prefix>/bin/arhost.
std::filesystem::path own_prefix();
std::filesystem::path own_folder();

} // namespace arhost::host
