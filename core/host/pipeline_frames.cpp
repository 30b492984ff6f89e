// SPDX-License-Identifier: Apache-2.0
//
// Moves frames through the stages of a pipeline: read, track, render, composite.
#include "host/pipeline.hpp"

#include "camera/mapping.hpp"
#include "host/outcome.hpp"

#include <arhost/shading/lens.hpp>
#include <glm/gtc/type_ptr.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>
#include <span>
#include <tuple>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;
using Clock = std::chrono::steady_clock;

namespace {

constexpr std::size_t max_reads_in_flight = 2;
constexpr std::chrono::seconds max_time_without_target{5}; // in mode live, from the first frame
constexpr std::chrono::milliseconds max_lateness{100};     // of a paced run that catches up
constexpr double max_step_s = 10;                          // longer gaps in the time of a film are not waited for
constexpr std::size_t max_waiting_for_delay = 3;           // frames in mode live, for a stage that catches up
constexpr std::uint32_t max_attempts = 2; // per frame and stage, if the worker dies while processing the frame

bool is_visible(const arhost_target &target) {
    return target.state != ARHOST_TARGET_LOST;
}

const char *name_of_stage(Frame::Stage waiting) {
    return waiting == Frame::Stage::to_track ? "tracker" : "raytracer";
}

} // namespace

bool Pipeline::read() {
    if (!source_)
        return read_from_trajectory();
    if (no_more_frames() || !source_->running() || reads_.size() >= max_reads_in_flight || (frozen_ && !live_))
        return false;
    std::optional<Lease> slot = source_slots_->acquire();
    if (!slot)
        return false;
    Command command{};
    command.kind = CommandKind::read;
    command.slot = slot->index();
    command.sequence = next_read_++;
    reads_.push_back(std::move(*slot));
    source_->submit(command);
    return true;
}

// Creates the next frame of a run without a source: one for each frame of the trajectory. Frames that the recorded
// run dropped are not rendered.
bool Pipeline::read_from_trajectory() {
    if (no_more_frames() || frozen_)
        return false;
    std::optional<Lease> slot = source_slots_->acquire();
    if (!slot)
        return false;
    const camera::Trajectory &trajectory = *configuration_.trajectory;
    const camera::TrajectoryFrame *recorded = trajectory.at_or_after(next_read_);
    if (recorded->frame >=
        configuration_.frames) { // the configured frame limit is reached before the end of the trajectory
        input_ended_ = true;
        return false;
    }
    auto frame = std::make_unique<Frame>(recorded->frame);
    frame->record.clock = trajectory.clock.value_or(ARHOST_CLOCK_MEDIA);
    frame->record.capture_ns = recorded->capture_ns;
    frame->pixels = std::move(*slot);
    frame->captured = Clock::now();
    next_read_ = recorded->frame + 1;
    start_frame(std::move(frame));
    return true;
}

void Pipeline::on_read(const Command &command, const Result &result) {
    Lease pixels = std::move(reads_.front());
    reads_.pop_front();
    if (command.sequence >= next_read_) // a read after the failed frame: the failed frame must be read again first
        return;
    if (result.status == ARHOST_STATUS_END_TRUNCATED && !input_ended_)
        fail(configuration_.source->node.where() +
                 ": source: the input is truncated; the frames before the truncation are kept",
             false);
    if (result.status >= ARHOST_STATUS_END || (input_ended_ && result.status < 0)) {
        input_ended_ = true;
        return;
    }
    if (input_ended_ && interrupted_ && live_)
        return;
    if (result.status < 0) {
        next_read_ = command.sequence; // reads this frame again after the restart
        return source_->end_process(std::string("read failed: ") + status_text(result.status));
    }
    const run_config::RecordedFrame *const recorded =
        configuration_.recording ? &configuration_.recording->frames[command.sequence] : nullptr;
    auto frame = std::make_unique<Frame>(recorded ? recorded->number : command.sequence);
    const std::int64_t arrival_ns = monotonic_ns();
    if (const char *problem = accept_frame_info(result.frame, last_capture_ns_, arrival_ns, frame->record)) {
        next_read_ = command.sequence;
        return source_->end_process(std::string("contract violation: ") + problem);
    }
    last_capture_ns_ = result.frame.capture_ns;
    if (recorded)
        repeat_record(*frame, *recorded);
    frame->pixels = std::move(pixels);
    if (configuration_.source->conform) {
        source_checks_->check(statistics_.contract_checks, frame->record, result.frame.skipped, arrival_ns);
        frame->pixels_sample = sample_hash(frame->pixels.bytes(), frame->record.sequence);
    }
    // The record of a replayed frame has the time at which it was recorded.
    statistics_.latency_from_capture = result.frame.clock == ARHOST_CLOCK_MONOTONIC;
    frame->captured = Clock::time_point(std::chrono::nanoseconds(
        statistics_.latency_from_capture ? std::min(result.frame.capture_ns, arrival_ns) : arrival_ns));
    frame->times.source = std::chrono::nanoseconds(result.busy_ns);
    skipped_ += result.frame.skipped;
    statistics_.dropped["source"] = skipped_;
    statistics_.stages.add("source", std::chrono::nanoseconds(result.busy_ns));
    if (frozen_ && live_) {
        ++statistics_.dropped["freeze"];
        return;
    }
    start_frame(std::move(frame));
}

