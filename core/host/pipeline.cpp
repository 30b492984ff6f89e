// SPDX-License-Identifier: Apache-2.0
#include "host/pipeline.hpp"

#include "camera/calibration.hpp"
#include "camera/mapping.hpp"

#include <algorithm>
#include <cstring>

namespace arhost::host {

using namespace ipc;
using supervise::Component;
using Clock = std::chrono::steady_clock;

namespace {

constexpr std::uint32_t source_slot_count = 8, stage_slot_count = 4;
constexpr std::size_t reads_in_flight = 2;
constexpr std::size_t live_sink_depth = 3;
constexpr std::uint32_t max_tries = 2; // a frame that was in a worker's hands at two deaths is suspect

std::int64_t now_ns() {
    return std::chrono::nanoseconds(Clock::now().time_since_epoch()).count();
}

std::shared_ptr<SlotPool> pool_of(const Component &component) {
    return component.output() ? std::make_shared<SlotPool>(component.output()) : nullptr;
}

} // namespace

Pipeline::Pipeline(const run_config::Configuration &configuration, supervise::Context context,
                   std::function<void(const Progress &)> on_progress)
    : configuration_(configuration), context_(std::move(context)), on_progress_(std::move(on_progress)),
      live_(configuration.mode == run_config::Mode::live) {
    statistics_.promises = Promises([this](const std::string &name, const std::string &sentence) {
        context_.log(ARHOST_SEVERITY_WARNING, name.substr(0, name.find('.')),
                     "breaks the promise " + name + ": " + sentence);
    });
}

bool Pipeline::run() {
    if (configuration_.source) {
        make_source();
        source_->start();
    } else {
        make_black_frames();
    }
    if (configuration_.raytracer) {
        SceneLoading::Hooks hooks;
        hooks.loaded = [this](SharedMemory arena) {
            arena_ = std::move(arena);
            if (configuration_.raytracer->conform)
                overlay_promises_.emplace(arena_.map(Access::read_only).as<const arhost_scene>());
            scene_loading_.reset();
        };
        hooks.failed = [this](const std::string &reason) {
            fail(reason, true);
            scene_loading_.reset();
        };
        scene_loading_ = std::make_unique<SceneLoading>(
            context_, configuration_.raytracer->scene, configuration_.sandbox, configuration_.raytracer->limits.start,
            configuration_.files, std::move(hooks));
    }
    while (phase_ != Phase::over) {
        context_.reactor.run_once();
        pump();
    }
    return failure_.empty();
}

// ---- components ------------------------------------------------------------------------------------

Component::Hooks Pipeline::hooks_for(const std::string &name, const yaml::Node &node) {
    Component::Hooks hooks;
    hooks.ready = [](const Json &) { return SlotLayout{}; };
    hooks.running = [] {};
    hooks.ended = [] {};
    hooks.stopped = [this, name](arhost_status status, const std::string &text) {
        if (status != ARHOST_STATUS_OK)
            fail(name + ": " + (text.empty() ? status_text(status) : text), false);
    };
    hooks.given_up = [this, name, node](const std::string &reason, bool by_configuration) {
        give_up(name, node, reason, by_configuration);
    };
    return hooks;
}

void Pipeline::make_source() {
    const run_config::SourceConfiguration &source = *configuration_.source;
    Component::Hooks hooks = hooks_for("source", source.node);
    hooks.hello = [this, &source, last = std::size_t{0}](const PluginDescription &plugin,
                                                         std::size_t candidate) mutable {
        if (std::exchange(last, candidate) != candidate)
            source_promises_.reset(); // another plugin's
        const Json options = to_json(run_config::options_for(plugin, ARHOST_KIND_SOURCE, source, candidate));
        Json setup = {{"first_sequence", next_read_ + skipped_}, {"fps", source.fps}, {"paced", live_}};
        if (configuration_.camera)
            setup["intrinsics"] = to_json(*configuration_.camera);
        return Component::Create{{{"options", options}, {"setup", setup}}, {}};
    };
    hooks.ready = [this, &source](const Json &ready) {
        const arhost_frame_format format = format_from_json(ready.at("format"));
        if (format_ && (format.pixel_format != format_->pixel_format || format.width != format_->width ||
                        format.height != format_->height))
            throw std::runtime_error("the restarted source gives frames of another format");
        format_ = format;
        frame_count_ = ready.at("frame_count").get<std::uint64_t>();
        const bool is_live = (source_->description().capabilities & ARHOST_CAPABILITY_LIVE) != 0;
        if (source.conform && !source_promises_)
            source_promises_.emplace(SourcePromises::Rate{is_live ? 0 : format.fps, source.fps > 0, live_}, now_ns());
        if (configuration_.camera)
            intrinsics_ = *configuration_.camera;
        else if (ready.contains("intrinsics"))
            intrinsics_ = intrinsics_from_json(ready["intrinsics"]);
        else if (configuration_.tracker)
            source.node.fail(
                "this source does not know its camera: add 'camera: {file: calibration.yaml}' (docs/camera.md)");
        if (configuration_.tracker || configuration_.trajectory) {
            try {
                camera::check_size(intrinsics_, format.width, format.height);
            } catch (const std::runtime_error &error) {
                configuration_.camera_node.value_or(source.node).fail(error.what());
            }
        }
        return SlotLayout{format.byte_size, source_slot_count};
    };
    hooks.running = [this] { source_slots_ = pool_of(*source_); };
    hooks.result = [this](const Command &command, const Result &result) { on_read(command, result); };
    hooks.lost = [this](const std::vector<Command> &unanswered) {
        reads_.clear();
        source_slots_.reset();
        for (const Command &command : unanswered)
            next_read_ = std::min(next_read_, command.sequence);
        const PluginDescription &plugin = source_->description(); // nothing where it died before it was opened
        if (next_read_ > 0 && !plugin.id.empty() &&
            !(plugin.capabilities & (ARHOST_CAPABILITY_SEEK | ARHOST_CAPABILITY_LIVE)) && !ended_) {
            ended_ = true;
            fail("source: " + plugin.id + " died, and can't go on in the middle", false);
        }
    };
    source_ = std::make_unique<Component>(context_, "source", source.plugins, source.limits, source.policy,
                                          std::move(hooks));
}

// What a trajectory without a source is composited over.
void Pipeline::make_black_frames() {
    intrinsics_ = *configuration_.camera;
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = ARHOST_PIXEL_FORMAT_GREY8;
    format.width = intrinsics_.width;
    format.height = intrinsics_.height;
    format.fps = configuration_.trajectory->fps;
    arhost_frame_layout(&format); // the configuration has checked the size
    format_ = format;
    source_slots_ = std::make_shared<SlotPool>(
        supervise::make_host_region("arhost-black", {format.byte_size, source_slot_count}));
}

void Pipeline::make_tracker() {
    const run_config::TrackerConfiguration &tracker = *configuration_.tracker;
    for (const arhost_marker_config &marker : tracker.markers)
        marker_ids_.insert(marker.id);
    Component::Hooks hooks = hooks_for("tracker", tracker.node);
    hooks.hello = [this, &tracker](const PluginDescription &plugin, std::size_t candidate) {
        const Json options = to_json(run_config::options_for(plugin, ARHOST_KIND_TRACKER, tracker, candidate));
        Json markers = Json::array();
        for (const arhost_marker_config &marker : tracker.markers)
            markers.push_back({{"id", marker.id}, {"side_mm", marker.side_mm}});
        return Component::Create{
            {{"options", options},
             {"setup", {{"format", to_json(*format_)}, {"intrinsics", to_json(intrinsics_)}, {"markers", markers}}}},
            {}};
    };
    hooks.ready = [](const Json &) { return SlotLayout{sizeof(arhost_tracker_result), stage_slot_count}; };
    hooks.running = [this] { tracker_slots_ = pool_of(*tracker_); };
    hooks.result = [this](const Command &command, const Result &result) { on_tracked(command, result); };
    hooks.lost = [this](const std::vector<Command> &unanswered) {
        on_stage_lost(unanswered, Frame::Stage::to_track, "tracker");
    };
    tracker_ = std::make_unique<Component>(context_, "tracker", tracker.plugins, tracker.limits, tracker.policy,
                                           std::move(hooks));
}

void Pipeline::make_raytracer() {
    const run_config::RaytracerConfiguration &raytracer = *configuration_.raytracer;
    Component::Hooks hooks = hooks_for("raytracer", raytracer.node);
    hooks.hello = [this, &raytracer](const PluginDescription &plugin, std::size_t candidate) {
        const Json options = to_json(run_config::options_for(plugin, ARHOST_KIND_RAYTRACER, raytracer, candidate));
        warp_.reset();
        if (intrinsics_.distortion != ARHOST_DISTORTION_NONE &&
            !(plugin.capabilities & ARHOST_CAPABILITY_LENS_DISTORTION)) {
            warp_ = std::make_shared<LensWarp>(intrinsics_);
            context_.log(ARHOST_SEVERITY_WARNING, "raytracer",
                         plugin.id + " can't trace through a distorted lens: its images are bent afterwards, which "
                                     "costs sharpness and the host's time");
        }
        const arhost_intrinsics &traced = warp_ ? warp_->pinhole() : intrinsics_;
        return Component::Create{
            {{"options", options},
             {"setup", {{"width", format_->width}, {"height", format_->height}, {"intrinsics", to_json(traced)}}}},
            {arena_.fd()}};
    };
    hooks.ready = [this](const Json &) {
        return SlotLayout{std::uint64_t(overlay_stride(format_->width)) * format_->height, stage_slot_count};
    };
    hooks.running = [this] { raytracer_slots_ = pool_of(*raytracer_); };
    hooks.result = [this](const Command &command, const Result &result) { on_rendered(command, result); };
    hooks.lost = [this](const std::vector<Command> &unanswered) {
        on_stage_lost(unanswered, Frame::Stage::to_render, "raytracer");
    };
    raytracer_ = std::make_unique<Component>(context_, "raytracer", raytracer.plugins, raytracer.limits,
                                             raytracer.policy, std::move(hooks));
}

void Pipeline::make_outputs() {
    output_slots_ = std::make_shared<SlotPool>(supervise::make_host_region(
        "arhost-outputs", {OutputSlot::byte_size(format_->width, format_->height),
                           // Sinks hold different frames when they are differently behind: none may take all.
                           static_cast<std::uint32_t>(live_sink_depth + 2 * configuration_.outputs.size() + 1)}));
    for (std::size_t i = 0; i < configuration_.outputs.size(); ++i) {
        const run_config::ComponentConfiguration &output = configuration_.outputs[i];
        std::string name = output.plugins.front().stem().string();
        if (std::any_of(sinks_.begin(), sinks_.end(),
                        [&](const auto &sink) { return sink->component->name() == name; }))
            name += "#" + std::to_string(i);
        sinks_.push_back(std::make_unique<SinkQueue>(statistics_));
        SinkQueue *sink = sinks_.back().get();
        sink->depth = live_ ? live_sink_depth : 0;
        Component::Hooks hooks = hooks_for(name, output.node);
        hooks.hello = [this, &output, sink](const PluginDescription &plugin, std::size_t candidate) {
            const Json options = to_json(run_config::options_for(plugin, ARHOST_KIND_SINK, output, candidate));
            if (plugin.capabilities & ARHOST_CAPABILITY_REALTIME_SINK)
                sink->depth = live_sink_depth; // a window never makes a film wait
            const bool fps_is_set = configuration_.source && configuration_.source->fps > 0;
            Json setup = {{"width", format_->width},
                          {"height", format_->height},
                          {"fps", fps_is_set ? configuration_.source->fps : format_->fps},
                          {"first_sequence", sink->first_sequence()}};
            if (intrinsics_.width > 0)
                setup["intrinsics"] = to_json(intrinsics_);
            return Component::Create{{{"options", options}, {"setup", setup}}, {}};
        };
        hooks.result = [this, sink, name](const Command &command, const Result &result) {
            sink->on_result(command, result);
            if (result.status == ARHOST_STATUS_END)
                end_run();
            if (result.status >= 0 || sink->failed)
                return;
            // A full disk does not mend itself: what is whole is kept, the video goes on elsewhere.
            const std::string reason = "can't write frame " + std::to_string(command.sequence) + ": " +
                                       status_text(result.status) + "; its messages above say more";
            context_.log(ARHOST_SEVERITY_ERROR, name, reason);
            fail(name + ": " + reason, false);
            give_up_sink(*sink);
            sink->component->stop();
        };
        hooks.lost = [sink](const std::vector<Command> &) { sink->on_lost(); };
        hooks.ended = [this] { end_run(); };
        hooks.given_up = [this, sink, name, &output](const std::string &reason, bool by_configuration) {
            give_up(name, output.node, reason, by_configuration);
            give_up_sink(*sink);
        };
        sink->component = std::make_unique<Component>(context_, name, output.plugins, output.limits, output.policy,
                                                      std::move(hooks));
        sink->component->start();
    }
}

std::vector<Component *> Pipeline::components() const {
    std::vector<Component *> all;
    for (const auto *component : {&source_, &tracker_, &raytracer_})
        if (*component)
            all.push_back(component->get());
    for (const auto &sink : sinks_)
        all.push_back(sink->component.get());
    return all;
}

// ---- the run ---------------------------------------------------------------------------------------

void Pipeline::pump() {
    if (abandoned_) {
        for (Component *component : components())
            component->kill();
        phase_ = Phase::over;
        return;
    }
    if (phase_ < Phase::running)
        enter_next_phase();
    if (phase_ == Phase::running) {
        while (read() || track() || render() || compose()) {
        }
        bool sinks_empty = true;
        for (const auto &sink : sinks_) {
            sink->pump();
            sinks_empty = sinks_empty && (sink->empty() || sink->failed);
        }
        if (no_more_frames() && reads_.empty()) {
            if (frames_.empty() && sinks_empty)
                stop_components();
            else if (!frames_.empty() &&
                     std::all_of(frames_.begin(), frames_.end(), [](const auto &f) { return f.second->overtaken; }))
                cancel_stages();
        }
    }
    if (phase_ == Phase::stopping) {
        for (const auto &sink : sinks_)
            sink->pump();
        const auto all = components();
        if (std::all_of(all.begin(), all.end(),
                        [](const Component *component) { return component->state() == Component::State::stopped; }))
            phase_ = Phase::over;
    }
}

void Pipeline::enter_next_phase() {
    const auto settled = [](const std::unique_ptr<Component> &component) {
        return !component || component->running();
    };
    if (phase_ == Phase::source && settled(source_) && !scene_loading_ && (!configuration_.raytracer || arena_)) {
        if (configuration_.tracker) {
            make_tracker();
            tracker_->start();
        }
        if (configuration_.raytracer) {
            coordinates_ = configuration_.coordinates.value_or(
                camera::default_for(arena_.map(Access::read_only).as<const arhost_scene>().axes));
            make_raytracer();
            raytracer_->start();
        }
        phase_ = Phase::stages;
    }
    if (phase_ == Phase::stages && settled(tracker_) && settled(raytracer_)) {
        make_outputs(); // last, so that no file is touched by a run that can't begin
        phase_ = Phase::outputs;
    }
    if (phase_ == Phase::outputs &&
        std::all_of(sinks_.begin(), sinks_.end(), [&](const auto &sink) { return settled(sink->component); }))
        phase_ = Phase::running;
}

bool Pipeline::no_more_frames() const {
    return ended_ || (configuration_.frames && next_read_ >= configuration_.frames);
}

bool Pipeline::read() {
    if (!source_)
        return read_from_trajectory();
    if (no_more_frames() || !source_->running() || reads_.size() >= reads_in_flight)
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

// Without a source the frames are the trajectory's, each once: what the recorded run dropped is not traced.
bool Pipeline::read_from_trajectory() {
    if (no_more_frames())
        return false;
    std::optional<Lease> slot = source_slots_->acquire();
    if (!slot)
        return false;
    const camera::Trajectory &trajectory = *configuration_.trajectory;
    const camera::TrajectoryFrame *recorded = trajectory.at_or_after(next_read_);
    if (recorded->frame >= configuration_.frames) { // a limit that is set, and lies within the trajectory
        ended_ = true;
        return false;
    }
    auto frame = std::make_unique<Frame>();
    frame->record.struct_size = sizeof(arhost_record);
    frame->record.sequence = recorded->frame;
    frame->record.overlay = ARHOST_OVERLAY_NONE;
    frame->record.clock = trajectory.clock.value_or(ARHOST_CLOCK_MEDIA);
    frame->record.capture_ns = recorded->capture_ns;
    frame->pixels = std::move(*slot);
    next_read_ = recorded->frame + 1;
    begin(std::move(frame));
    return true;
}

void Pipeline::on_read(const Command &command, const Result &result) {
    Lease pixels = std::move(reads_.front());
    reads_.pop_front();
    if (command.sequence >= next_read_) // the frame before it failed, and comes first
        return;
    if (result.status == ARHOST_STATUS_END_TRUNCATED && !ended_)
        fail(configuration_.source->node.where() + ": source: its input is cut short; what there was is kept", false);
    if (result.status >= ARHOST_STATUS_END || (ended_ && result.status < 0)) {
        ended_ = true;
        return;
    }
    if (ended_ && interrupted_ && live_)
        return;
    if (result.status < 0) {
        next_read_ = command.sequence; // it is tried again after the restart
        return source_->end_process(std::string("gave no frame: ") + status_text(result.status));
    }
    auto frame = std::make_unique<Frame>();
    frame->record.struct_size = sizeof(arhost_record);
    frame->record.sequence = command.sequence;
    frame->record.overlay = ARHOST_OVERLAY_NONE;
    const std::int64_t came_ns = now_ns();
    if (const char *problem = take_frame_info(result.frame, last_capture_ns_, came_ns, frame->record)) {
        next_read_ = command.sequence;
        return source_->end_process(std::string("broke the contract: ") + problem);
    }
    last_capture_ns_ = result.frame.capture_ns;
    frame->pixels = std::move(pixels);
    if (configuration_.source->conform) {
        source_promises_->look(statistics_.promises, frame->record, result.frame.skipped, came_ns);
        frame->pixels_sample = sample_of(frame->pixels.bytes(), frame->record.sequence);
    }
    frame->times.source = std::chrono::nanoseconds(result.busy_ns);
    skipped_ += result.frame.skipped;
    statistics_.dropped["source"] = skipped_;
    statistics_.stages["source"].add(std::chrono::nanoseconds(result.busy_ns));
    begin(std::move(frame));
}

// A frame sets out.
void Pipeline::begin(std::unique_ptr<Frame> frame) {
    frame->received = Clock::now();
    if (statistics_.frames_in++ == 0)
        statistics_.first_frame = frame->received;
    Frame &added = *(frames_[frame->record.sequence] = std::move(frame));
    if (configuration_.trajectory)
        take_camera_of_trajectory(added);
    if (live_ && is_behind())
        pass(added, "latency");
    else if (tracker_)
        wait_for(added, Frame::Stage::to_track);
    else
        on_camera_known(added);
}

bool Pipeline::track() {
    Frame *frame = next_waiting(Frame::Stage::to_track);
    if (!frame)
        return false;
    if (may_pass(tracker_.get())) {
        pass(*frame, "tracker");
        return true;
    }
    if (!tracker_->running() || tracker_->in_flight() >= (live_ ? 1u : 2u))
        return false;
    std::optional<Lease> slot = tracker_slots_->acquire();
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
    tracker_->submit(command, frame->pixels.region());
    return true;
}

// Counts a stage's answer; the frame that goes on with it, or null where there is none: it has been
// overtaken, or passes the stage by.
Frame *Pipeline::take_answer(const Command &command, const Result &result, const char *stage) {
    statistics_.stages[stage].add(std::chrono::nanoseconds(result.busy_ns));
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
        context_.log(ARHOST_SEVERITY_WARNING, stage,
                     "frame " + std::to_string(command.sequence) + ": " + status_text(result.status));
        pass(frame, stage);
        return nullptr;
    }
    return &frame;
}

void Pipeline::on_tracked(const Command &command, const Result &result) {
    Frame *answered = take_answer(command, result, "tracker");
    if (!answered)
        return;
    Frame &frame = *answered;
    frame.tries = 0;
    const char *problem = take_tracker_result(frame.result.bytes(), marker_ids_, frame.record);
    frame.result = Lease();
    if (problem) {
        pass(frame, "tracker");
        return tracker_->end_process(std::string("broke the contract: ") + problem);
    }
    if (configuration_.tracker->conform)
        look_at_markers(statistics_.promises, frame.record, intrinsics_, configuration_.tracker->markers);
    frame.times.tracker = std::chrono::nanoseconds(result.busy_ns);
    take_camera_of_markers(frame);
    on_camera_known(frame);
}

void Pipeline::take_camera_of_markers(Frame &frame) {
    // The first in the order of the configuration; trackers report in that order.
    const std::span markers(frame.record.markers, frame.record.marker_count);
    const auto anchor = std::find_if(markers.begin(), markers.end(),
                                     [](const arhost_marker &m) { return m.state != ARHOST_MARKER_LOST; });
    statistics_.tracked += anchor != markers.end();
    if (configuration_.trajectory)
        return;
    const std::uint64_t sequence = frame.record.sequence;
    if (anchor != markers.end())
        last_camera_ = {sequence, *camera::camera_from_marker(anchor->mt, coordinates_, intrinsics_)};
    if (!last_camera_ || sequence - last_camera_->first > configuration_.tracker->hold_frames)
        return;
    frame.held = last_camera_->first != sequence;
    frame.record.camera = last_camera_->second;
    frame.record.has_camera = 1;
}

// The recorded time too, so that what moves in the scene is where it was. A frame that the recorded run
// dropped has no camera.
void Pipeline::take_camera_of_trajectory(Frame &frame) const {
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
    if (raytracer_ && frame.record.has_camera)
        wait_for(frame, Frame::Stage::to_render);
    else
        frame.stage = Frame::Stage::done;
}

bool Pipeline::render() {
    Frame *frame = next_waiting(Frame::Stage::to_render);
    if (!frame)
        return false;
    if (may_pass(raytracer_.get())) {
        pass(*frame, "raytracer");
        return true;
    }
    if (!raytracer_->running() || raytracer_->in_flight() >= (live_ ? 1u : 2u))
        return false;
    std::optional<Lease> slot = raytracer_slots_->acquire();
    if (!slot)
        return false;
    frame->overlay = std::move(*slot);
    frame->stage = Frame::Stage::rendering;
    Command command{};
    command.kind = CommandKind::render;
    command.slot = frame->overlay.index();
    command.sequence = frame->record.sequence;
    command.time_s = 1e-9 * static_cast<double>(frame->record.capture_ns);
    command.camera = frame->record.camera;
    if (warp_)
        command.camera.intrinsics = warp_->pinhole();
    frame->warp = warp_;
    raytracer_->submit(command);
    return true;
}

void Pipeline::on_rendered(const Command &command, const Result &result) {
    const std::chrono::nanoseconds busy(result.busy_ns), device = device_time(result.render, busy);
    if (device.count())
        statistics_.stages["device"].add(device);
    Frame *answered = take_answer(command, result, "raytracer");
    if (!answered)
        return;
    Frame &frame = *answered;
    frame.render = result.render;
    frame.times.raytracer = busy;
    frame.times.device = device;
    frame.record.overlay = frame.held ? ARHOST_OVERLAY_HELD : ARHOST_OVERLAY_RENDERED;
    frame.stage = Frame::Stage::done;
    if (overlay_promises_) {
        overlay_promises_->look(statistics_.promises, command.sequence, command.camera,
                                region_of(frame.render, format_->width, format_->height), overlay_of(frame));
        frame.overlay_sample = sample_of(frame.overlay.bytes(), command.sequence);
    }
}

ImageView Pipeline::overlay_of(const Frame &frame) const {
    return {reinterpret_cast<const std::uint8_t *>(frame.overlay.bytes().data()), overlay_stride(format_->width)};
}

// Bytes that a component has given are its no more.
void Pipeline::check_buffers_unmodified(const Frame &frame) {
    const std::uint64_t sequence = frame.record.sequence;
    if (frame.pixels_sample)
        statistics_.promises.look("source.frame-stays", sequence,
                                  sample_of(frame.pixels.bytes(), sequence) == frame.pixels_sample
                                      ? ""
                                      : "it was written to after it had been given");
    if (frame.overlay_sample && frame.overlay)
        statistics_.promises.look("raytracer.image-stays", sequence,
                                  sample_of(frame.overlay.bytes(), sequence) == frame.overlay_sample
                                      ? ""
                                      : "its image was written to after it had been given");
}

void Pipeline::on_stage_lost(const std::vector<Command> &unanswered, Frame::Stage waiting, const char *stage) {
    (waiting == Frame::Stage::to_track ? tracker_slots_ : raytracer_slots_).reset();
    for (const Command &command : unanswered) {
        const auto found = frames_.find(command.sequence);
        if (found == frames_.end())
            continue;
        Frame &frame = *found->second;
        frame.result = Lease();
        frame.overlay = Lease();
        // Only the oldest was in the worker's hands when it died.
        const bool worked_on = &command == &unanswered.front();
        if (frame.overtaken)
            frames_.erase(found);
        else if (live_ || (worked_on && ++frame.tries >= max_tries))
            pass(frame, stage);
        else
            frame.stage = waiting;
    }
}

bool Pipeline::may_pass(const Component *stage) const {
    return live_ ? !stage->running() : stage->state() == Component::State::given_up;
}

bool Pipeline::is_behind() const {
    const Clock::time_point limit = Clock::now() - configuration_.max_latency;
    return std::any_of(frames_.begin(), frames_.end(), [&](const auto &entry) {
        return entry.second->in_worker() && entry.second->received < limit;
    });
}

void Pipeline::pass(Frame &frame, const char *stage) {
    frame.result = Lease();
    frame.overlay = Lease();
    frame.record.overlay = ARHOST_OVERLAY_NONE;
    frame.stage = Frame::Stage::done;
    ++statistics_.passed[stage];
}

// In mode live a frame that waits takes the place of an older one that waits for the same stage.
void Pipeline::wait_for(Frame &frame, Frame::Stage stage) {
    if (live_)
        for (auto it = frames_.begin(); it != frames_.end();) {
            const bool replaced = it->second->stage == stage && it->second.get() != &frame;
            if (replaced)
                ++statistics_.dropped[stage == Frame::Stage::to_track ? "tracker" : "raytracer"];
            it = replaced ? frames_.erase(it) : std::next(it);
        }
    frame.stage = stage;
}

Frame *Pipeline::next_waiting(Frame::Stage stage) {
    for (const auto &[sequence, frame] : frames_)
        if (frame->stage == stage)
            return frame.get();
    return nullptr;
}

bool Pipeline::compose() {
    // In lockstep the oldest frame; in live the newest one that is done.
    auto ready = frames_.begin();
    if (live_)
        for (auto it = frames_.begin(); it != frames_.end(); ++it)
            if (it->second->stage == Frame::Stage::done)
                ready = it;
    if (ready == frames_.end() || ready->second->stage != Frame::Stage::done)
        return false;
    const bool wanted = std::any_of(sinks_.begin(), sinks_.end(), [](const auto &sink) { return !sink->failed; });
    bool shown_somewhere = true;
    if (wanted) {
        std::optional<Lease> slot = output_slots_->acquire();
        if (!slot && !live_)
            return false; // the outputs are behind; the source waits for them in turn
        shown_somewhere = slot.has_value();
        if (slot) {
            auto output = std::make_shared<OutputFrame>(OutputFrame{ready->first, std::move(*slot)});
            compose(*ready->second, output->slot.bytes());
            for (const auto &sink : sinks_)
                sink->offer(output);
            for (const auto &sink : sinks_)
                sink->pump();
        } else {
            ++statistics_.dropped["output"];
        }
    }
    const std::uint64_t shown = ready->first;
    statistics_.composited += shown_somewhere;
    statistics_.augmented += shown_somewhere && ready->second->record.overlay != ARHOST_OVERLAY_NONE;
    statistics_.last_frame = Clock::now();
    const Clock::duration latency = statistics_.last_frame - ready->second->received;
    statistics_.stages["latency"].add(latency);
    if (configuration_.timeline && shown_somewhere) {
        FrameTimes &times = statistics_.timeline.emplace_back(ready->second->times);
        times.frame = shown;
        times.shown = statistics_.last_frame;
        times.latency = latency;
    }
    frames_.erase(ready);
    if (live_)
        forget_overtaken(shown);
    on_progress_({statistics_.composited, configuration_.frames ? configuration_.frames : frame_count_, false});
    return true;
}

void Pipeline::compose(Frame &frame, std::span<std::byte> slot) {
    check_buffers_unmodified(frame);
    const Clock::time_point begin = Clock::now();
    const auto *pixels = reinterpret_cast<const std::uint8_t *>(frame.pixels.bytes().data());
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {};
    for (std::uint32_t i = 0; i < format_->plane_count; ++i)
        planes[i] = pixels + format_->offset[i];
    ImageView overlay;
    Region region;
    if (frame.record.overlay != ARHOST_OVERLAY_NONE) {
        overlay = overlay_of(frame);
        region = region_of(frame.render, format_->width, format_->height);
        if (frame.warp) {
            overlay = frame.warp->warp(overlay, region);
            region = {0, 0, format_->width, format_->height};
        }
    }
    // The markers past marker_count are left as they are: they carry no meaning.
    const std::size_t used = offsetof(arhost_record, markers) + frame.record.marker_count * sizeof(arhost_marker);
    std::memcpy(slot.data(), &frame.record, used);
    composite(*format_, planes, overlay, region,
              {reinterpret_cast<std::uint8_t *>(slot.data()) + OutputSlot::image_offset,
               OutputSlot::stride(format_->width)});
    frame.times.composite = Clock::now() - begin;
    statistics_.stages["composite"].add(frame.times.composite);
}

void Pipeline::forget_overtaken(std::uint64_t shown) {
    for (auto it = frames_.begin(); it != frames_.end() && it->first < shown;) {
        it->second->overtaken = it->second->in_worker();
        statistics_.dropped["late"] += !it->second->in_worker();
        it = it->second->in_worker() ? std::next(it) : frames_.erase(it);
    }
}

// ---- the end ---------------------------------------------------------------------------------------

void Pipeline::end_run() {
    ended_ = true;
    if (source_)
        source_->cancel_call();
}

// Calls for frames that no one is to see any more.
void Pipeline::cancel_stages() {
    for (Component *stage : {tracker_.get(), raytracer_.get()})
        if (stage)
            stage->cancel_call();
}

void Pipeline::give_up_sink(SinkQueue &sink) {
    sink.failed = true;
    sink.clear();
    if (phase_ == Phase::running &&
        std::all_of(sinks_.begin(), sinks_.end(), [](const auto &other) { return other->failed; }))
        end_run(); // nobody is left to see a frame
}

void Pipeline::interrupt() {
    // Before the first frame nothing has been written: there is nothing to finish.
    abandoned_ = interrupted_ || phase_ < Phase::running;
    interrupted_ = true;
    end_run();
}

void Pipeline::stop_components() {
    if (phase_ >= Phase::stopping)
        return;
    phase_ = Phase::stopping;
    scene_loading_.reset();
    on_progress_({statistics_.composited, statistics_.composited, true});
    for (Component *stage : {source_.get(), tracker_.get(), raytracer_.get()})
        if (stage)
            stage->running() ? stage->stop() : stage->kill();
    // A sink that is down is started once more, to finish its files.
    for (const auto &sink : sinks_)
        if (sink->component->state() != Component::State::stopped)
            sink->component->stop();
}

void Pipeline::fail(const std::string &reason, bool by_configuration) {
    context_.log(ARHOST_SEVERITY_DEBUG, "arhost", reason);
    if (failure_.empty()) {
        failure_ = reason;
        failed_by_configuration_ = by_configuration && phase_ < Phase::running;
    }
    abandoned_ = abandoned_ || phase_ < Phase::running;
}

void Pipeline::give_up(const std::string &name, const yaml::Node &node, const std::string &reason,
                       bool by_configuration) {
    // What the configuration's own check said begins with its place in the file.
    const bool located = reason.starts_with(node.file().string() + ":") || reason.starts_with("--");
    fail(located ? reason : node.where() + ": " + name + ": " + reason, by_configuration);
    if (phase_ != Phase::running)
        return;
    context_.log(ARHOST_SEVERITY_ERROR, name, reason + "; the video goes on without it");
    if (name == "source")
        ended_ = true;
}

} // namespace arhost::host
