// SPDX-License-Identifier: Apache-2.0
//
// One output: its sink, the frames waiting for it, and the frames that it has not confirmed.
#pragma once

#include "host/frame.hpp"
#include "host/statistics.hpp"
#include "model/control.hpp"
#include "run_config/configuration.hpp"
#include "supervise/component.hpp"

#include <deque>

namespace arhost::host {

class SinkQueue {
public:
    explicit SinkQueue(Statistics &statistics) : statistics_(statistics) {}

    const run_config::ComponentConfiguration *configuration = nullptr;
    std::unique_ptr<supervise::Component> component;
    // Maximum number of waiting frames; if there are more, the queue drops the oldest. 0: unlimited, the run waits
    // for the sink.
    std::size_t max_waiting = 0;
    std::string id;               // unique, also among runs; a restarted sink uses it to recognise its files
    std::filesystem::path folder; // folder to write to instead of the configured folders; "": the configured ones
    bool closed = false;          // has failed or ended, and accepts no more frames
    bool has_quit = false;        // has ended the run; receives the remaining frames
    bool ending = false;          // accepts no more frames, and stops once it has written the waiting frames
    bool is_single = false;       // accepts one frame, then ends
    // For an output that a command has started: its file, and the function that answers the command in progress.
    bool on_demand = false;
    std::string path;
    control::Done done;
    std::string failure;             // why a frame could not be written; "": none
    std::uint64_t first_message = 0; // messages after this number are about this output

    void offer(OutputFramePointer frame);
    // Sets the images that the sink reads (ARHOST_SINK_CAPABILITY_VIDEO_INPUT, _OVERLAY_INPUT), and removes waiting
    // frames that lack them.
    void set_inputs(std::uint64_t inputs);
    std::uint64_t inputs() const { return closed ? 0 : inputs_; }
    bool awaits_its_frame() const { return is_single && !ending; }
    void pump(); // submits waiting frames to the sink
    // To be called by the component's callbacks of the same names.
    void on_result(const ipc::Command &command, const ipc::Result &result);
    void on_lost();

    bool has_written() const { return next_sequence_ > 0; } // at least one frame
    bool empty() const { return waiting_.empty() && unconfirmed_.empty(); }
    void clear();
    void answer(const std::string &error); // answers the command in progress; error "": success
    // Returns the number of the first unconfirmed frame, with which a restarted sink continues.
    std::uint64_t first_sequence() const;

private:
    static constexpr std::size_t max_in_flight = 2;
    Statistics &statistics_;
    std::deque<OutputFramePointer> waiting_, unconfirmed_;
    std::uint64_t inputs_ = 0;
    std::uint64_t next_sequence_ = 0; // number of the frame that follows the last confirmed one
};

} // namespace arhost::host
