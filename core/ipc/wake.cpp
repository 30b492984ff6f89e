// SPDX-License-Identifier: Apache-2.0
#include "ipc/wake.hpp"

#include <climits>
#include <ctime>
#include <fcntl.h>
#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace arhost::ipc {
namespace {

// std::atomic::wait uses private futexes, which do not work across processes.
long futex(const std::atomic<std::uint32_t> &word, int operation, std::uint32_t value, const timespec *timeout) {
    static_assert(sizeof(word) == sizeof(std::uint32_t));
    return ::syscall(SYS_futex, reinterpret_cast<const std::uint32_t *>(&word), operation, value, timeout, nullptr,
                     0);
}

void pause_cpu() {
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
}

} // namespace

void wake(WakeWord &word) {
    // SYNC POINT with wake_count (its acquire load): entries that were pushed before are visible to a reader of the
    // new count.
    // The kernel re-reads the word under the futex lock, so a sleeper either sees the new count or is woken.
    word.count.fetch_add(1, std::memory_order_release);
    futex(word.count, FUTEX_WAKE, INT_MAX, nullptr);
}

// SYNC POINT with wake (its release increment).
std::uint32_t wake_count(const WakeWord &word) {
    return word.count.load(std::memory_order_acquire);
}

bool wait_for_wake(const WakeWord &word, std::uint32_t seen, std::chrono::nanoseconds timeout,
                   std::chrono::nanoseconds spin) {
    using Clock = std::chrono::steady_clock;
    const Clock::time_point begin = Clock::now();
    while (wake_count(word) == seen && Clock::now() - begin < spin)
        pause_cpu();
    while (wake_count(word) == seen) {
        const auto left =
            std::chrono::duration_cast<std::chrono::nanoseconds>(begin + timeout - Clock::now()).count();
        if (left <= 0)
            return false;
        const timespec relative{left / 1'000'000'000, left % 1'000'000'000};
        // Returns at once (EAGAIN) if the word differs from `seen`; EINTR loops.
        futex(word.count, FUTEX_WAIT, seen, &relative);
    }
    return true;
}

DoorbellPair make_doorbell() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC | O_NONBLOCK) != 0)
        base::throw_errno("pipe for a doorbell");
    return {base::UniqueFd(ends[0]), base::UniqueFd(ends[1])};
}

void ring_doorbell(int worker_end) {
    // An error is ignored: if the pipe is full, the host has been notified already.
    (void)!::write(worker_end, "!", 1);
}

int drain_doorbell(int host_end) {
    char bytes[4096];
    const ssize_t count = ::read(host_end, bytes, sizeof bytes);
    if (count > 0)
        return static_cast<int>(count);
    if (count == 0)
        return -1;
    return errno == EAGAIN || errno == EINTR ? 0 : -1;
}

} // namespace arhost::ipc
