// SPDX-License-Identifier: Apache-2.0
#include "host/component_options.hpp"

#include <algorithm>

namespace arhost::host {

using namespace model;

std::vector<OptionValue> ComponentOptions::choose(const supervise::Component &component, arhost_kind kind,
                                                  const run_config::ComponentConfiguration &configuration,
                                                  std::size_t candidate) {
    expect_unique(component, configuration.node);
    std::vector<std::string> notes;
    std::vector<OptionValue> values =
        run_config::options_for(component.description(), kind, configuration, candidate, notes);
    const auto [entry, is_first] = in_use_.try_emplace(&component);
    InUse &in_use = entry->second;
    for (const std::string &note : notes)
        if (is_first)
            log_(ARHOST_SEVERITY_WARNING, component.description().short_name(), note);
    in_use.path = configuration.node.path();
    in_use.component = component.name();
    in_use.plugin = component.description().id;
    in_use.file = component.plugin();
    if (candidate > 0)
        in_use.changed.clear();
    for (OptionValue &value : values)
        if (in_use.changed.contains(value.key))
            value = *std::ranges::find(in_use.values, value.key, &OptionValue::key);
    in_use.values = values;
    return values;
}

// Two files with the same id are two versions or copies of a plugin. A component may run one after the other: its
// fallback may be an older version.
void ComponentOptions::expect_unique(const supervise::Component &component, const yaml::Node &node) const {
    for (const auto &[other, in_use] : in_use_) {
        std::error_code ignored;
        if (in_use.component != component.name() && in_use.plugin == component.description().id &&
            !std::filesystem::equivalent(in_use.file, component.plugin(), ignored))
            node.fail("'" + component.plugin().string() + "' and '" + in_use.file.string() + "' have the same id '" +
                      in_use.plugin + "'; use one of them, or change the id of one");
    }
}

void ComponentOptions::change(const supervise::Component &component, const OptionValue &value) {
    InUse &in_use = in_use_[&component];
    const auto old = std::ranges::find(in_use.values, value.key, &OptionValue::key);
    if (old == in_use.values.end())
        return;
    *old = value;
    in_use.changed.insert(value.key);
}

const ComponentOptions::InUse *ComponentOptions::of(const supervise::Component &component) const {
    const auto found = in_use_.find(&component);
    return found == in_use_.end() ? nullptr : &found->second;
}

} // namespace arhost::host
