// SPDX-License-Identifier: Apache-2.0
//
// arhost-inprocess: runs a configuration like `arhost --config FILE`, but in one process and without deadlines and
// sandbox, for debuggers, valgrind and sanitizers. If a plugin crashes, the whole program crashes.
#include "base/program.hpp"
#include "cli/commands.hpp"
#include "inprocess/thread_starter.hpp"
#include "worker/session.hpp"

#include <csignal>

int main(int argc, char **argv) {
    using namespace arhost;
    std::signal(SIGPIPE, SIG_IGN);
    worker::retain_freed_memory();
    command_line::CommandLine app(
        "arhost-inprocess runs a configuration like arhost, but with all plugins in one process and without\n"
        "deadlines or sandbox. Intended for debuggers, valgrind and sanitizers.");
    app.version("arhost-inprocess " ARHOST_VERSION);
    cli::Arguments arguments;
    arguments.in_process = true;
    add_run_options(app, arguments).required();
    return base::exit_status_of([&] {
        if (const auto status = app.parse(argc, argv))
            return *status;
        inprocess::ThreadStarter starter;
        return cli::run(arguments, starter);
    });
}
