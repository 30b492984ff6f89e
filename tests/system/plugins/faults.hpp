// SPDX-License-Identifier: Apache-2.0
//
// Options that make a test plugin fail at a given frame.
#pragma once

#include "misbehave.h"

#include <arhost-cpp/plugin.hpp>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <thread>
#include <unistd.h>

namespace arhost::test {

#define ARHOST_FAULT_OPTIONS                                                                                         \
    option(ARHOST_OPTION_INTEGER, "crash_at", "-1", "Crashes with SIGSEGV at this frame; -1: never"),                \
        option(ARHOST_OPTION_INTEGER, "exit_at", "-1", "Calls exit(0) at this frame; -1: never"),                    \
        option(ARHOST_OPTION_INTEGER, "hang_at", "-1", "Never returns from this frame; -1: never"),                  \
        option(ARHOST_OPTION_BOOL, "ignore_abort", "false", "Ignores SIGABRT"),                                      \
        option(ARHOST_OPTION_INTEGER, "error_at", "-1", "Returns an error for this frame; -1: never"),               \
        option(ARHOST_OPTION_INTEGER, "error", "-8", "Status to return with error_at"),                              \
        option(ARHOST_OPTION_INTEGER, "close_control_at", "-1", "Closes descriptor 3 at this frame; -1: never"),     \
        option(ARHOST_OPTION_INTEGER, "fork_at", "-1", "Forks two children, listed in children.txt; -1: never"),     \
        option(ARHOST_OPTION_REAL, "delay_ms", "0", "Delay per frame, in ms", 0, 60000)

class Faults {
public:
    explicit Faults(const Options &options)
        : crash_at_(options.integer("crash_at")), exit_at_(options.integer("exit_at")),
          hang_at_(options.integer("hang_at")), error_at_(options.integer("error_at")),
          error_(static_cast<arhost_status>(options.integer("error"))),
          close_control_at_(options.integer("close_control_at")), fork_at_(options.integer("fork_at")),
          delay_ms_(options.real("delay_ms")) {
        if (options.boolean("ignore_abort"))
            std::signal(SIGABRT, SIG_IGN);
        misbehave_install();
    }
    void at(std::uint64_t sequence) const {
        const auto frame = static_cast<std::int64_t>(sequence);
        if (frame == crash_at_) {
            (void)!::write(STDERR_FILENO, "last words: \xff\xc3(\n", 16); // text that is not valid UTF-8
            std::signal(SIGSEGV, SIG_DFL); // removes the handler that sanitizers install
            std::raise(SIGSEGV);
        }
        if (frame == exit_at_)
            ::_exit(0);
        while (frame == hang_at_)
            ::pause();
        if (frame == close_control_at_)
            ::close(3);
        if (frame == fork_at_)
            leave_children();
        if (misbehave_if_requested() || frame == error_at_)
            throw Failure(error_, "an error, as requested");
        if (delay_ms_ > 0)
            std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(delay_ms_));
    }

private:
    // Creates two child processes: one in this process group, and one in a new session, like a daemon.
    static void leave_children() {
        std::string pids;
        for (const bool daemon : {false, true}) {
            int ready[2];
            if (::pipe(ready) != 0)
                std::abort();
            const pid_t child = ::fork();
            if (child == 0) {
                if (daemon)
                    ::setsid();
                (void)!::write(ready[1], "!", 1);
                for (;;)
                    ::pause();
            }
            char byte;
            (void)!::read(ready[0], &byte, 1);
            ::close(ready[0]);
            ::close(ready[1]);
            pids += std::to_string(child) + "\n";
        }
        std::ofstream("children.txt") << pids << std::flush;
    }

    std::int64_t crash_at_, exit_at_, hang_at_, error_at_;
    arhost_status error_;
    std::int64_t close_control_at_, fork_at_;
    double delay_ms_;
};

} // namespace arhost::test
