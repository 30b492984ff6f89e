// SPDX-License-Identifier: Apache-2.0
#include "host/stage.hpp"

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

void Stage::make_component(const char *name, const run_config::ComponentConfiguration &configuration,
                           Component::Callbacks callbacks) {
    callbacks.running = [this, on_running = callbacks.running] {
        slots_ = slots_of(*component_);
        on_running();
    };
    callbacks.lost = [this](const std::vector<Command> &unanswered) {
        slots_.reset();
        parts_.flow.on_lost(waiting_, sequences_of(unanswered));
    };
    component_ = std::make_unique<Component>(parts_.context, name, configuration.plugins, configuration.limits,
                                             configuration.policy, std::move(callbacks));
}

FrameFlow::Intake Stage::intake() const {
    using enum FrameFlow::Readiness;
    const bool is_disabled = component_->state() == Component::State::disabled;
    return {.readiness = is_disabled                                 ? disabled
                         : !running()                                ? down
                         : component_->in_flight() >= max_in_flight_ ? busy
                                                                     : ready,
            .slots = slots_.get()};
}

Frame *Stage::accept(const Command &command, const Result &result) {
    parts_.statistics.stages.add(component_->name(), std::chrono::nanoseconds(result.busy_ns));
    Frame *const frame = parts_.flow.answered(command.sequence);
    if (!frame || result.status >= 0)
        return frame;
    if (parts_.statistics.errors[{component_->name(), result.status}]++ == 0) // the end of the run tells how many
        component_->log(ARHOST_SEVERITY_WARNING,
                        "frame " + std::to_string(command.sequence) + ": " + status_text(result.status));
    parts_.flow.on_failed(*frame, component_->name().c_str());
    return nullptr;
}

} // namespace arhost::host
