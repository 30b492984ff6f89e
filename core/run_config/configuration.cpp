// SPDX-License-Identifier: Apache-2.0
#include "run_config/configuration.hpp"

#include "camera/calibration.hpp"
#include "camera/lens_model.hpp"
#include "model/control.hpp"
#include "run_config/access.hpp"
#include "run_config/options.hpp"
#include "run_config/schema.hpp"
#include "run_config/user_view.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <limits>
#include <set>

namespace arhost::run_config {
namespace {

// Returns the default value of an integer key.
std::int64_t default_of(std::string_view path) {
    const std::string_view text = key_at(path).default_value;
    std::int64_t value = 0;
    std::from_chars(text.data(), text.data() + text.size(), value);
    return value;
}

// Returns the value of the integer key at `path`, whose parent is `map`.
std::int64_t integer_or_default(const yaml::Node &map, std::string_view path, std::int64_t minimum,
                                std::int64_t maximum) {
    const auto found = map.find(path.substr(path.rfind('.') + 1)); // npos + 1 is 0
    return found ? found->integer(minimum, maximum) : default_of(path);
}

std::uint32_t count_or_default(const yaml::Node &map, std::string_view path, std::int64_t minimum,
                               std::int64_t maximum = 1'000'000) {
    return static_cast<std::uint32_t>(integer_or_default(map, path, minimum, maximum));
}

std::chrono::milliseconds ms_or_default(const yaml::Node &map, std::string_view path, std::int64_t minimum) {
    return std::chrono::milliseconds(integer_or_default(map, path, minimum, 3'600'000));
}

base::RestartLimits parse_restart(const std::optional<yaml::Node> &node) {
    base::RestartLimits limits;
    if (!node)
        return limits;
    node->allow_keys(keys_of("restart"));
    limits.proven_after_frames = count_or_default(*node, "restart.proven_after_frames", 1);
    limits.quarantine_after = count_or_default(*node, "restart.quarantine_after", 1);
    limits.first_delay = ms_or_default(*node, "restart.first_delay_ms", 0);
    limits.longest_delay = ms_or_default(*node, "restart.longest_delay_ms", 0);
    return limits;
}

// Returns the commands that `list` grants. Commands that choose from a list of the configuration need this list.
std::set<std::string, std::less<>> parse_control(const yaml::Node &list, const yaml::Node &root) {
    std::set<std::string, std::less<>> granted;
    for (const yaml::Node &command : list.items()) {
        const std::string name = command.choice(control::names);
        for (const auto &[needing, key] : {std::pair{"load_scene", "scenes"},
                                           {"swap", "alternatives"},
                                           {"snapshot", "snapshot"},
                                           {"record", "record"}})
            if (name == needing && !root.find(key))
                command.fail("'" + name + "' needs the key '" + key + "' of the configuration (docs/control.md)");
        granted.insert(name);
    }
    return granted;
}

// Settings that apply to all components.
struct Shared {
    yaml::Node root;
    PluginPath plugin_path;
    base::RestartLimits restart;
    sandbox::Mode sandbox;
};

ComponentConfiguration parse_component(const yaml::Node &node, const std::string &schema_path, const Shared &shared) {
    if (const auto conform = node.find("conform"); conform && schema_path == "outputs[]")
        conform->fail(
            "is not available for outputs, as they return no results to check at run time; check the plugin with "
            "'arhost conform PLUGIN.so' (docs/conformance.md)");
    node.allow_keys(keys_of(schema_path));
    ComponentConfiguration component{
        node, {shared.plugin_path.resolve(node.require("plugin"))}, node.find("path"), node.find("options"), {}, {}};
    const auto name = node.find("name");
    component.name = name ? name->text() : component.plugins.front().stem().string();
    if (const auto fallback = node.find("fallback"))
        component.plugins.push_back(shared.plugin_path.resolve(*fallback));
    // "options:" without a value is an empty map.
    if (component.options && component.options->is_null())
        component.options.reset();
    component.limits.frame = ms_or_default(node, schema_path + ".deadline_ms", 1);
    component.limits.start = ms_or_default(node, schema_path + ".start_deadline_ms", 1);
    component.limits.stop = ms_or_default(node, schema_path + ".stop_deadline_ms", 1);
    component.limits.start_total = base::Limits::total_factor * component.limits.start;
    component.limits.frame_total = base::Limits::total_factor * component.limits.frame;
    component.limits.stop_total = base::Limits::total_factor * component.limits.stop;
    component.limits.restart = shared.restart;
    const bool is_output = schema_path == "outputs[]" || schema_path == "snapshot" || schema_path == "record";
    component.policy = access_of(node, is_output, shared.sandbox);
    component.policy.memory_bytes =
        static_cast<std::uint64_t>(integer_or_default(node, schema_path + ".memory_mb", 0, 1'000'000'000)) << 20;
    if (component.policy.memory_bytes && component.policy.allows("gpu"))
        node.require("memory_mb")
            .fail("cannot be enforced together with 'allow: [gpu]', as GPU drivers map large regions; remove one of "
                  "the two");
    if (const auto conform = node.find("conform"))
        component.conform = conform->boolean();
    if (const auto control = node.find("control"))
        component.control = parse_control(*control, shared.root);
    return component;
}

// Lets a tracker read the prints of its targets. If the sandbox cannot grant access to a print, the plugin reports
// that it cannot read the file.
void let_read_prints(TrackerConfiguration &tracker) {
    for (const Target &target : tracker.targets)
        for (const TargetMarker &marker : target.markers)
            if (!marker.file.empty())
                sandbox::allow_read(tracker.policy, marker.file);
}

TrackerConfiguration parse_tracker(const yaml::Node &node, const Shared &shared, std::vector<std::string> &warnings) {
    reject_markers(node);
    TrackerConfiguration tracker{parse_component(node, "tracker", shared), {}};
    reject_family_option(node);
    tracker.targets = parse_targets(node.require("targets"), tracker.target_nodes, tracker.map_files, warnings);
    let_read_prints(tracker);
    tracker.hold_frames = count_or_default(node, "tracker.hold_frames", 0);
    tracker.world_grace_frames = count_or_default(node, "tracker.world_grace_frames", 0);
    tracker.full_search_every = count_or_default(node, "tracker.full_search_every", 1);
    if (const auto filter = node.find("filter"))
        tracker.smooth = filter->choice(key_at("tracker.filter").choices) == "adaptive";
    if (const auto confirm = node.find("confirm"))
        tracker.confirm = confirm->boolean();
    return tracker;
}

// Returns the outputs, and those that the commands `snapshot` and `record` start.
std::vector<const ComponentConfiguration *> outputs_of(const Configuration &configuration) {
    std::vector<const ComponentConfiguration *> all;
    for (const ComponentConfiguration &output : configuration.outputs)
        all.push_back(&output);
    for (const auto *output : {&configuration.snapshot, &configuration.record})
        if (*output)
            all.push_back(&**output);
    return all;
}

FilesInUse files_read_by(const Configuration &configuration) {
    FilesInUse files;
    const yaml::Node &root = configuration.node;
    files.read(std::filesystem::absolute(root.file()));
    const auto camera = root.find("camera");
    for (const auto &node : {root.find("trajectory"), camera ? camera->find("file") : std::nullopt})
        if (node)
            files.read(node->input_path());
    const auto read_all_of = [&](const ComponentConfiguration &component) {
        for (const auto *paths : {&component.plugins, &component.policy.readable})
            std::ranges::for_each(*paths, [&](const auto &path) { files.read(path); });
    };
    if (configuration.source) {
        read_all_of(*configuration.source);
        if (const auto path = path_of(configuration.source->node))
            files.read_numbered(path->input_path()); // for a numbered file name, also registers the matching files
    }
    std::ranges::for_each(configuration.trackers, read_all_of);
    if (configuration.tracker)
        std::ranges::for_each(configuration.tracker->map_files, [&](const auto &file) { files.read(file); });
    std::ranges::for_each(configuration.raytracers, read_all_of);
    for (const Scene &scene : configuration.scenes)
        files.read(scene.file);
    for (const ComponentConfiguration *output : outputs_of(configuration))
        read_all_of(*output);
    return files;
}

// Whether a text begins with the scheme of a URL (RFC 3986, section 3.1), such as rtsp://.
bool is_url(std::string_view text) {
    const std::string_view scheme = text.substr(0, text.find("://"));
    return scheme.size() < text.size() && !scheme.empty() && std::ranges::all_of(scheme, [](unsigned char c) {
               return std::isalnum(c) || c == '+' || c == '-' || c == '.';
           });
}

// Returns the file of a scene, which is given as a path or, for the scenes installed with arhost, by name.
std::filesystem::path find_scene(const yaml::Node &scene, const std::filesystem::path &built_in_plugins) {
    std::filesystem::path file = scene.input_path();
    if (std::filesystem::is_regular_file(file))
        return file;
    std::string hint = hint_at_similar_name(file);
    if (const std::string name = scene.text(); name.find_first_of("./") == std::string::npos) {
        const std::filesystem::path prefix = built_in_plugins.parent_path().parent_path().parent_path();
        std::filesystem::path own = prefix / "share/arhost/config/scenes" / (name + ".yaml");
        if (std::filesystem::is_regular_file(own))
            return own;
        if (hint.empty())
            hint = hint_at_similar_name(own, ".yaml");
    }
    scene.fail("there is no scene file '" + file.string() + "'" + hint);
}

// Parses the source or the trajectory, and the settings for the sequence of frames.
void parse_run(Configuration &configuration, const Shared &shared) {
    const yaml::Node &root = shared.root;
    const auto trajectory = root.find("trajectory");
    if (trajectory)
        configuration.trajectory = camera::read_trajectory(trajectory->input_path());
    if (const auto node = trajectory ? root.find("source") : root.require("source")) {
        configuration.source = SourceConfiguration{parse_component(*node, "source", shared)};
        if (const auto fps = node->find("fps")) {
            configuration.source->fps = fps->real(0, 10'000);
            if (configuration.source->fps > 0 &&
                configuration.source->fps < 1e-6) // the duration of a frame in ns must fit in 64 bits
                fps->fail("must be 0 (the source's own rate) or 1e-06 to 10000, but is " + fps->text());
        }
    }
    if (const auto mode = root.find("mode"))
        configuration.mode = mode->choice(key_at("mode").choices) == "live" ? Mode::live : Mode::lockstep;
    if (configuration.mode == Mode::live && !configuration.source)
        root.require("mode").fail(
            "mode live needs a 'source', which sets the frame rate; without a source, a trajectory "
            "can only be rendered in mode lockstep");
    if (const auto node = root.find("paced"))
        configuration.paced = node->boolean();
    configuration.frames =
        static_cast<std::uint64_t>(integer_or_default(root, "frames", 0, std::numeric_limits<std::int64_t>::max()));
}

void parse_camera(Configuration &configuration) {
    const yaml::Node &root = configuration.node;
    if (const auto node = root.find("camera")) {
        node->allow_keys(keys_of("camera"));
        configuration.camera = camera::parse_camera(*node);
        configuration.camera_node = node;
    }
    if (const auto &trajectory = configuration.trajectory) {
        const std::uint64_t end = trajectory->end();
        configuration.frames = configuration.frames ? std::min(configuration.frames, end) : end;
        if (!configuration.camera) {
            configuration.camera = trajectory->intrinsics.value_or(camera::dissertation_camera({800, 600}));
            configuration.camera_node = root.find("trajectory");
        }
    }
    if (!configuration.camera)
        return;
    if (const std::string problem = camera::problem_with_lens(*configuration.camera); !problem.empty())
        configuration.camera_node->fail(problem);
    if (const std::string doubt = camera::doubt_about_focal_length(*configuration.camera); !doubt.empty())
        configuration.warnings.push_back(warning_at(*configuration.camera_node, doubt));
}

// Parses the tracker and the ray tracer.
void parse_stages(Configuration &configuration, const Shared &shared, const std::filesystem::path &built_in_plugins) {
    if (const auto node = shared.root.find("tracker")) {
        configuration.tracker = parse_tracker(*node, shared, configuration.warnings);
        if (!configuration.source)
            node->fail("a tracker needs a 'source' that delivers frames");
    }
    if (const auto node = shared.root.find("raytracer")) {
        const yaml::Node scene = node->require("scene");
        configuration.raytracer = RaytracerConfiguration{parse_component(*node, "raytracer", shared), {}, scene};
        if (!configuration.tracker && !configuration.trajectory)
            node->fail("a ray tracer needs camera poses from a 'tracker' or a 'trajectory'");
        configuration.raytracer->scene = find_scene(scene, built_in_plugins);
        if (const auto composite = node->find("composite"))
            configuration.raytracer->composite = composite->choice(key_at("raytracer.composite").choices) == "linear"
                                                     ? ARHOST_COMPOSITING_LINEAR
                                                     : ARHOST_COMPOSITING_SRGB;
    }
}

// Parses the lists from which the commands `swap` and `load_scene` choose.
void parse_choices(Configuration &configuration, const Shared &shared,
                   const std::filesystem::path &built_in_plugins) {
    const auto expect_new_name = [](const yaml::Node &node, const std::string &name, const auto &others) {
        if (std::ranges::any_of(others, [&](const auto &other) { return other.name == name; }))
            node.fail("there are two with the name '" + name + "'; give each its own 'name'");
    };
    // An alternative gets the settings of the configured component, except those of the plugin.
    const auto add_alternatives = [&](const char *kind, const auto &configured, auto &all) {
        if (configured)
            all.push_back(*configured);
        const auto alternatives = shared.root.find("alternatives");
        const auto nodes = alternatives ? alternatives->find(kind) : std::nullopt;
        if (!nodes)
            return;
        if (!configured)
            nodes->fail(std::string("there is no '") + kind + "' to which these are alternatives");
        for (const yaml::Node &node : nodes->items()) {
            auto alternative = *configured;
            static_cast<ComponentConfiguration &>(alternative) =
                parse_component(node, std::string("alternatives.") + kind + "[]", shared);
            reject_family_option(node);
            if constexpr (requires { let_read_prints(alternative); })
                let_read_prints(alternative);
            expect_new_name(node, alternative.name, all);
            all.push_back(std::move(alternative));
        }
    };
    if (const auto alternatives = shared.root.find("alternatives"))
        alternatives->allow_keys(keys_of("alternatives"));
    add_alternatives("tracker", configuration.tracker, configuration.trackers);
    add_alternatives("raytracer", configuration.raytracer, configuration.raytracers);
    if (configuration.raytracer)
        configuration.scenes.push_back(
            {configuration.raytracer->scene.stem().string(), configuration.raytracer->scene});
    const auto scenes = shared.root.find("scenes");
    if (scenes && !configuration.raytracer)
        scenes->fail("there is no 'raytracer' to render the scenes");
    if (scenes)
        for (const yaml::Node &node : scenes->items()) {
            const std::filesystem::path file = find_scene(node, built_in_plugins);
            if (file == configuration.raytracer->scene)
                continue;
            expect_new_name(node, file.stem().string(), configuration.scenes);
            configuration.scenes.push_back({file.stem().string(), file});
        }
}

// Registers the files of the outputs, and warns of an output that may write to many files.
void register_outputs(Configuration &configuration, const std::filesystem::path &built_in_plugins) {
    for (const ComponentConfiguration *output : outputs_of(configuration)) {
        const auto path = path_of(output->node);
        if (!path)
            continue;
        expect_folder_near_another(*path);
        configuration.files.write(*path);
        const std::filesystem::path &plugin = output->plugins.front();
        if (configuration.sandbox == sandbox::Mode::none || plugin.parent_path() == built_in_plugins)
            continue; // no warning for built-in plugins, which are trusted
        if (const std::string warning = warning_of_output(*path, plugin.stem()); !warning.empty())
            configuration.warnings.push_back(warning);
    }
}

void parse_live(Configuration &configuration, const yaml::Node &live) {
    live.allow_keys(keys_of("live"));
    configuration.max_latency = ms_or_default(live, "live.max_latency_ms", 1);
    if (const auto target = live.find("target_fps"))
        configuration.target_fps = target->real(0, 10'000);
    for (const char *key : {"min_scale", "min_samples"})
        if (const auto limit = live.find(key); limit && configuration.target_fps == 0)
            limit->fail("this limit needs 'target_fps', the frame rate for which the quality is reduced");
    if (const auto scale = live.find("min_scale"))
        configuration.min_scale = scale->real(0.1, 1);
    configuration.min_samples = count_or_default(live, "live.min_samples", 1, 65536);
}

// Parses the files that the host writes.
void parse_reports(Configuration &configuration) {
    for (const auto &[key, file] :
         {std::pair{"stats", &configuration.stats}, std::pair{"timeline", &configuration.timeline}}) {
        const auto node = configuration.node.find(key);
        if (!node)
            continue;
        *file = base::real_path(node->text()); // if it is a symbolic link, the link's target is replaced
        std::error_code error;
        const auto type = std::filesystem::status(**file, error).type();
        using enum std::filesystem::file_type;
        if (type != regular && type != not_found && type != character)
            node->fail("'" + node->text() +
                       (error ? "' cannot be accessed: " + error.message() : "' is not a regular file") +
                       "; choose another path");
        if (type != character) { // character devices such as /dev/null may be used several times
            configuration.files.write(*node);
            expect_writable(*node);
        }
    }
}

} // namespace

model::OptionValue option_value(const model::OptionDeclaration &declared, const std::string &text) {
    return value_of(declared, yaml::Node::scalar(text, declared.key));
}

std::string yaml_text(const model::OptionValue &value) {
    switch (value.type) {
    case ARHOST_OPTION_BOOL:
        return value.integer ? "true" : "false";
    case ARHOST_OPTION_INTEGER:
        return std::to_string(value.integer);
    case ARHOST_OPTION_REAL:
        return nlohmann::json(value.real).dump();
    default:
        return nlohmann::json(value.text).dump();
    }
}

std::vector<model::OptionValue> options_for(const model::PluginDescription &plugin, arhost_kind kind,
                                            const ComponentConfiguration &component, std::size_t candidate,
                                            std::vector<std::string> &notes) {
    const bool configured = candidate == 0;
    if (plugin.kind != kind)
        component.node.require(configured ? "plugin" : "fallback")
            .fail("'" + plugin.short_name() + "' is a " + model::to_text(plugin.kind) + ", not a " +
                  model::to_text(kind));
    for (const std::string &need : plugin.needs)
        if (component.policy.mode != sandbox::Mode::none && !component.policy.meets(need))
            component.node.require(configured ? "plugin" : "fallback")
                .fail("'" + plugin.short_name() + "' needs '" + need + "', which the sandbox blocks: add 'allow: [" +
                      need + "]'" + (need == "usb" ? ", or better 'usb: {vendor: …, product: …}'," : "") + " to " +
                      component.node.path() + " (docs/security.md)");
    const std::optional<yaml::Node> options = configured ? component.options : std::nullopt;
    std::vector<model::OptionValue> values = resolve_options(plugin, options, component.path, component.node, notes);
    if (const auto usb = std::ranges::find(values, "usb", &model::OptionValue::key);
        usb != values.end() && !component.policy.usb_device.empty()) {
        if (const auto option = options ? options->find("usb") : std::nullopt)
            option->fail("the device is also given by the key 'usb' next to 'plugin'; remove one of them");
        usb->text = component.policy.usb_device;
    }
    if (const auto debug_view = std::ranges::find(values, "debug_view", &model::OptionValue::key);
        component.debug_view && debug_view != values.end() && debug_view->type == ARHOST_OPTION_BOOL)
        debug_view->integer = 1;
    for (const model::OptionDeclaration &declared : plugin.options) {
        const auto option = options ? options->find(declared.key) : std::nullopt;
        const auto node = declared.key == "path" && component.path ? component.path : option;
        if (node && declared.type == ARHOST_OPTION_INPUT_PATH && is_url(node->text()))
            node->fail("is a URL, but '" + plugin.short_name() + "' reads only files" +
                       (kind == ARHOST_KIND_SOURCE
                            ? "; for network cameras write '" + component.node.path() +
                                  ": {plugin: source_network, allow: [network], options: {url: …}}' with this URL"
                            : ""));
        else if (node && declared.type == ARHOST_OPTION_INPUT_PATH)
            expect_readable(*node, component.policy);
        else if (node && declared.type == ARHOST_OPTION_OUTPUT_PATH)
            expect_writable(*node);
    }
    return values;
}

std::vector<OutputFile> Configuration::report_files() const {
    std::vector<OutputFile> reports;
    for (const char *key : {"stats", "timeline"})
        if (const auto report = node.find(key))
            reports.push_back({*report, false});
    return reports;
}

Configuration parse(const yaml::Node &root, const std::filesystem::path &built_in_plugins) {
    root.allow_keys(keys_of(""));
    if (const yaml::Node version = root.require("version"); version.integer() != 1)
        version.fail("must be 1, the only supported version");

    std::vector<std::filesystem::path> folders;
    if (const auto node = root.find("plugin_path"))
        for (const yaml::Node &folder : node->items())
            folders.push_back(folder.input_path());
    Configuration configuration{.node = root};
    if (const auto node = root.find("sandbox"))
        configuration.sandbox = sandbox::mode_of(node->choice(sandbox::modes));
    const Shared shared{root, PluginPath(folders, built_in_plugins), parse_restart(root.find("restart")),
                        configuration.sandbox};

    parse_run(configuration, shared);
    parse_camera(configuration);
    parse_stages(configuration, shared, built_in_plugins);
    parse_choices(configuration, shared, built_in_plugins);
    if (const auto node = root.find("coordinates")) {
        node->allow_keys(keys_of("coordinates"));
        configuration.coordinates = camera::parse_coordinates(*node);
    }
    if (const auto node = root.find("outputs"))
        for (const yaml::Node &output : node->items())
            configuration.outputs.push_back(parse_component(output, "outputs[]", shared));
    for (const auto &[key, output] :
         {std::pair{"snapshot", &configuration.snapshot}, {"record", &configuration.record}})
        if (const auto node = root.find(key))
            *output = parse_component(*node, key, shared);
    configuration.files = files_read_by(configuration);
    register_outputs(configuration, built_in_plugins);
    if (const auto node = root.find("live"))
        parse_live(configuration, *node);
    parse_reports(configuration);
    if (!configuration.source && !configuration.raytracer)
        root.require("trajectory")
            .fail("a trajectory needs a 'source' that delivers frames or a 'raytracer' that renders it");
    return configuration;
}

} // namespace arhost::run_config