void Pipeline::start_frame(std::unique_ptr<Frame> frame) {
    frame->received = Clock::now();
    if (statistics_.frames_in++ == 0)
        statistics_.first_frame = frame->received;
    Frame &added = *(frames_[frame->record.sequence] = std::move(frame));
    if (configuration_.trajectory)
        set_camera_from_trajectory(added);
    if (live_ && is_behind())
        skip(added, "latency");
    else if (tracker_ && !repeats_decisions(added))
        enqueue(added, Frame::Stage::to_track);
    else
        on_camera_known(added);
}

// Sets what the video of a session does not contain. If the recorded decisions are repeated, that includes the
// results of the tracker, which may depend on frames that the recorded run has dropped.
void Pipeline::repeat_record(Frame &frame, const run_config::RecordedFrame &recorded) {
    frame.recorded = &recorded;
    frame.record.clock = recorded.clock;
    frame.record.capture_ns = recorded.capture_ns;
    frame.record.has_truth = recorded.truth.has_value();
    if (recorded.truth) {
        recorded.truth->first.copy(frame.record.truth_target, ARHOST_MAX_NAME - 1);
        std::ranges::copy(recorded.truth->second, frame.record.true_mt);
    }
    if (!repeats_decisions(frame))
        return;
    frame.targets = recorded.targets;
    frame.observations = recorded.observations;
    frame.record.search = recorded.search;
    count_targets(frame);
    statistics_.search.add(frame.record.search);
    set_recorded_camera(frame);
}

bool Pipeline::repeats_decisions(const Frame &frame) const {
    return frame.recorded && configuration_.recording->repeats_decisions;
}

void Pipeline::set_recorded_camera(Frame &frame) const {
    if (!frame.recorded->view || configuration_.trajectory)
        return;
    frame.held = frame.recorded->overlay == ARHOST_OVERLAY_HELD;
    frame.record.camera = camera::camera_of(*frame.recorded->view, intrinsics_);
    frame.record.has_camera = 1;
}

bool Pipeline::track() {
    Frame *frame = next_waiting(Frame::Stage::to_track);
    if (!frame)
        return false;
    if (!is_running(next_tracker_) && may_skip(*tracker_)) {
        skip(*frame, "tracker");
        return true;
    }
    if (is_running(next_tracker_)) // finish_swaps waits until the current tracker has no frames
        return false;
    // One at a time, because a frame needs the state after the previous one.
    if (!tracker_->running() || tracker_->component->in_flight() > 0)
        return false;
    std::optional<Lease> slot = tracker_->slots->acquire();
    if (!slot)
        return false;
    frame->result = std::move(*slot);
    frame->stage = Frame::Stage::tracking;
    Command command{};
    command.kind = CommandKind::track;
    command.slot = frame->result.index();
    command.input_slot = frame->pixels.index();
    command.sequence = frame->record.sequence;
    command.capture_ns = frame->record.capture_ns;
    command.clock = frame->record.clock;
    if (tracker_->state)
        command.state_slot = tracker_->state.index();
    command.state_is_of_solver_only = tracker_->state_is_of_solver_only;
    tracker_->component->submit(command, frame->pixels.region(),
                                tracker_->state ? tracker_->state.region() : nullptr);
    return true;
}

