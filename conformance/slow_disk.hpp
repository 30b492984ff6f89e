// SPDX-License-Identifier: Apache-2.0
//
// A disk that takes its time. No file system is one at will, so what a thread writes is held up on its way there.
#pragma once

#include <atomic>
#include <functional>

namespace arhost::conformance {

class SlowDisk {
public:
    // Does the work on a thread of its own; what that and the threads that it starts write to files can be held up.
    // Throws what the work throws, and Skip where the kernel has no such thing.
    static void under(const std::function<void(SlowDisk &)> &work);

    void hold_up_next_write() { is_due_ = true; } // by 100 ms
    bool has_held_up() const { return !is_due_; }

private:
    // Until the work is done; false: this kernel does not let those go on who wait.
    bool serve(int listener, const std::function<bool()> &is_done);
    std::atomic<bool> is_due_{false};
};

} // namespace arhost::conformance
