// SPDX-License-Identifier: Apache-2.0
//
// The worker's end of the link to the host.
#pragma once

#include "ipc/memory.hpp"
#include "ipc/messages.hpp"
#include "ipc/protocol.hpp"

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <string>

namespace arhost::worker {

// Thrown if the host has exited. The worker then exits, too.
class HostLost : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

class Link {
public:
    Link(ipc::Channel channel, base::UniqueFd doorbell)
        : channel_(std::move(channel)), doorbell_(std::move(doorbell)) {}

    // Waits for the next control message. Throws HostLost, or ProtocolViolation if it is malformed.
    ipc::Message receive() const;
    template <class T> void send(const T &message, std::initializer_list<int> fds = {}) const {
        send_json(ipc::encode(message), fds);
    }
    // Returns false if the host cannot keep up. May be called on any thread.
    template <class T> bool try_send(const T &message) const {
        return channel_.send(ipc::encode(message), {}, false);
    }
    // Both never block, and drop what exceeds their rates: per second, 200 warnings and errors and 200 other lines,
    // or 100 KB of each; one progress report per 5 ms. The host prints fewer lines, and ends a worker that sends many
    // more.
    void log(arhost_severity severity, const std::string &text) const;
    void progress(double fraction, const char *what) const;

    // Maps the pages whose descriptors accompanied `open`; they contain the rings.
    void map_pages(ipc::Message &open);
    bool cancelled() const {
        return host_page_ && host_page_.as<ipc::HostPage>().cancelled.load(std::memory_order_relaxed) != 0;
    }

    // Returns the next command, or nullopt if none arrives within `timeout`. Throws HostLost or
    // ProtocolViolation.
    std::optional<ipc::Command> next_command(std::chrono::milliseconds timeout);
    void send_result(const ipc::Result &result);

    bool serving = false; // Ready has been sent, so later failures are not configuration errors

    // Marks a plugin function as running during the lifetime of this object, for crash reports.
    class InCall {
    public:
        InCall(const Link &link, ipc::Call call) : link_(link) { link_.mark(call); }
        ~InCall() { link_.mark(ipc::Call::none); }
        InCall(const InCall &) = delete;
        InCall &operator=(const InCall &) = delete;

    private:
        const Link &link_;
    };

private:
    void send_json(const ipc::Json &body, std::initializer_list<int> fds) const;
    // A relaxed store suffices, because the host reads the value after this process has exited (Process::on_death).
    void mark(ipc::Call call) const {
        if (worker_page_)
            worker_page_.as<ipc::WorkerPage>().call.store(static_cast<std::uint32_t>(call),
                                                          std::memory_order_relaxed);
    }

    struct Rates {
        std::mutex mutex; // any thread of the plugin may log
        std::chrono::steady_clock::time_point log_second_ends{}, next_progress{};
        bool log_flood_reported = false;
        std::size_t log_costs[2] = {}; // costs of the lines in the current second; [1]: warnings and errors
    };
    std::unique_ptr<Rates> rates_ = std::make_unique<Rates>();
    ipc::Channel channel_;
    base::UniqueFd doorbell_;
    ipc::Mapping host_page_, worker_page_;
    std::optional<ipc::CommandConsumer> commands_;
    std::optional<ipc::ResultProducer> results_;
};

} // namespace arhost::worker
