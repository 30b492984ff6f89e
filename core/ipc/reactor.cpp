// SPDX-License-Identifier: Apache-2.0
#include "ipc/reactor.hpp"

#include <algorithm>
#include <array>
#include <sys/epoll.h>
#include <time.h>
#include <utility>

namespace arhost::ipc {
namespace {

std::chrono::nanoseconds cpu_time_of_thread() {
    timespec time{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

} // namespace

void Reactor::Registration::cancel() {
    if (reactor_)
        reactor_->remove(id_);
    reactor_ = nullptr;
}

Reactor::Reactor(const base::Clock &clock)
    : clock_(clock), epoll_(base::checked(::epoll_create1(EPOLL_CLOEXEC), "epoll_create1")),
      cpu_time_at_last_wait_end_(cpu_time_of_thread()) {}

Reactor::Registration Reactor::watch(int fd, Callback callback) {
    const std::uint64_t id = next_id_++;
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.u64 = id;
    if (::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event) != 0)
        base::throw_errno("epoll_ctl");
    watches_[id] = {fd, std::make_shared<Callback>(std::move(callback))};
    return Registration(this, id);
}

Reactor::Registration Reactor::at(Clock::time_point when, Callback callback) {
    const std::uint64_t id = next_id_++;
    deadlines_.emplace(when, Deadline{id, std::move(callback)});
    return Registration(this, id);
}

void Reactor::remove(std::uint64_t id) {
    if (const auto found = watches_.find(id); found != watches_.end()) {
        ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, found->second.fd, nullptr);
        watches_.erase(found);
        return;
    }
    std::erase_if(deadlines_, [id](const auto &entry) { return entry.second.id == id; });
}

void Reactor::run_once() {
    using std::chrono::milliseconds;
    // Waits only for short times, so that postpone_by_suspension can detect a suspension of this process: a wait then
    // takes noticeably longer than requested.
    constexpr milliseconds slice{100};
    std::optional<milliseconds> timeout;
    if (!deadlines_.empty()) {
        // Rounded up, because waking up just before a deadline would cause busy waiting.
        const auto left = std::chrono::ceil<milliseconds>(deadlines_.begin()->first - now());
        timeout = std::clamp(left, milliseconds(0), slice);
    }
    dispatch_events(timeout);
    if (!deadlines_.empty() && deadlines_.begin()->first <= now())
        dispatch_events(milliseconds(0)); // events that arrived while this process was suspended precede the deadline
    while (!deadlines_.empty() && deadlines_.begin()->first <= now()) {
        auto due = deadlines_.extract(deadlines_.begin());
        due.mapped().callback();
    }
}

void Reactor::dispatch_events(std::optional<std::chrono::milliseconds> timeout) {
    std::array<epoll_event, 32> events;
    const int count = ::epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()),
                                   timeout ? static_cast<int>(timeout->count()) : -1);
    if (count < 0 && errno != EINTR)
        base::throw_errno("epoll_wait");
    postpone_by_suspension(timeout);
    for (int i = 0; i < count; ++i) {
        const std::uint64_t id = events[static_cast<std::size_t>(i)].data.u64; // a copy: epoll_event is packed
        // An earlier callback may have removed this watch; ids are never reused.
        const auto found = watches_.find(id);
        if (found == watches_.end())
            continue;
        const std::shared_ptr<Callback> callback = found->second.callback;
        (*callback)();
    }
}

// Extends all deadlines if this process was suspended since the last call, by the duration of the suspension, because
// the workers may have been suspended, too. Time in which this thread used a processor does not count as suspension.
void Reactor::postpone_by_suspension(std::optional<std::chrono::milliseconds> timeout) {
    constexpr std::chrono::milliseconds noticeable{50}; // above the scheduling delays of a busy machine
    const Clock::time_point now = Clock::now(), before = std::exchange(last_wait_end_, now);
    const std::chrono::nanoseconds cpu_time = cpu_time_of_thread(),
                                   cpu_time_before = std::exchange(cpu_time_at_last_wait_end_, cpu_time);
    if (!timeout) // no deadline was pending
        return;
    const auto suspension = now - before - *timeout - (cpu_time - cpu_time_before);
    if (suspension < noticeable)
        return;
    std::multimap<Clock::time_point, Deadline> postponed;
    for (auto &[when, deadline] : deadlines_)
        postponed.emplace_hint(postponed.end(), when + suspension, std::move(deadline));
    deadlines_ = std::move(postponed);
}

} // namespace arhost::ipc
