// SPDX-License-Identifier: Apache-2.0
// Runs a sink in another process, to kill it there. The process executes this program again, because a plugin that
// has been used does not survive a fork.
#pragma once

#include "base/unique_fd.hpp"
#include "conformance/sink_run.hpp"

#include <sys/types.h>

namespace arhost::conformance {

class SinkProcess {
public:
    struct Work {
        std::string folder; // in the test's scratch folder
        std::uint64_t frames;
        Size size;
    };
    // The process writes its frames as fast as possible, then waits to be killed.
    SinkProcess(Context &context, const Work &work);
    ~SinkProcess() { kill(); }
    SinkProcess(const SinkProcess &) = delete;
    SinkProcess &operator=(const SinkProcess &) = delete;

    void wait_until_written(std::uint64_t frames); // throws Failure if the process ends first
    void kill();                                   // by SIGTERM, then SIGKILL a second later; waits for the process

private:
    pid_t pid_ = 0;                            // 0 once reaped
    base::UniqueFd work_pipe_, progress_pipe_; // the process ends when work_pipe_ is closed
    std::uint64_t count_ = 0;
};

} // namespace arhost::conformance
