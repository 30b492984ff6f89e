// SPDX-License-Identifier: Apache-2.0
//
// Configuration files: parsing, and all checks that need no plugin (docs/config.md).
#pragma once

#include "base/limits.hpp"
#include "camera/coordinates.hpp"
#include "camera/trajectory.hpp"
#include "ipc/json_abi.hpp"
#include "run_config/files_in_use.hpp"
#include "run_config/plugin_path.hpp"
#include "sandbox/sandbox.hpp"
#include "yaml/yaml.hpp"

#include <arhost/camera.h>
#include <arhost/tracker.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace arhost::run_config {

enum class Mode { lockstep, live };

// Settings that every component has.
struct ComponentConfiguration {
    yaml::Node node;                            // its YAML map, for error messages
    std::vector<std::filesystem::path> plugins; // shared objects: the plugin, then its fallback
    std::optional<yaml::Node> path, options;
    base::Limits limits;
    sandbox::Policy policy; // docs/security.md
    bool conform = false;   // check results at run time (docs/conformance.md)
};

struct SourceConfiguration : ComponentConfiguration {
    double fps = 0;
};

struct TrackerConfiguration : ComponentConfiguration {
    std::vector<arhost_marker_config> markers;
    std::uint32_t hold_frames = 0;
};

struct RaytracerConfiguration : ComponentConfiguration {
    std::filesystem::path scene;
    yaml::Node scene_node;
};

struct Configuration {
    yaml::Node node;
    Mode mode = Mode::lockstep;
    sandbox::Mode sandbox = sandbox::Mode::permissive;
    std::uint64_t frames = 0;                       // 0: all
    std::optional<SourceConfiguration> source{};    // none: black frames, with a trajectory
    std::optional<camera::Trajectory> trajectory{}; // poses that replace the tracker's
    std::optional<arhost_intrinsics> camera{};      // always set with a trajectory
    std::optional<yaml::Node> camera_node{};
    std::optional<TrackerConfiguration> tracker{};
    std::optional<RaytracerConfiguration> raytracer{};
    std::optional<camera::Coordinates> coordinates{};
    std::vector<ComponentConfiguration> outputs{};
    std::chrono::milliseconds max_latency{500};
    std::vector<std::string> warnings{};
    std::optional<std::filesystem::path> stats{}, timeline{}; // absolute
    FilesInUse files{};                                       // excluding those that the scene refers to
};

// The options to create a component's plugin with. `candidate`: 0 is the plugin, 1 its fallback, which gets its own
// defaults. Throws yaml::Error if the plugin has the wrong kind, needs a permission that is not allowed, or does not
// accept the options.
std::vector<ipc::OptionValue> options_for(const ipc::PluginDescription &plugin, arhost_kind kind,
                                          const ComponentConfiguration &component, std::size_t candidate);

// Throws yaml::Error at the first error. `built_in_plugins`: folder of the built-in plugins.
Configuration parse(const yaml::Node &root, const std::filesystem::path &built_in_plugins);

} // namespace arhost::run_config
