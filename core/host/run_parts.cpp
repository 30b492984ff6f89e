// SPDX-License-Identifier: Apache-2.0
#include "host/run_parts.hpp"

#include <algorithm>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

Component::Callbacks RunParts::callbacks(const std::string &name, const yaml::Node &node) const {
    Component::Callbacks callbacks;
    callbacks.ready = [](const messages::Ready &) { return SlotLayout{}; };
    callbacks.running = [] {};
    callbacks.end_requested = [] {};
    callbacks.request = [](const messages::Request &) {};
    callbacks.stopped = [&failures = failures, name](arhost_status status, const std::string &text) {
        if (status != ARHOST_STATUS_OK)
            failures.add(name + ": " + (text.empty() ? status_text(status) : text), false);
    };
    callbacks.disabled = [&failures = failures, name, node](const std::string &reason, bool is_configuration_error) {
        failures.add_disabled(name, node, reason, is_configuration_error);
    };
    return callbacks;
}

std::shared_ptr<SlotPool> slots_of(const Component &component) {
    return component.output() ? std::make_shared<SlotPool>(component.output()) : nullptr;
}

bool RunParts::take_if_ended(const Component &component) const {
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
