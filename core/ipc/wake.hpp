// SPDX-License-Identifier: Apache-2.0
//
// How the two sides wake each other. Both are hints: the rings' positions are the truth.
//
// Host → worker: a futex on a counter in the host's page. Raising it never blocks the host, and the
// worker waits on a read-only mapping, so it can't disturb it.
// Worker → host: a byte on a socket pair, sent with MSG_DONTWAIT: one epoll of the host covers it, and no
// flag that the worker may set on its end (O_NONBLOCK is shared by an eventfd's holders) makes it block.
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

// Raises the count and wakes who waits. Only the page's writer may call it.
void wake(WakeWord &word);

// The count now: take it, look for work, and only then wait on it, so that no wake is lost between.
std::uint32_t wake_count(const WakeWord &word);

// Returns once the count differs from `seen`, at the latest after `timeout` (then false). Polls for
// `spin` first, which saves the sleep's 20 µs where a core can be spared.
bool wait_for_wake(const WakeWord &word, std::uint32_t seen, std::chrono::nanoseconds timeout,
                   std::chrono::nanoseconds spin = std::chrono::nanoseconds(0));

struct DoorbellPair {
    base::UniqueFd host;   // readable when rung
    base::UniqueFd worker; // ring() it
};
DoorbellPair make_doorbell();
void ring_doorbell(int worker_end);

// Empties the doorbell and returns how many rings there were, at most 4096 a call, so that a flood
// costs the host a bounded time; -1 when the other end is closed.
int drain_doorbell(int host_end);

} // namespace arhost::ipc
