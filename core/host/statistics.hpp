// SPDX-License-Identifier: Apache-2.0
//
// What a run counted and measured, and the JSON file that tells it.
#pragma once

#include "host/promises.hpp"
#include "supervise/component.hpp"

#include <nlohmann/json.hpp>

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace arhost::host {

// The times of one stage, in buckets that grow by 1 %: constant memory, however long a run lasts.
class Timing {
public:
    void add(std::chrono::nanoseconds time);
    std::uint64_t count() const { return count_; }
    double percentile_ms(double share) const; // nearest rank, within 0.5 %; 0 where there is no sample
    double max_ms() const { return 1e-6 * static_cast<double>(max_ns_); }
    nlohmann::ordered_json to_json() const; // count, p50, p95, p99, max in ms

private:
    std::vector<std::uint64_t> buckets_;
    std::uint64_t count_ = 0;
    std::int64_t max_ns_ = 0;
};

// One frame that was sent to the outputs. Times of stages that it did not pass are 0, and so is what the ray tracer's
// device took where that is not told.
struct FrameTimes {
    std::uint64_t frame = 0;
    std::chrono::steady_clock::time_point shown{};
    std::chrono::nanoseconds source{}, tracker{}, raytracer{}, device{}, composite{}, latency{};
};

struct Statistics {
    std::uint64_t frames_in = 0;                  // given by the source
    std::uint64_t tracked = 0;                    // with at least one marker
    std::uint64_t augmented = 0;                  // composited with an overlay
    std::uint64_t composited = 0;                 // sent to the outputs, augmented or not
    std::map<std::string, std::uint64_t> dropped; // by the stage where it happened
    std::map<std::string, std::uint64_t> passed;  // went on unaugmented since this stage failed
    std::map<std::string, Timing> stages; // by name: source, tracker, raytracer, device, composite, latency, …
    std::chrono::steady_clock::time_point first_frame{}, last_frame{};
    Promises promises;                // of the components with `conform: true`
    std::vector<FrameTimes> timeline; // kept only where the configuration asks for it

    double fps() const;
};

// A header and a line a frame: frame,shown_s,source_ms,tracker_ms,raytracer_ms,device_ms,composite_ms,latency_ms.
// shown_s counts from the first frame's arrival.
std::string timeline_csv(const Statistics &statistics);

nlohmann::ordered_json report(const Statistics &statistics, const std::vector<supervise::Component *> &components,
                              double host_cpu_seconds);

} // namespace arhost::host
