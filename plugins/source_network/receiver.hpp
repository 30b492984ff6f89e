// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "network_stream.hpp"
#include "sender_clock.hpp"

#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

namespace arhost {

struct ReceiverSettings {
    StreamSettings stream;
    bool uses_sender_clock; // whether the sender's wall clock is synchronised with this machine's clock
    std::size_t capacity;   // maximum number of stored pictures; if more arrive, the oldest are dropped
    bool retries_at_once;   // false: the first connection must succeed
};

struct Received {
    libav::FramePointer picture;
    std::int64_t capture_ns = 0; // CLOCK_MONOTONIC
    std::uint32_t skipped = 0;   // damaged or dropped pictures since the previous one
};

// Receives a stream on its own thread, so that no data waits in the network while the source takes no pictures. If
// the connection is lost, it reconnects until it is destroyed.
class Receiver {
public:
    Receiver(const Host &host, ReceiverSettings settings);

    // Returns the oldest stored picture. Waits up to `limit` for a picture, then returns std::nullopt. If the first
    // connection failed, throws its error.
    std::optional<Received> take(std::chrono::milliseconds limit);
    // Returns whether the stream was a recording that has ended and all its pictures have been taken.
    bool ended();
    double fps(); // 0: unknown

    // Numbers of undelivered pictures by cause, and the number of lost connections.
    struct Losses {
        std::uint64_t damaged = 0, superseded = 0, connections = 0;
    };
    Losses losses() const;

private:
    void run(const std::stop_token &stop);
    void receive(const std::stop_token &stop);
    bool wait(const std::stop_token &stop, std::chrono::steady_clock::time_point until); // false: stop was requested
    bool wait_until_due(const NetworkStream &stream, const std::stop_token &stop);
    std::int64_t capture_ns(const NetworkStream &stream);
    void publish(const NetworkStream &stream);
    void finish(std::exception_ptr error);

    static constexpr std::chrono::milliseconds first_delay{250}, longest_delay{5000}; // between attempts to connect

    Host host_;
    ReceiverSettings settings_;
    LibavLog log_;
    // Only the thread uses the following members:
    SenderClock clock_;
    bool has_received_ = false, is_lost_ = false, clock_reported_ = false;
    std::chrono::milliseconds delay_ = first_delay; // delay before the next attempt
    std::optional<std::int64_t> epoch_ns_; // CLOCK_MONOTONIC at time stamp 0, for streams that are ahead of time

    mutable std::mutex mutex_;
    std::condition_variable_any changed_;
    std::deque<Received> kept_;
    // Pictures skipped since the newest stored picture, or since the last taken picture if none is stored.
    std::uint32_t skipped_ = 0;
    Losses losses_;
    double fps_ = 0;
    bool ended_ = false;
    std::exception_ptr error_;

    std::jthread thread_; // the last member, so that it ends first
};

} // namespace arhost
