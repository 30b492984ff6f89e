// SPDX-License-Identifier: Apache-2.0
#include "host/stage.hpp"

#include <utility>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

Stage::Stage(RunParts &parts, const char *name, const run_config::ComponentConfiguration &configuration,
             Frame::Stage waiting, std::size_t max_in_flight, Abandon abandon)
    : parts_(parts), max_in_flight_(max_in_flight) {
    Component::Callbacks callbacks = parts.callbacks(name, configuration.node);
    callbacks.hello = [this](const PluginDescription &plugin, std::size_t candidate) {
        compare_with_recorded(plugin);
        return on_hello(plugin, candidate);
    };
    callbacks.ready = [this](const messages::Ready &ready) { return on_ready(ready); };
    callbacks.running = [this] {
        slots_ = slots_of(*component_);
        on_running();
    };
    callbacks.result = [this](const Command &command, const Result &result) { on_result(command, result); };
    callbacks.lost = [this, waiting](const std::vector<Command> &unanswered) {
        slots_.reset();
        parts_.flow.on_lost(waiting, sequences_of(unanswered));
    };
    callbacks.disabled = [this, abandon = std::move(abandon)](const std::string &reason,
                                                              bool is_configuration_error) {
        if (!abandon(*this, reason))
            on_disabled(reason, is_configuration_error);
    };
    component_ = std::make_unique<Component>(parts.context, name, configuration.plugins, configuration.limits,
                                             configuration.policy, std::move(callbacks));
}

// The configuration of a session names plugins by their short names, which plugins of several vendors may have.
void Stage::compare_with_recorded(const PluginDescription &plugin) {
    const auto &recording = parts_.configuration.recording;
    if (!recording)
        return;
    const auto recorded = recording->plugin_ids.find(component_->name());
    if (recorded != recording->plugin_ids.end() && recorded->second != plugin.id &&
        short_name(recorded->second) == plugin.short_name() && std::exchange(warned_of_, plugin.id) != plugin.id)
        component_->log(ARHOST_SEVERITY_WARNING, "the session was recorded with '" + recorded->second +
                                                     "', but this plugin is '" + plugin.id +
                                                     "'; its results may differ");
}

FrameFlow::Intake Stage::intake() const {
    using enum FrameFlow::Readiness;
    const auto readiness = [&] {
        if (component_->state() == Component::State::disabled)
            return disabled;
        if (!running())
            return down;
        const bool is_busy =
            component_->in_flight() >= max_in_flight_ || component_->earlier_outputs() >= max_earlier_outputs;
        return is_busy ? busy : ready;
    };
    return {.readiness = readiness(), .slots = slots_.get()};
}

bool Stage::continues_state(std::uint64_t slot_size) {
    const StateOwner owner{component_->candidate(), component_->description().version, slot_size};
    return std::exchange(state_owner_, owner) == owner;
}

Frame *Stage::accept(const Command &command, const Result &result) {
    parts_.statistics.stages.add(component_->name(), std::chrono::nanoseconds(result.busy_ns));
    Frame *const frame = parts_.flow.answered(command.sequence);
    if (!frame || result.status >= 0)
        return frame;
    // Logs only the first error of each kind. The end of the run reports the number.
    if (parts_.statistics.errors[{component_->name(), result.status}]++ == 0)
        component_->log(ARHOST_SEVERITY_WARNING,
                        "frame " + std::to_string(command.sequence) + ": " + status_text(result.status));
    parts_.flow.on_failed(*frame, component_->name().c_str());
    return nullptr;
}

} // namespace arhost::host