// Records the result of a stage and returns the result's frame; null if the frame was overtaken or the stage failed.
Frame *Pipeline::accept_result(const Command &command, const Result &result, Component &stage) {
    statistics_.stages.add(stage.name(), std::chrono::nanoseconds(result.busy_ns));
    const auto found = frames_.find(command.sequence);
    if (found == frames_.end())
        return nullptr;
    Frame &frame = *found->second;
    if (frame.overtaken) {
        ++statistics_.dropped["late"];
        frames_.erase(found);
        return nullptr;
    }
    if (result.status < 0) {
        if (frame_errors_[{stage.name(), result.status}]++ == 0) // report_frame_errors reports the number
            stage.log(ARHOST_SEVERITY_WARNING,
                      "frame " + std::to_string(command.sequence) + ": " + status_text(result.status));
        skip(frame, stage.name().c_str());
        return nullptr;
    }
    return &frame;
}

void Pipeline::on_tracked(const Command &command, const Result &result) {
    Frame *accepted = accept_result(command, result, *tracker_->component);
    if (!accepted)
        return;
    Frame &frame = *accepted;
    frame.attempts = 0;
    const run_config::TrackerConfiguration &configuration = *tracker_->configuration;
    const char *problem =
        accept_tracker_result(frame.result.bytes(), configuration.targets, tracker_->families.size(), frame);
    if (!problem) {
        tracker_->state = std::move(frame.result);
        tracker_->state_is_of_solver_only = false;
    }
    frame.result = Lease();
    if (problem) {
        skip(frame, "tracker");
        return tracker_->component->end_process(std::string("contract violation: ") + problem);
    }
    for (std::size_t i = 0; i < tracker_->families.size(); ++i)
        tracker_->families[i].copy(frame.record.families[i], ARHOST_MAX_FAMILY - 1);
    ++statistics_.tracker_results;
    if (configuration.conform)
        check_tracking(statistics_.contract_checks, command.sequence, frame.targets, frame.observations);
    frame.times.tracker = std::chrono::nanoseconds(result.busy_ns);
    tracker_->add_duration(frame.times.tracker);
    count_targets(frame);
    count_strangers(frame);
    statistics_.search.add(frame.record.search);
    frame.world = world_.locate(configuration.targets.front().name, frame.targets, command.sequence,
                                configuration.world_grace_frames);
    set_camera_from_targets(frame);
    on_camera_known(frame);
}

void Pipeline::count_targets(const Frame &frame) {
    statistics_.tracked += std::ranges::any_of(frame.targets, is_visible);
    const std::span observations(frame.observations);
    for (const arhost_target &target : frame.targets)
        if (is_visible(target) && target.age_frames == 0)
            statistics_.targets[target.name].add(
                target, observations.subspan(target.first_observation, target.observation_count));
}

// Counts the markers of no target and those of targets without a pose. If targets were not seen for a while, tells
// the user of them.
void Pipeline::count_strangers(Frame &frame) {
    std::set<std::string> strangers, unconfirmed;
    std::vector<bool> has_pose(frame.observations.size());
    for (const arhost_target &target : frame.targets)
        if (is_visible(target))
            std::fill_n(has_pose.begin() + target.first_observation, target.observation_count, true);
    for (std::size_t i = 0; i < frame.observations.size(); ++i) {
        const arhost_observation &observation = frame.observations[i];
        const std::string &family = tracker_->families[observation.family];
        const auto listed = tracker_->listed.find({family, observation.id});
        const bool is_listed = listed != tracker_->listed.end();
        frame.record.search.unlisted_count += !is_listed;
        std::set<std::string> &names = is_listed ? unconfirmed : strangers;
        if (!has_pose[i] && names.size() < Statistics::max_strangers)
            names.insert(is_listed ? listed->second : family + " " + std::to_string(observation.id));
    }
    const auto add = [](const std::set<std::string> &names, std::map<std::string, std::uint64_t> &frames) {
        for (const std::string &name : names)
            if (frames.contains(name) || frames.size() < Statistics::max_strangers)
                ++frames[name];
    };
    add(strangers, statistics_.strangers);
    add(unconfirmed, statistics_.unconfirmed);
    if (live_ && !reported_missing_targets_ && !configuration_.time_codes &&
        Clock::now() - statistics_.first_frame > max_time_without_target) {
        reported_missing_targets_ = true;
        const std::vector<model::Target> &targets = tracker_->configuration->targets;
        if (statistics_.targets.empty())
            context_.log(ARHOST_SEVERITY_WARNING, "tracker",
                         "has seen no target yet; it looks for " + describe_targets(targets) +
                             seen_instead(statistics_, targets) + how_to_compare(targets));
        else if (const std::string unseen = unseen_targets(configuration_, statistics_, targets); !unseen.empty())
            context_.log(ARHOST_SEVERITY_WARNING, "tracker", unseen);
    }
}

