// SPDX-License-Identifier: Apache-2.0
#include "host/source.hpp"

#include "camera/calibration.hpp"
#include "camera/lens_model.hpp"
#include "host/frame_validation.hpp"
#include "host/sightings.hpp"

#include <algorithm>
#include <utility>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

Source::Source(RunParts &parts) : parts_(parts) {
    if (!parts.configuration.source) {
        make_black_frames();
        return;
    }
    const run_config::SourceConfiguration &source = *parts.configuration.source;
    Component::Callbacks callbacks = parts.callbacks("source", source.node);
    callbacks.hello = [this](const PluginDescription &, std::size_t candidate) { return on_hello(candidate); };
    callbacks.ready = [this](const messages::Ready &ready) { return on_ready(ready); };
    callbacks.running = [this] { slots_ = slots_of(*component_); };
    callbacks.result = [this](const Command &command, const Result &result) { on_result(command, result); };
    callbacks.lost = [this](const std::vector<Command> &unanswered) { on_lost(unanswered); };
    callbacks.disabled = [this, report = callbacks.disabled](const std::string &reason, bool is_configuration_error) {
        report(reason, is_configuration_error);
        if (parts_.failures.video_runs())
            parts_.flow.on_input_ended();
    };
    component_ = std::make_unique<Component>(parts.context, "source", source.plugins, source.limits, source.policy,
                                             std::move(callbacks));
}

void Source::start() {
    if (component_)
        component_->start();
}

void Source::make_black_frames() {
    arhost_frame_format &format = parts_.video.format;
    parts_.video.intrinsics = *parts_.configuration.camera;
    format.struct_size = sizeof format;
    format.pixel_format = ARHOST_PIXEL_FORMAT_GREY8;
    format.width = parts_.video.intrinsics.width;
    format.height = parts_.video.intrinsics.height;
    format.fps = parts_.configuration.trajectory->fps;
    arhost_frame_layout(&format); // cannot fail, because the size was validated with the configuration
    slots_ = std::make_shared<SlotPool>(
        supervise::make_host_region("arhost-black", {format.byte_size, source_slot_count}));
    parts_.cameras.set_intrinsics(parts_.video.intrinsics);
    parts_.flow.set_rate(format.fps);
}

Component::Create Source::on_hello(std::size_t candidate) {
    if (std::exchange(candidate_, candidate) != candidate)
        checks_.reset(); // the checks apply to one plugin; this is a different one
    const run_config::SourceConfiguration &source = *parts_.configuration.source;
    return {{parts_.options.choose(*component_, ARHOST_KIND_SOURCE, source, candidate),
             messages::SourceSetup{parts_.flow.next_read() + skipped_, source.fps, parts_.live(),
                                   parts_.configuration.camera}},
            {}};
}

SlotLayout Source::on_ready(const messages::Ready &ready) {
    if (!ready.format)
        throw ProtocolViolation("the source's 'ready' lacks the frame format");
    const arhost_frame_format &format = *ready.format, &before = parts_.video.format;
    if (parts_.video.is_known() && (format.pixel_format != before.pixel_format || format.width != before.width ||
                                    format.height != before.height || format.has_depth != before.has_depth ||
                                    format.transfer != before.transfer))
        throw std::runtime_error("the frame format differs after the restart");
    parts_.video.format = format;
    parts_.video.frame_count = ready.frame_count;
    parts_.flow.set_rate(format.fps);
    const run_config::SourceConfiguration &source = *parts_.configuration.source;
    const bool is_live = (component_->description().capabilities & ARHOST_SOURCE_CAPABILITY_LIVE) != 0;
    if (source.conform && !checks_)
        checks_.emplace(contracts::SourceChecks::Rate{is_live ? 0 : format.fps, source.fps > 0, parts_.live()},
                        parts_.now_ns());
    set_intrinsics(ready);
    return {format.byte_size, source_slot_count};
}

void Source::set_intrinsics(const messages::Ready &ready) {
    const run_config::Configuration &configuration = parts_.configuration;
    const arhost_frame_format &format = parts_.video.format;
    arhost_intrinsics &intrinsics = parts_.video.intrinsics;
    const yaml::Node &node = configuration.camera_node ? *configuration.camera_node : configuration.source->node;
    if (configuration.camera)
        intrinsics = *configuration.camera;
    else if (ready.intrinsics)
        intrinsics = *ready.intrinsics;
    else if (configuration.time_codes) // only the ids of markers matter here, not their poses
        intrinsics = camera::dissertation_camera({format.width, format.height});
    else if (configuration.tracker)
        configuration.source->node.fail("this source does not report camera intrinsics: add 'camera: {file: "
                                        "calibration.yaml}' (docs/camera.md)");
    if (const std::string problem = camera::problem_with_lens(intrinsics); !problem.empty())
        node.fail(problem);
    intrinsics.coefficient_count = std::min(intrinsics.coefficient_count, camera::untilted_coefficients);
    if (configuration.tracker || configuration.trajectory) {
        try {
            camera::check_size(intrinsics, format.width, format.height);
        } catch (const std::runtime_error &error) {
            node.fail(error.what());
        }
    }
    parts_.cameras.set_intrinsics(intrinsics);
}

