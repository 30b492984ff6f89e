// SPDX-License-Identifier: Apache-2.0
// Simulates a slow disk: delays a thread's write system calls by seccomp's user notification, whichever library makes
// them. No file system can be slowed down without privileges.
#pragma once

#include <atomic>
#include <functional>

namespace arhost::conformance {

class SlowDisk {
public:
    // Runs `work` on a new thread. File writes of that thread and the threads that it starts can be delayed. Throws
    // what `work` throws, and Skip if the kernel does not support it.
    static void under(const std::function<void(SlowDisk &)> &work);

    void delay_next_write() { is_due_ = true; } // by 100 ms
    bool has_delayed() const { return !is_due_; }

private:
    // Answers notifications until the work is done. False if this kernel cannot continue a system call.
    bool serve(int listener, const std::function<bool()> &is_done);
    std::atomic<bool> is_due_{false};
};

} // namespace arhost::conformance
