// SPDX-License-Identifier: Apache-2.0
//
// What the user sees while arhost runs, on stderr: log lines, and how far the run is. On a terminal the
// latter is one line that is drawn anew, elsewhere a plain line now and then.
#pragma once

#include "host/pipeline.hpp"

#include <spdlog/logger.h>

#include <memory>

namespace arhost::host {

class Console {
public:
    explicit Console(bool verbose);
    ~Console(); // leaves the cursor on a line of its own

    void log(arhost_severity severity, const std::string &component, const std::string &text);
    void show(const Progress &progress, const Statistics &statistics);

private:
    void clear_line();

    bool terminal_;
    bool line_shown_ = false;
    std::shared_ptr<spdlog::logger> logger_;
    std::chrono::steady_clock::time_point last_shown_{};
    std::uint64_t last_frame_ = 0;
};

} // namespace arhost::host
