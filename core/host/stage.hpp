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
    // Called when the stage is disabled. Returns true if the stage was only meant to replace another stage, so that
    // the run does not fail.
    using Abandon = std::function<bool(const Stage &stage, const std::string &reason)>;

    virtual ~Stage() = default;

    supervise::Component &component() const { return *component_; }
    bool running() const { return component_->running(); }
    void start() { component_->start(); }
    virtual FrameFlow::Intake intake() const;

    control::Done swapped; // answers the command that has started this stage as the successor of another one

protected:
    // `waiting`: the stage of frames that wait for this one. `max_in_flight`: maximum number of frames in the worker.
    Stage(RunParts &parts, const char *name, const run_config::ComponentConfiguration &configuration,
          Frame::Stage waiting, std::size_t max_in_flight, Abandon abandon);

    // As in supervise::Component::Callbacks.
    virtual supervise::Component::Create on_hello(const model::PluginDescription &plugin, std::size_t candidate) = 0;
    virtual ipc::SlotLayout on_ready(const ipc::messages::Ready &ready) = 0;
    virtual void on_running() {}
    virtual void on_result(const ipc::Command &command, const ipc::Result &result) = 0;
    virtual void on_disabled(const std::string &reason, bool is_configuration_error) = 0;

    // Returns the frame if the worker has processed it successfully. Otherwise returns nullptr, and the frame skips
    // this stage.
    Frame *accept(const ipc::Command &command, const ipc::Result &result);

    // Returns whether a worker that has just started can read the plugin's part of `state_`: it has the same plugin
    // and version, and slots of the same size, as the previous worker.
    bool continues_state(std::uint64_t slot_size);

    RunParts &parts_;
    std::shared_ptr<SlotPool> slots_; // slots of the current worker; null unless the worker is running
    std::size_t max_in_flight_;
    Lease state_; // the state that the last accepted call has written (docs/adr/0026)

private:
    void compare_with_recorded(const model::PluginDescription &plugin);
    std::string warned_of_; // the id of the plugin that compare_with_recorded() has warned of last

    struct StateOwner {
        std::size_t candidate = 0;
        std::string version;
        std::uint64_t slot_size = 0;
        bool operator==(const StateOwner &) const = default;
    };

    StateOwner state_owner_; // the current worker
    std::unique_ptr<supervise::Component> component_;
};

} // namespace arhost::host
