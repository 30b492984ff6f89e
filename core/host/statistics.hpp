// SPDX-License-Identifier: Apache-2.0
//
// Counters and timings of a run, and their JSON and CSV reports.
#pragma once

#include "contracts/contract_checks.hpp"
#include "host/quality.hpp"
#include "supervise/component.hpp"

#include <nlohmann/json_fwd.hpp>

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace arhost::host {

// Histogram of a stage's durations. Each bucket is 1 % wider than the previous one, so memory use is bounded for runs
// of any length.
class Timing {
public:
    void add(std::chrono::nanoseconds time);
    void add(const Timing &other);
    std::uint64_t count() const { return count_; }
    double percentile_ms(double share) const; // nearest-rank percentile, accurate to 0.5 %; 0 without samples
    double max_ms() const { return 1e-6 * static_cast<double>(max_ns_); }
    nlohmann::ordered_json to_json() const; // count, p50, p95, p99, max in ms
    std::string to_text() const;            // p50/p95/p99 in ms

private:
    std::vector<std::uint64_t> buckets_;
    std::uint64_t count_ = 0;
    std::int64_t max_ns_ = 0;
};

// Times of a frame that was sent to the outputs. A stage that the frame skipped has the time 0. `device` is 0, too,
// if the ray tracer reported no device time.
struct FrameTimes {
    std::uint64_t frame = 0;
    std::chrono::steady_clock::time_point shown{};
    std::chrono::nanoseconds source{}, tracker{}, raytracer{}, device{}, composite{}, latency{};
};

// Timings by name (source, tracker, raytracer, device, composite, latency, …), of the whole run and of the last 5 to
// 10 s.
class StageTimings {
public:
    using Clock = std::chrono::steady_clock;
    using ByName = std::map<std::string, Timing>;

    void add(const std::string &name, std::chrono::nanoseconds time, Clock::time_point now = Clock::now());
    const ByName &all() const { return all_; }
    ByName recent() const;
    double recent_rate(const std::string &name, Clock::time_point now = Clock::now()) const; // timings per second

private:
    ByName all_, window_, previous_window_;
    Clock::time_point window_begin_{}, previous_begin_{};
};

// Statistics of the frames in which a target was detected.
struct TargetStatistics {
    std::uint64_t frames = 0;
    double smallest_px = 0, largest_px = 0; // mean side of its markers in the image; 0 for a body
    double mean_reprojection_px = 0;
    void add(const arhost_target &target, std::span<const arhost_observation> observations);
};

// Totals of arhost_record.search.
struct SearchStatistics {
    std::uint64_t frames = 0, everywhere = 0; // frames that the tracker has processed; those searched completely
    std::uint64_t frames_with_candidate_count = 0, candidates = 0; // quadrilaterals that the tracker has examined
    std::uint64_t observations = 0, unlisted = 0, expected = 0, missed = 0; // markers
    void add(const arhost_search &search);
};

struct Statistics {
    static constexpr std::size_t max_marker_names = 64, max_hints = 4;
    std::uint64_t frames_in = 0;                     // frames received from the source
    std::uint64_t tracker_results = 0;               // frames for which the tracker delivered a result in time
    std::uint64_t composited = 0;                    // frames sent to the outputs
    std::uint64_t tracked = 0, augmented = 0;        // those of them with a visible target; with an overlay
    std::map<std::string, TargetStatistics> targets; // by name of the target
    SearchStatistics search;
    std::map<std::string, std::uint64_t> unlisted;    // frames with a marker that no target lists, by name
    std::map<std::string, std::uint64_t> unconfirmed; // frames with a listed marker whose target got no pose
    // Since when no result of the tracker had a visible target; nullopt: the last one had, or there was none.
    std::optional<std::chrono::steady_clock::time_point> without_target_since;
    std::vector<std::string> hints;               // what the tracker saw instead of the targets
    std::map<std::string, std::uint64_t> dropped; // number of dropped frames by stage
    std::map<std::string, std::uint64_t> skipped; // number of unaugmented frames by the failed stage
    std::map<std::pair<std::string, arhost_status>, std::uint64_t> errors; // frames by stage and error
    StageTimings stages;
    // Time from the capture of a frame until an output has written it, for each output. `latency` of `stages` ends
    // when the frame is composited. If the source does not know the capture time, both begin at the arrival of the
    // frame.
    StageTimings latencies;
    bool latency_from_capture = false;
    std::optional<Quality> quality;    // requested from the ray tracer; only with `live.target_fps`
    std::uint64_t quality_changes = 0; // number of changes
    std::chrono::steady_clock::time_point first_frame{}, last_frame{};
    contracts::ContractChecks contract_checks; // checks of the components with `conform: true`
    std::vector<FrameTimes> timeline;          // only if the configuration requests it

    double fps() const;
};

// Totals of the components of a run, by name: processor time, restarts, counters and crashes.
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

// Returns the percentiles of the latencies and then of the stages, as one line.
std::string percentiles_text(const StageTimings::ByName &stages, const StageTimings::ByName &latencies);

// Returns the member `latency` of the statistics and of the status document.
nlohmann::ordered_json latency_json(const Statistics &statistics, const StageTimings::ByName &latencies);

// Returns the member `quality` of the statistics and of the status document; null without `live.target_fps`.
nlohmann::ordered_json quality_json(const Statistics &statistics);

// Returns CSV with a header and one line per frame:
// frame,shown_s,source_ms,tracker_ms,raytracer_ms,device_ms,composite_ms,latency_ms. shown_s counts from the arrival
// of the first frame.
std::string timeline_csv(const Statistics &statistics);

// `components`: the totals of all components of the run.
nlohmann::ordered_json report(const Statistics &statistics, const ComponentTotals &components,
                              double host_cpu_seconds);

} // namespace arhost::host
