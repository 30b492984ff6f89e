// SPDX-License-Identifier: Apache-2.0
#include "cli/commands.hpp"

namespace arhost::cli {

void add_configuration_options(command_line::CommandLine &command, Arguments &arguments) {
    command.option("--set", arguments.settings, "Override a value: key.path=value (repeatable)")
        .type_name("KEY=VALUE")
        .one_value_each();
    command.flag("-v,--verbose", arguments.verbose, "Log debug messages of components");
}

command_line::Option add_run_options(command_line::CommandLine &command, Arguments &arguments) {
    const command_line::Option config =
        command.option("--config,FILE", arguments.file, "The configuration to run (docs/config.md)")
            .type_name("FILE");
    add_configuration_options(command, arguments);
    command.option("--frames", arguments.frames, "Stop after N frames").type_name("N").range(0.0, 1e15);
    command.flag("--allow-no-target", arguments.allow_no_target,
                 "Exit with status 0 even if the tracker has seen no marker in any frame");
    command.flag("--debug-view", arguments.debug_view,
                 "Draw the measurements of the tracker into every output that can (docs/tracking.md)");
    command.flag("--watch", arguments.watch,
                 "Apply edits of the configuration and of the scene while the video runs (docs/control.md)");
    return config;
}

} // namespace arhost::cli
