// SPDX-License-Identifier: Apache-2.0
//
// The host's event loop: one epoll instance for doorbells, control channels, process exits (pidfds), signals and
// deadlines. Single-threaded.
#pragma once

#include "base/clock.hpp"
#include "base/unique_fd.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>

namespace arhost::ipc {

class Reactor {
public:
    using Clock = std::chrono::steady_clock;
    using Callback = std::function<void()>;

    // Cancels a watch or a deadline on destruction, which may happen inside any callback.
    class Registration {
    public:
        Registration() = default;
        ~Registration() { cancel(); }
        Registration(Registration &&other) noexcept { *this = std::move(other); }
        Registration &operator=(Registration &&other) noexcept {
            std::swap(reactor_, other.reactor_);
            std::swap(id_, other.id_);
            return *this;
        }
        void cancel();
        bool active() const { return reactor_ != nullptr; }

    private:
        friend class Reactor;
        Registration(Reactor *reactor, std::uint64_t id) : reactor_(reactor), id_(id) {}
        Reactor *reactor_ = nullptr;
        std::uint64_t id_ = 0;
    };

    explicit Reactor(const base::Clock &clock = base::steady_clock());

    const base::Clock &clock() const { return clock_; }
    Clock::time_point now() const { return clock_.now(); }

    // Calls `callback` whenever `fd` is readable or hung up. `fd` must stay open until the registration ends.
    [[nodiscard]] Registration watch(int fd, Callback callback);
    // Calls `callback` once, at the time `when` of the clock.
    [[nodiscard]] Registration at(Clock::time_point when, Callback callback);

    // Waits for events or a deadline and calls the callbacks. Handles events before expired deadlines. Deadlines do
    // not include time in which this thread could not run (Ctrl-Z, a frozen container), but include its own work.
    void run_once();

private:
    struct Watch {
        int fd;
        std::shared_ptr<Callback> callback;
    };
    struct Deadline {
        std::uint64_t id;
        Callback callback;
    };
    void remove(std::uint64_t id);
    void dispatch_events(std::optional<std::chrono::milliseconds> timeout);
    void postpone_by_suspension(std::optional<std::chrono::milliseconds> timeout);

    const base::Clock &clock_;
    base::UniqueFd epoll_;
    std::uint64_t next_id_ = 1;
    std::map<std::uint64_t, Watch> watches_;
    std::multimap<Clock::time_point, Deadline> deadlines_;
    Clock::time_point last_wait_end_ = Clock::now(); // time of the system, even if `clock_` is another clock
    std::chrono::nanoseconds cpu_time_at_last_wait_end_;
};

} // namespace arhost::ipc
