// SPDX-License-Identifier: Apache-2.0
//
// The source of a run: passes its frames to the flow. Without a source, the frames of a trajectory are black.
#pragma once

#include "contracts/contract_checks.hpp"
#include "host/run_parts.hpp"

namespace arhost::host {

class Source {
public:
    explicit Source(RunParts &parts);

    void start();
    bool has_started() const { return !component_ || component_->running(); }
    FrameFlow::Intake intake() const;
    void read(const FrameFlow::Read &action);

    supervise::Component *component() const { return component_.get(); } // null without a source

private:
    void make_black_frames();
    supervise::Component::Create on_hello(std::size_t candidate);
    ipc::SlotLayout on_ready(const ipc::messages::Ready &ready);
    void set_intrinsics(const ipc::messages::Ready &ready);
    void on_result(const ipc::Command &command, const ipc::Result &result);
    void on_frame(Lease pixels, const ipc::Command &command, const ipc::Result &result);
    void repeat_record(Frame &frame) const;
    void on_lost(const std::vector<ipc::Command> &unanswered);

    RunParts &parts_;
    std::unique_ptr<supervise::Component> component_;
    std::shared_ptr<SlotPool> slots_; // slots of the current worker; null unless the worker is running
    std::uint64_t skipped_ = 0;       // frames that the source has skipped
    std::int64_t last_capture_ns_ = INT64_MIN;
    std::size_t candidate_ = 0;                     // plugin of the current worker
    std::optional<contracts::SourceChecks> checks_; // for the current plugin; survives restarts
};

} // namespace arhost::host