// Keeps what the tracker sees instead of the targets for the warning that they were not seen.
void Pipeline::take_hint(std::string text) {
    constexpr std::size_t max_bytes = 500;
    std::vector<std::string> &hints = statistics_.hints;
    text.resize(std::min(text.size(), max_bytes));
    if (!retired_.empty() || hints.size() == Statistics::max_hints || std::ranges::find(hints, text) != hints.end())
        return; // it may be of a tracker that was replaced, or is known
    hints.push_back(text);
    const bool is_late = reported_missing_targets_ && statistics_.targets.empty();
    context_.log(is_late ? ARHOST_SEVERITY_INFO : ARHOST_SEVERITY_DEBUG, "tracker", text);
}

void Pipeline::set_camera_from_targets(Frame &frame) {
    if (configuration_.trajectory)
        return;
    if (repeats_decisions(frame))
        return set_recorded_camera(frame);
    const std::uint64_t sequence = frame.record.sequence;
    if (frame.world)
        if (const auto camera = camera::camera_from_marker(*frame.world, coordinates(), intrinsics_))
            last_camera_ = {sequence, *camera};
    if (!last_camera_ || sequence - last_camera_->first > tracker_->configuration->hold_frames)
        return;
    frame.held = last_camera_->first != sequence;
    frame.record.camera = last_camera_->second;
    frame.record.has_camera = 1;
}

// Sets the recorded camera and also the recorded time, which determines the positions of animated objects. A frame
// that the recorded run dropped gets no camera.
void Pipeline::set_camera_from_trajectory(Frame &frame) const {
    const camera::Trajectory &trajectory = *configuration_.trajectory;
    const camera::TrajectoryFrame *recorded = trajectory.at_or_after(frame.record.sequence);
    if (!recorded || recorded->frame != frame.record.sequence)
        return;
    if (trajectory.clock) {
        frame.record.clock = *trajectory.clock;
        frame.record.capture_ns = recorded->capture_ns;
    }
    if (recorded->view) {
        frame.record.camera = camera::camera_of(*recorded->view, intrinsics_);
        frame.record.has_camera = 1;
    }
}

void Pipeline::on_camera_known(Frame &frame) {
    const bool has_overlay = !repeats_decisions(frame) || frame.recorded->overlay != ARHOST_OVERLAY_NONE;
    if (raytracer_ && frame.record.has_camera && has_overlay)
        enqueue(frame, Frame::Stage::to_render);
    else
        frame.stage = Frame::Stage::done;
}

bool Pipeline::render() {
    Frame *frame = next_waiting(Frame::Stage::to_render);
    if (!frame)
        return false;
    if (!is_running(next_raytracer_) && may_skip(*raytracer_)) {
        skip(*frame, "raytracer");
        return true;
    }
    if (is_running(next_raytracer_))
        return false;
    if (!raytracer_->running() || raytracer_->component->in_flight() >= (live_ ? 1u : 2u))
        return false;
    std::optional<Lease> slot = raytracer_->slots->acquire(),
                         anchors = raytracer_->anchor_slots ? raytracer_->anchor_slots->acquire() : Lease();
    if (!slot || !anchors)
        return false;
    frame->overlay = std::move(*slot);
    frame->anchors = std::move(*anchors);
    frame->stage = Frame::Stage::rendering;
    if (repeats_decisions(*frame))
        frame->quality = {frame->recorded->scale, frame->recorded->samples};
    else
        frame->quality = raytracer_->quality ? raytracer_->quality->current() : Quality();
    request_samples(*raytracer_, frame->quality.samples);
    Command command{};
    command.kind = CommandKind::render;
    command.slot = frame->overlay.index();
    command.sequence = frame->record.sequence;
    command.time_s = 1e-9 * static_cast<double>(frame->record.capture_ns);
    command.camera = frame->record.camera;
    if (frame->quality.scale < 1) {
        const auto [width, height] = overlay_size(frame->quality);
        command.camera.intrinsics = shading::scaled(frame->record.camera.intrinsics, width, height);
    }
    if (!frame->anchors)
        raytracer_->component->submit(command);
    else {
        write_anchors(*frame, frame->anchors.bytes());
        command.input_slot = frame->anchors.index();
        raytracer_->component->submit(command, frame->anchors.region());
    }
    return true;
}

