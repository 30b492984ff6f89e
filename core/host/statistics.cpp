// SPDX-License-Identifier: Apache-2.0
#include "host/statistics.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <utility>

namespace arhost::host {

using Json = nlohmann::ordered_json;

namespace {
const double log_growth = std::log(1.01);
}

void TargetStatistics::add(const arhost_target &target, std::span<const arhost_observation> observations) {
    double side_px = 0;
    for (const arhost_observation &marker : observations)
        for (int i = 0; i < 4; ++i) {
            const double(&a)[2] = marker.corners_px[i], (&b)[2] = marker.corners_px[(i + 1) % 4];
            side_px += std::hypot(b[0] - a[0], b[1] - a[1]) / (4 * static_cast<double>(observations.size()));
        }
    smallest_px = frames == 0 ? side_px : std::min(smallest_px, side_px);
    largest_px = std::max(largest_px, side_px);
    ++frames;
    mean_reprojection_px += (target.reprojection_px - mean_reprojection_px) / static_cast<double>(frames);
}

void SearchStatistics::add(const arhost_search &search) {
    if (!search.everywhere && search.expected_count == 0) // the tracker has not processed the frame
        return;
    ++frames;
    everywhere += search.everywhere != 0;
    if (search.candidate_count >= 0) {
        ++frames_with_candidate_count;
        candidates += static_cast<std::uint64_t>(search.candidate_count);
    }
    observations += search.observation_count;
    unlisted += search.unlisted_count;
    expected += search.expected_count;
    missed += search.missed_count;
}

void Timing::add(std::chrono::nanoseconds time) {
    const std::int64_t ns = std::max<std::int64_t>(time.count(), 1);
    const auto bucket = static_cast<std::size_t>(std::lround(std::log(static_cast<double>(ns)) / log_growth));
    if (bucket >= buckets_.size())
        buckets_.resize(bucket + 1);
    ++buckets_[bucket];
    ++count_;
    max_ns_ = std::max(max_ns_, ns);
}

void Timing::add(const Timing &other) {
    buckets_.resize(std::max(buckets_.size(), other.buckets_.size()));
    std::transform(other.buckets_.begin(), other.buckets_.end(), buckets_.begin(), buckets_.begin(), std::plus<>());
    count_ += other.count_;
    max_ns_ = std::max(max_ns_, other.max_ns_);
}

double Timing::percentile_ms(double share) const {
    const auto rank = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count_)));
    std::uint64_t seen = 0;
    for (std::size_t bucket = 0; bucket < buckets_.size(); ++bucket)
        if ((seen += buckets_[bucket]) >= std::max<std::uint64_t>(rank, 1))
            return std::min(1e-6 * std::exp(static_cast<double>(bucket) * log_growth), max_ms());
    return 0;
}

Json Timing::to_json() const {
    return {{"count", count()},
            {"p50_ms", percentile_ms(0.50)},
            {"p95_ms", percentile_ms(0.95)},
            {"p99_ms", percentile_ms(0.99)},
            {"max_ms", max_ms()}};
}

std::string Timing::to_text() const {
    char text[64];
    std::snprintf(text, sizeof text, "%.1f/%.1f/%.1f", percentile_ms(0.50), percentile_ms(0.95), percentile_ms(0.99));
    return text;
}

void StageTimings::add(const std::string &name, std::chrono::nanoseconds time, Clock::time_point now) {
    if (now - window_begin_ > std::chrono::seconds(5)) {
        previous_window_ = std::exchange(window_, {});
        previous_begin_ = std::exchange(window_begin_, now);
    }
    window_[name].add(time);
    all_[name].add(time);
}

StageTimings::ByName StageTimings::recent() const {
    ByName recent = previous_window_;
    for (const auto &[name, timing] : window_)
        recent[name].add(timing);
    return recent;
}

double StageTimings::recent_rate(const std::string &name, Clock::time_point now) const {
    const ByName timings = recent();
    const auto timing = timings.find(name);
    const double seconds =
        std::chrono::duration<double>(now - (previous_window_.empty() ? window_begin_ : previous_begin_)).count();
    return timing == timings.end() || seconds <= 0 ? 0 : static_cast<double>(timing->second.count()) / seconds;
}

double Statistics::fps() const {
    const double seconds = std::chrono::duration<double>(last_frame - first_frame).count();
    return composited > 1 && seconds > 0 ? static_cast<double>(composited - 1) / seconds : 0;
}

