// SPDX-License-Identifier: Apache-2.0
//
// Parses configuration files (docs/config.md) and does all checks for which no plugin must be loaded.
#pragma once

#include "base/limits.hpp"
#include "camera/coordinates.hpp"
#include "camera/trajectory.hpp"
#include "model/plugin_description.hpp"
#include "run_config/files_in_use.hpp"
#include "run_config/plugin_path.hpp"
#include "run_config/recording.hpp"
#include "run_config/targets.hpp"
#include "sandbox/sandbox.hpp"
#include "yaml/yaml.hpp"

#include <arhost/camera.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace arhost::run_config {

enum class Mode { lockstep, live };

// Settings that all kinds of components have in common.
struct ComponentConfiguration {
    yaml::Node node;                            // the component's YAML map, for error messages
    std::vector<std::filesystem::path> plugins; // shared objects: the plugin, then its fallback
    std::optional<yaml::Node> path, options;
    base::Limits limits;
    sandbox::Policy policy;                       // docs/security.md
    bool conform = false;                         // check results at run time (docs/conformance.md)
    std::set<std::string, std::less<>> control{}; // the commands that the output may send
    bool debug_view = false; // set the output's option `debug_view`, if the plugin has this option
    std::string name{};      // of a tracker or ray tracer among the alternatives; default: the name of the plugin
};

struct SourceConfiguration : ComponentConfiguration {
    double fps = 0;
};

struct TrackerConfiguration : ComponentConfiguration {
    std::vector<Target> targets;
    std::vector<yaml::Node> target_nodes{}; // the node of each target
    std::vector<std::filesystem::path> map_files{};
    std::uint32_t hold_frames = 0;
    std::uint32_t world_grace_frames = 90, full_search_every = 10;
    bool smooth = false; // filter: adaptive
    bool confirm = true;
};

struct RaytracerConfiguration : ComponentConfiguration {
    std::filesystem::path scene;
    yaml::Node scene_node;
    std::optional<arhost_compositing> composite{}; // nullopt: the scene's integrator decides
};

struct Scene {
    std::string name; // the file's name without extension
    std::filesystem::path file;
};

struct Configuration {
    yaml::Node node;
    Mode mode = Mode::lockstep;
    sandbox::Mode sandbox = sandbox::Mode::standard;
    std::optional<bool> paced{};                    // mode lockstep: composite at the rate of the time stamps
    std::uint64_t frames = 0;                       // maximum number of frames; 0: no limit
    std::optional<SourceConfiguration> source{};    // nullopt only with a trajectory; the frames are then black
    std::optional<camera::Trajectory> trajectory{}; // camera poses to use instead of the tracker's
    std::optional<Recording> recording{};           // the frames of a session, which the source plays
    std::optional<arhost_intrinsics> camera{};      // always set with a trajectory
    std::optional<yaml::Node> camera_node{};
    std::optional<TrackerConfiguration> tracker{};
    std::optional<RaytracerConfiguration> raytracer{};
    std::optional<camera::Coordinates> coordinates{};
    std::vector<ComponentConfiguration> outputs{};
    // For the commands `swap` and `load_scene`: the configured component or scene, then the alternatives to it.
    std::vector<TrackerConfiguration> trackers{};
    std::vector<RaytracerConfiguration> raytracers{};
    std::vector<Scene> scenes{};
    // The outputs that the commands `snapshot` and `record` start.
    std::optional<ComponentConfiguration> snapshot{}, record{};
    std::chrono::milliseconds max_latency{500};
    double target_fps = 0; // mode live: frame rate for which the quality of images is reduced; 0: never
    double min_scale = 0.5;
    std::uint32_t min_samples = 1;
    // `arhost latency`: outputs get pictures of time codes instead of the frames. The camera sees the display that
    // shows these pictures, and the tracker reads the codes.
    bool time_codes = false;
    std::vector<std::string> warnings{};
    std::optional<std::filesystem::path> stats{}, timeline{}; // absolute
    FilesInUse files{};                                       // without the files that the scene refers to

    std::vector<OutputFile> report_files() const; // the files that the host writes: `stats` and `timeline`
};

// Calls `function` for each component that a run can start, among them those that commands start.
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

// Returns the option values for creating a component's plugin. `candidate` is 0 for the plugin itself and 1 for the
// fallback. For the fallback, the configured options are ignored and all options have their defaults. Throws
// yaml::Error if the plugin has the wrong kind, needs a permission that is not allowed, or does not accept the
// options. Throws it also if an input file cannot be read or an output file cannot be written. Adds to `notes` the
// options that are ignored (resolve_options).
std::vector<model::OptionValue> options_for(const model::PluginDescription &plugin, arhost_kind kind,
                                            const ComponentConfiguration &component, std::size_t candidate,
                                            std::vector<std::string> &notes);

// Returns the value of the declared option that `text`, in YAML syntax, represents. Throws yaml::Error.
model::OptionValue option_value(const model::OptionDeclaration &declared, const std::string &text);

// Returns the value in YAML syntax; the inverse of option_value.
std::string yaml_text(const model::OptionValue &value);

// Parses and checks a configuration. Throws yaml::Error at the first error. `built_in_plugins` is the folder of the
// built-in plugins.
Configuration parse(const yaml::Node &root, const std::filesystem::path &built_in_plugins);

} // namespace arhost::run_config