// Writes where the targets are that objects belong to. With them, an object is where its target is seen, also if the
// pose of the world is that of an earlier frame.
void Pipeline::write_anchors(const Frame &frame, std::span<std::byte> slot) const {
    const LoadedScene &scene = *raytracer_->scene;
    auto *poses = reinterpret_cast<AnchorPose *>(slot.data());
    for (std::size_t i = 0; i < scene.anchors.size(); ++i) {
        const auto target = std::ranges::find_if(frame.targets, [&](const arhost_target &one) {
            return is_visible(one) && one.name == scene.anchors[i].target;
        });
        poses[i] = {};
        if (target == frame.targets.end())
            continue;
        poses[i].is_visible = 1;
        const glm::dmat4 pose = camera::scene_from_target(frame.record.camera, target->mt, scene.coordinates);
        std::copy_n(glm::value_ptr(pose), 16, poses[i].world_from_anchor);
    }
}

// Begins to adapt the quality of images to `live.target_fps`, unless `stage` already does so within the same limits.
void Pipeline::start_quality(RaytracerStage &stage) {
    stage.samples_in_use = 0; // a new worker has the configured number
    if (!live_ || configuration_.target_fps == 0)
        return;
    const PluginDescription &plugin = stage.component->description();
    const auto supports = [&](std::uint32_t capability) { return (plugin.capabilities & capability) != 0; };
    QualityController::Limits limits{.target_fps = configuration_.target_fps};
    // The worker that warps the images of a plugin without support for lenses needs them in full size.
    if (supports(ARHOST_CAPABILITY_SCALED_IMAGES) &&
        (supports(ARHOST_CAPABILITY_LENS_DISTORTION) || intrinsics_.distortion == ARHOST_DISTORTION_NONE))
        limits.min_scale = configuration_.min_scale;
    const std::vector<OptionValue> &options = options_[stage.component.get()].values;
    const auto samples = std::ranges::find(options, "samples", &OptionValue::key);
    if (samples != options.end() && samples->type == ARHOST_OPTION_INTEGER && samples->integer > 0 &&
        std::ranges::count(plugin.changeable, "samples"))
        limits.max_samples = static_cast<std::uint32_t>(samples->integer);
    limits.min_samples = std::min(configuration_.min_samples, limits.max_samples);
    stage.samples_in_use = limits.max_samples;
    if (stage.quality && stage.quality->limits() == limits)
        return;
    stage.quality.emplace(limits);
    if (stage.quality->is_lowest() && limits.min_samples == 0 && configuration_.min_scale < 1)
        stage.component->log(ARHOST_SEVERITY_WARNING, plugin.id +
                                                          " can render neither smaller images nor fewer samples; "
                                                          "'live.target_fps' has no effect");
}

// Lets the images that are requested from now on have this number of samples; 0: does not change it.
void Pipeline::request_samples(RaytracerStage &stage, std::uint32_t samples) {
    if (samples == 0 || samples == stage.samples_in_use)
        return;
    const std::uint32_t previous = std::exchange(stage.samples_in_use, samples);
    OptionValue value;
    value.key = "samples";
    value.type = ARHOST_OPTION_INTEGER;
    value.integer = samples;
    // If a worker dies before it answers, start_quality() is called for the next one.
    stage.component->set_option(value, [this, &stage, previous](const std::string &error) {
        if (!error.empty() && configuration_.recording)
            stage.component->log(ARHOST_SEVERITY_WARNING, "the recorded number of samples cannot be set: " + error);
        if (!error.empty())
            stage.samples_in_use = previous; // requested again with the next image
    });
}

