// SPDX-License-Identifier: Apache-2.0
//
// Log and progress on stderr. On a terminal, progress is one line that is redrawn; otherwise a line every few
// seconds. A thread writes the output, so that a stopped terminal (Ctrl-S) does not stop the video; when its queue is
// full, lines are dropped.
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
    ~Console(); // clears the progress line; waits until the queue is written

    void log(arhost_severity severity, const std::string &component, const std::string &text);
    void show(const Progress &progress, const Statistics &statistics);

private:
    void clear_line();

    bool terminal_;
    bool line_shown_ = false;
    std::shared_ptr<spdlog::details::thread_pool> thread_;
    std::shared_ptr<spdlog::logger> log_, line_; // formatted lines; raw text
    std::chrono::steady_clock::time_point last_shown_{};
    std::uint64_t last_frame_ = 0;
};

} // namespace arhost::host
