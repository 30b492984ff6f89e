// SPDX-License-Identifier: Apache-2.0
//
// arhost: the command line.
#include "base/command_line.hpp"
#include "base/text.hpp"
#include "base/write_all.hpp"
#include "host/commands.hpp"
#include "host/new_plugin.hpp"
#include "yaml/yaml.hpp"

#include <csignal>
#include <cstdio>
#include <fcntl.h>
#include <filesystem>
#include <unistd.h>

namespace {

// What the shell may have handed over: closed standard streams, whose numbers a socket must not get, signals that are
// ignored, and signals that would end the run where an error message is meant.
void prepare_process() {
    int fd = ::open("/dev/null", O_RDWR);
    while (fd >= 0 && fd <= 2)
        fd = ::open("/dev/null", O_RDWR);
    ::close(fd);
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);
    std::signal(SIGCHLD, SIG_DFL); // or no child could be waited for
}

// One line, which no name of a file makes two.
int refuse(const std::string &why, int exit_status) {
    std::fprintf(stderr, "error: %s\n", arhost::base::printable(why).c_str());
    return exit_status;
}

int told(int status) {
    return arhost::base::flush_stdout() ? status
                                        : refuse("standard output can't be written", arhost::host::run_failed);
}

} // namespace

int main(int argc, char **argv) {
    using namespace arhost::host;
    using arhost::base::CommandLine;
    prepare_process();

    CommandLine app(
        "arhost lays ray-traced objects over live video. Its trackers, ray tracers, sources and outputs are\n"
        "plugins, each in a process of its own; a YAML file says which run.");
    app.version("arhost " ARHOST_VERSION);

    Arguments arguments;
    const auto add_configuration_options = [&](CommandLine &command) {
        command.option("--set", arguments.settings, "Override a value: key.path=value (again for more)")
            .type_name("KEY=VALUE")
            .one_value_each();
        command.flag("-v,--verbose", arguments.verbose, "Log what components say in detail");
    };
    app.option("--config", arguments.file, "The configuration to run (docs/config.md)").type_name("FILE");
    add_configuration_options(app);
    app.option("--frames", arguments.frames, "Stop after so many frames").type_name("N").range(0.0, 1e15);
    CommandLine axes = app.group(
        "Coordinates", "The dissertation's options (docs/camera.md); they stand above 'coordinates:' in the file");
    axes.option("--ar", arguments.ar,
                "Profile of the tracker: 1 x-right y-back z-up, 2 x-right y-up z-front, 3 other");
    axes.option("--rt", arguments.rt, "Profile of the scene, likewise");
    axes.option("--g1,--g", arguments.g1, "First rotation, degrees");
    axes.option("--x1,--x", arguments.axis1[0], "Its axis");
    axes.option("--y1,--y", arguments.axis1[1]);
    axes.option("--z1,--z", arguments.axis1[2]);
    axes.option("--g2", arguments.g2, "Second rotation, degrees");
    axes.option("--x2", arguments.axis2[0], "Its axis");
    axes.option("--y2", arguments.axis2[1]);
    axes.option("--z2", arguments.axis2[2]);

    ReplayArguments replay_arguments;
    CommandLine replay_command =
        app.subcommand("replay", "Trace the cameras of a recorded run again (docs/trajectories.md)");
    replay_command.option("--trajectory", replay_arguments.trajectory, "The recorded cameras")
        .type_name("FILE")
        .required();
    replay_command.option("--scene", replay_arguments.scene, "The scene to trace").type_name("FILE");
    replay_command.option("--raytracer", replay_arguments.raytracer, "The ray tracer's plugin (rt_embree)")
        .type_name("PLUGIN");
    replay_command.flag("--with-pipeline", replay_arguments.with_pipeline,
                        "With source, tracker and composite at work too, not the ray tracer alone");
    replay_command.option("--config", arguments.file, "Take components and scene from here, but no outputs")
        .type_name("FILE");
    replay_command.option("--width", replay_arguments.width, "Image width in px, where FILE tells none (800)")
        .range(1, 16384);
    replay_command.option("--height", replay_arguments.height, "Image height in px (600)").range(1, 16384);
    replay_command.option("--frames", arguments.frames, "Stop after so many frames").type_name("N").range(0.0, 1e15);
    replay_command.option("--output", replay_arguments.output, "A film, images, poses; by the name's extension")
        .type_name("FILE|none");
    replay_command.option("--stats", replay_arguments.stats, "Where the statistics are written (JSON)")
        .type_name("FILE");
    replay_command.option("--timeline", replay_arguments.timeline, "Where each frame's times are written (CSV)")
        .type_name("FILE");
    add_configuration_options(replay_command);

    CommandLine check_command = app.subcommand("check", "Check a configuration, its plugins' options and its scene");
    check_command.option("FILE", arguments.file, "The configuration").required();
    add_configuration_options(check_command);

    PluginsArguments plugins_arguments;
    CommandLine plugins_command = app.subcommand("plugins", "List the plugins, or why one can't be used");
    plugins_command.flag("--options", plugins_arguments.with_options, "With their options");
    plugins_command.flag("--devices", plugins_arguments.with_devices,
                         "With the devices that they could run on; drivers may take some time to load");
    plugins_command
        .option("--reads", plugins_arguments.reads, "A folder where libraries of theirs lie (again for more)")
        .existing_path()
        .type_name("FOLDER")
        .one_value_each();

    bool markdown = false;
    CommandLine schema_command = app.subcommand("schema", "Print the JSON Schema of configurations, for editors");
    schema_command.flag("--markdown", markdown, "As the table of docs/config.md");

    NewPlugin plugin;
    CommandLine new_plugin_command =
        app.subcommand("new-plugin", "Make a working plugin to begin with (docs/backend-guide.md)");
    new_plugin_command.option("KIND", plugin.kind, "What it is to be").required().one_of(plugin_kinds);
    new_plugin_command.option("NAME", plugin.name, "Its name, and its folder's").required();
    new_plugin_command.option("--language", plugin.language, "What to write it in")
        .required()
        .one_of(plugin_languages);
    new_plugin_command.option("--into", plugin.into, "The folder to make it in (here)").type_name("DIR");
    CommandLine conform_command =
        app.raw_subcommand("conform", "Try whether a plugin keeps the ABI's promises (docs/conformance.md)");

    if (const auto status = app.parse(argc, argv))
        return told(*status);
    const auto command = [&]() -> int {
        if (schema_command.selected())
            return print_schema(markdown);
        if (new_plugin_command.selected())
            return new_plugin(plugin, own_prefix());
        if (conform_command.selected())
            return conform(conform_command.arguments());
        arhost::supervise::Launcher launcher(own_folder() / "arhost-launcher");
        if (replay_command.selected())
            return replay(arguments, replay_arguments, launcher);
        if (check_command.selected())
            return check(arguments, launcher);
        if (plugins_command.selected())
            return list_plugins(arguments, plugins_arguments, launcher);
        if (arguments.file.empty()) {
            std::fputs(app.help().c_str(), stderr);
            return bad_configuration;
        }
        return run(arguments, launcher);
    };
    try {
        return told(command());
    } catch (const arhost::yaml::Error &error) {
        return refuse(error.what(), bad_configuration);
    } catch (
        const std::filesystem::filesystem_error &error) { // a name too long, a folder that may not be looked into
        return refuse(error.path1().string() + ": " + error.code().message(), bad_configuration);
    } catch (const std::exception &error) {
        return refuse(error.what(), run_failed);
    }
}
