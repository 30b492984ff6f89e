// SPDX-License-Identifier: Apache-2.0
#include "host/component_totals.hpp"

#include <algorithm>
#include <utility>

namespace arhost::host {

void ComponentTotals::add(const supervise::Component &component) {
    cpu_seconds[component.name()] += component.cpu_seconds();
    restarts[component.name()] += component.restarts();
    for (const auto &[name, value] : component.counters())
        if (auto &counted = counters[component.name()];
            counted.contains(name) || counted.size() < ARHOST_MAX_COUNTERS) // the names are the plugin's
            counted[name] += value;
    for (const supervise::Crash &crash : component.crashes())
        crashes.push_back({component.name(), crash});
    const auto is_of_component = [&](const Crash &crash) { return crash.component == component.name(); };
    auto count = std::ranges::count_if(crashes, is_of_component);
    for (; std::cmp_greater(count, supervise::Crash::max_kept); --count)
        crashes.erase(std::ranges::find_if(crashes, is_of_component));
}

ComponentTotals ComponentTotals::plus(const std::vector<supervise::Component *> &components) const {
    ComponentTotals totals = *this;
    for (const supervise::Component *component : components)
        totals.add(*component);
    return totals;
}

} // namespace arhost::host
