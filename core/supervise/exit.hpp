// SPDX-License-Identifier: Apache-2.0
//
// Exit status of a child process.
#pragma once

#include <sys/resource.h>
#include <sys/types.h>

namespace arhost::supervise {

struct Exit {
    pid_t pid;
    int wait_status; // as returned by wait(2)
    double cpu_seconds;
    bool exceeded_memory = false; // the kernel killed it because of its control group's memory limit
};

// Returns user plus system time.
inline double cpu_seconds(const rusage &usage) {
    const auto seconds = [](const timeval &t) {
        return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

} // namespace arhost::supervise
