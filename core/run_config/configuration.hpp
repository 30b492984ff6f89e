// SPDX-License-Identifier: Apache-2.0
//
// A configuration, read and checked as far as it can be without its plugins (docs/config.md).
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

// What every component has.
struct ComponentConfiguration {
    yaml::Node node;                            // its map, for errors
    std::vector<std::filesystem::path> plugins; // the shared object, then its fallback
    std::optional<yaml::Node> path, options;
    base::Limits limits;
    sandbox::Policy policy; // what its worker may touch (docs/security.md)
    bool conform = false;   // its promises are looked at on real frames (docs/conformance.md)
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
    std::optional<SourceConfiguration> source{};    // none: black frames for a trajectory
    std::optional<camera::Trajectory> trajectory{}; // where cameras come from in place of the tracker
    std::optional<arhost_intrinsics> camera{};      // always set where there is a trajectory
    std::optional<yaml::Node> camera_node{};
    std::optional<TrackerConfiguration> tracker{};
    std::optional<RaytracerConfiguration> raytracer{};
    std::optional<camera::Coordinates> coordinates{};
    std::vector<ComponentConfiguration> outputs{};
    std::chrono::milliseconds max_latency{500};
    std::vector<std::string> warnings{};
    std::optional<std::filesystem::path> stats{}, timeline{}; // absolute
    FilesInUse files{};                                       // but for those that the scene names
};

// The options to create a component's plugin with. Throws yaml::Error where the plugin is of another kind,
// needs what the configuration does not allow, or the configured options do not fit it. `candidate` 0 is the plugin,
// 1 its fallback, which takes its own defaults.
std::vector<ipc::OptionValue> options_for(const ipc::PluginDescription &plugin, arhost_kind kind,
                                          const ComponentConfiguration &component, std::size_t candidate);

// Reads the whole; throws yaml::Error at the first fault. `built_in_plugins` is where arhost's own are.
Configuration parse(const yaml::Node &root, const std::filesystem::path &built_in_plugins);

} // namespace arhost::run_config