void Pipeline::on_rendered(const Command &command, const Result &result) {
    const std::chrono::nanoseconds busy(result.busy_ns), device = device_time(result.render, busy);
    if (device.count())
        statistics_.stages.add("device", device);
    if (const auto frame = frames_.find(command.sequence); frame != frames_.end() && raytracer_->quality) {
        if (result.status >= 0)
            statistics_.quality_changes += raytracer_->quality->add(frame->second->quality, busy, Clock::now());
        statistics_.quality = raytracer_->quality->current();
    }
    Frame *accepted = accept_result(command, result, *raytracer_->component);
    if (!accepted)
        return;
    Frame &frame = *accepted;
    frame.anchors = Lease();
    frame.render = result.render;
    frame.times.raytracer = busy;
    raytracer_->add_duration(busy);
    frame.times.device = device;
    frame.record.overlay = frame.held ? ARHOST_OVERLAY_HELD : ARHOST_OVERLAY_RENDERED;
    frame.record.overlay_scale = frame.quality.scale < 1 ? frame.quality.scale : 0;
    frame.record.overlay_samples = frame.quality.samples;
    frame.stage = Frame::Stage::done;
    if (auto &checks = raytracer_->scene->overlay_checks; checks && frame.quality.scale == 1) {
        checks->check(statistics_.contract_checks, command.sequence, command.camera,
                      region_of(frame.render, format_->width, format_->height), overlay_of(frame));
        frame.overlay_sample = sample_hash(frame.overlay.bytes(), command.sequence);
    }
}

std::pair<std::uint32_t, std::uint32_t> Pipeline::overlay_size(const Quality &quality) const {
    const auto scaled = [&](std::uint32_t side) {
        return std::max(1u, static_cast<std::uint32_t>(std::lround(side * quality.scale)));
    };
    return {scaled(format_->width), scaled(format_->height)};
}

ImageView Pipeline::overlay_of(const Frame &frame) const {
    return {reinterpret_cast<const std::uint8_t *>(frame.overlay.bytes().data()),
            overlay_stride(overlay_size(frame.quality).first)};
}

// Returns the overlay in the size of the frame, and its region. It is valid until the next call.
std::pair<ImageView, Region> Pipeline::full_size_overlay(const Frame &frame) {
    const auto [width, height] = overlay_size(frame.quality);
    const Region region = region_of(frame.render, width, height);
    if (width == format_->width && height == format_->height)
        return {overlay_of(frame), region};
    const std::size_t stride = overlay_stride(format_->width);
    enlarged_.resize(stride * format_->height);
    const Region larger = enlarge(overlay_of(frame), width, height, region, *format_, enlarged_.data(), stride);
    return {ImageView{enlarged_.data(), stride}, larger};
}

// Reports a contract violation if a buffer changed after hand-over.
void Pipeline::check_buffers_unmodified(const Frame &frame) {
    const std::uint64_t sequence = frame.record.sequence;
    if (frame.pixels_sample)
        statistics_.contract_checks.add("source.frame-stays", sequence,
                                        sample_hash(frame.pixels.bytes(), sequence) == frame.pixels_sample
                                            ? ""
                                            : "the frame changed after hand-over");
    if (frame.overlay_sample && frame.overlay)
        statistics_.contract_checks.add("raytracer.image-stays", sequence,
                                        sample_hash(frame.overlay.bytes(), sequence) == frame.overlay_sample
                                            ? ""
                                            : "the image changed after hand-over");
}

void Pipeline::on_stage_lost(Stage &stage, const std::vector<Command> &unanswered, Frame::Stage waiting) {
    stage.slots.reset();
    for (const Command &command : unanswered) {
        const auto found = frames_.find(command.sequence);
        if (found == frames_.end())
            continue;
        Frame &frame = *found->second;
        frame.result = Lease();
        frame.anchors = Lease();
        frame.overlay = Lease();
        // The worker was executing the oldest unanswered command when it died.
        const bool was_executing = &command == &unanswered.front();
        if (frame.overtaken)
            frames_.erase(found);
        else if (live_ || (was_executing && ++frame.attempts >= max_attempts))
            skip(frame, name_of_stage(waiting));
        else
            frame.stage = waiting;
    }
}

bool Pipeline::may_skip(const Stage &stage) const {
    return live_ ? !stage.running() : stage.component->state() == Component::State::disabled;
}

bool Pipeline::is_behind() const {
    const Clock::time_point limit = Clock::now() - configuration_.max_latency;
    return std::any_of(frames_.begin(), frames_.end(), [&](const auto &entry) {
        return entry.second->in_worker() && entry.second->received < limit;
    });
}

void Pipeline::skip(Frame &frame, const char *stage) {
    frame.result = Lease();
    frame.anchors = Lease();
    frame.overlay = Lease();
    frame.record.overlay = ARHOST_OVERLAY_NONE;
    frame.stage = Frame::Stage::done;
    ++statistics_.skipped[stage];
}

