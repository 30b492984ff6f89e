// SPDX-License-Identifier: Apache-2.0
//
// arhost-inprocess: runs a configuration like `arhost --config FILE`, but in one process and without deadlines and
// sandbox, for debuggers, valgrind and sanitizers. If a plugin crashes, the whole program crashes.
#include "base/command_line.hpp"
#include "host/commands.hpp"
#include "inprocess/thread_starter.hpp"
#include "worker/session.hpp"
#include "yaml/yaml.hpp"

#include <csignal>
#include <cstdio>

int main(int argc, char **argv) {
    using namespace arhost;
    std::signal(SIGPIPE, SIG_IGN);
    worker::retain_freed_memory();
    base::CommandLine app(
        "arhost-inprocess runs a configuration like arhost, but with all plugins in one process and without\n"
        "deadlines or sandbox. Intended for debuggers, valgrind and sanitizers.");
    app.version("arhost-inprocess " ARHOST_VERSION);
    host::Arguments arguments;
    arguments.in_process = true;
    app.option("--config,FILE", arguments.file, "The configuration to run (docs/config.md)")
        .type_name("FILE")
        .required();
    app.option("--set", arguments.settings, "Override a value: key.path=value (repeatable)")
        .type_name("KEY=VALUE")
        .one_value_each();
    app.option("--frames", arguments.frames, "Stop after N frames").type_name("N").range(0.0, 1e15);
    app.flag("--allow-no-target", arguments.allow_no_target,
             "Exit with status 0 even if the tracker has seen no marker in any frame");
    app.flag("-v,--verbose", arguments.verbose, "Log debug messages of components");
    if (const auto status = app.parse(argc, argv))
        return *status;
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
