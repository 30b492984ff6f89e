// SPDX-License-Identifier: Apache-2.0
//
// Totals of the components of a run, by name: processor time, restarts, counters and crashes.
#pragma once

#include "supervise/component.hpp"

#include <deque>
#include <map>
#include <string>
#include <vector>

namespace arhost::host {

struct ComponentTotals {
    struct Crash {
        std::string component;
        supervise::Crash crash;
    };
    std::map<std::string, double> cpu_seconds;
    std::map<std::string, std::uint32_t> restarts;
    std::map<std::string, model::Counters> counters;
    std::deque<Crash> crashes; // the last supervise::Crash::max_kept of each component
    void add(const supervise::Component &component);
    ComponentTotals plus(const std::vector<supervise::Component *> &components) const;
};

} // namespace arhost::host
