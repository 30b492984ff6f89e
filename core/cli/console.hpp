// SPDX-License-Identifier: Apache-2.0
//
// Writes log messages and progress to stderr. On a terminal, the progress is a single line that is redrawn; otherwise
// a new line is printed every few seconds. A separate thread writes the output, so a stopped terminal (Ctrl-S) does
// not stop the video. If the thread's queue is full, lines are dropped.
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
} // namespace arhost::host

namespace arhost::cli {

class Console {
public:
    explicit Console(bool verbose);
    ~Console(); // clears the progress line and waits until all queued lines are written

    void log(arhost_severity severity, const std::string &component, const std::string &text);
    void show(const host::Progress &progress, const host::Statistics &statistics);

private:
    void clear_line();

    bool terminal_;
    bool line_shown_ = false;
    std::shared_ptr<spdlog::details::thread_pool> thread_;
    std::shared_ptr<spdlog::logger> log_, line_; // `log_` formats its lines; `line_` writes raw text
    std::chrono::steady_clock::time_point last_shown_{};
    std::uint64_t last_frame_ = 0;
};

} // namespace arhost::cli
