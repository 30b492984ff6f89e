// SPDX-License-Identifier: Apache-2.0
#include "host/tracker.hpp"

#include "host/frame_validation.hpp"

#include <algorithm>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

namespace {

// Finds the first quoted text in a tracker's message that is the name of a target, or the family or the file of one
// of its markers. Returns the matching key. Later quotes may be names of keys, such as 'image', which are also
// families.
std::optional<yaml::Node> quoted_target(const std::string &message, const run_config::TrackerConfiguration &tracker) {
    std::optional<yaml::Node> quoted;
    std::size_t first = std::string::npos;
    for (std::size_t i = 0; i < tracker.targets.size(); ++i) {
        const auto look_for = [&](const std::string &text, const auto &...keys) {
            const std::size_t at = message.find("'" + text + "'");
            if (text.empty() || at >= first)
                return;
            first = at;
            quoted = tracker.target_nodes[i];
            for (const char *key : {keys...})
                if (const auto value = tracker.target_nodes[i].find(key)) {
                    quoted = value;
                    break;
                }
        };
        look_for(tracker.targets[i].name, "marker", "ids", "map", "pattern", "image");
        for (const TargetMarker &marker : tracker.targets[i].markers) {
            look_for(marker.family, "family", "dictionary", "map");
            look_for(marker.file, "pattern", "image", "map");
        }
    }
    return quoted;
}

} // namespace

// A tracker processes one frame at a time, because a frame needs the state after the previous one.
Tracker::Tracker(RunParts &parts, Sightings &sightings, Configuration configuration, Abandon abandon)
    : Stage(parts, "tracker", *configuration, Frame::Stage::to_track, 1, std::move(abandon)), sightings_(sightings),
      configuration_(std::move(configuration)), targets_(to_memory(configuration_->targets)),
      family_count_(families_of(configuration_->targets).size()) {}

Component::Create Tracker::on_hello(const PluginDescription &plugin, std::size_t candidate) {
    const run_config::TrackerConfiguration &own = *configuration_;
    if (const auto body = std::ranges::find_if(own.targets, [](const auto &target) { return !target.body.empty(); });
        body != own.targets.end() && !(plugin.capabilities & ARHOST_TRACKER_CAPABILITY_REPORTS_POSES))
        own.node.find("targets").value_or(own.node).fail(
            "the target '" + body->name + "' is a body, but '" + plugin.short_name() +
            "' finds only markers; choose a tracker that reports the poses of bodies");
    return {{parts_.options.choose(component(), ARHOST_KIND_TRACKER, own, candidate),
             messages::TrackerSetup{parts_.video.format, parts_.video.intrinsics, own.full_search_every, own.smooth,
                                    own.confirm}},
            {targets_.fd()}};
}

SlotLayout Tracker::on_ready(const messages::Ready &ready) {
    // The plugin and the worker itself each have a state.
    constexpr std::uint64_t max_size = 2 * std::uint64_t{ARHOST_MAX_STATE};
    if (ready.state_size > max_size)
        throw ProtocolViolation("the state has " + std::to_string(ready.state_size) + " bytes; the limit is " +
                                std::to_string(max_size));
    const std::uint64_t slot_size = TrackerSlot(configuration_->targets.size()).byte_size(ready.state_size);
    if (!continues_state(slot_size))
        state_is_of_solver_only_ = true;
    return {slot_size, stage_slot_count};
}

void Tracker::on_disabled(const std::string &reason, bool is_configuration_error) {
    // While the video runs, the run continues without the tracker, so the message concerns all targets.
    const auto target = parts_.failures.video_runs() ? std::nullopt : quoted_target(reason, *configuration_);
    parts_.failures.add_disabled(target ? target->path() : "tracker", target.value_or(configuration_->node), reason,
                                 is_configuration_error);
}

void Tracker::track(Frame &frame) {
    Command command{};
    command.kind = CommandKind::track;
    command.slot = frame.result.index();
    command.input_slot = frame.pixels.index();
    command.sequence = frame.record.sequence;
    command.capture_ns = frame.record.capture_ns;
    command.clock = frame.record.clock;
    if (state_)
        command.state_slot = state_.index();
    command.state_is_of_solver_only = state_is_of_solver_only_;
    component().submit(command, frame.pixels.region(), state_ ? state_.region() : nullptr);
}

void Tracker::on_result(const Command &command, const Result &result) {
    Frame *const frame = accept(command, result);
    if (!frame)
        return;
    if (const char *problem =
            accept_tracker_result(frame->result.bytes(), configuration_->targets, family_count_, *frame)) {
        parts_.flow.on_failed(*frame, "tracker");
        return component().end_process(std::string("contract violation: ") + problem);
    }
    state_ = std::move(frame->result);
    state_is_of_solver_only_ = false;
    if (configuration_->conform)
        contracts::check_tracking(parts_.statistics.contract_checks, command.sequence, frame->targets,
                                  frame->observations);
    frame->times.tracker = std::chrono::nanoseconds(result.busy_ns);
    sightings_.add(*frame);
    parts_.flow.on_tracked(*frame, frame->times.tracker);
}

void Tracker::take_over(Tracker *previous) {
    const bool has_same_targets = previous && previous->configuration_->targets == configuration_->targets;
    if (has_same_targets) {
        state_ = std::move(previous->state_);
        state_is_of_solver_only_ = true;
    }
    sightings_.set_tracker(configuration_);
    parts_.cameras.set_targets(
        {configuration_->targets.front().name, configuration_->world_grace_frames, configuration_->hold_frames},
        has_same_targets);
    if (!previous)
        return;
    parts_.statistics.hints.clear();
    parts_.flow.on_tracker_replaced();
}

} // namespace arhost::host
