// SPDX-License-Identifier: Apache-2.0
//
// arhost: the command line.
#include "base/text.hpp"
#include "base/usage.hpp"
#include "base/write_all.hpp"
#include "host/commands.hpp"
#include "host/new_plugin.hpp"

#include <CLI/CLI.hpp>

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
    return arhost::base::stdout_is_written() ? status
                                             : refuse("standard output can't be written", arhost::host::run_failed);
}

} // namespace

int main(int argc, char **argv) {
    using namespace arhost::host;
    prepare_process();

    CLI::App app(
        "arhost lays ray-traced objects over live video. Its trackers, ray tracers, sources and outputs are\n"
        "plugins, each in a process of its own; a YAML file says which run.");
    app.set_version_flag("--version", "arhost " ARHOST_VERSION);
    app.require_subcommand(0, 1);
    app.get_formatter()->column_width(34);
    app.failure_message(arhost::base::usage_failure);

    Arguments arguments;
    const auto add_configuration_options = [&](CLI::App &command) {
        command.add_option("--set", arguments.settings, "Override a value: key.path=value (again for more)")
            ->type_name("KEY=VALUE")
            ->allow_extra_args(false);
        command.add_flag("-v,--verbose", arguments.verbose, "Log what components say in detail");
    };
    app.add_option("--config", arguments.file, "The configuration to run (docs/config.md)")->type_name("FILE");
    add_configuration_options(app);
    app.add_option("--frames", arguments.frames, "Stop after so many frames")
        ->type_name("N")
        ->check(CLI::Range(0.0, 1e15));
    CLI::Option_group &axes = *app.add_option_group(
        "Coordinates", "The dissertation's options (docs/camera.md); they stand above 'coordinates:' in the file");
    axes.add_option("--ar", arguments.ar,
                    "Profile of the tracker: 1 x-right y-back z-up, 2 x-right y-up z-front, 3 other");
    axes.add_option("--rt", arguments.rt, "Profile of the scene, likewise");
    axes.add_option("--g1,--g", arguments.g1, "First rotation, degrees");
    axes.add_option("--x1,--x", arguments.axis1[0], "Its axis");
    axes.add_option("--y1,--y", arguments.axis1[1]);
    axes.add_option("--z1,--z", arguments.axis1[2]);
    axes.add_option("--g2", arguments.g2, "Second rotation, degrees");
    axes.add_option("--x2", arguments.axis2[0], "Its axis");
    axes.add_option("--y2", arguments.axis2[1]);
    axes.add_option("--z2", arguments.axis2[2]);

    ReplayArguments replay_arguments;
    CLI::App *replay_command =
        app.add_subcommand("replay", "Trace the cameras of a recorded run again (docs/trajectories.md)");
    replay_command->add_option("--trajectory", replay_arguments.trajectory, "The recorded cameras")
        ->type_name("FILE")
        ->required();
    replay_command->add_option("--scene", replay_arguments.scene, "The scene to trace")->type_name("FILE");
    replay_command->add_option("--raytracer", replay_arguments.raytracer, "The ray tracer's plugin (rt_embree)")
        ->type_name("PLUGIN");
    replay_command->add_flag("--with-pipeline", replay_arguments.with_pipeline,
                             "With source, tracker and composite at work too, not the ray tracer alone");
    replay_command->add_option("--config", arguments.file, "Take components and scene from here, but no outputs")
        ->type_name("FILE");
    replay_command->add_option("--width", replay_arguments.width, "Image width in px, where FILE tells none (800)")
        ->check(CLI::Range(1, 16384));
    replay_command->add_option("--height", replay_arguments.height, "Image height in px (600)")
        ->check(CLI::Range(1, 16384));
    replay_command->add_option("--frames", arguments.frames, "Stop after so many frames")
        ->type_name("N")
        ->check(CLI::Range(0.0, 1e15));
    replay_command->add_option("--output", replay_arguments.output, "A film, images, poses; by the name's extension")
        ->type_name("FILE|none");
    replay_command->add_option("--stats", replay_arguments.stats, "Where the statistics are written (JSON)")
        ->type_name("FILE");
    replay_command->add_option("--timeline", replay_arguments.timeline, "Where each frame's times are written (CSV)")
        ->type_name("FILE");
    add_configuration_options(*replay_command);

    CLI::App *check_command =
        app.add_subcommand("check", "Check a configuration, its plugins' options and its scene");
    check_command->add_option("FILE", arguments.file, "The configuration")->required();
    add_configuration_options(*check_command);

    PluginsArguments plugins_arguments;
    CLI::App *plugins_command = app.add_subcommand("plugins", "List the plugins, or why one can't be used");
    plugins_command->add_flag("--options", plugins_arguments.with_options, "With their options");
    plugins_command->add_flag("--devices", plugins_arguments.with_devices,
                              "With the devices that they could run on; drivers may take some time to load");
    plugins_command
        ->add_option("--reads", plugins_arguments.reads, "A folder where libraries of theirs lie (again for more)")
        ->check(CLI::ExistingPath)
        ->type_name("FOLDER")
        ->allow_extra_args(false);

    bool markdown = false;
    CLI::App *schema_command = app.add_subcommand("schema", "Print the JSON Schema of configurations, for editors");
    schema_command->add_flag("--markdown", markdown, "As the table of docs/config.md");

    NewPlugin plugin;
    CLI::App *new_plugin_command =
        app.add_subcommand("new-plugin", "Make a working plugin to begin with (docs/backend-guide.md)");
    new_plugin_command->add_option("KIND", plugin.kind, "What it is to be")
        ->required()
        ->check(CLI::IsMember(plugin_kinds));
    new_plugin_command->add_option("NAME", plugin.name, "Its name, and its folder's")->required();
    new_plugin_command->add_option("--language", plugin.language, "What to write it in")
        ->required()
        ->check(CLI::IsMember(plugin_languages));
    new_plugin_command->add_option("--into", plugin.into, "The folder to make it in (here)")->type_name("DIR");
    CLI::App *conform_command =
        app.add_subcommand("conform", "Try whether a plugin keeps the ABI's promises (docs/conformance.md)");
    conform_command->set_help_flag(); // the program that it becomes has its own
    conform_command->prefix_command();

    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError &error) {
        return told(app.exit(error) == 0 ? success : bad_configuration);
    }
    const auto command = [&]() -> int {
        if (*schema_command)
            return print_schema(markdown);
        if (*new_plugin_command)
            return new_plugin(plugin, own_prefix());
        if (*conform_command)
            return conform(conform_command->remaining());
        arhost::supervise::Launcher launcher(own_folder() / "arhost-launcher");
        if (*replay_command)
            return replay(arguments, replay_arguments, launcher);
        if (*check_command)
            return check(arguments, launcher);
        if (*plugins_command)
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
