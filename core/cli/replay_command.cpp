// SPDX-License-Identifier: Apache-2.0
#include "cli/commands.hpp"
#include "cli/read_configuration.hpp"
#include "cli/recorded_session.hpp"
#include "cli/run_command.hpp"
#include "cli/session_grants.hpp"

#include <algorithm>
#include <map>

namespace arhost::cli {
namespace {

namespace fs = std::filesystem;

// Returns the sink plugin that writes files with the extension of `file`.
std::string sink_for(const fs::path &file) {
    const std::string extension = file.extension().string();
    for (const char *picture : {".png", ".jpg", ".jpeg"})
        if (extension == picture)
            return "sink_images";
    if (extension == ".jsonl")
        return "sink_poses";
    if (extension.empty())
        throw yaml::Error("--output " + file.string() +
                          ": add an extension: .mp4 or .mkv for video, .png or .jpg for images, .jsonl for poses");
    return "sink_video"; // sink_video itself rejects extensions that it does not support
}

void override_outputs(yaml::Node &root, const ReplayArguments &replay) {
    if (!replay.stats.empty())
        root.override_text("stats", replay.stats, "--stats");
    if (!replay.timeline.empty())
        root.override_text("timeline", replay.timeline, "--timeline");
    if (replay.output.empty() || replay.output == "none")
        return root.override_value("outputs", "[]", replayed);
    root.override_value("outputs", "[{plugin: " + sink_for(replay.output) + "}]", "--output");
    root.override_text("outputs[0].path", replay.output, "--output");
}

// Sets the plugin of `component`, and removes the settings that only apply to the previous plugin.
void override_plugin(yaml::Node &root, const char *component, const std::string &plugin, const std::string &option) {
    if (plugin.empty())
        return;
    root.override_text(std::string(component) + ".plugin", plugin, option);
    const auto node = root.find(component);
    for (const char *key : {"options", "path", "fallback", "allow", "reads", "usb"})
        yaml::Node(*node).remove(key);
}

// Returns the parts of a configuration that determine poses and images.
std::string rendering_of(const yaml::Node &root) {
    std::string text;
    for (const char *key : {"tracker", "raytracer", "camera", "coordinates", "trajectory"})
        if (const auto node = root.find(key))
            text += std::string(key) + ": " + node->to_yaml() + "\n";
    return text;
}

// Returns the ids of the recorded plugins. Sessions of earlier drafts have only their short names.
std::map<std::string, std::string> recorded_ids(const yaml::Node &description) {
    std::map<std::string, std::string> ids;
    const yaml::Node plugins = description.require("plugins");
    for (const char *kind : {"tracker", "raytracer"})
        if (const auto plugin = plugins.find(kind))
            if (const auto id = plugin->find("id"))
                ids[kind] = id->text();
    return ids;
}

// Chooses the alternative and the scene that were in use when the recording began.
void choose_recorded(run_config::Configuration &configuration, const yaml::Node &description) {
    const yaml::Node plugins = description.require("plugins");
    const auto choose = [&](const char *kind, auto &chosen, const auto &all) {
        const auto plugin = plugins.find(kind);
        if (!chosen || !plugin)
            return;
        const std::string name = plugin->require("name").text();
        const auto found = std::ranges::find_if(all, [&](const auto &each) { return each.name == name; });
        if (found != all.end())
            chosen = *found;
    };
    choose("tracker", configuration.tracker, configuration.trackers);
    choose("raytracer", configuration.raytracer, configuration.raytracers);
    const auto scene = description.find("scene");
    if (!scene || !configuration.raytracer)
        return;
    const auto found = std::ranges::find(configuration.scenes, scene->text(), &run_config::Scene::name);
    if (found == configuration.scenes.end())
        return;
    configuration.raytracer->scene = found->file;
    std::iter_swap(configuration.scenes.begin(), found);
}

// Removes what would let a session run other programs or write files; no replay needs it.
void remove_grants(yaml::Node &root, const ReplayArguments &replay) {
    for (const char *key : {"sandbox", "plugin_path"})
        root.remove(key);
    const auto alternatives = root.find("alternatives");
    for (const auto &[kind, chosen] : {std::pair{"tracker", &replay.tracker}, {"raytracer", &replay.raytracer}}) {
        std::vector<yaml::Node> components;
        if (const auto listed = alternatives ? alternatives->find(kind) : std::nullopt)
            components = listed->items();
        if (const auto component = root.find(kind); component && chosen->empty())
            components.push_back(*component);
        for (yaml::Node &component : components) {
            for (const char *key : {"writes", "environment"})
                component.remove(key);
            for (const char *key : {"plugin", "fallback"})
                if (const auto plugin = component.find(key); plugin && plugin->text().find('/') != std::string::npos)
                    plugin->fail("is a file, which a session cannot choose; if you trust it, use --" +
                                 std::string(kind) + " " + plugin->text());
        }
    }
}

// Whether `path` is tracker.options.KEY, raytracer.options.KEY or that of an alternative.
bool is_option_of_stage(std::string_view path) {
    const auto skip = [&](std::string_view prefix) {
        return path.starts_with(prefix) ? (path.remove_prefix(prefix.size()), true) : false;
    };
    const bool is_alternative = skip("alternatives.");
    if (!skip("tracker") && !skip("raytracer"))
        return false;
    if (is_alternative) {
        const std::size_t end = path.find(']');
        if (!path.starts_with('[') || end == std::string_view::npos ||
            path.substr(1, end - 1).find_first_not_of("0123456789") != std::string_view::npos)
            return false;
        path.remove_prefix(end + 1);
    }
    return skip(".options.") && path.find_first_of(".[") == std::string_view::npos;
}

// Changes a configuration so that it plays the video of the session. `is_recorded`: the
// configuration is that of the recorded run.
void play_video(yaml::Node &root, const Session &session, bool is_recorded) {
    for (const char *key : {"record", "snapshot", "stats", "timeline", "frames"})
        root.remove(key);
    root.override_value("mode", "lockstep", replayed);
    root.override_value("source", "{plugin: source_file}", replayed);
    root.override_text("source.path", session.video().string(), replayed);
    if (const double fps = session.description.require("fps").real(0); fps > 0)
        root.override_text("source.fps", session.description.require("fps").text(), replayed);
    const yaml::Node camera = session.description.require("camera");
    if (!camera.is_null() && (is_recorded || !root.find("camera")))
        root.override_value("camera", camera.to_yaml(), replayed);
    const yaml::Node changed = session.description.require("changed_options");
    for (const auto &[path, value] : is_recorded ? changed.entries() : decltype(changed.entries())()) {
        if (!is_option_of_stage(path))
            value.fail("'" + path + "' is not an option of the tracker or ray tracer");
        root.override_text(path, value.text(), replayed);
    }
}

std::vector<std::string> warnings_of(const Session &session) {
    std::vector<std::string> warnings;
    if (const yaml::Node version = session.description.require("arhost"); version.text() != ARHOST_VERSION)
        warnings.push_back(version.where() + ": the session was recorded with arhost " + version.text() +
                           "; poses and images of this version, " ARHOST_VERSION ", may differ");
    if (!session.warning.empty())
        warnings.push_back(session.warning);
    return warnings;
}

// Returns a configuration that plays the video of a session in the pipeline of the recorded run, or in that of
// `arguments.file`.
run_config::Configuration session_configuration(const Arguments &arguments, const ReplayArguments &replay,
                                                supervise::Starter &launcher) {
    if (replay.with_pipeline || replay.width || replay.height)
        throw yaml::Error("--with-pipeline, --width and --height are for trajectories; remove them");
    Session session = read_session(replay.session);
    const bool is_recorded = arguments.file.empty();
    yaml::Node root = is_recorded ? session.configuration : yaml::Node::load(arguments.file);
    if (is_recorded) {
        remove_grants(root, replay);
        session.recording.plugin_ids = recorded_ids(session.description);
    }
    play_video(root, session, is_recorded);
    const std::string recorded = is_recorded ? rendering_of(root) : "";
    override_plugin(root, "tracker", replay.tracker, "--tracker");
    override_plugin(root, "raytracer", replay.raytracer, "--raytracer");
    if (!replay.scene.empty())
        root.override_text("raytracer.scene", replay.scene, "--scene");
    override_outputs(root, replay);
    override_settings(root, arguments);
    session.recording.repeats_decisions = rendering_of(root) == recorded;
    if (is_recorded)
        expect_granted(root, session, replay.allow, !session.recording.repeats_decisions);
    else if (!replay.allow.empty())
        throw yaml::Error("--allow grants what a recorded configuration asks for; with --config, use 'allow' and "
                          "'reads' in that file");
    run_config::Configuration configuration = parse_configuration(root, arguments);
    {
        Console console(arguments.verbose);
        ipc::Reactor reactor;
        supervise::Context context = make_context(reactor, launcher, console);
        read_log(session, context, configuration.sandbox, configuration.source->limits);
    }
    if (session.recording.repeats_decisions) {
        choose_recorded(configuration, session.description);
        configuration.tracker.reset(); // its results are in the log
        for (const std::string &change : session.changed_scene_files())
            configuration.warnings.push_back(change);
    }
    std::ranges::move(warnings_of(session), std::back_inserter(configuration.warnings));
    for (const char *file : {"", "session.json", "frames.jsonl"})
        configuration.files.read((session.folder / file).lexically_normal());
    const std::uint64_t count = session.recording.frames.size();
    configuration.frames = configuration.frames ? std::min(configuration.frames, count) : count;
    configuration.recording = std::move(session.recording);
    return configuration;
}

// Returns the keys of `arguments.file`, or of a default pipeline, with the options of the command line.
yaml::Node trajectory_root(const Arguments &arguments, const ReplayArguments &replay) {
    constexpr const char *default_raytracer = "version: 1\nraytracer: {plugin: rt_embree}\n";
    constexpr const char *default_pipeline =
        "version: 1\n"
        "source: {plugin: source_synthetic, options: {frames: 0, id: 0, side_mm: 80}}\n"
        "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
        "raytracer: {plugin: rt_embree}\n";
    yaml::Node root = !arguments.file.empty()
                          ? yaml::Node::load(arguments.file)
                          : yaml::Node::parse(replay.with_pipeline ? default_pipeline : default_raytracer, replayed);
    if (arguments.file.empty() && replay.scene.empty())
        throw yaml::Error("--scene is missing: the scene to render, as in --scene optix-cs");
    root.override_text("trajectory", replay.trajectory, "--trajectory");
    if (!replay.scene.empty())
        root.override_text("raytracer.scene", replay.scene, "--scene");
    if (!replay.tracker.empty())
        root.override_text("tracker.plugin", replay.tracker, "--tracker");
    if (!replay.raytracer.empty())
        root.override_text("raytracer.plugin", replay.raytracer, "--raytracer");
    if (replay.width.has_value() != replay.height.has_value())
        throw yaml::Error("--width and --height must be given together");
    if (replay.width)
        root.override_value("camera",
                            "{width: " + std::to_string(*replay.width) +
                                ", height: " + std::to_string(*replay.height) + ", vertical_fov_degrees: 45}",
                            "--width, --height");
    override_outputs(root, replay);
    if ((replay.output.empty() || replay.output == "none") && replay.with_pipeline)
        root.override_value("outputs", "[{plugin: sink_null}]", replayed);
    return root;
}

// Returns a configuration that plays the trajectory in the pipeline of `arguments.file`, or in a default pipeline.
// The file's outputs are ignored because they may be the outputs of the recorded run.
run_config::Configuration trajectory_configuration(const Arguments &arguments, const ReplayArguments &replay) {
    yaml::Node root = trajectory_root(arguments, replay);
    override_settings(root, arguments);
    if (!replay.allow.empty())
        throw yaml::Error("--allow is for sessions; remove it");
    run_config::Configuration configuration = parse_configuration(root, arguments);
    if (replay.width && configuration.trajectory->intrinsics)
        throw yaml::Error("--width, --height: " + replay.trajectory +
                          " contains the image size; remove --width and --height");
    if (replay.with_pipeline && !(configuration.source && configuration.tracker))
        throw yaml::Error("--with-pipeline needs a 'source' and a 'tracker'; " + arguments.file +
                          " lacks at least one of them");
    if (!replay.with_pipeline) {
        configuration.source.reset();
        configuration.tracker.reset();
    }
    if (replay.stats.empty())
        configuration.stats.reset();
    if (replay.timeline.empty())
        configuration.timeline.reset();
    configuration.mode = run_config::Mode::lockstep;
    return configuration;
}

} // namespace

int replay(const Arguments &arguments, const ReplayArguments &replay, supervise::Starter &launcher) {
    if (replay.session.empty() == replay.trajectory.empty())
        throw yaml::Error(replay.session.empty()
                              ? "name the folder of a session, or a trajectory with --trajectory FILE"
                              : "a session and --trajectory exclude each other; remove one of them");
    return run(replay.session.empty() ? trajectory_configuration(arguments, replay)
                                      : session_configuration(arguments, replay, launcher),
               arguments, launcher);
}

} // namespace arhost::cli