void ComponentTotals::add(const supervise::Component &component) {
    cpu_seconds[component.name()] += component.cpu_seconds();
    restarts[component.name()] += component.restarts();
    for (const auto &[name, value] : component.counters())
        if (auto &counted = counters[component.name()];
            counted.contains(name) || counted.size() < ARHOST_MAX_COUNTERS) // the plugin chooses the names
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

std::string percentiles_text(const StageTimings::ByName &stages, const StageTimings::ByName &latencies) {
    std::string text = "ms p50/p95/p99:";
    const auto add = [&](const StageTimings::ByName &timings, const char *name) {
        if (const auto timing = timings.find(name); timing != timings.end())
            text += std::string("  ") + name + " " + timing->second.to_text();
    };
    add(stages, "glass_to_glass");
    add(stages, "latency");
    for (const auto &[output, timing] : latencies)
        text += "  to " + output + " " + timing.to_text();
    for (const char *stage : {"source", "tracker", "raytracer", "composite"})
        add(stages, stage);
    return text;
}

Json latency_json(const Statistics &statistics, const StageTimings::ByName &latencies) {
    Json outputs = Json::object();
    for (const auto &[output, timing] : latencies)
        outputs[output] = timing.to_json();
    return {{"from", statistics.latency_from_capture ? "capture" : "arrival"}, {"outputs", std::move(outputs)}};
}

Json quality_json(const Statistics &statistics) {
    if (!statistics.quality)
        return nullptr;
    Json json = {{"scale", statistics.quality->scale}, {"changes", statistics.quality_changes}};
    if (statistics.quality->samples > 0)
        json["samples"] = statistics.quality->samples;
    if (statistics.quality->shading_px > 1)
        json["shading_px"] = statistics.quality->shading_px;
    return json;
}

std::string timeline_csv(const Statistics &statistics) {
    std::string text = "frame,shown_s,source_ms,tracker_ms,raytracer_ms,device_ms,composite_ms,latency_ms\n";
    for (const FrameTimes &times : statistics.timeline) {
        const double shown = std::chrono::duration<double>(times.shown - statistics.first_frame).count();
        char line[192];
        std::snprintf(line, sizeof line, "%llu,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f\n",
                      static_cast<unsigned long long>(times.frame), shown, 1e-6 * double(times.source.count()),
                      1e-6 * double(times.tracker.count()), 1e-6 * double(times.raytracer.count()),
                      1e-6 * double(times.device.count()), 1e-6 * double(times.composite.count()),
                      1e-6 * double(times.latency.count()));
        text += line;
    }
    return text;
}

Json report(const Statistics &statistics, const ComponentTotals &components, double host_cpu_seconds) {
    Json json = {{"frames",
                  {{"in", statistics.frames_in},
                   {"tracked", statistics.tracked},
                   {"augmented", statistics.augmented},
                   {"composited", statistics.composited},
                   {"dropped", statistics.dropped},
                   {"passed_unaugmented", statistics.skipped}}},
                 {"fps", statistics.fps()}};
    json["targets"] = Json::object();
    for (const auto &[name, target] : statistics.targets)
        json["targets"][name] = {{"frames", target.frames},
                                 {"smallest_px", target.smallest_px},
                                 {"largest_px", target.largest_px},
                                 {"mean_reprojection_px", target.mean_reprojection_px}};
    const SearchStatistics &search = statistics.search;
    json["search"] = {{"frames", search.frames},
                      {"everywhere", search.everywhere},
                      {"observations", search.observations},
                      {"unlisted", search.unlisted},
                      {"expected", search.expected},
                      {"missed", search.missed},
                      {"candidates", search.frames_with_candidate_count > 0 ? Json(search.candidates) : Json()}};
    json["unlisted_markers"] = statistics.unlisted;
    json["unconfirmed_markers"] = statistics.unconfirmed;
    for (const auto &[name, timing] : statistics.stages.all())
        json["stages"][name] = timing.to_json();
    json["latency"] = latency_json(statistics, statistics.latencies.all());
    if (statistics.quality)
        json["quality"] = quality_json(statistics);
    for (const auto &[name, check] : statistics.contract_checks.all()) {
        Json &entry = json["conformance"][name] = {{"checked", check.checked}, {"violations", check.violations}};
        if (check.violations > 0)
            entry["first_violation"] = check.first_violation;
    }
    double total = host_cpu_seconds;
    json["cpu_seconds"]["host"] = host_cpu_seconds;
    for (const auto &[name, seconds] : components.cpu_seconds) {
        json["cpu_seconds"][name] = seconds;
        total += seconds;
    }
    json["cpu_seconds"]["total"] = total;
    json["restarts"] = components.restarts;
    json["counters"] = Json(components.counters);
    json["crashes"] = Json::array();
    for (const auto &[name, crash] : components.crashes) {
        Json entry = {{"component", name}, {"plugin", crash.plugin}, {"how", crash.how}};
        if (crash.frame != supervise::Crash::no_frame)
            entry["frame"] = crash.frame;
        entry["log_tail"] = crash.log_tail;
        json["crashes"].push_back(std::move(entry));
    }
    return json;
}

} // namespace arhost::host
