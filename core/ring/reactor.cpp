// SPDX-License-Identifier: Apache-2.0
#include "ring/reactor.hpp"

#include <algorithm>
#include <array>
#include <sys/epoll.h>

namespace arhost::ring {

void Reactor::Registration::cancel() {
    if (reactor_)
        reactor_->remove(id_);
    reactor_ = nullptr;
}

Reactor::Reactor() : epoll_(checked(::epoll_create1(EPOLL_CLOEXEC), "epoll_create1")) {}

Reactor::Registration Reactor::watch(int fd, Callback callback) {
    const std::uint64_t id = next_id_++;
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.u64 = id;
    if (::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event) != 0)
        throw_errno("epoll_ctl");
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
    int timeout_ms = -1;
    if (!deadlines_.empty()) {
        const auto left = deadlines_.begin()->first - Clock::now();
        // Rounded up: waking just before a deadline would spin.
        timeout_ms = static_cast<int>(
            std::clamp<std::int64_t>(std::chrono::ceil<std::chrono::milliseconds>(left).count(), 0, 60'000));
    }
    take_events(timeout_ms);
    if (!deadlines_.empty() && deadlines_.begin()->first <= Clock::now())
        take_events(0); // what came while this process was stopped came in time
    if (overslept(Clock::now()))
        return;
    while (!deadlines_.empty() && deadlines_.begin()->first <= Clock::now()) {
        auto due = deadlines_.extract(deadlines_.begin());
        due.mapped().callback();
    }
}

void Reactor::take_events(int timeout_ms) {
    std::array<epoll_event, 32> events;
    const int count = ::epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), timeout_ms);
    if (count < 0 && errno != EINTR)
        throw_errno("epoll_wait");
    for (int i = 0; i < count; ++i) {
        // A callback may end any watch, its own too: look it up anew, and keep it alive while it runs.
        const auto found = watches_.find(events[static_cast<std::size_t>(i)].data.u64);
        if (found == watches_.end())
            continue;
        const std::shared_ptr<Callback> callback = found->second.callback;
        (*callback)();
    }
}

// A deadline that is seen much too late tells that this process did not run; others may not have run either.
// Postpones all deadlines by the time since the last look: at worst a hang is found that much later.
bool Reactor::overslept(Clock::time_point now) {
    const Clock::time_point before = std::exchange(looked_at_deadlines_, now);
    if (deadlines_.empty() || now - std::max(deadlines_.begin()->first, before) < std::chrono::milliseconds(250))
        return false;
    std::multimap<Clock::time_point, Deadline> postponed;
    for (auto &[when, deadline] : deadlines_)
        postponed.emplace_hint(postponed.end(), when + (now - before), std::move(deadline));
    deadlines_ = std::move(postponed);
    return true;
}

} // namespace arhost::ring
