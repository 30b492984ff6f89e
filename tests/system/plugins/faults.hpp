// SPDX-License-Identifier: Apache-2.0
//
// Options by which a test plugin fails, and the number that its frames bear.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <thread>
#include <unistd.h>

namespace arhost::test {

#define ARHOST_FAULT_OPTIONS                                                                                         \
    option(ARHOST_OPTION_INTEGER, "crash_at", "-1", "Dies of SIGSEGV at this frame, each time; -1: never"),          \
        option(ARHOST_OPTION_INTEGER, "hang_at", "-1", "Never returns from this frame; -1: never"),                  \
        option(ARHOST_OPTION_INTEGER, "error_at", "-1", "Returns an error for this frame; -1: never"),               \
        option(ARHOST_OPTION_REAL, "delay_ms", "0", "Sleeps so long in each frame, in ms", 0, 60000)

class Faults {
public:
    explicit Faults(const Options &options)
        : crash_at_(options.integer("crash_at")), hang_at_(options.integer("hang_at")),
          error_at_(options.integer("error_at")), delay_ms_(options.real("delay_ms")) {}
    void at(std::uint64_t sequence) const {
        const auto frame = static_cast<std::int64_t>(sequence);
        if (frame == crash_at_) {
            std::signal(SIGSEGV, SIG_DFL); // sanitizers have a handler of their own
            std::raise(SIGSEGV);
        }
        while (frame == hang_at_)
            ::pause();
        if (frame == error_at_)
            throw Failure(ARHOST_ERROR_INTERNAL, "an error, as asked for");
        if (delay_ms_ > 0)
            std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(delay_ms_));
    }

private:
    std::int64_t crash_at_, hang_at_, error_at_;
    double delay_ms_;
};

} // namespace arhost::test
