// SPDX-License-Identifier: Apache-2.0
//
// The tracker of a run. The host owns the tracker's state. The state that a call writes becomes valid with the call's
// result, and survives the worker (docs/adr/0026).
#pragma once

#include "host/sightings.hpp"
#include "host/stage.hpp"

namespace arhost::host {

class Tracker final : public Stage {
public:
    using Configuration = std::shared_ptr<const run_config::TrackerConfiguration>;

    Tracker(RunParts &parts, Sightings &sightings, Configuration configuration, Abandon abandon);

    void track(Frame &frame);
    const Configuration &configuration() const { return configuration_; }
    // Makes this stage the current one. `previous`: the stage that it replaces, or null. If both have the same
    // targets, continues with the previous poses.
    void take_over(Tracker *previous);

private:
    // Identifies the workers that can read the plugin's part of a state: those with the same plugin.
    struct StateOwner {
        std::size_t candidate = 0;
        std::string version;
        std::uint64_t size = 0;
        bool operator==(const StateOwner &) const = default;
    };
    supervise::Component::Create on_hello(const model::PluginDescription &plugin, std::size_t candidate) override;
    ipc::SlotLayout on_ready(const ipc::messages::Ready &ready) override;
    void on_result(const ipc::Command &command, const ipc::Result &result) override;
    void on_disabled(const std::string &reason, bool is_configuration_error) override;

    Sightings &sightings_;
    const Configuration configuration_;
    const ipc::SharedMemory targets_; // the configured targets, for the workers
    const std::size_t family_count_;
    StateOwner state_owner_;               // the current worker
    Lease state_;                          // the state that the last accepted call has written
    bool state_is_of_solver_only_ = false; // another plugin wrote the rest (ipc::Command)
};

} // namespace arhost::host
