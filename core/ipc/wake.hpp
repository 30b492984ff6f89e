// SPDX-License-Identifier: Apache-2.0
//
// Wake-ups between host and worker. Both are hints; the rings' positions decide.
//
// Host → worker: a futex on a counter in the host's page. Incrementing it never blocks, and the worker cannot modify
// it, as it waits on a read-only mapping.
// Worker → host: a byte on a socket pair, sent with MSG_DONTWAIT. The host's epoll covers it, and no flag that the
// worker sets on its end can make the host block (with an eventfd, both ends would share O_NONBLOCK).
#pragma once

#include "base/unique_fd.hpp"

#include <atomic>
#include <chrono>
#include <cstdint>

namespace arhost::ipc {

// In the waker's page.
struct WakeWord {
    alignas(64) std::atomic<std::uint32_t> count;
};

// Increments the count and wakes all waiters. Only the page's writer may call it.
void wake(WakeWord &word);

// The current count. Read it, check for work, and only then wait for it to change, so that no wake-up is lost.
std::uint32_t wake_count(const WakeWord &word);

// Waits until the count differs from `seen`; false after `timeout`. Polls for `spin` first, which avoids the 20 µs
// of a sleep if a core is free.
bool wait_for_wake(const WakeWord &word, std::uint32_t seen, std::chrono::nanoseconds timeout,
                   std::chrono::nanoseconds spin = std::chrono::nanoseconds(0));

struct DoorbellPair {
    base::UniqueFd host;   // readable once rung
    base::UniqueFd worker; // for ring_doorbell
};
DoorbellPair make_doorbell();
void ring_doorbell(int worker_end);

// Drains the doorbell and returns the number of rings, at most 4096 per call to bound the host's time; -1 if the
// other end is closed.
int drain_doorbell(int host_end);

} // namespace arhost::ipc