// Lets a frame wait for a stage. In mode live, it replaces the oldest frames that wait for the same stage.
void Pipeline::enqueue(Frame &frame, Frame::Stage stage) {
    frame.stage = stage;
    if (!live_)
        return;
    const Stage &worker = stage == Frame::Stage::to_track ? static_cast<const Stage &>(*tracker_) : *raytracer_;
    const auto is_other = [&](const auto &entry) {
        return entry.second->stage == stage && entry.second.get() != &frame;
    };
    const auto others = static_cast<std::size_t>(std::count_if(frames_.begin(), frames_.end(), is_other));
    const std::size_t allowed = worker.keeps_up(format_->fps) ? max_waiting_for_delay - 1 : 0;
    for (std::size_t excess = others > allowed ? others - allowed : 0; excess > 0; --excess) {
        ++statistics_.dropped[name_of_stage(stage)];
        frames_.erase(std::find_if(frames_.begin(), frames_.end(), is_other));
    }
}

Frame *Pipeline::next_waiting(Frame::Stage stage) {
    for (const auto &[sequence, frame] : frames_)
        if (frame->stage == stage)
            return frame.get();
    return nullptr;
}

// Whether a frame of a film must wait because the run is paced. A run that is too slow for the film shows the
// following frames later, instead of faster.
bool Pipeline::is_early(const Frame &frame) {
    if (live_ || interrupted_ || !configuration_.paced.value_or(has_window_) ||
        (frame.record.clock != ARHOST_CLOCK_MEDIA && !configuration_.recording))
        return false;
    const Clock::time_point now = Clock::now();
    Clock::time_point due = now;
    if (paced_) {
        const double step_s =
            1e-9 * (static_cast<double>(frame.record.capture_ns) - static_cast<double>(paced_->media_ns));
        if (step_s <= max_step_s)
            due = paced_->due + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(step_s));
    }
    if (due > now) {
        due_ = context_.reactor.at(due, [] {}); // wakes the pipeline
        return true;
    }
    paced_ = {frame.record.capture_ns, now - due > max_lateness ? now : due};
    return false;
}

bool Pipeline::compose() {
    // Selects the oldest frame; in mode live, the newest frame that is done.
    auto ready = frames_.begin();
    if (live_)
        for (auto it = frames_.begin(); it != frames_.end(); ++it)
            if (it->second->stage == Frame::Stage::done)
                ready = it;
    if (ready == frames_.end() || ready->second->stage != Frame::Stage::done || is_early(*ready->second))
        return false;
    const bool has_sink = std::any_of(sinks_.begin(), sinks_.end(), [](const auto &sink) { return !sink->closed; });
    bool is_shown = true;
    Clock::time_point composited = Clock::now();
    if (has_sink) {
        std::optional<Lease> slot = output_slots_->acquire();
        if (!slot && !live_)
            return false; // no free slot: waits for the outputs, and the source has to wait, too
        is_shown = slot.has_value();
        if (slot) {
            std::uint32_t inputs = 0;
            for (const auto &sink : sinks_)
                inputs |= sink->inputs();
            auto output = std::make_shared<OutputFrame>(
                OutputFrame{ready->first, std::move(*slot), ready->second->captured, ready->second->quality, inputs});
            compose(*ready->second, inputs, output->slot.bytes());
            composited = Clock::now(); // before an output can have written the frame
            if (configuration_.snapshot)
                last_output_ = output;
            for (const auto &sink : sinks_)
                sink->offer(output);
            for (const auto &sink : sinks_)
                sink->pump();
        } else {
            ++statistics_.dropped["output"];
        }
    }
    const std::uint64_t sequence = ready->first;
    last_targets_ = std::move(ready->second->targets);
    statistics_.composited += is_shown;
    statistics_.augmented += is_shown && ready->second->record.overlay != ARHOST_OVERLAY_NONE;
    statistics_.last_frame = composited;
    const Clock::duration latency = statistics_.last_frame - ready->second->captured;
    statistics_.stages.add("latency", latency);
    if (configuration_.timeline && is_shown) {
        FrameTimes &times = statistics_.timeline.emplace_back(ready->second->times);
        times.frame = sequence;
        times.shown = statistics_.last_frame;
        times.latency = latency;
    }
    frames_.erase(ready);
    if (live_)
        drop_overtaken(sequence);
    on_progress_({statistics_.composited, configuration_.frames ? configuration_.frames : frame_count_, false});
    return true;
}

