// SPDX-License-Identifier: Apache-2.0
//
// What a run counted and measured, and the JSON file that tells it.
#pragma once

#include "supervise/component.hpp"

#include <nlohmann/json.hpp>

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace arhost::host {

// The times of one stage.
class Timing {
public:
    void add(std::chrono::nanoseconds time) { samples_ns_.push_back(time.count()); }
    std::size_t count() const { return samples_ns_.size(); }
    double percentile_ms(double share) const; // nearest rank; 0 where there is no sample
    nlohmann::ordered_json to_json() const;   // count, p50, p95, p99, max in ms

private:
    std::vector<std::int64_t> samples_ns_;
};

struct Statistics {
    std::uint64_t frames_in = 0;      // given by the source
    std::uint64_t tracked = 0;        // with at least one marker
    std::uint64_t augmented = 0;      // composited with an overlay
    std::uint64_t composited = 0;     // sent to the outputs, augmented or not
    std::map<std::string, std::uint64_t> dropped; // by the stage where it happened
    std::map<std::string, std::uint64_t> passed;  // went on unaugmented since this stage failed
    std::map<std::string, Timing> stages;         // by name: source, tracker, raytracer, composite, latency, …
    std::chrono::steady_clock::time_point first_frame{}, last_frame{};

    double fps() const;
};

nlohmann::ordered_json report(const Statistics &statistics, const std::vector<supervise::Component *> &components,
                               double host_cpu_seconds);

} // namespace arhost::host
