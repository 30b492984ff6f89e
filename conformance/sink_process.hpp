// SPDX-License-Identifier: Apache-2.0
//
// A sink at work in a process of its own, to be killed there: this program executed anew, since a plugin that has
// been used does not live through a fork.
#pragma once

#include "base/unique_fd.hpp"
#include "conformance/sink_run.hpp"

#include <sys/types.h>

namespace arhost::conformance {

class SinkProcess {
public:
    struct Work {
        std::string folder; // of the test's own folder
        std::uint64_t frames;
        Size size;
    };
    // It writes its frames as fast as it can, and then waits for its end.
    SinkProcess(Context &context, const Work &work);
    ~SinkProcess() { kill(); }
    SinkProcess(const SinkProcess &) = delete;
    SinkProcess &operator=(const SinkProcess &) = delete;

    void wait_until_written(std::uint64_t frames); // throws Failure where it ends before
    void kill();                                   // by SIGTERM, and SIGKILL a second later; returns once it is gone

private:
    pid_t pid_ = 0;                   // 0: reaped
    base::UniqueFd orders_, written_; // while the former is open, it stays
    std::uint64_t count_ = 0;
};

} // namespace arhost::conformance
