// SPDX-License-Identifier: Apache-2.0
#include "host/raytracer.hpp"

#include "camera/mapping.hpp"
#include "host/frame_validation.hpp"

#include <arhost/shading/lens.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

std::pair<std::uint32_t, std::uint32_t> overlay_size(const arhost_frame_format &format, const Quality &quality) {
    const auto scaled = [&](std::uint32_t side) {
        return std::max(1u, static_cast<std::uint32_t>(std::lround(side * quality.scale)));
    };
    return {scaled(format.width), scaled(format.height)};
}

ImageView overlay_of(const Frame &frame, const arhost_frame_format &format) {
    return {reinterpret_cast<const std::uint8_t *>(frame.overlay.bytes().data()),
            overlay_stride(overlay_size(format, frame.quality).first, frame.overlay_format.form),
            frame.overlay_format};
}

std::span<const std::byte> overlay_bytes(const Frame &frame, const arhost_frame_format &format) {
    if (!frame.overlay)
        return {};
    const RaytracerSlot slot(format.width, format.height, frame.overlay_format.form);
    return frame.overlay.bytes().first(slot.image_size);
}

Raytracer::Raytracer(RunParts &parts, Configuration configuration, std::shared_ptr<LoadedScene> scene,
                     Abandon abandon)
    : Stage(parts, "raytracer", *configuration, Frame::Stage::to_render, 1, std::move(abandon)),
      configuration_(std::move(configuration)), scene_(std::move(scene)) {
    if (const std::size_t count = scene_->anchors.size(); count > 0)
        anchor_slots_ = std::make_shared<SlotPool>(
            supervise::make_host_region("arhost-anchors", {count * sizeof(AnchorPose), stage_slot_count}));
}

SlotLayout Raytracer::on_ready(const messages::Ready &ready) {
    const auto mebibytes = [](std::uint64_t bytes) { return static_cast<double>(bytes) / (1 << 20); };
    if (ready.state_size > max_raytracer_state) // the worker checks this too
        throw std::runtime_error("the ray tracer's worker sent an impossible state_size");
    const bool is_linear_wanted =
        scene_->integrator == ARHOST_INTEGRATOR_PATH && overlay_format_.compositing == ARHOST_COMPOSITING_LINEAR;
    if (!(ready.capabilities & ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES)) {
        overlay_format_.form = ARHOST_IMAGE_FORM_STRAIGHT;
        if (is_linear_wanted)
            component().log(ARHOST_SEVERITY_WARNING,
                            component().description().short_name() +
                                " cannot write linear images: the overlay cannot brighten the video, and its shadows "
                                "have no colour");
    }
    reads_video_ = reads_video_ && (ready.capabilities & ARHOST_RAYTRACER_CAPABILITY_VIDEO) != 0;
    const arhost_frame_format &format = parts_.video.format;
    const RaytracerSlot slot(format.width, format.height, overlay_format_.form);
    has_state_ = ready.state_size > 0;
    max_in_flight_ = parts_.live() || has_state_ ? 1 : 2; // an image needs the state after the previous one
    const SlotLayout layout{slot.byte_size(ready.state_size), has_state_ ? slot_count_with_state : stage_slot_count};
    // The other half is for the worker's own memory.
    const std::uint64_t limit = sandbox::memory_limit(configuration_->policy) / 2;
    if (has_state_ && limit > 0 && layout.byte_size() > limit)
        throw std::runtime_error(
            fmt::format("the ray tracer's state has {:.1f} MiB; {} states and images take {:.1f} MiB, "
                        "more than half of the {} MiB that it may use ('memory_mb')",
                        mebibytes(ready.state_size), layout.count, mebibytes(layout.byte_size()), limit >> 19));
    if (!continues_state(layout.slot_size))
        state_ = Lease();
    return layout;
}

void Raytracer::on_disabled(const std::string &reason, bool is_configuration_error) {
    state_ = Lease();
    parts_.failures.add_disabled("raytracer", configuration_->node, reason, is_configuration_error);
}

