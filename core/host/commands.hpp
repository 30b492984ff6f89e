// SPDX-License-Identifier: Apache-2.0
//
// What `arhost` can be told to do; each returns the exit status (docs/config.md lists them).
#pragma once

#include "supervise/launcher.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace arhost::host {

enum ExitStatus { success = 0, run_failed = 1, bad_configuration = 2, interrupted = 130 };

// The command line, as far as it is about a configuration.
struct Arguments {
    std::string file;
    std::vector<std::string> settings; // "key.path=value"
    std::optional<std::uint64_t> frames;
    std::optional<int> ar, rt;
    std::optional<double> g1, g2;
    double axis1[3] = {0, 0, 0}, axis2[3] = {0, 0, 0};
    bool verbose = false;
    bool in_process = false; // plugins in this process, for debuggers: no deadlines, no sandbox
};

// `arhost replay`.
struct ReplayArguments {
    std::string trajectory, scene, raytracer, output, stats, timeline; // "": not given
    std::optional<std::uint32_t> width, height;                        // px
    bool with_pipeline = false;
};

// `arhost plugins`.
struct PluginsArguments {
    bool with_options = false;
    bool with_devices = false; // which takes as long as drivers take to load
    std::vector<std::filesystem::path> reads;
};

int run(const Arguments &arguments, supervise::Starter &launcher);
int replay(const Arguments &arguments, const ReplayArguments &replay, supervise::Starter &launcher);
int check(const Arguments &arguments, supervise::Starter &launcher);
int list_plugins(const Arguments &arguments, const PluginsArguments &plugins, supervise::Starter &launcher);
int print_schema(bool markdown);
// Becomes arhost-conform, which lies beside this program: the host itself opens no plugin.
int conform(std::vector<std::string> arguments);

// Where this arhost is installed: <prefix>/bin/arhost, in a folder with the programs that it starts.
std::filesystem::path own_prefix();
std::filesystem::path own_folder();

} // namespace arhost::host
