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

// Options of commands that take a configuration.
struct Arguments {
    std::string file;
    std::vector<std::string> settings; // "key.path=value"
    std::optional<std::uint64_t> frames;
    std::optional<int> ar, rt;
    std::optional<double> g1, g2;
    double axis1[3] = {0, 0, 0}, axis2[3] = {0, 0, 0};
    bool verbose = false;
    bool in_process = false; // plugins run in this process: no deadlines, no sandbox
};

// `arhost replay`.
struct ReplayArguments {
    std::string trajectory, scene, raytracer, output, stats, timeline; // "": not set
    std::optional<std::uint32_t> width, height;                        // px
    bool with_pipeline = false;
};

// `arhost plugins`.
struct PluginsArguments {
    bool with_options = false;
    bool with_devices = false; // slow if drivers must be loaded
    std::vector<std::filesystem::path> reads;
};

int run(const Arguments &arguments, supervise::Starter &launcher);
int replay(const Arguments &arguments, const ReplayArguments &replay, supervise::Starter &launcher);
int check(const Arguments &arguments, supervise::Starter &launcher);
int list_plugins(const Arguments &arguments, const PluginsArguments &plugins, supervise::Starter &launcher);
int print_schema(bool markdown);
// Replaces this process by arhost-conform: the host itself opens no plugin.
int conform(std::vector<std::string> arguments);

// This program is <prefix>/bin/arhost; the programs that it starts are in the same folder.
std::filesystem::path own_prefix();
std::filesystem::path own_folder();

} // namespace arhost::host
