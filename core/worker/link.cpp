// SPDX-License-Identifier: Apache-2.0
#include "worker/link.hpp"

#include <cerrno>
#include <poll.h>
#include <stdexcept>
#include <unistd.h>

namespace arhost::worker {

using namespace ipc;

Message Link::receive() const {
    Message message;
    for (;;) {
        switch (channel_.receive(message, -1)) {
        case ReceiveState::message:
            return message;
        case ReceiveState::none:
            continue;
        case ReceiveState::closed:
            throw HostGone("the host has closed the channel");
        case ReceiveState::breach:
            throw HostGone("the host sent a malformed message");
        }
    }
}

void Link::send(const Json &body, std::initializer_list<int> fds) const {
    // The kernel counts the descriptors that are under way for all processes of a user, and others may have too many.
    constexpr int max_attempts = 500;
    for (int tries = 0; !channel_.send(body, fds); ++tries) {
        if (errno != ETOOMANYREFS)
            throw HostGone("the host has closed the channel");
        if (tries == max_attempts)
            throw std::runtime_error("this user's processes have too many descriptors under way in messages");
        ::usleep(10'000);
    }
}

void Link::log(arhost_severity severity, const std::string &text) const {
    channel_.send({{"type", "log"}, {"severity", severity}, {"text", text.substr(0, 4000)}}, {}, false);
}

void Link::progress(double fraction, const char *what) const {
    channel_.send({{"type", "progress"}, {"fraction", fraction}, {"what", what ? what : ""}}, {}, false);
}

void Link::map_pages(Message &open) {
    if (open.fds.size() < 2)
        throw HostGone("the pages did not come with 'open'");
    host_page_ = SharedMemory::adopt(std::move(open.fds[0])).map(Access::read_only);
    worker_page_ = SharedMemory::adopt(std::move(open.fds[1])).map(Access::read_write);
    if (host_page_.bytes().size() < sizeof(HostPage) || worker_page_.bytes().size() < sizeof(WorkerPage))
        throw HostGone("a page is too small");
    commands_.emplace(host_page_.as<HostPage>().commands, worker_page_.as<WorkerPage>().commands);
    results_.emplace(worker_page_.as<WorkerPage>().results, host_page_.as<HostPage>().results);
}

std::optional<Command> Link::next(std::chrono::milliseconds timeout) {
    const WakeWord &word = host_page_.as<HostPage>().wake;
    for (bool waited = false;; waited = true) {
        const std::uint32_t seen = wake_count(word);
        Command command;
        switch (commands_->pop(command)) {
        case RingResult::done:
            return command;
        case RingResult::breach:
            throw HostGone("the host's ring is inconsistent");
        case RingResult::wait:
            break;
        }
        if (waited) {
            pollfd hang_up{channel_.fd(), POLLHUP, 0};
            if (::poll(&hang_up, 1, 0) > 0 && (hang_up.revents & (POLLHUP | POLLERR)))
                throw HostGone("the host has closed the channel");
            return std::nullopt;
        }
        wait_for_wake(word, seen, timeout);
    }
}

void Link::answer(const Result &result) {
    // The host never has more commands out than its ring holds, so there is always room.
    if (results_->push(result) != RingResult::done)
        throw HostGone("the host does not take results");
    ring_doorbell(doorbell_.get());
}

} // namespace arhost::worker
