// SPDX-License-Identifier: Apache-2.0
//
// arhost-inprocess: `arhost --config FILE` in one process, without deadlines and sandbox, so that a debugger,
// valgrind or a sanitizer sees a plugin at work. A plugin that dies takes all along.
#include "host/commands.hpp"
#include "inprocess/thread_starter.hpp"
#include "worker/session.hpp"

#include <CLI/CLI.hpp>

#include <csignal>
#include <cstdio>

int main(int argc, char **argv) {
    using namespace arhost;
    std::signal(SIGPIPE, SIG_IGN);
    worker::retain_freed_memory();
    CLI::App app("arhost-inprocess runs a configuration as arhost does, but with every plugin in this one process\n"
                 "and without deadlines and sandbox: for debuggers.");
    app.set_version_flag("--version", "arhost-inprocess " ARHOST_VERSION);
    host::Arguments arguments;
    arguments.in_process = true;
    app.add_option("--config", arguments.file, "The configuration to run (docs/config.md)")
        ->type_name("FILE")
        ->required();
    app.add_option("--set", arguments.settings, "Override a value: key.path=value (again for more)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    app.add_option("--frames", arguments.frames, "Stop after so many frames")
        ->type_name("N")
        ->check(CLI::Range(0.0, 1e15));
    app.add_flag("-v,--verbose", arguments.verbose, "Log what components say in detail");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError &error) {
        return app.exit(error) == 0 ? host::success : host::bad_configuration;
    }
    try {
        inprocess::ThreadStarter starter;
        return host::run(arguments, starter);
    } catch (const yaml::Error &error) {
        std::fprintf(stderr, "error: %s\n", error.what());
        return host::bad_configuration;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "error: %s\n", error.what());
        return host::run_failed;
    }
}
