// SPDX-License-Identifier: Apache-2.0
#include "host/frame_flow.hpp"

#include "host/cameras.hpp"

#include <algorithm>

namespace arhost::host {
namespace {

constexpr std::size_t max_reads_in_flight = 2;
constexpr std::size_t max_waiting_for_delay = 3; // frames in mode live, for a component that catches up
constexpr std::uint32_t max_attempts = 2; // per frame and component, if the worker dies while processing the frame
constexpr std::chrono::milliseconds max_lateness{100}; // maximum lateness of a paced run that catches up
constexpr double max_step_s = 10; // longer gaps between the time stamps of recorded video are skipped

const char *name_of(Frame::Stage waiting) {
    return waiting == Frame::Stage::to_track ? "tracker" : "raytracer";
}

} // namespace

FrameFlow::FrameFlow(const Settings &settings, const Clock &clock, Cameras &cameras, Statistics &statistics)
    : settings_(settings), clock_(clock), cameras_(cameras), statistics_(statistics) {}

std::optional<FrameFlow::Action> FrameFlow::next(const Intakes &intakes) {
    due_.reset();
    if (auto action = read(intakes.source))
        return action;
    if (auto action = track(intakes.tracker))
        return action;
    if (auto action = render(intakes.raytracer))
        return action;
    return show(intakes);
}

// ---- source → frames ------------------------------------------------------------------------------------

std::optional<FrameFlow::Action> FrameFlow::read(const Intake &source) {
    if (!settings_.has_source) {
        while (read_from_trajectory(source)) {
        }
        return std::nullopt;
    }
    if (no_more_frames() || source.readiness != Readiness::ready || reads_.size() >= max_reads_in_flight ||
        (frozen_ && !settings_.live))
        return std::nullopt;
    std::optional<Lease> slot = source.slots->acquire();
    if (!slot)
        return std::nullopt;
    reads_.push_back(std::move(*slot));
    return Read{next_read_++, reads_.back().index()};
}

// Adds the next frame of a run without a source: one for each frame of the trajectory. Frames that the recorded run
// dropped are not rendered.
bool FrameFlow::read_from_trajectory(const Intake &source) {
    if (no_more_frames() || frozen_)
        return false;
    std::optional<Lease> slot = source.slots->acquire();
    if (!slot)
        return false;
    const camera::TrajectoryFrame *recorded = settings_.trajectory->at_or_after(next_read_);
    if (recorded->frame >= settings_.max_frames) { // the limit is reached before the end of the trajectory
        input_ended_ = true;
        return false;
    }
    auto frame = std::make_unique<Frame>(recorded->frame);
    frame->record.clock = settings_.trajectory->clock.value_or(ARHOST_CLOCK_MEDIA);
    frame->record.capture_ns = recorded->capture_ns;
    frame->pixels = std::move(*slot);
    frame->captured = clock_.now();
    next_read_ = recorded->frame + 1;
    start(std::move(frame));
    return true;
}

Lease FrameFlow::take_read() {
    Lease slot = std::move(reads_.front());
    reads_.pop_front();
    return slot;
}

void FrameFlow::on_source_lost(std::span<const std::uint64_t> unanswered) {
    reads_.clear();
    for (const std::uint64_t sequence : unanswered)
        next_read_ = std::min(next_read_, sequence);
}

void FrameFlow::on_arrived(std::unique_ptr<Frame> frame) {
    if (frozen_ && settings_.live)
        ++statistics_.dropped["freeze"];
    else
        start(std::move(frame));
}

void FrameFlow::start(std::unique_ptr<Frame> frame) {
    frame->received = clock_.now();
    if (statistics_.frames_in++ == 0)
        statistics_.first_frame = frame->received;
    Frame &added = *(frames_[frame->record.sequence] = std::move(frame));
    if (settings_.trajectory)
        cameras_.set_from_trajectory(added);
    if (settings_.live && is_behind())
        on_failed(added, "latency");
    else if (settings_.has_tracker && !repeats_decisions(added))
        enqueue(added, Frame::Stage::to_track);
    else
        on_camera_known(added);
}

bool FrameFlow::is_behind() const {
    const Clock::time_point limit = clock_.now() - settings_.max_latency;
    return std::ranges::any_of(
        frames_, [&](const auto &entry) { return entry.second->in_worker() && entry.second->received < limit; });
}

// ---- frames → tracker -----------------------------------------------------------------------------------

std::optional<FrameFlow::Action> FrameFlow::track(const Intake &tracker) {
    Frame *const frame = next_for(Frame::Stage::to_track, tracker);
    std::optional<Lease> slot = frame ? tracker.slots->acquire() : std::nullopt;
    if (!slot)
        return std::nullopt;
    frame->result = std::move(*slot);
    frame->stage = Frame::Stage::tracking;
    return Track{*frame};
}

Frame *FrameFlow::answered(std::uint64_t sequence) {
    const auto found = frames_.find(sequence);
    if (found == frames_.end())
        return nullptr;
    if (!found->second->overtaken)
        return found->second.get();
    ++statistics_.dropped["late"];
    frames_.erase(found);
    return nullptr;
}

void FrameFlow::on_tracked(Frame &frame, std::chrono::nanoseconds busy) {
    tracker_pace_.add(busy);
    frame.attempts = 0;
    frame.result = Lease();
    cameras_.set_from_targets(frame);
    on_camera_known(frame);
}

// ---- frames → ray tracer --------------------------------------------------------------------------------

void FrameFlow::on_camera_known(Frame &frame) {
    const bool has_overlay = !repeats_decisions(frame) || frame.recorded->overlay != ARHOST_OVERLAY_NONE;
    if (settings_.has_raytracer && frame.record.has_camera && has_overlay)
        enqueue(frame, Frame::Stage::to_render);
    else
        frame.stage = Frame::Stage::done;
}

void FrameFlow::on_coordinates_changed() {
    if (settings_.trajectory)
        return;
    for (const auto &[sequence, frame] : frames_) {
        if (frame->stage != Frame::Stage::to_render || repeats_decisions(*frame))
            continue;
        cameras_.update(*frame);
        if (!frame->record.has_camera) // its camera was that of an earlier frame
            frame->stage = Frame::Stage::done;
    }
}

std::optional<FrameFlow::Action> FrameFlow::render(const Intake &raytracer) {
    Frame *const frame = next_for(Frame::Stage::to_render, raytracer);
    if (!frame)
        return std::nullopt;
    std::optional<Lease> slot = raytracer.slots->acquire(),
                         anchors = raytracer.anchors ? raytracer.anchors->acquire() : Lease();
    if (!slot || !anchors)
        return std::nullopt;
    frame->overlay = std::move(*slot);
    frame->anchors = std::move(*anchors);
    frame->stage = Frame::Stage::rendering;
    return Render{*frame};
}

void FrameFlow::on_rendered(Frame &frame, std::chrono::nanoseconds busy) {
    raytracer_pace_.add(busy);
    frame.anchors = Lease();
    frame.record.overlay = frame.held ? ARHOST_OVERLAY_HELD : ARHOST_OVERLAY_RENDERED;
    frame.stage = Frame::Stage::done;
}

// ---- frames that wait for a component or skip it --------------------------------------------------------

// Returns the oldest frame that waits for a component, if the component accepts one. Frames that need not wait skip
// the component.
Frame *FrameFlow::next_for(Frame::Stage waiting, const Intake &intake) {
    for (const auto &[sequence, frame] : frames_) {
        if (frame->stage != waiting)
            continue;
        if (!skips(intake))
            return intake.readiness == Readiness::ready ? frame.get() : nullptr;
        on_failed(*frame, name_of(waiting));
    }
    return nullptr;
}

// Makes a frame wait for a component. In mode live, the frame replaces the oldest frames that wait for the same
// component.
void FrameFlow::enqueue(Frame &frame, Frame::Stage stage) {
    frame.stage = stage;
    if (!settings_.live)
        return;
    const Pace &pace = stage == Frame::Stage::to_track ? tracker_pace_ : raytracer_pace_;
    const auto is_other = [&](const auto &entry) {
        return entry.second->stage == stage && entry.second.get() != &frame;
    };
    const auto others = static_cast<std::size_t>(std::ranges::count_if(frames_, is_other));
    const std::size_t allowed = pace.keeps_up(fps_) ? max_waiting_for_delay - 1 : 0;
    for (std::size_t excess = others > allowed ? others - allowed : 0; excess > 0; --excess) {
        ++statistics_.dropped[name_of(stage)];
        frames_.erase(std::ranges::find_if(frames_, is_other));
    }
}

void FrameFlow::Pace::add(std::chrono::nanoseconds duration) {
    const double seconds = std::chrono::duration<double>(duration).count();
    mean_s_ = mean_s_.value_or(seconds) + (seconds - mean_s_.value_or(seconds)) / 16;
}

bool FrameFlow::skips(const Intake &intake) const {
    return intake.readiness == Readiness::disabled || (settings_.live && intake.readiness == Readiness::down);
}

void FrameFlow::on_failed(Frame &frame, const char *stage) {
    frame.release_results();
    frame.record.overlay = ARHOST_OVERLAY_NONE;
    frame.stage = Frame::Stage::done;
    ++statistics_.skipped[stage];
}

void FrameFlow::on_lost(Frame::Stage waiting, std::span<const std::uint64_t> unanswered) {
    for (const std::uint64_t &sequence : unanswered) {
        const auto found = frames_.find(sequence);
        if (found == frames_.end())
            continue;
        Frame &frame = *found->second;
        frame.release_results();
        const bool was_processed = &sequence == &unanswered.front();
        if (frame.overtaken)
            frames_.erase(found);
        else if (settings_.live || (was_processed && ++frame.attempts >= max_attempts))
            on_failed(frame, name_of(waiting));
        else
            frame.stage = waiting;
    }
}

// ---- frames → outputs -----------------------------------------------------------------------------------

std::optional<FrameFlow::Action> FrameFlow::show(const Intakes &intakes) {
    // In mode lockstep the oldest frame; in mode live the newest frame that is done.
    auto ready = frames_.begin();
    if (settings_.live)
        for (auto it = frames_.begin(); it != frames_.end(); ++it)
            if (it->second->stage == Frame::Stage::done)
                ready = it;
    if (ready == frames_.end() || ready->second->stage != Frame::Stage::done || is_early(*ready->second))
        return std::nullopt;
    if (intakes.outputs_are_full && !settings_.live) // waits for the outputs, and the source has to wait, too
        return std::nullopt;
    std::unique_ptr<Frame> frame = std::move(ready->second);
    frames_.erase(ready);
    if (settings_.live)
        drop(frames_.begin(), frames_.lower_bound(frame->record.sequence));
    if (!intakes.outputs_are_full)
        return Show{std::move(frame)};
    ++statistics_.dropped["output"];
    finish(*frame, false, clock_.now());
    frame.reset();
    return next(intakes); // its slots are free
}

// Whether a frame of recorded video must wait because the run is paced. If the run is too slow, the following frames
// are shown later instead of faster.
bool FrameFlow::is_early(const Frame &frame) {
    if (settings_.live || interrupted_ || !paced_ ||
        (frame.record.clock != ARHOST_CLOCK_MEDIA && !settings_.recording))
        return false;
    const Clock::time_point now = clock_.now();
    Clock::time_point due = now;
    if (last_paced_) {
        const double step_s =
            1e-9 * (static_cast<double>(frame.record.capture_ns) - static_cast<double>(last_paced_->media_ns));
        if (step_s <= max_step_s)
            due =
                last_paced_->due + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(step_s));
    }
    if (due > now) {
        due_ = due;
        return true;
    }
    last_paced_ = {frame.record.capture_ns, now - due > max_lateness ? now : due};
    return false;
}