FrameFlow::Intake Source::intake() const {
    const bool is_ready =
        slots_ && has_started() && (!component_ || component_->earlier_outputs() < max_earlier_outputs);
    return {is_ready ? FrameFlow::Readiness::ready : FrameFlow::Readiness::down, slots_.get()};
}

void Source::read(const FrameFlow::Read &action) {
    Command command{};
    command.kind = CommandKind::read;
    command.slot = action.slot;
    command.sequence = action.sequence;
    component_->submit(command);
}

void Source::on_result(const Command &command, const Result &result) {
    FrameFlow &flow = parts_.flow;
    Lease pixels = flow.take_read();
    if (!flow.expects(command.sequence))
        return;
    if (result.status == ARHOST_STATUS_END_TRUNCATED && !flow.input_has_ended())
        parts_.failures.add(parts_.configuration.source->node.where() +
                                ": source: the input is truncated; the frames before the truncation are kept",
                            false);
    if (result.status >= ARHOST_STATUS_END || (flow.input_has_ended() && result.status < 0))
        return flow.on_input_ended();
    if (flow.discards_arrivals())
        return;
    if (result.status < 0) {
        flow.read_again(command.sequence);
        const std::string reason = std::string("read failed: ") + status_text(result.status);
        const bool is_final =
            result.status == ARHOST_STATUS_ERROR_CONFIGURATION || result.status == ARHOST_STATUS_ERROR_UNSUPPORTED;
        return is_final ? component_->disable(reason + "; see its messages above") : component_->end_process(reason);
    }
    on_frame(std::move(pixels), command, result);
}

void Source::on_frame(Lease pixels, const Command &command, const Result &result) {
    FrameFlow &flow = parts_.flow;
    Statistics &statistics = parts_.statistics;
    const session::RecordedFrame *const recorded = flow.recorded(command.sequence);
    auto frame = std::make_unique<Frame>(recorded ? recorded->number : command.sequence);
    const std::int64_t arrival_ns = parts_.now_ns();
    if (const char *problem = accept_frame_info(result.frame, last_capture_ns_, arrival_ns, frame->record)) {
        flow.read_again(command.sequence);
        return component_->end_process(std::string("contract violation: ") + problem);
    }
    last_capture_ns_ = result.frame.capture_ns;
    frame->recorded = recorded;
    if (recorded)
        repeat_record(*frame);
    frame->pixels = std::move(pixels);
    if (checks_) {
        checks_->check(statistics.contract_checks, frame->record, result.frame.skipped, arrival_ns);
        frame->pixels_sample = contracts::sample_hash(frame->pixels.bytes(), frame->record.sequence);
    }
    // The record of a replayed frame has the time at which it was recorded.
    statistics.latency_from_capture = result.frame.clock == ARHOST_CLOCK_MONOTONIC;
    frame->captured = Frame::Clock::time_point(std::chrono::nanoseconds(
        statistics.latency_from_capture ? std::min(result.frame.capture_ns, arrival_ns) : arrival_ns));
    frame->times.source = std::chrono::nanoseconds(result.busy_ns);
    skipped_ += result.frame.skipped;
    statistics.dropped["source"] = skipped_;
    statistics.stages.add("source", frame->times.source);
    flow.on_arrived(std::move(frame));
}

// Copies recorded data that the video of a session does not contain, such as the capture time. If the run repeats the
// recorded decisions, also copies the recorded results of the tracker, because they may depend on frames that the
// recorded run dropped.
void Source::repeat_record(Frame &frame) const {
    const session::RecordedFrame &recorded = *frame.recorded;
    frame.record.clock = recorded.clock;
    frame.record.capture_ns = recorded.capture_ns;
    frame.record.has_truth = recorded.truth.has_value();
    if (recorded.truth) {
        recorded.truth->first.copy(frame.record.truth_target, ARHOST_MAX_NAME - 1);
        std::ranges::copy(recorded.truth->second, frame.record.true_mt);
    }
    if (!parts_.flow.repeats_decisions(frame))
        return;
    frame.targets = recorded.targets;
    frame.observations = recorded.observations;
    frame.record.search = recorded.search;
    count_targets(frame, parts_.statistics);
    parts_.cameras.set_from_recording(frame);
}

void Source::on_lost(const std::vector<Command> &unanswered) {
    FrameFlow &flow = parts_.flow;
    slots_.reset();
    flow.on_source_lost(sequences_of(unanswered));
    const PluginDescription &plugin = component_->description(); // empty if the worker died before its hello message
    if (flow.next_read() > 0 && !plugin.id.empty() &&
        !(plugin.capabilities & (ARHOST_SOURCE_CAPABILITY_SEEK | ARHOST_SOURCE_CAPABILITY_LIVE)) &&
        !flow.input_has_ended()) {
        flow.on_input_ended();
        parts_.failures.add("source: " + plugin.short_name() +
                                " died, and after a restart it cannot continue at a later frame",
                            false);
    }
}

} // namespace arhost::host
