// SPDX-License-Identifier: Apache-2.0
#include "host/commands.hpp"

#include "base/atomic_file.hpp"
#include "base/file_identity.hpp"
#include "base/temporary_folder.hpp"
#include "base/text.hpp"
#include "camera/coordinates.hpp"
#include "host/console.hpp"
#include "host/device_report.hpp"
#include "host/outcome.hpp"
#include "host/pipeline.hpp"
#include "host/probe.hpp"
#include "run_config/access.hpp"
#include "run_config/schema.hpp"
#include "scene/capabilities.hpp"

#include <nlohmann/json.hpp>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/stat.h>

namespace arhost::host {
namespace {

namespace fs = std::filesystem;

fs::path built_in_plugins() {
    return own_prefix() / "lib/arhost/plugins";
}

supervise::Context make_context(ipc::Reactor &reactor, supervise::Starter &launcher, Console &console) {
    return {reactor, launcher, own_folder() / "arhost-worker",
            [&console](arhost_severity severity, const std::string &component, const std::string &text) {
                console.log(severity, component, text);
            }};
}

// Returns the coordinates set with the options of the dissertation's figure 7, which override `coordinates:` in the
// configuration; nullopt if none of these options is given.
std::optional<camera::Coordinates> coordinates_of(const Arguments &arguments) {
    const auto is_set = [](const double(&a)[3]) { return a[0] != 0 || a[1] != 0 || a[2] != 0; };
    if (!arguments.ar && !arguments.rt && !arguments.g1 && !arguments.g2 && !is_set(arguments.axis1) &&
        !is_set(arguments.axis2))
        return std::nullopt;
    camera::Coordinates coordinates;
    coordinates.ar = arguments.ar.value_or(coordinates.ar);
    coordinates.rt = arguments.rt.value_or(coordinates.rt);
    const auto axis = [](const double(&a)[3]) { return glm::dvec3(a[0], a[1], a[2]); };
    if (arguments.g1)
        coordinates.rotations.push_back({*arguments.g1, axis(arguments.axis1)});
    if (arguments.g2)
        coordinates.rotations.push_back({*arguments.g2, axis(arguments.axis2)});
    if (!arguments.g1 && is_set(arguments.axis1))
        throw yaml::Error("--x1, --y1 and --z1 need --g1, the angle in degrees");
    if (!arguments.g2 && is_set(arguments.axis2))
        throw yaml::Error("--x2, --y2 and --z2 need --g2, the angle in degrees");
    if (arguments.g2 && !arguments.g1)
        throw yaml::Error("--g2 sets the second rotation and needs --g1, the first rotation");
    if (const std::string problem = camera::problem_with(coordinates); !problem.empty())
        throw yaml::Error("--ar … --z2: " + problem);
    return coordinates;
}

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

void lift_deadlines(run_config::Configuration &configuration) {
    for_each_component(configuration, [](run_config::ComponentConfiguration &component) {
        base::Limits &limits = component.limits;
        limits.start = limits.frame = limits.stop = limits.start_total = limits.stop_total = std::chrono::hours(1000);
    });
}

// Throws if an output would overwrite one of arhost's own programs, libraries and plugins.
void protect_programs(const run_config::FilesInUse &files) {
    for (const char *program : {"arhost", "arhost-calibrate", "arhost-conform", "arhost-inprocess", "arhost-launcher",
                                "arhost-map", "arhost-marker", "arhost-worker", "render-scene"})
        files.protect(base::identity_of(own_folder() / program));
    std::error_code ignored;
    for (fs::recursive_directory_iterator entry(own_prefix() / "lib/arhost", ignored), end; !ignored && entry != end;
         entry.increment(ignored))
        if (entry->is_regular_file(ignored))
            files.protect(base::identity_of(entry->path()));
}

// Whether a program that may write to `folder` can change `file`, or replace a symbolic link on the way to it.
bool may_redirect(const fs::path &folder, const fs::path &file, int links = 40) {
    if (sandbox::contains(folder, base::real_path(file)))
        return true;
    for (fs::path at = file; at.has_relative_path(); at = at.parent_path()) {
        const fs::path parent = base::real_path(at.parent_path());
        std::error_code not_a_link;
        const fs::path target = fs::read_symlink(at, not_a_link);
        if (sandbox::contains(folder, parent) ||
            (!not_a_link && links > 0 && may_redirect(folder, parent / target, links - 1)))
            return true;
    }
    return false;
}

// Throws if a plugin may change the configuration, a map or a scene: with `--watch`, it could grant itself
// permissions.
void expect_watchable(const run_config::Configuration &configuration) {
    std::vector<fs::path> files{fs::absolute(configuration.node.file())};
    for (const run_config::Scene &scene : configuration.scenes)
        files.push_back(scene.file);
    if (configuration.tracker)
        files.insert(files.end(), configuration.tracker->map_files.begin(), configuration.tracker->map_files.end());
    for_each_component(configuration, [&](const run_config::ComponentConfiguration &component) {
        if (component.policy.mode == sandbox::Mode::none)
            return;
        for (const fs::path &folder : component.policy.writable)
            for (const fs::path &file : files)
                if (may_redirect(base::real_path(folder), file))
                    component.node.fail("may write to the folder of '" + file.string() +
                                        "', so with '--watch' it could change what runs; let it write to another "
                                        "folder, or remove '--watch'");
    });
}

run_config::Configuration parse_configuration(yaml::Node &root, const Arguments &arguments) {
    for (const std::string &setting : arguments.settings) {
        const std::size_t equals = setting.find('=');
        if (equals == 0 || equals == std::string::npos)
            throw yaml::Error("--set " + setting + ": must be key.path=value, as in --set source.fps=30");
        root.override_value(setting.substr(0, equals), setting.substr(equals + 1));
    }
    if (arguments.frames)
        root.override_value("frames", std::to_string(*arguments.frames), "--frames");
    if (arguments.in_process)
        root.override_value("sandbox", "none");
    run_config::Configuration configuration = run_config::parse(root, built_in_plugins());
    if (const auto coordinates = coordinates_of(arguments))
        configuration.coordinates = coordinates;
    for (run_config::ComponentConfiguration &output : configuration.outputs)
        output.debug_view = arguments.debug_view;
    if (arguments.in_process)
        lift_deadlines(configuration);
    protect_programs(configuration.files);
    if (arguments.watch)
        expect_watchable(configuration);
    return configuration;
}

run_config::Configuration read_configuration(const Arguments &arguments) {
    yaml::Node root = yaml::Node::load(arguments.file);
    return parse_configuration(root, arguments);
}

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
        return root.override_value("outputs", "[]", "arhost replay");
    root.override_value("outputs", "[{plugin: " + sink_for(replay.output) + "}]", "--output");
    root.override_text("outputs[0].path", replay.output, "--output");
}

// Sets the plugin of `component` and discards the settings of the recorded one that other plugins do not have.
void override_plugin(yaml::Node &root, const char *component, const std::string &plugin, const std::string &option) {
    if (plugin.empty())
        return;
    root.override_text(std::string(component) + ".plugin", plugin, option);
    const auto node = root.find(component);
    for (const char *key : {"options", "fallback", "allow"})
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

// Sessions are files of plugins, which are not trusted: removes what would let a session run other programs or write
// files.
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

// Returns a configuration that plays the video of a session in the pipeline of the recorded run, or in that of
// `arguments.file`.
run_config::Configuration session_configuration(const Arguments &arguments, const ReplayArguments &replay) {
    if (replay.with_pipeline || replay.width || replay.height)
        throw yaml::Error("--with-pipeline, --width and --height are for trajectories; remove them");
    run_config::Session session = run_config::read_session(replay.session);
    yaml::Node root = arguments.file.empty() ? session.configuration : yaml::Node::load(arguments.file);
    for (const char *key : {"record", "snapshot", "stats", "timeline", "frames"})
        root.remove(key);
    if (arguments.file.empty())
        remove_grants(root, replay);
    root.override_value("mode", "lockstep", "arhost replay");
    root.override_value("source", "{plugin: source_file}", "arhost replay");
    root.override_text("source.path", session.video().string(), "arhost replay");
    if (const double fps = session.description.require("fps").real(0); fps > 0)
        root.override_text("source.fps", session.description.require("fps").text(), "arhost replay");
    const yaml::Node camera = session.description.require("camera");
    if (!camera.is_null() && (arguments.file.empty() || !root.find("camera")))
        root.override_value("camera", camera.to_yaml(), "arhost replay");
    const yaml::Node changed = session.description.require("changed_options");
    for (const auto &[path, value] : arguments.file.empty() ? changed.entries() : decltype(changed.entries())()) {
        if (!is_option_of_stage(path))
            value.fail("'" + path + "' is not an option of the tracker or ray tracer");
        root.override_text(path, value.text(), "arhost replay");
    }
    const std::string recorded = arguments.file.empty() ? rendering_of(root) : "";
    override_plugin(root, "tracker", replay.tracker, "--tracker");
    override_plugin(root, "raytracer", replay.raytracer, "--raytracer");
    if (!replay.scene.empty())
        root.override_text("raytracer.scene", replay.scene, "--scene");
    override_outputs(root, replay);
    run_config::Configuration configuration = parse_configuration(root, arguments);
    session.recording.repeats_decisions = rendering_of(root) == recorded;
    if (session.recording.repeats_decisions) {
        choose_recorded(configuration, session.description);
        configuration.tracker.reset(); // its results are in the log
        for (const std::string &change : session.changed_scene_files())
            configuration.warnings.push_back(change);
    }
    if (const yaml::Node version = session.description.require("arhost"); version.text() != ARHOST_VERSION)
        configuration.warnings.push_back(version.where() + ": the session was recorded with arhost " +
                                         version.text() +
                                         "; poses and images of this version, " ARHOST_VERSION ", may differ");
    if (!session.warning.empty())
        configuration.warnings.push_back(session.warning);
    for (const char *file : {"", "session.json", "frames.jsonl"})
        configuration.files.read((session.folder / file).lexically_normal());
    const std::uint64_t count = session.recording.frames.size();
    configuration.frames = configuration.frames ? std::min(configuration.frames, count) : count;
    configuration.recording = std::move(session.recording);
    return configuration;
}

// Returns a configuration that plays the trajectory in the pipeline of `arguments.file`, or in a default pipeline.
// The file's outputs are ignored because they may be the outputs of the recorded run.
run_config::Configuration replay_configuration(const Arguments &arguments, const ReplayArguments &replay) {
    constexpr const char *default_raytracer = "version: 1\nraytracer: {plugin: rt_embree}\n";
    constexpr const char *default_pipeline =
        "version: 1\n"
        "source: {plugin: source_synthetic, options: {frames: 0, id: 0, side_mm: 80}}\n"
        "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
        "raytracer: {plugin: rt_embree}\n";
    yaml::Node root =
        !arguments.file.empty()
            ? yaml::Node::load(arguments.file)
            : yaml::Node::parse(replay.with_pipeline ? default_pipeline : default_raytracer, "arhost replay");
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
        root.override_value("outputs", "[{plugin: sink_null}]", "arhost replay");
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

// Returns the configuration without tracker and ray tracer, with a tracker of time codes.
run_config::Configuration latency_configuration(const Arguments &arguments) {
    yaml::Node root = yaml::Node::load(arguments.file);
    root.override_value("mode", "live", "arhost latency");
    root.override_value("tracker",
                        fmt::format("{{plugin: tracker_apriltag, targets: [{{ids: 0-{}, family: tag36h11, side_mm: "
                                    "100}}]}}",
                                    TimeCodes::count - 1),
                        "arhost latency");
    run_config::Configuration configuration = parse_configuration(root, arguments);
    if (!configuration.source || configuration.outputs.empty())
        throw yaml::Error(arguments.file + ": to measure latency, it needs the camera as 'source' and an output that "
                                           "shows the picture, as in 'outputs: [{plugin: sink_window, allow: "
                                           "[display]}]'");
    configuration.time_codes = true;
    configuration.raytracer.reset();
    configuration.trajectory.reset();
    for (run_config::ComponentConfiguration &output : configuration.outputs)
        std::erase_if(output.control,
                      [](const std::string &command) { return command != "quit" && command != "status"; });
    return configuration;
}

void show_warnings(const run_config::Configuration &configuration, Console &console) {
    for (const std::string &warning : configuration.warnings)
        console.log(ARHOST_SEVERITY_WARNING, "arhost", warning);
    if (configuration.trajectory && !configuration.trajectory->warning.empty())
        console.log(ARHOST_SEVERITY_WARNING, "trajectory", configuration.trajectory->warning);
}

double cpu_seconds_of_host() {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    return supervise::cpu_seconds(usage);
}

// Opens the file of a report. Must be called before workers run, because they could create a link or a pipe with the
// file's name.
base::AtomicFile open_report(const std::optional<fs::path> &file) {
    std::error_code ignored; // AtomicFile reports the error
    if (file)
        fs::create_directories(file->parent_path(), ignored);
    return base::AtomicFile(file.value_or(""));
}

bool write_report(base::AtomicFile &file, const char *key, Console &console, const std::string &text) {
    try {
        file.write(text);
        return true;
    } catch (const std::runtime_error &error) {
        console.log(ARHOST_SEVERITY_ERROR, key, error.what());
        return false;
    }
}

void log_contract_checks(const ContractChecks &checks, Console &console) {
    std::size_t passed = 0;
    for (const auto &[name, check] : checks.all()) {
        passed += check.violations == 0;
        if (check.violations > 0)
            console.log(ARHOST_SEVERITY_WARNING, "conform",
                        name + ": contract violated in " + std::to_string(check.violations) + " of " +
                            std::to_string(check.checked) + " frames");
    }
    if (!checks.all().empty())
        console.log(ARHOST_SEVERITY_INFO, "conform",
                    std::to_string(passed) + " of " + std::to_string(checks.all().size()) +
                        " contract checks passed");
}

// Logs what the plugins have counted: "lost_by_driver 3, superseded 12".
void log_counters(const EndedComponents &totals, Console &console) {
    for (const auto &[component, counters] : totals.counters) {
        std::vector<std::string> texts;
        for (const auto &[name, value] : counters)
            if (value > 0)
                texts.push_back(fmt::format("{} {}", name, value));
        if (!texts.empty())
            console.log(ARHOST_SEVERITY_INFO, component, fmt::format("counted: {}", fmt::join(texts, ", ")));
    }
}

int run(const run_config::Configuration &configuration, const Arguments &arguments, supervise::Starter &launcher) {
    sigset_t signals;
    ::sigemptyset(&signals);
    ::sigaddset(&signals, SIGINT);
    ::sigaddset(&signals, SIGTERM);
    ::sigaddset(&signals, SIGHUP);
    ::sigprocmask(
        SIG_BLOCK, &signals,
        nullptr); // blocked before the console's thread starts, because that thread must not receive these signals
    const base::UniqueFd signal_fd = base::checked(::signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK), "signalfd");

    base::AtomicFile stats = open_report(configuration.stats), timeline = open_report(configuration.timeline);
    Console console(arguments.verbose);
    show_warnings(configuration, console);
    ipc::Reactor reactor;
    Pipeline *running = nullptr;
    Pipeline pipeline(configuration, make_context(reactor, launcher, console),
                      [&](const Progress &progress) { console.show(progress, running->statistics()); });
    running = &pipeline;
    if (arguments.watch)
        pipeline.watch([&arguments] { return read_configuration(arguments); });
    bool stopped_by_signal = false;
    auto first_signal = std::chrono::steady_clock::time_point::min();
    const auto watch = reactor.watch(signal_fd.get(), [&] {
        signalfd_siginfo info;
        while (::read(signal_fd.get(), &info, sizeof info) > 0) {
            // A second signal ends the run immediately, unless it arrives within a second of the first one:
            // timeout(1) sends two signals.
            const auto now = std::chrono::steady_clock::now();
            if (stopped_by_signal && now - first_signal < std::chrono::seconds(1))
                continue;
            if (!stopped_by_signal) {
                first_signal = now;
                console.log(ARHOST_SEVERITY_INFO, "arhost",
                            "stopping after the current frames and files are finished; a second signal ends "
                            "the run at once");
            }
            stopped_by_signal = true;
            pipeline.interrupt();
        }
    });

    const bool completed = pipeline.run();
    if (!completed && !pipeline.failure_was_logged())
        console.log(ARHOST_SEVERITY_ERROR, "arhost", pipeline.failure());
    const Statistics &statistics = pipeline.statistics();
    const auto problem = completed ? problem_with_run(configuration, statistics, pipeline.targets()) : std::nullopt;
    const bool is_accepted = problem && problem->is_missing_target && arguments.allow_no_target;
    if (problem)
        console.log(is_accepted || stopped_by_signal ? ARHOST_SEVERITY_WARNING : ARHOST_SEVERITY_ERROR,
                    problem->component,
                    problem->text + (problem->is_missing_target ? " (--allow-no-target accepts this)" : ""));
    if (const std::string unseen = unseen_targets(configuration, statistics, pipeline.targets());
        completed && !unseen.empty() && !(problem && problem->is_missing_target))
        console.log(ARHOST_SEVERITY_WARNING, "tracker", unseen);
    if (const std::string misfits = misfitting_targets(statistics, pipeline.targets()); !misfits.empty())
        console.log(ARHOST_SEVERITY_WARNING, "tracker", misfits);
    if (configuration.mode == run_config::Mode::live && statistics.composited > 0)
        console.log(ARHOST_SEVERITY_INFO, "arhost",
                    fmt::format("{} frames, {:.1f} fps, latency from {}, {}", statistics.composited, statistics.fps(),
                                statistics.latency_from_capture ? "capture" : "arrival",
                                percentiles_text(statistics.stages.all(), statistics.latencies.all())));
    if (const auto &stages = statistics.stages.all(); stages.contains("glass_to_glass")) {
        const Timing &timing = stages.at("glass_to_glass");
        std::printf("glass to glass: p50 %.1f ms, p95 %.1f ms, p99 %.1f ms, maximum %.1f ms, in %llu measurements\n",
                    timing.percentile_ms(0.50), timing.percentile_ms(0.95), timing.percentile_ms(0.99),
                    timing.max_ms(), static_cast<unsigned long long>(timing.count()));
    }
    log_counters(statistics.ended.and_running(pipeline.components()), console);
    log_contract_checks(statistics.contract_checks, console);
    bool written = true;
    if (configuration.stats && statistics.frames_in > 0)
        written = write_report(stats, "stats", console,
                               report(statistics, pipeline.components(), cpu_seconds_of_host())
                                       .dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
                                   "\n");
    if (configuration.timeline && statistics.frames_in > 0)
        written &= write_report(timeline, "timeline", console, timeline_csv(statistics));
    // From here on, signals end the process immediately, because a stopped terminal may block the last log lines.
    signalfd_siginfo taken;
    while (::read(signal_fd.get(), &taken, sizeof taken) > 0) {
    }
    ::sigprocmask(SIG_UNBLOCK, &signals, nullptr);
    if (!written)
        return run_failed;
    if (!completed)
        return pipeline.failed_by_configuration() ? bad_configuration : run_failed;
    if (stopped_by_signal)
        return interrupted;
    return problem && !is_accepted ? run_failed : success;
}

// Checks the plugins, fallbacks included, and their options. Returns the ray tracers.
// `logs_notes`: warns of options that are set aside, which otherwise the pipeline does.
std::vector<ipc::PluginDescription> check_plugins(const run_config::Configuration &configuration,
                                                  supervise::Context &context, bool logs_notes) {
    const auto check_component = [&](const run_config::ComponentConfiguration &component, arhost_kind kind) {
        std::vector<ipc::PluginDescription> plugins;
        for (std::size_t i = 0; i < component.plugins.size(); ++i) {
            const ProbeResult result = probe(context, component.plugins[i], component.policy);
            if (const auto *reason = std::get_if<std::string>(&result))
                component.node.require(i == 0 ? "plugin" : "fallback").fail(*reason);
            plugins.push_back(std::get<ipc::PluginDescription>(result));
            std::vector<std::string> notes;
            run_config::options_for(plugins.back(), kind, component, i, notes);
            for (const std::string &note : notes)
                if (logs_notes)
                    context.log(ARHOST_SEVERITY_WARNING, plugins.back().id, note);
        }
        return plugins;
    };
    if (configuration.source)
        check_component(*configuration.source, ARHOST_KIND_SOURCE);
    for (const run_config::TrackerConfiguration &tracker : configuration.trackers)
        check_component(tracker, ARHOST_KIND_TRACKER);
    std::vector<ipc::PluginDescription> raytracers;
    for (const run_config::RaytracerConfiguration &raytracer : configuration.raytracers)
        std::ranges::move(check_component(raytracer, ARHOST_KIND_RAYTRACER), std::back_inserter(raytracers));
    for (const auto *output : {&configuration.snapshot, &configuration.record})
        if (*output)
            check_component(**output, ARHOST_KIND_SINK);
    std::vector<run_config::OutputFile> files = configuration.report_files();
    for (const run_config::ComponentConfiguration &output : configuration.outputs) {
        const ipc::PluginDescription plugin = check_component(output, ARHOST_KIND_SINK).back();
        if (const auto path = run_config::path_of(output.node))
            files.push_back({*path, (plugin.capabilities & ARHOST_CAPABILITY_NUMBERED_FILES) != 0});
    }
    run_config::expect_distinct(files);
    return raytracers;
}

// Loads the scene. Warns of parts that one of the ray tracers lacks, according to its descriptor.
void check_scene(const run_config::Configuration &configuration, supervise::Context &context,
                 const std::vector<ipc::PluginDescription> &raytracers) {
    std::optional<std::string> outcome;
    std::uint32_t needed = 0;
    const SceneLoading loading(
        context, configuration.raytracer->scene, configuration.sandbox, configuration.raytracer->limits,
        configuration.files,
        {[&](const ipc::SharedMemory &arena, const std::vector<Anchor> &anchors, const auto &) {
             needed = scene::needed_capabilities(arena.map(ipc::Access::read_only).as<const arhost_scene>());
             outcome = problem_with(anchors, configuration.tracker ? &*configuration.tracker : nullptr);
         },
         [&](const std::string &reason, const auto &) { outcome = reason; }});
    while (!outcome)
        context.reactor.run_once();
    if (!outcome->empty())
        throw yaml::Error(*outcome);
    for (const ipc::PluginDescription &plugin : raytracers)
        if (const std::string text = scene::missing_capabilities_text(plugin.id, needed & ~plugin.capabilities);
            !text.empty())
            context.log(ARHOST_SEVERITY_WARNING, "raytracer", text);
}

// Starts all components once, without restarts, and prints what they report. The outputs may write only to a
// temporary folder; messages name their own folder instead.
// Returns the exit status.
int check_by_opening(run_config::Configuration configuration, const Arguments &arguments,
                     supervise::Context context) {
    const base::TemporaryFolder scratch("arhost-check");
    std::vector<std::pair<std::string, std::string>> folders; // temporary folder, the output's own folder
    const auto restart_never = [](run_config::ComponentConfiguration &component) {
        component.limits.restart.quarantine_after = 1;
    };
    for (std::size_t i = 0; i < configuration.outputs.size(); ++i) {
        run_config::ComponentConfiguration &output = configuration.outputs[i];
        restart_never(output);
        const auto path = run_config::path_of(output.node);
        if (!path || run_config::is_standard_output(*path))
            continue;
        const fs::path folder = Pipeline::check_folder(scratch.path(), i), own = path->output_path().parent_path();
        fs::create_directory(folder);
        folders.emplace_back(folder, own);
        if (fs::is_fifo(path->output_path()))
            ::mkfifo((folder / path->output_path().filename()).c_str(), 0600); // on failure, the output reports it
        std::erase_if(output.policy.writable, [&](const fs::path &writable) {
            return writable == own || writable == base::real_path(path->output_path()).parent_path();
        });
        output.policy.writable.push_back(folder);
    }
    if (configuration.source)
        restart_never(*configuration.source);
    if (configuration.tracker)
        restart_never(*configuration.tracker);
    if (configuration.raytracer)
        restart_never(*configuration.raytracer);
    const auto with_own_folders = [&](std::string text) {
        for (const auto &[temporary, own] : folders)
            for (std::size_t at = 0; (at = text.find(temporary, at)) != std::string::npos; at += own.size())
                text.replace(at, temporary.size(), own);
        return text;
    };
    context.log = [&, log = context.log](arhost_severity severity, const std::string &component,
                                         const std::string &text) {
        log(severity, component, with_own_folders(text));
    };
    Pipeline pipeline(configuration, context, [](const Progress &) {});
    if (!pipeline.check(scratch.path(), arguments.frames.has_value())) {
        const std::string reason = with_own_folders(pipeline.failure());
        if (pipeline.failed_by_configuration())
            throw yaml::Error(reason);
        throw std::runtime_error(reason);
    }
    for (const std::string &line : pipeline.findings())
        std::printf("%s\n", base::printable(line).c_str());
    const auto problem = problem_with_run(configuration, pipeline.statistics(), pipeline.targets());
    if (problem)
        context.log(ARHOST_SEVERITY_ERROR, problem->component, problem->text);
    if (const std::string misfits = misfitting_targets(pipeline.statistics(), pipeline.targets()); !misfits.empty())
        context.log(ARHOST_SEVERITY_WARNING, "tracker", misfits);
    return problem ? run_failed : success;
}

// Returns the files of the plugins with these names; of all plugins if there are none.
std::vector<fs::path> plugin_files(const std::vector<std::string> &names) {
    const run_config::PluginPath path({}, built_in_plugins());
    if (names.empty())
        return path.all();
    std::vector<fs::path> files;
    try {
        for (const std::string &name : names)
            files.push_back(path.find(name));
    } catch (const std::runtime_error &error) {
        throw yaml::Error(error.what()); // an invalid command line
    }
    return files;
}

sandbox::Policy reading(const std::vector<fs::path> &paths) {
    sandbox::Policy policy;
    for (const fs::path &path : paths)
        policy.readable.push_back(fs::absolute(path));
    return policy;
}

// Returns nullopt if the plugin does not list devices.
std::optional<PluginDevices> devices_of(supervise::Context &context, const fs::path &file,
                                        const sandbox::Policy &policy) {
    PluginDevices devices;
    devices.plugin = file.stem().string();
    const ProbeResult probed = probe(context, file, policy);
    if (const auto *reason = std::get_if<std::string>(&probed)) {
        devices.problem = "cannot be used: " + *reason;
        return devices;
    }
    const auto &plugin = std::get<ipc::PluginDescription>(probed);
    devices.kind = plugin.kind;
    DevicesResult listed = list_devices(context, file, policy, plugin.needs);
    if (const auto *reason = std::get_if<std::string>(&listed)) {
        devices.problem = "cannot list its devices: " + *reason;
        return devices;
    }
    auto &list = std::get<std::optional<ipc::DeviceList>>(listed);
    if (!list)
        return std::nullopt;
    devices.list = std::move(*list);
    return devices;
}

} // namespace

fs::path own_prefix() {
    return own_folder().parent_path();
}

fs::path own_folder() {
    fs::path folder = fs::read_symlink("/proc/self/exe").parent_path();
    if (!base::is_utf8(folder.native())) // the protocol of the workers requires UTF-8 paths
        throw std::runtime_error("arhost is in a folder whose path is not UTF-8: " + folder.string());
    return folder;
}

int run(const Arguments &arguments, supervise::Starter &launcher) {
    return run(read_configuration(arguments), arguments, launcher);
}

int latency(Arguments arguments, supervise::Starter &launcher) {
    if (!arguments.frames)
        arguments.frames = 600;
    return run(latency_configuration(arguments), arguments, launcher);
}

int replay(const Arguments &arguments, const ReplayArguments &replay, supervise::Starter &launcher) {
    if (replay.session.empty() == replay.trajectory.empty())
        throw yaml::Error(replay.session.empty()
                              ? "name the folder of a session, or a trajectory with --trajectory FILE"
                              : "a session and --trajectory exclude each other; remove one of them");
    return run(replay.session.empty() ? replay_configuration(arguments, replay)
                                      : session_configuration(arguments, replay),
               arguments, launcher);
}

int check(const Arguments &arguments, bool open, supervise::Starter &launcher) {
    if (!open && arguments.frames)
        throw yaml::Error("--run and --no-open exclude each other; remove one of them");
    Console console(arguments.verbose);
    const run_config::Configuration configuration = read_configuration(arguments);
    show_warnings(configuration, console);
    ipc::Reactor reactor;
    supervise::Context context = make_context(reactor, launcher, console);
    const std::vector<ipc::PluginDescription> raytracers = check_plugins(configuration, context, !open);
    if (open) {
        if (const int status = check_by_opening(configuration, arguments, context); status != success)
            return status;
    } else if (configuration.raytracer) {
        check_scene(configuration, context, raytracers);
    }
    std::printf("%s: OK\n", base::printable(arguments.file).c_str());
    return success;
}

int list_plugins(const Arguments &arguments, const PluginsArguments &plugins, supervise::Starter &launcher) {
    Console console(arguments.verbose);
    ipc::Reactor reactor;
    supervise::Context context = make_context(reactor, launcher, console);
    const std::vector<fs::path> files = plugin_files(plugins.plugins);
    const sandbox::Policy policy = reading(plugins.reads);
    int status = success;
    std::string level;
    const auto print = [](const std::string &line) { std::printf("%s\n", base::printable(line).c_str()); };
    for (const fs::path &file : files) {
        const ProbeResult result = probe(context, file, policy, &level);
        if (const auto *reason = std::get_if<std::string>(&result)) {
            print(fmt::format("{:<18} cannot be used: {}", file.stem().string(), *reason));
            status = run_failed;
            continue;
        }
        const auto &plugin = std::get<ipc::PluginDescription>(result);
        print(fmt::format("{:<18} {:<10} {:<8} {}", plugin.id, ipc::to_text(plugin.kind), plugin.version,
                          file.string()));
        print(fmt::format("{:<18} {}", "", plugin.description));
        for (const std::string &need : plugin.needs)
            print(fmt::format("{:<18} needs 'allow: [{}]'", "", need));
        if (!plugins.with_options)
            continue;
        for (const ipc::OptionDeclaration &option : plugin.options) {
            const std::string standard =
                option.default_value ? "default '" + *option.default_value + "'" : "required";
            print(fmt::format("    {:<20} {} ({})", option.key, option.help, standard));
            if (!option.choices.empty())
                print(fmt::format("    {:<20} one of: {}", "", fmt::join(option.choices, " ")));
        }
    }
    if (!level.empty())
        std::printf("\nsandbox on this machine: %s\n", level.c_str());
    if (files.empty())
        print("no plugins in " + built_in_plugins().string());
    return status;
}

int devices(const Arguments &arguments, const DevicesArguments &options, supervise::Starter &launcher) {
    const std::vector<fs::path> files = plugin_files(options.plugins);
    Console console(arguments.verbose);
    ipc::Reactor reactor;
    supervise::Context context = make_context(reactor, launcher, console);
    const sandbox::Policy policy = reading(options.reads);
    std::vector<PluginDevices> found;
    for (const fs::path &file : files)
        if (auto devices = devices_of(context, file, policy))
            found.push_back(std::move(*devices));
    if (options.as_json)
        std::printf(
            "%s\n",
            devices_as_json(found).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
    else
        for (const std::string &line : devices_as_text(found))
            std::printf("%s\n", base::printable(line).c_str());
    const bool failed = std::ranges::any_of(found, [](const PluginDevices &p) { return !p.problem.empty(); });
    return failed ? run_failed : success;
}

int print_schema(bool markdown) {
    const std::string text = markdown ? run_config::schema_as_markdown() : run_config::schema_as_json_schema();
    std::fputs(text.c_str(), stdout);
    return success;
}

int run_program(const char *name, std::vector<std::string> arguments) {
    const std::string program = own_folder() / name;
    arguments.insert(arguments.begin(), program);
    std::vector<char *> argv;
    argv.reserve(arguments.size() + 1);
    for (std::string &argument : arguments)
        argv.push_back(argument.data());
    argv.push_back(nullptr);
    ::execv(program.c_str(), argv.data());
    throw yaml::Error(program + " cannot be executed: " + std::strerror(errno));
}

} // namespace arhost::host