// Drops the frames in [first, last). Those in a worker are dropped when it answers.
void FrameFlow::drop(Frames::iterator first, Frames::iterator last) {
    while (first != last) {
        first->second->overtaken = first->second->in_worker();
        statistics_.dropped["late"] += !first->second->in_worker();
        first = first->second->in_worker() ? std::next(first) : frames_.erase(first);
    }
}

void FrameFlow::omit_unfinished() {
    omits_unfinished_ = true;
    drop(std::ranges::find_if(frames_, [](const auto &entry) { return entry.second->stage != Frame::Stage::done; }),
         frames_.end());
}

const Frame *FrameFlow::find(std::uint64_t sequence) const {
    const auto found = frames_.find(sequence);
    return found == frames_.end() ? nullptr : found->second.get();
}

bool FrameFlow::has_only_overtaken() const {
    return !frames_.empty() &&
           std::ranges::all_of(frames_, [](const auto &entry) { return entry.second->overtaken; });
}

void FrameFlow::on_shown(Frame &frame, Clock::time_point composited) {
    finish(frame, true, composited);
}

void FrameFlow::finish(Frame &frame, bool is_shown, Clock::time_point when) {
    statistics_.composited += is_shown;
    statistics_.tracked += is_shown && std::ranges::any_of(frame.targets, is_visible);
    statistics_.augmented += is_shown && frame.has_overlay();
    statistics_.last_frame = when;
    const Clock::duration latency = when - frame.captured;
    statistics_.stages.add("latency", latency, when);
    if (settings_.has_timeline && is_shown) {
        FrameTimes &times = statistics_.timeline.emplace_back(frame.times);
        times.frame = frame.record.sequence;
        times.shown = when;
        times.latency = latency;
    }
    last_targets_ = std::move(frame.targets);
}

} // namespace arhost::host
