// SPDX-License-Identifier: Apache-2.0
#include "host/statistics.hpp"

#include "supervise/component.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace arhost::host {

using Json = nlohmann::ordered_json;

namespace {
const double log_growth = std::log(1.01);
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

double Statistics::fps() const {
    const double seconds = std::chrono::duration<double>(last_frame - first_frame).count();
    return composited > 1 && seconds > 0 ? static_cast<double>(composited - 1) / seconds : 0;
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

Json report(const Statistics &statistics, const std::vector<supervise::Component *> &components,
            double host_cpu_seconds) {
    Json json = {{"frames",
                  {{"in", statistics.frames_in},
                   {"tracked", statistics.tracked},
                   {"augmented", statistics.augmented},
                   {"composited", statistics.composited},
                   {"dropped", statistics.dropped},
                   {"passed_unaugmented", statistics.skipped}}},
                 {"fps", statistics.fps()}};
    for (const auto &[name, timing] : statistics.stages)
        json["stages"][name] = timing.to_json();
    for (const auto &[name, check] : statistics.contract_checks.all()) {
        Json &entry = json["conformance"][name] = {{"checked", check.checked}, {"violations", check.violations}};
        if (check.violations > 0)
            entry["first_violation"] = check.first_violation;
    }
    double total = host_cpu_seconds;
    json["cpu_seconds"]["host"] = host_cpu_seconds;
    for (const supervise::Component *component : components) {
        json["cpu_seconds"][component->name()] = component->cpu_seconds();
        total += component->cpu_seconds();
    }
    json["cpu_seconds"]["total"] = total;
    json["restarts"] = Json::object();
    json["crashes"] = Json::array();
    for (const supervise::Component *component : components) {
        json["restarts"][component->name()] = component->restarts();
        for (const supervise::Component::Crash &crash : component->crashes()) {
            Json entry = {{"component", component->name()}, {"plugin", crash.plugin}, {"how", crash.how}};
            if (crash.frame != supervise::Component::Crash::no_frame)
                entry["frame"] = crash.frame;
            entry["log_tail"] = crash.log_tail;
            json["crashes"].push_back(std::move(entry));
        }
    }
    return json;
}

} // namespace arhost::host
