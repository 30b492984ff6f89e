// SPDX-License-Identifier: Apache-2.0
#include "host/run_parts.hpp"

#include <algorithm>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

namespace {

FrameFlow::Settings settings_of(const run_config::Configuration &configuration) {
    FrameFlow::Settings settings;
    settings.live = configuration.mode == run_config::Mode::live;
    settings.has_source = configuration.source.has_value();
    settings.has_tracker = configuration.tracker.has_value();
    settings.has_raytracer = configuration.raytracer.has_value();
    settings.max_frames = configuration.frames;
    settings.max_latency = configuration.max_latency;
    settings.has_timeline = configuration.timeline.has_value();
    settings.trajectory = configuration.trajectory ? &*configuration.trajectory : nullptr;
    settings.recording = configuration.recording ? &*configuration.recording : nullptr;
    return settings;
}

} // namespace

RunParts::RunParts(const run_config::Configuration &run_configuration, supervise::Context run_context)
    : configuration(run_configuration), context(std::move(run_context)), failures(context.log), options(context.log),
      cameras(configuration.trajectory ? &*configuration.trajectory : nullptr),
      flow(settings_of(configuration), context.reactor.clock(), cameras, statistics) {
    statistics.contract_checks =
        contracts::ContractChecks([this](const std::string &name, const std::string &violation) {
            context.log(ARHOST_SEVERITY_WARNING, name.substr(0, name.find('.')),
                        "violates the contract: " + name + ": " + violation);
        });
    flow.set_paced(configuration.paced.value_or(false));
}

Component::Callbacks RunParts::callbacks(const std::string &name, const yaml::Node &node) {
    Component::Callbacks callbacks;
    callbacks.ready = [](const messages::Ready &) { return SlotLayout{}; };
    callbacks.running = [] {};
    callbacks.end_requested = [] {};
    callbacks.request = [](const messages::Request &) {};
    callbacks.stopped = [this, name](arhost_status status, const std::string &text) {
        if (status != ARHOST_STATUS_OK)
            failures.add(name + ": " + (text.empty() ? status_text(status) : text), false);
    };
    callbacks.disabled = [this, name, node](const std::string &reason, bool is_configuration_error) {
        failures.add_disabled(name, node, reason, is_configuration_error);
    };
    return callbacks;
}

std::shared_ptr<SlotPool> slots_of(const Component &component) {
    return component.output() ? std::make_shared<SlotPool>(component.output()) : nullptr;
}

bool RunParts::take_if_ended(const Component &component) {
    if (component.state() != Component::State::stopped && component.state() != Component::State::disabled)
        return false;
    totals.add(component);
    options.forget(component);
    return true;
}

std::vector<std::uint64_t> sequences_of(const std::vector<Command> &commands) {
    std::vector<std::uint64_t> sequences;
    std::ranges::transform(commands, std::back_inserter(sequences), &Command::sequence);
    return sequences;
}

} // namespace arhost::host
