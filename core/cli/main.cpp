// SPDX-License-Identifier: Apache-2.0
//
// Command line of arhost.
#include "base/program.hpp"
#include "cli/commands.hpp"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <unistd.h>

namespace {

using namespace arhost::cli;
using arhost::command_line::CommandLine;
namespace base = arhost::base;

void add_coordinates(CommandLine &app, Arguments &arguments) {
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
}

CommandLine add_replay(CommandLine &app, Arguments &arguments, ReplayArguments &replay) {
    CommandLine command = app.subcommand(
        "replay", "Repeat a recorded session (docs/sessions.md), or render a trajectory (docs/trajectories.md)");
    command.option("SESSION", replay.session, "The folder of a session that sink_session recorded");
    command.option("--trajectory", replay.trajectory, "Recorded camera poses, instead of a session")
        .type_name("FILE");
    command.option("--scene", replay.scene, "The scene to render").type_name("FILE");
    command.option("--tracker", replay.tracker, "The tracker, instead of the recorded one").type_name("PLUGIN");
    command
        .option("--raytracer", replay.raytracer,
                "The ray tracer, instead of the recorded one (for a trajectory, default rt_embree)")
        .type_name("PLUGIN");
    command
        .option("--allow", replay.allow,
                "Grant what the session asks for beyond its folder: a permission such as gpu, a file or a folder "
                "(repeatable)")
        .type_name("WHAT");
    command.flag("--with-pipeline", replay.with_pipeline,
                 "For a trajectory: also run source, tracker and compositor");
    command
        .option("--config", arguments.file,
                "Configuration for components and scene; its outputs are ignored. For a session, replaces the "
                "recorded one")
        .type_name("FILE");
    command.option("--width", replay.width, "Image width in px, if the trajectory has none (default 800)")
        .range(1, 16384);
    command.option("--height", replay.height, "Image height in px, if the trajectory has none (default 600)")
        .range(1, 16384);
    command.option("--frames", arguments.frames, "Stop after N frames").type_name("N").range(0.0, 1e15);
    command.option("--output", replay.output, "Video, images or poses, by file extension").type_name("FILE|none");
    command.flag("--debug-view", arguments.debug_view,
                 "Draw the measurements of the tracker into every output that can (docs/tracking.md)");
    command.option("--stats", replay.stats, "File for the statistics (JSON)").type_name("FILE");
    command.option("--timeline", replay.timeline, "File for the times of each frame (CSV)").type_name("FILE");
    add_configuration_options(command, arguments);
    return command;
}

CommandLine add_latency(CommandLine &app, Arguments &arguments) {
    CommandLine command =
        app.subcommand("latency", "Measure the time from the camera's lens to the display (docs/latency.md)");
    command.option("FILE", arguments.file, "The configuration, with the camera and the output to measure").required();
    command.option("--frames", arguments.frames, "Stop after N frames (default 600)").type_name("N").range(0.0, 1e15);
    add_configuration_options(command, arguments);
    return command;
}

CommandLine add_check(CommandLine &app, Arguments &arguments, bool &no_open) {
    CommandLine command = app.subcommand("check", "Check a configuration: open everything that a run opens");
    command.option("FILE", arguments.file, "The configuration").required();
    command.flag("--no-open", no_open,
                 "Check only the file, the plugins' options and the scene, for example without the camera");
    command.option("--run", arguments.frames, "Also process the first N frames and report what was found in them")
        .type_name("N")
        .range(1.0, 1e6);
    add_configuration_options(command, arguments);
    return command;
}

// The subcommands that separate programs implement, because the host does not need their code: `arhost devices` runs
// arhost-devices.
constexpr struct {
    const char *command, *description;
} programs[] = {
    {"plugins", "List the plugins; for unusable ones, print the reason"},
    {"devices", "List cameras, GPUs and displays; for unusable ones, print the reason"},
    {"ctl", "Send a command to a running arhost (docs/control.md)"},
    {"schema", "Print the JSON Schema of configurations, for editors"},
    {"new-plugin", "Create a working skeleton plugin (docs/backend-guide.md)"},
    {"conform", "Test whether a plugin conforms to the ABI (docs/conformance.md)"},
    {"marker", "Print markers and boards in their true size (docs/markers.md)"},
    {"calibrate", "Calibrate a camera with a printed board (docs/calibration.md)"},
    {"place", "Put a model on a marker: write a scene and a configuration, and run them"},
    {"map", "Learn where markers are relative to each other, from images (docs/maps.md)"},
    {"view", "Show a model or a scene in a window, or write a picture or a film (docs/scenes.md)"},
};

// Replaces this process with the program of the subcommand (exec).
int run_program(const std::string &command, std::vector<std::string> arguments) {
    const std::string program = base::own_folder() / ("arhost-" + command);
    arguments.insert(arguments.begin(), program);
    std::vector<char *> argv;
    argv.reserve(arguments.size() + 1);
    for (std::string &argument : arguments)
        argv.push_back(argument.data());
    argv.push_back(nullptr);
    ::execv(program.c_str(), argv.data());
    throw base::InvalidInput(program + " cannot be executed: " + std::strerror(errno));
}

int print_help(const CommandLine &app, const std::string &command) {
    for (const auto &program : programs)
        if (command == program.command)
            return run_program(command, {"--help"});
    std::fputs(app.help(command).c_str(), stdout);
    return base::success;
}

} // namespace

int main(int argc, char **argv) {
    base::prepare_process();
    CommandLine app(
        "arhost overlays ray-traced objects on live video. Sources, trackers, ray tracers and outputs are plugins,\n"
        "each in its own process; a YAML file selects and configures them.\n"
        "Exit status: 0 success; 1 the run had failures; 2 invalid command line, configuration, scene or plugin;\n"
        "130 interrupted (docs/config.md).",
        "arhost");
    app.version("arhost " ARHOST_VERSION);
    Arguments arguments;
    ReplayArguments replay_arguments;
    bool no_open = false;
    std::string helped;
    add_run_options(app, arguments);
    add_coordinates(app, arguments);
    CommandLine run_command = app.subcommand("run", "Run a configuration, as without this word");
    add_run_options(run_command, arguments);
    add_coordinates(run_command, arguments);
    const CommandLine replay_command = add_replay(app, arguments, replay_arguments);
    const CommandLine latency_command = add_latency(app, arguments);
    const CommandLine check_command = add_check(app, arguments, no_open);
    std::vector<CommandLine> program_commands;
    for (const auto &[command, description] : programs)
        program_commands.push_back(app.raw_subcommand(command, description));
    CommandLine help_command = app.subcommand("help", "Print help about arhost or a command");
    help_command.option("COMMAND", helped, "The command").one_of(app.subcommands());

    return base::exit_status_of([&]() -> int {
        if (const auto status = app.parse(argc, argv))
            return *status;
        if (help_command.selected())
            return print_help(app, helped);
        for (std::size_t i = 0; i < program_commands.size(); ++i)
            if (program_commands[i].selected())
                return run_program(programs[i].command, program_commands[i].arguments());
        arhost::supervise::Launcher launcher(base::own_folder() / "arhost-launcher");
        if (replay_command.selected())
            return replay(arguments, replay_arguments, launcher);
        if (latency_command.selected())
            return latency(arguments, launcher);
        if (check_command.selected())
            return check(arguments, !no_open, launcher);
        if (arguments.file.empty()) {
            std::fputs(app.help().c_str(), stderr);
            return base::invalid_input;
        }
        return run(arguments, launcher);
    });
}
