// SPDX-License-Identifier: Apache-2.0
// Simulates a slow disk: delays a thread's write system calls by seccomp user notification, which needs no privileges
// and works for any library.
#pragma once

#include <atomic>
#include <functional>

namespace arhost::conformance {

class SlowDisk {
public:
    // Runs `work` on a new thread. File writes of that thread and the threads that it starts can be delayed. Rethrows
    // exceptions of `work`; throws Skip if the kernel does not support it.
    static void run(const std::function<void(SlowDisk &)> &work);

    void delay_next_write() { delay_pending_ = true; } // by 100 ms
    bool has_delayed() const { return !delay_pending_; }

private:
    // Answers notifications until the work is done. False if this kernel cannot continue a system call.
    bool serve(int listener, const std::function<bool()> &is_done);
    std::atomic<bool> delay_pending_{false};
};

} // namespace arhost::conformance
