// SPDX-License-Identifier: Apache-2.0
//
// The worker's end of its link to the host.
#pragma once

#include "ring/channel.hpp"
#include "ring/memory.hpp"
#include "ring/protocol.hpp"

#include <atomic>
#include <mutex>
#include <string>

namespace arhost::worker {

// Thrown where the host is gone or breaks the protocol: the worker ends.
class HostGone : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

class Link {
public:
    Link(ring::Channel channel, base::UniqueFd doorbell)
        : channel_(std::move(channel)), doorbell_(std::move(doorbell)) {}

    // Waits for the next control message; throws HostGone.
    ring::Message receive() const;
    void send(const ring::Json &body, std::initializer_list<int> fds = {}) const;
    void log(arhost_severity severity, const std::string &text) const; // never blocks
    void progress(double fraction, const char *what) const;            // never blocks

    // Maps the pages that came with `open`; before this, there are no rings.
    void map_pages(ring::Message &open);
    bool cancelled() const {
        return host_page_ && host_page_.as<ring::HostPage>().cancelled.load(std::memory_order_relaxed) != 0;
    }

    // The next command; nullopt after `timeout` without one. Throws HostGone.
    std::optional<ring::Command> next(std::chrono::milliseconds timeout);
    void answer(const ring::Result &result);

    bool serving = false; // past `ready`: what fails now is no fault of the configuration

    // Marks which of the plugin's functions runs, for crash reports, while it is alive.
    class InCall {
    public:
        InCall(const Link &link, ring::Call call) : link_(link) { link_.mark(call); }
        ~InCall() { link_.mark(ring::Call::none); }
        InCall(const InCall &) = delete;
        InCall &operator=(const InCall &) = delete;

    private:
        const Link &link_;
    };

private:
    // Relaxed: the host reads it after this process has died.
    void mark(ring::Call call) const {
        if (worker_page_)
            worker_page_.as<ring::WorkerPage>().call.store(static_cast<std::uint32_t>(call),
                                                           std::memory_order_relaxed);
    }

    ring::Channel channel_;
    base::UniqueFd doorbell_;
    ring::Mapping host_page_, worker_page_;
    std::optional<ring::CommandConsumer> commands_;
    std::optional<ring::ResultProducer> results_;
};

} // namespace arhost::worker
