// SPDX-License-Identifier: Apache-2.0
#include "worker/link.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <poll.h>
#include <stdexcept>
#include <unistd.h>
#include <utility>

namespace arhost::worker {

using namespace ipc;
using Clock = std::chrono::steady_clock;

Message Link::receive() const {
    Message message;
    for (;;) {
        switch (channel_.receive(message, -1)) {
        case ReceiveState::message:
            return message;
        case ReceiveState::none:
            continue;
        case ReceiveState::closed:
            throw HostLost("the host has closed the channel");
        case ReceiveState::malformed:
            throw ProtocolViolation("the host sent a malformed message");
        }
    }
}

void Link::send_json(const Json &body, std::initializer_list<int> fds) const {
    // The kernel limits the number of descriptors in unread messages per user, and other processes of the user may
    // have reached the limit. Therefore retries.
    constexpr int max_attempts = 500;
    for (int attempts = 0; !channel_.send(body, fds); ++attempts) {
        if (errno != ETOOMANYREFS)
            throw HostLost("the host has closed the channel");
        if (attempts == max_attempts)
            throw std::runtime_error("this user's processes have too many file descriptors in flight (ETOOMANYREFS)");
        ::usleep(10'000);
    }
}

void Link::log(arhost_severity severity, const std::string &text) const {
    constexpr std::size_t max_cost = 100'000, cost_per_line = 500;
    bool is_flood = false;
    {
        const std::lock_guard lock(rates_->mutex);
        if (const auto now = Clock::now(); now >= rates_->log_second_ends) {
            rates_->log_second_ends = now + std::chrono::seconds(1);
            std::fill(std::begin(rates_->log_costs), std::end(rates_->log_costs), 0);
        }
        std::size_t &cost = rates_->log_costs[severity >= ARHOST_SEVERITY_WARNING];
        cost += std::clamp(text.size(), cost_per_line, messages::max_text);
        is_flood = cost > max_cost;
        if (is_flood && std::exchange(rates_->log_flood_reported, true))
            return;
    }
    channel_.send(encode(is_flood
                             ? messages::Log{ARHOST_SEVERITY_WARNING,
                                             "it logs more than 200 lines or 100 kB per second (warnings and errors "
                                             "count apart from other lines); arhost drops the rest. Let it log or "
                                             "print less, for example once per second instead of in each frame"}
                             : messages::Log{severity, text}),
                  {}, false);
}

void Link::progress(double fraction, const char *what) const {
    {
        const std::lock_guard lock(rates_->mutex);
        const auto now = Clock::now();
        if (now < rates_->next_progress)
            return;
        rates_->next_progress = now + std::chrono::milliseconds(5);
    }
    // JSON cannot represent NaN and infinity.
    channel_.send(encode(messages::Progress{std::isfinite(fraction) ? fraction : 0,
                                            std::string(what ? what : "").substr(0, 1000)}),
                  {}, false);
}

void Link::map_pages(Message &open) {
    if (open.fds.size() < 2)
        throw ProtocolViolation("'open' was sent without the descriptors of the pages");
    host_page_ = SharedMemory::adopt(std::move(open.fds[0])).map(Access::read_only);
    worker_page_ = SharedMemory::adopt(std::move(open.fds[1])).map(Access::read_write);
    if (host_page_.bytes().size() < sizeof(HostPage) || worker_page_.bytes().size() < sizeof(WorkerPage))
        throw ProtocolViolation("a page is too small");
    commands_.emplace(host_page_.as<HostPage>().commands, worker_page_.as<WorkerPage>().commands);
    results_.emplace(worker_page_.as<WorkerPage>().results, host_page_.as<HostPage>().results);
}

std::optional<Command> Link::next_command(std::chrono::milliseconds timeout) {
    const WakeWord &word = host_page_.as<HostPage>().wake;
    for (bool waited = false;; waited = true) {
        const std::uint32_t seen = wake_count(word);
        Command command;
        switch (commands_->pop(command)) {
        case RingResult::done:
            return command;
        case RingResult::violation:
            throw ProtocolViolation("the host's ring is inconsistent");
        case RingResult::wait:
            break;
        }
        if (waited) {
            pollfd hang_up{channel_.fd(), POLLHUP, 0};
            if (::poll(&hang_up, 1, 0) > 0 && (hang_up.revents & (POLLHUP | POLLERR)))
                throw HostLost("the host has closed the channel");
            return std::nullopt;
        }
        wait_for_wake(word, seen, timeout);
    }
}

void Link::send_result(const Result &result) {
    // The result ring is never full, because the host never has more commands in flight than the ring has entries.
    if (results_->push(result) != RingResult::done)
        throw ProtocolViolation("the result ring is full or inconsistent");
    ring_doorbell(doorbell_.get());
}

} // namespace arhost::worker
