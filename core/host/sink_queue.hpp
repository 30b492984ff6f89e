// SPDX-License-Identifier: Apache-2.0
//
// One output: its sink, the frames that wait for it, and those that it has not confirmed.
#pragma once

#include "host/frames.hpp"
#include "host/statistics.hpp"

#include <deque>

namespace arhost::host {

class SinkQueue {
public:
    explicit SinkQueue(Statistics &statistics) : statistics_(statistics) {}

    std::unique_ptr<supervise::Component> component;
    // So many frames wait at most; the oldest gives way. 0: none does, the run waits for the sink.
    std::size_t depth = 0;
    bool failed = false; // takes no more frames

    void offer(OutputFramePointer frame);
    void pump(); // hands waiting frames to the sink
    // The hooks of its component.
    void on_result(const ipc::Command &command, const ipc::Result &result);
    void on_lost();

    bool empty() const { return waiting_.empty() && unconfirmed_.empty(); }
    void clear();
    // The first frame that the sink has not confirmed: where it goes on after a restart.
    std::uint64_t first_sequence() const;

private:
    static constexpr std::size_t in_flight_limit = 2;
    Statistics &statistics_;
    std::deque<OutputFramePointer> waiting_, unconfirmed_;
    std::uint64_t next_sequence_ = 0; // after the last confirmed one
};

} // namespace arhost::host
