// SPDX-License-Identifier: Apache-2.0
//
// Creates the components of a pipeline and defines how the pipeline reacts to changes of their state.
#include "host/pipeline.hpp"

#include "base/text.hpp"
#include "camera/calibration.hpp"
#include "camera/coordinates.hpp"
#include "camera/lens_model.hpp"
#include "host/outcome.hpp"
#include "run_config/access.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <optional>
#include <random>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

namespace {

constexpr std::uint32_t source_slot_count = 8, stage_slot_count = 4;
constexpr std::size_t live_sink_depth = 3;

std::string random_id() {
    std::random_device random;
    return fmt::format("{:08x}{:08x}", random(), random());
}

std::shared_ptr<SlotPool> pool_of(const Component &component) {
    return component.output() ? std::make_shared<SlotPool>(component.output()) : nullptr;
}

// Returns the key of the target that a message of the tracker quotes first: by its name, or by the family or the file
// of a marker. Later quotes may be keys, such as 'image', that other targets have as their family.
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

Component::Callbacks Pipeline::common_callbacks(const std::string &name, const yaml::Node &node) {
    Component::Callbacks callbacks;
    callbacks.ready = [](const messages::Ready &) { return SlotLayout{}; };
    callbacks.running = [] {};
    callbacks.end_requested = [] {};
    callbacks.request = [](const messages::Request &) {};
    callbacks.stopped = [this, name](arhost_status status, const std::string &text) {
        if (status != ARHOST_STATUS_OK)
            fail(name + ": " + (text.empty() ? status_text(status) : text), false);
    };
    callbacks.disabled = [this, name, node](const std::string &reason, bool is_configuration_error) {
        on_disabled(name, node, reason, is_configuration_error);
    };
    return callbacks;
}

void Pipeline::make_source() {
    const run_config::SourceConfiguration &source = *configuration_.source;
    Component::Callbacks callbacks = common_callbacks("source", source.node);
    callbacks.hello = [this, &source, last = std::size_t{0}](const PluginDescription &,
                                                             std::size_t candidate) mutable {
        if (std::exchange(last, candidate) != candidate)
            source_checks_.reset(); // the checks apply to one plugin; this is a different one
        return Component::Create{
            {options_for(*source_, ARHOST_KIND_SOURCE, source, candidate),
             messages::SourceSetup{next_read_ + skipped_, source.fps, live_, configuration_.camera}},
            {}};
    };
    callbacks.ready = [this, &source](const messages::Ready &ready) {
        if (!ready.format)
            throw ProtocolViolation("the source's 'ready' lacks the frame format");
        const arhost_frame_format &format = *ready.format;
        if (format_ && (format.pixel_format != format_->pixel_format || format.width != format_->width ||
                        format.height != format_->height || format.has_depth != format_->has_depth ||
                        format.transfer != format_->transfer))
            throw std::runtime_error("the frame format differs after the restart");
        format_ = format;
        frame_count_ = ready.frame_count;
        const bool is_live = (source_->description().capabilities & ARHOST_CAPABILITY_LIVE) != 0;
        if (source.conform && !source_checks_)
            source_checks_.emplace(SourceChecks::Rate{is_live ? 0 : format.fps, source.fps > 0, live_},
                                   monotonic_ns());
        if (configuration_.camera)
            intrinsics_ = *configuration_.camera;
        else if (ready.intrinsics)
            intrinsics_ = *ready.intrinsics;
        else if (configuration_.time_codes) // only the ids of markers matter, not their poses
            intrinsics_ = camera::dissertation_camera({format.width, format.height});
        else if (configuration_.tracker)
            source.node.fail("this source does not report camera intrinsics: add 'camera: {file: calibration.yaml}' "
                             "(docs/camera.md)");
        if (const std::string problem = camera::problem_with_lens(intrinsics_); !problem.empty())
            configuration_.camera_node.value_or(source.node).fail(problem);
        if (configuration_.tracker || configuration_.trajectory) {
            try {
                camera::check_size(intrinsics_, format.width, format.height);
            } catch (const std::runtime_error &error) {
                configuration_.camera_node.value_or(source.node).fail(error.what());
            }
        }
        return SlotLayout{format.byte_size, source_slot_count};
    };
    callbacks.running = [this] { source_slots_ = pool_of(*source_); };
    callbacks.result = [this](const Command &command, const Result &result) { on_read(command, result); };
    callbacks.lost = [this](const std::vector<Command> &unanswered) {
        reads_.clear();
        source_slots_.reset();
        for (const Command &command : unanswered)
            next_read_ = std::min(next_read_, command.sequence);
        const PluginDescription &plugin = source_->description(); // empty if the worker died before its hello message
        if (next_read_ > 0 && !plugin.id.empty() &&
            !(plugin.capabilities & (ARHOST_CAPABILITY_SEEK | ARHOST_CAPABILITY_LIVE)) && !input_ended_) {
            input_ended_ = true;
            fail("source: " + plugin.id + " died, and after a restart it cannot continue at a later frame", false);
        }
    };
    source_ = std::make_unique<Component>(context_, "source", source.plugins, source.limits, source.policy,
                                          std::move(callbacks));
}

// Creates the black background frames of a trajectory without a source.
void Pipeline::make_black_frames() {
    intrinsics_ = *configuration_.camera;
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = ARHOST_PIXEL_FORMAT_GREY8;
    format.width = intrinsics_.width;
    format.height = intrinsics_.height;
    format.fps = configuration_.trajectory->fps;
    arhost_frame_layout(&format); // cannot fail, because the size was validated with the configuration
    format_ = format;
    source_slots_ = std::make_shared<SlotPool>(
        supervise::make_host_region("arhost-black", {format.byte_size, source_slot_count}));
}

void Pipeline::load_scene() {
    scene_loading_ = load(
        configuration_.scenes.front(), *configuration_.raytracer,
        [this](std::shared_ptr<LoadedScene> scene) {
            scene_ = std::move(scene);
            scene_loading_.reset();
        },
        [this](const std::string &reason) {
            fail(reason, true);
            scene_loading_.reset();
        });
}

// Returns the tracker whose targets objects can belong to; null if there is none.
const run_config::TrackerConfiguration *Pipeline::tracker_of_anchors() const {
    // A session contains the poses of the targets, so its replay needs no tracker.
    const bool replays_poses = configuration_.recording && configuration_.recording->repeats_decisions;
    return latest_->tracker                              ? &*latest_->tracker
           : replays_poses && !latest_->trackers.empty() ? &latest_->trackers.front()
                                                         : nullptr;
}

// Starts to load a scene. Calls one of the two functions, which may destroy the returned object.
std::unique_ptr<SceneLoading> Pipeline::load(const run_config::Scene &scene,
                                             const run_config::RaytracerConfiguration &raytracer,
                                             const std::function<void(std::shared_ptr<LoadedScene>)> &on_loaded,
                                             const std::function<void(const std::string &reason)> &on_failed) {
    auto loaded = std::make_shared<LoadedScene>();
    loaded->source = scene;
    SceneLoading::Callbacks callbacks;
    callbacks.loaded = [this, loaded, conform = raytracer.conform, on_loaded, on_failed](
                           SharedMemory arena, const std::vector<Anchor> &anchors, const FileWatch::Files &files) {
        const Mapping mapping = arena.map(Access::read_only);
        const auto &content = mapping.as<const arhost_scene>();
        loaded->files = files;
        loaded->anchors = anchors;
        if (const std::string problem = problem_with(anchors, tracker_of_anchors()); !problem.empty())
            return on_failed(problem);
        loaded->coordinates = latest_->coordinates.value_or(camera::default_for(content.axes));
        if (conform)
            loaded->overlay_checks.emplace(content);
        loaded->arena = std::move(arena);
        watch_files(files);
        on_loaded(loaded);
    };
    callbacks.failed = [this, on_failed](const std::string &reason, const FileWatch::Files &files) {
        watch_files(files);
        on_failed(reason);
    };
    watch_files({scene.file, base::real_path(scene.file)});
    return std::make_unique<SceneLoading>(context_, scene.file, configuration_.sandbox, raytracer.limits,
                                          configuration_.files, std::move(callbacks));
}

std::unique_ptr<TrackerStage> Pipeline::make_tracker(TrackerPointer configuration) {
    auto tracker = std::make_unique<TrackerStage>();
    TrackerStage *stage = tracker.get();
    stage->families = families_of(configuration->targets);
    stage->targets = to_memory(configuration->targets);
    for (const model::Target &target : configuration->targets)
        for (const model::TargetMarker &marker : target.markers)
            stage->listed.try_emplace({marker.family, marker.id}, marker_name(marker));
    Component::Callbacks callbacks = common_callbacks("tracker", configuration->node);
    callbacks.hello = [this, stage](const PluginDescription &plugin, std::size_t candidate) {
        const run_config::TrackerConfiguration &own = *stage->configuration;
        if (const auto body =
                std::ranges::find_if(own.targets, [](const auto &target) { return !target.body.empty(); });
            body != own.targets.end() && !(plugin.capabilities & ARHOST_CAPABILITY_REPORTS_POSES))
            own.node.find("targets").value_or(own.node).fail(
                "the target '" + body->name + "' is a body, but '" + plugin.id +
                "' finds only markers; choose a tracker that reports the poses of bodies");
        return Component::Create{
            {options_for(*stage->component, ARHOST_KIND_TRACKER, own, candidate),
             messages::TrackerSetup{*format_, intrinsics_, own.full_search_every, own.smooth, own.confirm}},
            {stage->targets->fd()}};
    };
    callbacks.ready = [stage](const messages::Ready &ready) {
        constexpr std::uint64_t max_size = 2 * std::uint64_t{ARHOST_MAX_STATE}; // of the plugin and the worker itself
        if (ready.state_size > max_size)
            throw ProtocolViolation("the state has " + std::to_string(ready.state_size) + " bytes; the limit is " +
                                    std::to_string(max_size));
        const TrackerStage::StateOwner owner{stage->component->candidate(), stage->component->description().version,
                                             ready.state_size};
        if (std::exchange(stage->state_owner, owner) != owner)
            stage->state_is_of_solver_only = true;
        return SlotLayout{TrackerSlot(stage->configuration->targets.size()).byte_size(ready.state_size),
                          stage_slot_count};
    };
    callbacks.running = [stage] { stage->slots = pool_of(*stage->component); };
    callbacks.disabled = [this, stage](const std::string &reason, bool is_configuration_error) {
        if (stage == next_tracker_.get())
            return abandon_swap(std::exchange(next_tracker_, nullptr), reason);
        // While the video runs, it continues without the whole tracker.
        if (const auto target = quoted_target(reason, *stage->configuration); target && phase_ != Phase::running)
            return on_disabled(target->path(), *target, reason, is_configuration_error);
        on_disabled("tracker", stage->configuration->node, reason, is_configuration_error);
    };
    callbacks.result = [this](const Command &command, const Result &result) { on_tracked(command, result); };
    callbacks.lost = [this, stage](const std::vector<Command> &unanswered) {
        on_stage_lost(*stage, unanswered, Frame::Stage::to_track);
    };
    stage->component = std::make_unique<Component>(context_, "tracker", configuration->plugins, configuration->limits,
                                                   configuration->policy, std::move(callbacks));
    stage->configuration = std::move(configuration);
    return tracker;
}

std::unique_ptr<RaytracerStage> Pipeline::make_raytracer(RaytracerPointer configuration,
                                                         std::shared_ptr<LoadedScene> scene) {
    auto raytracer = std::make_unique<RaytracerStage>();
    RaytracerStage *stage = raytracer.get();
    stage->scene = std::move(scene);
    if (const std::size_t count = stage->scene->anchors.size(); count > 0)
        stage->anchor_slots = std::make_shared<SlotPool>(
            supervise::make_host_region("arhost-anchors", {count * sizeof(AnchorPose), stage_slot_count}));
    Component::Callbacks callbacks = common_callbacks("raytracer", configuration->node);
    callbacks.hello = [this, stage](const PluginDescription &plugin, std::size_t candidate) {
        std::vector<OptionValue> options =
            options_for(*stage->component, ARHOST_KIND_RAYTRACER, *stage->configuration, candidate);
        if (intrinsics_.distortion != ARHOST_DISTORTION_NONE &&
            !(plugin.capabilities & ARHOST_CAPABILITY_LENS_DISTORTION))
            stage->component->log(
                ARHOST_SEVERITY_WARNING,
                plugin.id + " does not support lens distortion: its worker warps the rendered images, which costs "
                            "sharpness and time");
        return Component::Create{
            {std::move(options), messages::RaytracerSetup{format_->width, format_->height, intrinsics_}},
            {stage->scene->arena.fd()}};
    };
    callbacks.ready = [this](const messages::Ready &) {
        return SlotLayout{std::uint64_t(overlay_stride(format_->width)) * format_->height, stage_slot_count};
    };
    callbacks.running = [this, stage] {
        stage->slots = pool_of(*stage->component);
        start_quality(*stage);
    };
    callbacks.disabled = [this, stage](const std::string &reason, bool is_configuration_error) {
        if (stage == next_raytracer_.get())
            return abandon_swap(std::exchange(next_raytracer_, nullptr), reason);
        on_disabled("raytracer", stage->configuration->node, reason, is_configuration_error);
    };
    callbacks.result = [this](const Command &command, const Result &result) { on_rendered(command, result); };
    callbacks.lost = [this, stage](const std::vector<Command> &unanswered) {
        on_stage_lost(*stage, unanswered, Frame::Stage::to_render);
    };
    stage->component =
        std::make_unique<Component>(context_, "raytracer", configuration->plugins, configuration->limits,
                                    configuration->policy, std::move(callbacks));
    stage->configuration = std::move(configuration);
    return raytracer;
}

void Pipeline::make_outputs() {
    output_slots_ = std::make_shared<SlotPool>(supervise::make_host_region(
        "arhost-outputs",
        {OutputSlot(*format_).byte_size,
         // Sinks may lag by different amounts and hold different frames, so each sink needs slots of its own.
         static_cast<std::uint32_t>(live_sink_depth + 2 * (configuration_.outputs.size() + max_started_outputs) +
                                    2)}));
    for (std::size_t i = 0; i < configuration_.outputs.size(); ++i) {
        const run_config::ComponentConfiguration &output = configuration_.outputs[i];
        std::string name = output.plugins.front().stem().string();
        if (std::any_of(sinks_.begin(), sinks_.end(),
                        [&](const auto &sink) { return sink->component->name() == name; }))
            name += "#" + std::to_string(i);
        make_sink(output, name);
    }
}

// `path`: for an output that a command starts, the file to write instead of the configured one.
SinkQueue &Pipeline::make_sink(const run_config::ComponentConfiguration &output, const std::string &name,
                               const std::string &path) {
    sinks_.push_back(std::make_unique<SinkQueue>(statistics_));
    SinkQueue *sink = sinks_.back().get();
    sink->configuration = &output;
    sink->id = random_id();
    sink->max_waiting = live_ ? live_sink_depth : 0;
    Component::Callbacks callbacks = common_callbacks(name, output.node);
    callbacks.hello = [this, &output, sink](const PluginDescription &plugin, std::size_t candidate) {
        if (plugin.capabilities & ARHOST_CAPABILITY_REALTIME_SINK)
            sink->max_waiting = live_sink_depth; // a window drops frames instead of delaying other outputs
        messages::SinkSetup setup{*format_, format_->fps, sink->first_sequence(), {}};
        if (configuration_.source && configuration_.source->fps > 0)
            setup.fps = configuration_.source->fps;
        if (intrinsics_.width > 0)
            setup.intrinsics = intrinsics_;
        if (plugin.capabilities & ARHOST_CAPABILITY_RUN_DESCRIPTION)
            setup.run_description = run_description(sink->id);
        std::vector<OptionValue> options = options_for(*sink->component, ARHOST_KIND_SINK, output, candidate);
        expect_distinct_files(output, plugin);
        for (OptionValue &option : options)
            if (check_scratch_ && option.type == ARHOST_OPTION_OUTPUT_PATH && !option.text.empty() &&
                option.text != "-")
                option.text =
                    check_folder(*check_scratch_, index_of(output)) / std::filesystem::path(option.text).filename();
            else if (option.key == "path" && !sink->path.empty())
                option.text = sink->path;
        has_window_ |= std::ranges::count(plugin.needs, "display") > 0;
        std::vector<int> sockets = open_sockets(output, options);
        return Component::Create{{std::move(options), setup}, std::move(sockets)};
    };
    callbacks.ready = [sink](const messages::Ready &ready) {
        sink->set_inputs(ready.capabilities & (ARHOST_CAPABILITY_VIDEO_INPUT | ARHOST_CAPABILITY_OVERLAY_INPUT));
        return SlotLayout{};
    };
    callbacks.result = [this, sink, name](const Command &command, const Result &result) {
        sink->on_result(command, result);
        if (result.status == ARHOST_STATUS_END)
            end_sink(*sink);
        if (result.status >= 0 || sink->closed)
            return;
        if (interrupted_ && result.status == ARHOST_STATUS_ERROR_CANCELLED) { // its receiver did not take the frame
            close_sink(*sink);
            return sink->component->stop();
        }
        // A restart would not help, for example if the disk is full. Keeps the files that are complete and continues
        // with the other outputs.
        const std::string reason = "cannot write frame " + std::to_string(command.sequence) + ": " +
                                   status_text(result.status) + "; see the output's messages above";
        context_.log(ARHOST_SEVERITY_ERROR, name, reason);
        fail(name + ": " + reason, false, true);
        sink->answer(reason);
        close_sink(*sink);
        sink->component->stop();
    };
    callbacks.lost = [sink](const std::vector<Command> &) { sink->on_lost(); };
    callbacks.end_requested = [this, sink] { end_sink(*sink); };
    callbacks.request = [this, sink](const messages::Request &request) { on_request(*sink, request); };
    callbacks.running = [this, sink] {
        if (sink->awaits_its_frame() && frozen_) {
            sink->answer("the frame that is shown was composited without what this output writes; end the freeze and "
                         "send the command again");
            close_sink(*sink);
            sink->component->stop();
        } else if (!sink->ending && !sink->is_single) {
            sink->answer("");
        }
    };
    callbacks.stopped = [sink, common = callbacks.stopped](arhost_status status, const std::string &text) {
        common(status, text);
        sink->answer(sink->awaits_its_frame()     ? "the run ended before the next frame"
                     : status == ARHOST_STATUS_OK ? ""
                     : text.empty()               ? status_text(status)
                                                  : text);
    };
    callbacks.disabled = [this, sink, name, &output](const std::string &reason, bool is_configuration_error) {
        on_disabled(name, output.node, reason, is_configuration_error);
        sink->answer(reason);
        close_sink(*sink);
    };
    sink->component = std::make_unique<Component>(context_, name, output.plugins, output.limits, output.policy,
                                                  std::move(callbacks));
    sink->path = path;
    sink->component->start();
    return *sink;
}

// Opens the sockets of an output's options, unless they are still open because its worker has restarted. Returns
// their descriptors.
std::vector<int> Pipeline::open_sockets(const run_config::ComponentConfiguration &output,
                                        std::vector<OptionValue> &options) {
    std::vector<int> descriptors;
    for (OptionValue &option : options) {
        if (option.type != ARHOST_OPTION_LISTEN || option.text.empty())
            continue;
        const auto configured = output.options ? output.options->find(option.key) : std::nullopt;
        const yaml::Node node = configured.value_or(output.node);
        if (output.policy.mode != sandbox::Mode::none && !output.policy.allows("listen"))
            node.fail("needs 'allow: [listen]' in " + output.node.path() + " (docs/security.md)");
        auto socket = sockets_.find({&output, option.key});
        if (socket == sockets_.end()) {
            try {
                socket = sockets_.try_emplace({&output, option.key}, option.text).first;
            } catch (const std::exception &error) {
                node.fail(error.what());
            }
        }
        option.text = socket->second.address();
        option.integer = static_cast<std::int64_t>(descriptors.size());
        descriptors.push_back(socket->second.fd());
    }
    return descriptors;
}

// Compares the output's file with those of the plugins that are already known.
void Pipeline::expect_distinct_files(const run_config::ComponentConfiguration &output,
                                     const PluginDescription &plugin) {
    if (const auto path = run_config::path_of(output.node))
        output_files_.insert_or_assign(
            &output, run_config::OutputFile{*path, (plugin.capabilities & ARHOST_CAPABILITY_NUMBERED_FILES) != 0});
    std::vector<run_config::OutputFile> files = configuration_.report_files();
    for (const auto &[writer, file] : output_files_)
        files.push_back(file);
    run_config::expect_distinct(files);
}

// Called when a sink has returned ARHOST_STATUS_END.
void Pipeline::end_sink(SinkQueue &sink) {
    const std::string &name = sink.component->name();
    if (sink.closed || sink.has_quit)
        return;
    if (sink.configuration->control.contains("quit")) {
        sink.has_quit = true;
        context_.log(ARHOST_SEVERITY_INFO, name, "ends the run");
        return end_run();
    }
    close_sink(sink);
    context_.log(ARHOST_SEVERITY_INFO, name,
                 input_ended_ ? "has ended"
                              : "has ended; the other outputs continue ('control: [quit]' lets it end the run)");
    sink.component->stop();
}

void Pipeline::close_sink(SinkQueue &sink) {
    sink.closed = true;
    sink.clear();
    if (phase_ == Phase::running)
        end_without_sinks();
}

void Pipeline::end_without_sinks() {
    if (!sinks_.empty() &&
        std::all_of(sinks_.begin(), sinks_.end(), [](const auto &sink) { return sink->closed || sink->on_demand; }))
        end_run();
}

void Pipeline::on_disabled(const std::string &name, const yaml::Node &node, const std::string &reason,
                           bool is_configuration_error) {
    // Configuration errors already start with a position in the file or with an option's name.
    const bool located = reason.starts_with(node.file().string() + ":") || reason.starts_with("--");
    const std::string text = located ? reason : node.where() + ": " + name + ": " + reason;
    const bool runs = phase_ == Phase::running;
    if (runs)
        context_.log(ARHOST_SEVERITY_ERROR, "arhost", text + "; the video continues without it");
    fail(text, is_configuration_error, runs);
    if (!runs)
        return;
    if (name == "source")
        input_ended_ = true;
}

} // namespace arhost::host
