// SPDX-License-Identifier: Apache-2.0
//
// The tracker and the ray tracer of a run: each passes frames to its worker, and checks what the worker answers. A
// swap starts a second stage of the same kind and then exchanges the two.
#pragma once

#include "host/run_parts.hpp"
#include "model/control.hpp"

namespace arhost::host {

class Stage {
public:
    // Called when the stage is disabled. Returns whether it only was to replace another stage, so that the run does
    // not fail.
    using Abandon = std::function<bool(const Stage &stage, const std::string &reason)>;

    virtual ~Stage() = default;

    supervise::Component &component() const { return *component_; }
    bool running() const { return component_->running(); }
    void start() { component_->start(); }
    FrameFlow::Intake intake() const;

    control::Done swapped; // answers the command that has started this stage as the successor of another one

protected:
    Stage(const RunParts &parts, Frame::Stage waiting, std::size_t max_in_flight)
        : parts_(parts), waiting_(waiting), max_in_flight_(max_in_flight) {}

    // Adds what the stages have in common to `callbacks`, and creates the component.
    void make_component(const char *name, const run_config::ComponentConfiguration &configuration,
                        supervise::Component::Callbacks callbacks);
    // Returns the frame that was answered successfully. Otherwise returns nullptr, and the frame passes without this
    // stage.
    Frame *accept(const ipc::Command &command, const ipc::Result &result);

    const RunParts parts_;
    std::shared_ptr<SlotPool> slots_; // of the current worker; null unless it is running

private:
    const Frame::Stage waiting_; // of a frame that waits for this one
    const std::size_t max_in_flight_;
    std::unique_ptr<supervise::Component> component_;
};

} // namespace arhost::host