void Pipeline::compose(Frame &frame, std::uint32_t inputs, std::span<std::byte> slot) {
    check_buffers_unmodified(frame);
    const Clock::time_point begin = Clock::now();
    const auto *pixels = reinterpret_cast<const std::uint8_t *>(frame.pixels.bytes().data());
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {};
    for (std::uint32_t i = 0; i < format_->plane_count; ++i)
        planes[i] = pixels + format_->offset[i];
    ImageView overlay;
    Region region;
    if (frame.record.overlay != ARHOST_OVERLAY_NONE)
        std::tie(overlay, region) = full_size_overlay(frame);
    frame.record.target_count = static_cast<std::uint32_t>(frame.targets.size());
    frame.record.observation_count = static_cast<std::uint32_t>(frame.observations.size());
    frame.record.expected_count = static_cast<std::uint32_t>(frame.expected.size());
    std::memcpy(slot.data(), &frame.record, sizeof frame.record);
    const auto copy_array = [&]<class T>(const std::vector<T> &array, std::uint64_t offset) {
        std::ranges::copy(std::as_bytes(std::span(array)), slot.data() + offset);
    };
    copy_array(frame.targets, OutputSlot::targets_offset);
    copy_array(frame.observations, OutputSlot::observations_offset);
    copy_array(frame.expected, OutputSlot::expected_offset);
    const OutputView out{reinterpret_cast<std::uint8_t *>(slot.data()) + OutputSlot::image_offset,
                         OutputSlot::stride(format_->width)};
    if (configuration_.time_codes)
        exchange_time_code(frame.observations, out);
    else
        composite(*format_, planes, overlay, region, out);
    copy_sink_inputs(frame, overlay, region, inputs, slot);
    frame.times.composite = Clock::now() - begin;
    statistics_.stages.add("composite", frame.times.composite);
}

// Measures the age of the picture that the frame shows, and draws the next one.
void Pipeline::exchange_time_code(std::span<const arhost_observation> observations, const OutputView &out) {
    const Clock::time_point now = Clock::now();
    if (!time_codes_)
        time_codes_.emplace(now);
    if (const auto age = time_codes_->see(observations, now))
        statistics_.stages.add("glass_to_glass", *age);
    if (time_codes_->is_overdue(std::chrono::seconds(5), now))
        context_.log(ARHOST_SEVERITY_WARNING, "latency",
                     "the camera has not shown a time code for 5 s: point it at the output's picture, so that the "
                     "whole black square with its white border is in view, sharp, without reflections and not "
                     "mirrored");
    time_codes_->draw(out, format_->width, format_->height, now);
}

// Copies the video frame and the overlay if sinks read them.
void Pipeline::copy_sink_inputs(const Frame &frame, const ImageView &overlay, const Region &region,
                                std::uint32_t inputs, std::span<std::byte> slot) const {
    const OutputSlot layout(*format_);
    if (inputs & ARHOST_CAPABILITY_VIDEO_INPUT)
        std::memcpy(slot.data() + layout.video_offset, frame.pixels.bytes().data(), format_->byte_size);
    if (!(inputs & ARHOST_CAPABILITY_OVERLAY_INPUT))
        return;
    const std::size_t stride = overlay_stride(format_->width);
    std::byte *const rgba = slot.data() + layout.overlay_offset;
    std::memset(rgba, 0, stride * format_->height);
    if (frame.record.overlay == ARHOST_OVERLAY_NONE)
        return;
    for (std::size_t y = region.y; y < region.y + region.height; ++y) {
        const std::size_t begin = y * stride + 4 * std::size_t{region.x};
        std::memcpy(rgba + begin, reinterpret_cast<const std::byte *>(overlay.rgba) + begin,
                    4 * std::size_t{region.width});
    }
}

void Pipeline::drop_overtaken(std::uint64_t shown) {
    for (auto it = frames_.begin(); it != frames_.end() && it->first < shown;) {
        it->second->overtaken = it->second->in_worker();
        statistics_.dropped["late"] += !it->second->in_worker();
        it = it->second->in_worker() ? std::next(it) : frames_.erase(it);
    }
}

} // namespace arhost::host
