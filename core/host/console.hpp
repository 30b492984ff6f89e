// SPDX-License-Identifier: Apache-2.0
//
// What the user sees while arhost runs, on stderr: log lines, and how far the run is. On a terminal the
// latter is one line that is drawn anew, elsewhere a plain line now and then. A thread writes them, so that
// a terminal that is halted (Ctrl-S) does not halt the video; what it has no room for is lost.
#pragma once

#include <arhost/arhost.h>

#include <spdlog/async.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

namespace arhost::host {

struct Progress;
struct Statistics;

class Console {
public:
    explicit Console(bool verbose);
    ~Console(); // leaves the cursor on a line of its own; waits until all is written

    void log(arhost_severity severity, const std::string &component, const std::string &text);
    void show(const Progress &progress, const Statistics &statistics);

private:
    void clear_line();

    bool terminal_;
    bool line_shown_ = false;
    std::shared_ptr<spdlog::details::thread_pool> thread_;
    std::shared_ptr<spdlog::logger> log_, line_; // whole lines, and text as it is
    std::chrono::steady_clock::time_point last_shown_{};
    std::uint64_t last_frame_ = 0;
};

} // namespace arhost::host
