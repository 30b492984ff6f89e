// SPDX-License-Identifier: Apache-2.0
#include "host/sightings.hpp"

#include "host/outcome.hpp"

#include <algorithm>
#include <set>

namespace arhost::host {
namespace {

constexpr std::chrono::seconds max_time_without_target{5}; // in mode live, from the first frame

} // namespace

void count_targets(const Frame &frame, Statistics &statistics) {
    statistics.search.add(frame.record.search);
    const std::span observations(frame.observations);
    for (const arhost_target &target : frame.targets)
        if (is_visible(target) && target.age_frames == 0)
            statistics.targets[target.name].add(
                target, observations.subspan(target.first_observation, target.observation_count));
}

void Sightings::set_tracker(std::shared_ptr<const run_config::TrackerConfiguration> tracker) {
    tracker_ = std::move(tracker);
    families_ = families_of(tracker_->targets);
    listed_.clear();
    for (const model::Target &target : tracker_->targets)
        for (const model::TargetMarker &marker : target.markers)
            listed_.try_emplace({marker.family, marker.id}, marker_name(marker));
}

void Sightings::add(Frame &frame) {
    for (std::size_t i = 0; i < families_.size(); ++i)
        families_[i].copy(frame.record.families[i], ARHOST_MAX_FAMILY - 1);
    ++parts_.statistics.tracker_results;
    auto &without_target_since = parts_.statistics.without_target_since;
    if (std::ranges::any_of(frame.targets, is_visible))
        without_target_since.reset();
    else if (!without_target_since)
        without_target_since = parts_.context.reactor.now();
    count_other_markers(frame);
    count_targets(frame, parts_.statistics);
    warn_of_missing_targets();
}

// Counts the markers that belong to no target, and those of targets without a pose.
void Sightings::count_other_markers(Frame &frame) {
    std::set<std::string> unlisted, unconfirmed;
    std::vector<bool> has_pose(frame.observations.size());
    for (const arhost_target &target : frame.targets)
        if (is_visible(target))
            std::fill_n(has_pose.begin() + target.first_observation, target.observation_count, true);
    for (std::size_t i = 0; i < frame.observations.size(); ++i) {
        const arhost_observation &observation = frame.observations[i];
        const std::string &family = families_[observation.family];
        const auto listed = listed_.find({family, observation.id});
        const bool is_listed = listed != listed_.end();
        frame.record.search.unlisted_count += !is_listed;
        std::set<std::string> &names = is_listed ? unconfirmed : unlisted;
        if (!has_pose[i] && names.size() < Statistics::max_marker_names)
            names.insert(is_listed ? listed->second : family + " " + std::to_string(observation.id));
    }
    const auto count = [](const std::set<std::string> &names, std::map<std::string, std::uint64_t> &frames) {
        for (const std::string &name : names)
            if (frames.contains(name) || frames.size() < Statistics::max_marker_names)
                ++frames[name];
    };
    count(unlisted, parts_.statistics.unlisted);
    count(unconfirmed, parts_.statistics.unconfirmed);
}

void Sightings::warn_of_missing_targets() {
    if (has_warned_ || !parts_.live() || parts_.configuration.time_codes ||
        parts_.context.reactor.now() - parts_.statistics.first_frame <= max_time_without_target)
        return;
    has_warned_ = true;
    const std::vector<model::Target> &targets = tracker_->targets;
    if (parts_.statistics.targets.empty())
        parts_.context.log(ARHOST_SEVERITY_WARNING, "tracker",
                           "has seen no target yet; " + looks_for(parts_.statistics, targets));
    else if (const std::string unseen = unseen_targets(parts_.configuration, parts_.statistics, targets);
             !unseen.empty())
        parts_.context.log(ARHOST_SEVERITY_WARNING, "tracker", unseen);
}

void Sightings::add_hint(std::string text) {
    constexpr std::size_t max_bytes = 500;
    std::vector<std::string> &hints = parts_.statistics.hints;
    text.resize(std::min(text.size(), max_bytes));
    if (hints.size() == Statistics::max_hints || std::ranges::find(hints, text) != hints.end())
        return;
    hints.push_back(text);
    const bool is_late = has_warned_ && parts_.statistics.targets.empty();
    parts_.context.log(is_late ? ARHOST_SEVERITY_INFO : ARHOST_SEVERITY_DEBUG, "tracker", text);
}

} // namespace arhost::host
