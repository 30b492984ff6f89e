// SPDX-License-Identifier: Apache-2.0
//
// Command line of arhost.
#include "base/write_all.hpp"
#include "host/ctl.hpp"
#include "host/new_plugin.hpp"
#include "host/program.hpp"
#include "run_config/configuration.hpp"
#include "sandbox/sandbox.hpp"

#include <csignal>
#include <cstdio>
#include <fcntl.h>
#include <unistd.h>

namespace {

// Establishes a known state, whatever the parent process has set up: reopens standard streams that are closed, so
// that no socket gets descriptor 0, 1 or 2, and resets the signal handling. Ignores SIGPIPE and SIGXFSZ, so that the
// failing system calls return an error instead.
void prepare_process() {
    int fd = ::open("/dev/null", O_RDWR);
    while (fd >= 0 && fd <= 2)
        fd = ::open("/dev/null", O_RDWR);
    ::close(fd);
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);
    std::signal(SIGCHLD, SIG_DFL); // waitpid() fails if SIGCHLD is ignored
}

int checked_output(int status) {
    using namespace arhost::host;
    return arhost::base::flush_stdout() ? status : print_error("cannot write to standard output", run_failed);
}

} // namespace

int main(int argc, char **argv) {
    using namespace arhost::host;
    using arhost::base::CommandLine;
    prepare_process();

    CommandLine app(
        "arhost overlays ray-traced objects on live video. Sources, trackers, ray tracers and outputs are plugins,\n"
        "each in its own process; a YAML file selects and configures them.\n"
        "Exit status: 0 success; 1 the run had failures; 2 invalid command line, configuration, scene or plugin;\n"
        "130 interrupted (docs/config.md).",
        "arhost");
    app.version("arhost " ARHOST_VERSION);

    Arguments arguments;
    add_run_options(app, arguments);
    CommandLine axes =
        app.group("Coordinates",
                  "The dissertation's options (docs/camera.md); they override 'coordinates:' in the configuration");
    axes.option("--ar", arguments.ar,
                "Profile of the tracker: 1 x-right y-back z-up, 2 x-right y-up z-front, 3 other");
    axes.option("--rt", arguments.rt, "Profile of the scene");
    axes.option("--g1,--g", arguments.g1, "First rotation, in degrees");
    axes.option("--x1,--x", arguments.axis1[0], "Axis of the first rotation: x");
    axes.option("--y1,--y", arguments.axis1[1], "Axis of the first rotation: y");
    axes.option("--z1,--z", arguments.axis1[2], "Axis of the first rotation: z");
    axes.option("--g2", arguments.g2, "Second rotation, in degrees");
    axes.option("--x2", arguments.axis2[0], "Axis of the second rotation: x");
    axes.option("--y2", arguments.axis2[1], "Axis of the second rotation: y");
    axes.option("--z2", arguments.axis2[2], "Axis of the second rotation: z");

    ReplayArguments replay_arguments;
    CommandLine replay_command = app.subcommand(
        "replay", "Repeat a recorded session (docs/sessions.md), or render a trajectory (docs/trajectories.md)");
    replay_command.option("SESSION", replay_arguments.session, "The folder of a session that sink_session recorded");
    replay_command.option("--trajectory", replay_arguments.trajectory, "Recorded camera poses, instead of a session")
        .type_name("FILE");
    replay_command.option("--scene", replay_arguments.scene, "The scene to render").type_name("FILE");
    replay_command.option("--tracker", replay_arguments.tracker, "The tracker, instead of the recorded one")
        .type_name("PLUGIN");
    replay_command
        .option("--raytracer", replay_arguments.raytracer,
                "The ray tracer, instead of the recorded one (for a trajectory, default rt_embree)")
        .type_name("PLUGIN");
    replay_command.flag("--with-pipeline", replay_arguments.with_pipeline,
                        "For a trajectory: also run source, tracker and compositor");
    replay_command
        .option("--config", arguments.file,
                "Configuration for components and scene; its outputs are ignored. For a session, replaces the "
                "recorded one")
        .type_name("FILE");
    replay_command
        .option("--width", replay_arguments.width, "Image width in px, if the trajectory has none (default 800)")
        .range(1, 16384);
    replay_command
        .option("--height", replay_arguments.height, "Image height in px, if the trajectory has none (default 600)")
        .range(1, 16384);
    replay_command.option("--frames", arguments.frames, "Stop after N frames").type_name("N").range(0.0, 1e15);
    replay_command.option("--output", replay_arguments.output, "Video, images or poses, by file extension")
        .type_name("FILE|none");
    replay_command.flag("--debug-view", arguments.debug_view,
                        "Draw the measurements of the tracker into every output that can (docs/tracking.md)");
    replay_command.option("--stats", replay_arguments.stats, "File for the statistics (JSON)").type_name("FILE");
    replay_command.option("--timeline", replay_arguments.timeline, "File for the times of each frame (CSV)")
        .type_name("FILE");
    add_configuration_options(replay_command, arguments);

    CommandLine latency_command =
        app.subcommand("latency", "Measure the time from the camera's lens to the display (docs/latency.md)");
    latency_command.option("FILE", arguments.file, "The configuration, with the camera and the output to measure")
        .required();
    latency_command.option("--frames", arguments.frames, "Stop after N frames (default 600)")
        .type_name("N")
        .range(0.0, 1e15);
    add_configuration_options(latency_command, arguments);

    bool no_open = false;
    CommandLine check_command = app.subcommand("check", "Check a configuration: open everything that a run opens");
    check_command.option("FILE", arguments.file, "The configuration").required();
    check_command.flag("--no-open", no_open,
                       "Check only the file, the plugins' options and the scene, for example without the camera");
    check_command
        .option("--run", arguments.frames, "Also process the first N frames and report what was found in them")
        .type_name("N")
        .range(1.0, 1e6);
    add_configuration_options(check_command, arguments);

    PluginsArguments plugins_arguments;
    CommandLine plugins_command = app.subcommand("plugins", "List the plugins; for unusable ones, print the reason");
    plugins_command.option("PLUGIN", plugins_arguments.plugins, "List only these plugins");
    plugins_command.flag("--options", plugins_arguments.with_options, "Also list the options of each plugin");
    const auto add_reads = [](CommandLine &command, std::vector<std::filesystem::path> &reads) {
        command.option("--reads", reads, "A folder with libraries that the plugins need (repeatable)")
            .existing_path()
            .check(arhost::sandbox::obstacle_to_grant)
            .type_name("FOLDER")
            .one_value_each();
    };
    add_reads(plugins_command, plugins_arguments.reads);

    DevicesArguments devices_arguments;
    CommandLine devices_command =
        app.subcommand("devices", "List cameras, GPUs and displays; for unusable ones, print the reason");
    devices_command.option("PLUGIN", devices_arguments.plugins, "List only the devices of these plugins");
    devices_command.flag("--json", devices_arguments.as_json, "Print JSON (docs/devices.schema.json)");
    add_reads(devices_command, devices_arguments.reads);

    CtlArguments ctl_arguments;
    CommandLine ctl_command = app.subcommand("ctl", "Send a command to a running arhost (docs/control.md)");
    ctl_command.option("COMMAND", ctl_arguments.command, "The command")
        .required()
        .one_of({arhost::run_config::control_commands.begin(), arhost::run_config::control_commands.end()});
    ctl_command.option("VALUE", ctl_arguments.values,
                       "freeze and record: on|off; load_scene: SCENE; swap: COMPONENT PLUGIN; set: COMPONENT OPTION "
                       "VALUE");
    ctl_command.option("--name", ctl_arguments.name, "Name of the run, the option 'listen' of its sink_control")
        .type_name("NAME")
        .show_default();
    ctl_command.flag("--json", ctl_arguments.json, "Print the answer as JSON");

    bool markdown = false;
    CommandLine schema_command = app.subcommand("schema", "Print the JSON Schema of configurations, for editors");
    schema_command.flag("--markdown", markdown, "Print the Markdown table of docs/config.md instead");

    NewPlugin plugin;
    CommandLine new_plugin_command =
        app.subcommand("new-plugin", "Create a working skeleton plugin (docs/backend-guide.md)");
    new_plugin_command.option("KIND", plugin.kind, "Kind of plugin").required().one_of(plugin_kinds);
    new_plugin_command.option("NAME", plugin.name, "Name of the plugin and its folder").required();
    new_plugin_command.option("--language", plugin.language, "Programming language")
        .required()
        .one_of(plugin_languages);
    new_plugin_command.option("--into", plugin.into, "Parent folder (default: current folder)").type_name("DIR");
    CommandLine conform_command =
        app.raw_subcommand("conform", "Test whether a plugin conforms to the ABI (docs/conformance.md)");
    CommandLine marker_command =
        app.raw_subcommand("marker", "Print markers and boards in their true size (docs/markers.md)");
    CommandLine calibrate_command =
        app.raw_subcommand("calibrate", "Calibrate a camera with a printed board (docs/calibration.md)");
    CommandLine map_command =
        app.raw_subcommand("map", "Learn where markers are relative to each other, from images (docs/maps.md)");
    std::string helped;
    CommandLine help_command = app.subcommand("help", "Print help about arhost or a command");
    help_command.option("COMMAND", helped, "The command").one_of(app.subcommands());

    if (const auto status = app.parse(argc, argv))
        return checked_output(*status);
    const auto command = [&]() -> int {
        if (help_command.selected() && (helped == "conform" || helped == "marker" || helped == "map" ||
                                        helped == "calibrate")) // programs with their own options
            return run_program(("arhost-" + helped).c_str(), {"--help"});
        if (help_command.selected()) {
            std::fputs(app.help(helped).c_str(), stdout);
            return success;
        }
        if (schema_command.selected())
            return print_schema(markdown);
        if (ctl_command.selected())
            return ctl(ctl_arguments);
        if (new_plugin_command.selected())
            return new_plugin(plugin, own_prefix());
        if (conform_command.selected())
            return run_program("arhost-conform", conform_command.arguments());
        if (marker_command.selected())
            return run_program("arhost-marker", marker_command.arguments());
        if (calibrate_command.selected())
            return run_program("arhost-calibrate", calibrate_command.arguments());
        if (map_command.selected())
            return run_program("arhost-map", map_command.arguments());
        arhost::supervise::Launcher launcher(own_folder() / "arhost-launcher");
        if (replay_command.selected())
            return replay(arguments, replay_arguments, launcher);
        if (latency_command.selected())
            return latency(arguments, launcher);
        if (check_command.selected())
            return check(arguments, !no_open, launcher);
        if (plugins_command.selected())
            return list_plugins(arguments, plugins_arguments, launcher);
        if (devices_command.selected())
            return devices(arguments, devices_arguments, launcher);
        if (arguments.file.empty()) {
            std::fputs(app.help().c_str(), stderr);
            return bad_configuration;
        }
        return run(arguments, launcher);
    };
    return exit_status_of([&] { return checked_output(command()); });
}
