// SPDX-License-Identifier: Apache-2.0
//
// Wake-ups between host and worker, one mechanism for each direction. Both are only hints: after a wake-up, the
// receiver checks the positions of the ring.
//
// Host → worker: a futex on a counter in the host's page. The host increments it without blocking; the worker cannot
// modify it, because its mapping is read-only.
// Worker → host: a byte in a pipe. The host waits for it with epoll. The worker has only the write end, so it can
// neither read bytes from the pipe nor set a flag that makes the host block. (An eventfd would be unsuitable, because
// host and worker would share its only end.)
#pragma once

#include "base/unique_fd.hpp"

#include <atomic>
#include <chrono>
#include <cstdint>

namespace arhost::ipc {

// The futex counter that wakes the worker. It is in the page that the host writes and the worker maps read-only.
struct WakeWord {
    alignas(64) std::atomic<std::uint32_t> count;
};

// Increments the count and wakes all waiters. Only the process that has mapped the page writable may call it.
void wake(WakeWord &word);

// Returns the current count. To lose no wake-up, read the count first, then check for work, and only then wait for
// the count to change.
std::uint32_t wake_count(const WakeWord &word);

// Waits until the count differs from `seen`; returns false after `timeout`. Polls the count for the duration `spin`
// before it sleeps: if a core is free, this avoids the 20 µs that a sleep costs.
bool wait_for_wake(const WakeWord &word, std::uint32_t seen, std::chrono::nanoseconds timeout,
                   std::chrono::nanoseconds spin = std::chrono::nanoseconds(0));

struct DoorbellPair {
    base::UniqueFd host;   // readable after ring_doorbell
    base::UniqueFd worker; // passed to ring_doorbell
};
DoorbellPair make_doorbell();
void ring_doorbell(int worker_end);

// Reads all rings of the doorbell and returns their number; -1 if the other end is closed. Reads at most 4096 per
// call, which bounds the time that the host spends.
int drain_doorbell(int host_end);

} // namespace arhost::ipc
