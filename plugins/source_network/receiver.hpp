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
    bool uses_sender_clock; // the sender's wall clock is synchronised with that of this machine
    std::size_t capacity;   // number of pictures to keep; if more arrive, the oldest are dropped
    bool retries_at_once;   // false: the first connection must succeed
};

struct Received {
    libav::FramePointer picture;
    std::int64_t capture_ns = 0; // CLOCK_MONOTONIC
    std::uint32_t skipped = 0;   // damaged or dropped pictures since the previous one
};

// Receives a stream on a thread of its own, so that no data waits in the network while nobody takes pictures. If the
// connection is lost, it reconnects until it is destroyed.
class Receiver {
public:
    Receiver(const Host &host, ReceiverSettings settings);

    // Returns the oldest kept picture; waits for one up to `limit`, then returns std::nullopt. Throws the error of
    // the first connection.
    std::optional<Received> take(std::chrono::milliseconds limit);
    // Whether the stream was a recording, and has ended. All of its pictures have then been taken.
    bool ended();
    double fps(); // 0: unknown

    // Numbers of pictures that were not delivered, by cause, and of lost connections.
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
    // Used only by the thread:
    SenderClock clock_;
    bool has_received_ = false, is_lost_ = false, clock_reported_ = false;
    std::chrono::milliseconds delay_ = first_delay; // before the next attempt
    std::optional<std::int64_t> epoch_ns_; // CLOCK_MONOTONIC at time stamp 0, for streams that are ahead of time

    mutable std::mutex mutex_;
    std::condition_variable_any changed_;
    std::deque<Received> kept_;
    std::uint32_t skipped_ = 0; // pictures since the newest kept one, or since the last taken one
    Losses losses_;
    double fps_ = 0;
    bool ended_ = false;
    std::exception_ptr error_;

    std::jthread thread_; // the last member, so that it ends first
};

} // namespace arhost