// Whether the plugin does not support the camera's lens, so that its worker warps the images.
bool Raytracer::warps_images(const PluginDescription &plugin) const {
    return parts_.video.intrinsics.distortion != ARHOST_DISTORTION_NONE &&
           !(plugin.capabilities & ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION);
}

OverlayFormat Raytracer::choose_format(const PluginDescription &plugin) const {
    const bool is_path = scene_->integrator == ARHOST_INTEGRATOR_PATH;
    OverlayFormat format;
    format.compositing =
        configuration_->composite.value_or(is_path ? ARHOST_COMPOSITING_LINEAR : ARHOST_COMPOSITING_SRGB);
    if (!is_path || format.compositing == ARHOST_COMPOSITING_SRGB)
        return format;
    if (plugin.capabilities & ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES)
        format.form = ARHOST_IMAGE_FORM_LINEAR;
    return format;
}

Component::Create Raytracer::on_hello(const PluginDescription &plugin, std::size_t candidate) {
    const Video &video = parts_.video;
    std::vector<OptionValue> options =
        parts_.options.choose(component(), ARHOST_KIND_RAYTRACER, *configuration_, candidate);
    if (warps_images(plugin))
        component().log(ARHOST_SEVERITY_WARNING,
                        plugin.short_name() +
                            " does not support lens distortion: its worker warps the rendered images, which "
                            "costs sharpness and time");
    overlay_format_ = choose_format(plugin);
    reads_video_ = (plugin.capabilities & ARHOST_RAYTRACER_CAPABILITY_VIDEO) != 0 && !warps_images(plugin);
    return {{std::move(options), messages::RaytracerSetup{video.format.width, video.format.height, video.intrinsics,
                                                          overlay_format_.form, overlay_format_.compositing,
                                                          reads_video_ ? std::optional(video.format) : std::nullopt}},
            {scene_->arena.fd()}};
}

void Raytracer::take_over(const Raytracer *previous) {
    if (previous)
        parts_.flow.on_raytracer_replaced();
    if (previous && previous->scene_ == scene_)
        return;
    parts_.cameras.set_coordinates(scene_->coordinates);
    parts_.flow.on_coordinates_changed();
}

FrameFlow::Intake Raytracer::intake() const {
    FrameFlow::Intake intake = Stage::intake();
    intake.anchors = anchor_slots_.get();
    return intake;
}

void Raytracer::render(Frame &frame) {
    if (parts_.flow.repeats_decisions(frame))
        frame.quality = {frame.recorded->scale, frame.recorded->samples, frame.recorded->shading_px};
    else
        frame.quality = quality_ ? quality_->current() : Quality();
    Command command{};
    command.kind = CommandKind::render;
    command.slot = frame.overlay.index();
    command.sequence = frame.record.sequence;
    command.capture_ns = frame.record.capture_ns;
    command.clock = frame.record.clock;
    command.time_s = 1e-9 * static_cast<double>(frame.record.capture_ns);
    command.max_samples = frame.quality.samples;
    command.shading_px = frame.quality.shading_px;
    command.camera = frame.record.camera;
    if (frame.quality.scale < 1) {
        const auto [width, height] = overlay_size(parts_.video.format, frame.quality);
        command.camera.intrinsics = arhost_scaled_intrinsics(frame.record.camera.intrinsics, width, height);
    }
    if (frame.anchors) {
        write_anchors(frame);
        command.input_slot = frame.anchors.index();
    }
    if (state_)
        command.state_slot = state_.index();
    if (reads_video_)
        command.video_slot = frame.pixels.index();
    component().submit(command, frame.anchors ? frame.anchors.region() : nullptr, state_ ? state_.region() : nullptr,
                       reads_video_ ? frame.pixels.region() : nullptr);
}

