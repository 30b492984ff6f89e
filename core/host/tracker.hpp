// SPDX-License-Identifier: Apache-2.0
//
// The tracker of a run.
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
    supervise::Component::Create on_hello(const model::PluginDescription &plugin, std::size_t candidate) override;
    ipc::SlotLayout on_ready(const ipc::messages::Ready &ready) override;
    void on_result(const ipc::Command &command, const ipc::Result &result) override;
    void on_disabled(const std::string &reason, bool is_configuration_error) override;

    Sightings &sightings_;
    const Configuration configuration_;
    const ipc::SharedMemory targets_; // the configured targets, for the workers
    const std::size_t family_count_;
    bool state_is_of_solver_only_ = false; // another plugin wrote the rest (ipc::Command)
};

} // namespace arhost::host