// Writes the poses of the anchors: the targets to which objects of the scene are attached. The poses are those of
// this frame, so that an object stays on its target even if the pose of the world is from an earlier frame.
void Raytracer::write_anchors(const Frame &frame) const {
    auto *poses = reinterpret_cast<AnchorPose *>(frame.anchors.bytes().data());
    for (std::size_t i = 0; i < scene_->anchors.size(); ++i) {
        const auto target = std::ranges::find_if(frame.targets, [&](const arhost_target &one) {
            return is_visible(one) && one.name == scene_->anchors[i].target;
        });
        poses[i] = {};
        if (target == frame.targets.end())
            continue;
        poses[i].is_visible = 1;
        const glm::dmat4 pose = camera::scene_from_target(frame.record.camera, target->mt, scene_->coordinates);
        std::copy_n(glm::value_ptr(pose), 16, poses[i].world_from_anchor);
    }
}

void Raytracer::on_result(const Command &command, const Result &result) {
    Statistics &statistics = parts_.statistics;
    const std::chrono::nanoseconds busy(result.busy_ns), device = device_time(result.render, busy);
    if (device.count())
        statistics.stages.add("device", device);
    if (const Frame *frame = parts_.flow.find(command.sequence); frame && quality_) {
        if (result.status >= 0) {
            add_report({result.render.full_samples, result.render.coarsest_shading_px < 2 ? 0u : 2u});
            statistics.quality_changes += quality_->add(frame->quality, busy, parts_.context.reactor.now());
        }
        statistics.quality = quality_->current();
    }
    Frame *const frame = accept(command, result);
    if (!frame)
        return;
    if (has_state_)
        state_ = frame->overlay.share();
    frame->render = result.render;
    frame->overlay_format = overlay_format_;
    frame->times.raytracer = busy;
    frame->times.device = device;
    frame->record.overlay_scale = frame->quality.scale < 1 ? frame->quality.scale : 0;
    frame->record.overlay_samples = std::min(frame->quality.samples, result.render.full_samples);
    const std::uint32_t shading_px = std::min(frame->quality.shading_px, result.render.coarsest_shading_px);
    frame->record.overlay_shading_px = shading_px > 1 ? shading_px : 0;
    parts_.flow.on_rendered(*frame, busy);
    if (auto &checks = scene_->overlay_checks; checks && frame->quality.scale == 1) {
        const arhost_frame_format &format = parts_.video.format;
        checks->check(statistics.contract_checks, command.sequence, command.camera,
                      region_of(frame->render, format.width, format.height), overlay_of(*frame, format));
        frame->overlay_sample = contracts::sample_hash(overlay_bytes(*frame, format), command.sequence);
    }
}

// Begins to adapt the quality of images to `live.target_fps`, unless a controller with the same limits exists.
void Raytracer::start_quality() {
    const run_config::Configuration &run = parts_.configuration;
    if (!parts_.live() || run.target_fps == 0)
        return;
    const PluginDescription &plugin = component().description();
    if (std::exchange(adapted_plugin_, plugin.id) != plugin.id)
        reports_ = {};
    const auto supports = [&](std::uint64_t capability) { return (plugin.capabilities & capability) != 0; };
    QualityController::Limits limits{.target_fps = run.target_fps};
    // If the worker warps the images because the plugin does not support lenses, they must have full size.
    if (supports(ARHOST_RAYTRACER_CAPABILITY_SCALED_IMAGES) && !warps_images(plugin))
        limits.min_scale = run.min_scale;
    const Adaptable adaptable = reports_.latest().value_or(Adaptable());
    limits.max_samples = adaptable.full_samples;
    limits.min_samples = std::min(run.min_samples, limits.max_samples);
    limits.max_shading_px = adaptable.coarsest_shading_px;
    if (!quality_ || quality_->limits() != limits)
        quality_.emplace(limits);
}

void Raytracer::add_report(const Adaptable &report) {
    const bool is_first = !reports_.latest();
    if (!reports_.add(report, parts_.context.reactor.now()))
        return;
    start_quality();
    if (is_first && report == Adaptable() && quality_->is_lowest() && parts_.configuration.min_scale < 1)
        component().log(ARHOST_SEVERITY_WARNING,
                        component().description().short_name() +
                            " can render neither smaller images nor fewer samples, nor shade fewer pixels; "
                            "'live.target_fps' has no effect");
}

} // namespace arhost::host
