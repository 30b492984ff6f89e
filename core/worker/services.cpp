// SPDX-License-Identifier: Apache-2.0
#include "worker/services.hpp"

#include "pixels/grey.hpp"
#include "scene/capabilities.hpp"
#include "scene/motion.hpp"
#include "worker/lens_warp.hpp"
#include "worker/library.hpp"
#include "worker/target_solver.hpp"

#include <glm/gtc/type_ptr.hpp>

#include <algorithm>
#include <optional>

namespace arhost::worker {
namespace {

using namespace ipc;
using namespace model;

std::uint8_t *as_pixels(std::span<std::byte> bytes) {
    return reinterpret_cast<std::uint8_t *>(bytes.data());
}

std::uint16_t *as_depth(std::span<std::byte> bytes) {
    return reinterpret_cast<std::uint16_t *>(bytes.data());
}

void require(bool condition, const char *what) {
    if (!condition)
        throw ProtocolViolation(what);
}

template <class T> const T &setup_of_kind(const messages::Setup &setup) {
    const T *found = std::get_if<T>(&setup);
    require(found, "the setup is for another kind of plugin");
    return *found;
}

// A video frame in a slot, for a tracker or a ray tracer. It must not be moved, because frames refer to its format.
class VideoFrame {
public:
    explicit VideoFrame(const arhost_frame_format &format) : format_(format) {
        if (has_limited_luma_plane(format_))
            full_range_luma_.resize(format_.grey_stride / sizeof(Block) * format_.height);
    }
    VideoFrame(const VideoFrame &) = delete;
    VideoFrame &operator=(const VideoFrame &) = delete;

    const arhost_frame_format &format() const { return format_; }

    // The result is valid until the next call.
    arhost_frame at(std::span<std::byte> slot, const Command &command) {
        require(slot.size() >= format_.byte_size, "the slots of video frames are too small");
        arhost_frame frame{};
        frame.struct_size = sizeof frame;
        frame.clock = command.clock;
        frame.format = &format_;
        for (std::uint32_t i = 0; i < format_.plane_count; ++i)
            frame.plane[i] = as_pixels(slot) + format_.offset[i];
        frame.grey = as_pixels(slot) + format_.grey_offset;
        if (!full_range_luma_.empty()) {
            std::uint8_t *grey = full_range_luma_.front().bytes;
            expand_luma_plane(format_, frame.grey, grey);
            frame.grey = grey;
        }
        frame.depth_mm = format_.has_depth ? as_depth(slot.subspan(format_.depth_offset)) : nullptr;
        frame.sequence = command.sequence;
        frame.capture_ns = command.capture_ns;
        return frame;
    }

private:
    struct alignas(64) Block { // strides and alignments of planes are multiples of its size
        std::uint8_t bytes[64];
    };
    const arhost_frame_format format_;
    std::vector<Block> full_range_luma_; // only for a luma plane of limited range
};

class SourceService final : public Service {
public:
    SourceService(const arhost_source &source, arhost_instance *instance) : source_(source), instance_(instance) {}

    arhost_status start(const messages::Setup &any, const std::vector<base::UniqueFd> &,
                        messages::Ready &ready) override {
        const auto &message = setup_of_kind<messages::SourceSetup>(any);
        arhost_source_setup setup{};
        setup.struct_size = sizeof setup;
        setup.first_sequence = next_ = message.first_sequence;
        setup.fps = message.fps;
        setup.paced = message.paced;
        setup.intrinsics = message.intrinsics ? &*message.intrinsics : nullptr;
        arhost_source_properties properties{};
        properties.struct_size = sizeof properties;
        properties.format.struct_size = sizeof properties.format;
        properties.intrinsics.struct_size = sizeof properties.intrinsics;
        const arhost_status status = source_.start(instance_, &setup, &properties);
        if (status != ARHOST_STATUS_OK)
            return status;
        format_ = properties.format;
        if (!arhost_frame_layout(&format_))
            throw std::runtime_error("the source's frame format is invalid");
        if (format_.byte_size != properties.format.byte_size)
            throw std::runtime_error("the source did not compute its frame layout with arhost_frame_layout");
        ready.format = format_;
        ready.frame_count = properties.frame_count;
        if (properties.has_intrinsics)
            ready.intrinsics = properties.intrinsics;
        return status;
    }

    arhost_status execute(const Command &command, const Memory &memory, Result &result) override {
        require(command.kind == CommandKind::read, "a source got a command other than read");
        const std::span<std::byte> slot = memory.output.slot(command.slot);
        require(slot.size() >= format_.byte_size, "the frame slots are too small");
        arhost_frame_buffer buffer{};
        buffer.struct_size = sizeof buffer;
        buffer.format = &format_;
        for (std::uint32_t i = 0; i < format_.plane_count; ++i)
            buffer.plane[i] = as_pixels(slot) + format_.offset[i];
        buffer.grey = as_pixels(slot) + format_.grey_offset;
        buffer.depth_mm = format_.has_depth ? as_depth(slot.subspan(format_.depth_offset)) : nullptr;
        buffer.sequence = next_;
        result.frame.struct_size = sizeof result.frame;
        const arhost_status status = source_.read(instance_, &buffer, &result.frame);
        if (status == ARHOST_STATUS_OK)
            next_ += std::uint64_t{1} + result.frame.skipped;
        // The worker fills the grey plane, so that the host need not spend this time.
        if (status == ARHOST_STATUS_OK && !result.frame.has_grey && buffer.grey != buffer.plane[0])
            fill_grey(format_, buffer.plane, buffer.grey);
        return status;
    }

    arhost_status stop() override { return source_.stop(instance_), ARHOST_STATUS_OK; }

private:
    const arhost_source &source_;
    arhost_instance *instance_;
    arhost_frame_format format_{};
    std::uint64_t next_ = 0; // arhost_frame_buffer.sequence of the next call, which counts skipped frames
};

// The arrays of an arhost_tracker_setup. Refers to the texts of `targets`.
struct TrackerSetup {
    explicit TrackerSetup(const std::vector<Target> &targets) : families(families_of(targets)) {
        for (const Target &target : targets) {
            for (const TargetMarker &marker : target.markers) {
                const auto family = std::ranges::find(families, marker.family) - families.begin();
                arhost_marker_config config{sizeof config,
                                            marker.id,
                                            static_cast<std::uint32_t>(family),
                                            static_cast<std::uint32_t>(configs.size()),
                                            {},
                                            marker.file.empty() ? nullptr : marker.file.c_str(),
                                            marker.pattern_ratio};
                for (std::size_t corner = 0; corner < 4; ++corner)
                    std::ranges::copy(marker.corners_mm[corner], config.corners_mm[corner]);
                markers.push_back(config);
            }
            configs.push_back({sizeof(arhost_target_config), 0, target.name.c_str(),
                               target.body.empty() ? nullptr : target.body.c_str()});
        }
        for (const std::string &family : families)
            family_names.push_back(family.c_str());
    }
    const std::vector<std::string> families;
    std::vector<arhost_target_config> configs;
    std::vector<arhost_marker_config> markers;
    std::vector<const char *> family_names;
};

// Resets an array before a plugin fills it. In an earlier call, the plugin may have written anything to the array.
template <class T> void reset(std::vector<T> &elements) {
    T element{};
    element.struct_size = sizeof element;
    std::ranges::fill(elements, element);
}

class TrackerService final : public Service {
public:
    TrackerService(const arhost_tracker &tracker, arhost_instance *instance)
        : tracker_(tracker), instance_(instance) {}

    arhost_status start(const messages::Setup &any, const std::vector<base::UniqueFd> &fds,
                        messages::Ready &ready) override {
        const auto &message = setup_of_kind<messages::TrackerSetup>(any);
        require(!fds.empty(), "'create' was sent without the descriptor of the targets");
        std::vector<Target> targets =
            targets_from(SharedMemory::adopt(base::UniqueFd(::dup(fds[0].get()))).map(Access::read_only));
        video_.emplace(message.format);
        const TrackerSetup arrays(targets);
        arhost_tracker_setup setup{};
        setup.struct_size = sizeof setup;
        setup.target_count = static_cast<std::uint32_t>(arrays.configs.size());
        setup.format = &video_->format();
        setup.intrinsics = &message.intrinsics;
        setup.targets = arrays.configs.data();
        setup.markers = arrays.markers.data();
        setup.marker_count = static_cast<std::uint32_t>(arrays.markers.size());
        setup.family_count = static_cast<std::uint32_t>(arrays.family_names.size());
        setup.families = arrays.family_names.data();
        const arhost_status status = tracker_.start(instance_, &setup);
        if (status != ARHOST_STATUS_OK)
            return status;
        try {
            state_size_ = state_size_of(tracker_, instance_);
            scale_pictures(targets);
        } catch (...) {
            tracker_.stop(instance_);
            throw;
        }
        solver_.emplace(message.intrinsics, targets,
                        TargetSolver::Settings{message.full_search_every, message.smooth, message.confirm});
        layout_.emplace(targets.size());
        poses_.resize(targets.size());
        plugin_offset_ = layout_->state_offset + (solver_->state_size() + 63) / 64 * 64;
        ready.state_size = plugin_offset_ - layout_->state_offset + state_size_;
        return status;
    }

    arhost_status execute(const Command &command, const Memory &memory, Result &) override {
        require(command.kind == CommandKind::track, "a tracker got a command other than track");
        const std::span<std::byte> input = memory.input(command.input_generation).slot(command.input_slot);
        const std::span<std::byte> output = memory.output.slot(command.slot);
        require(output.size() >= plugin_offset_ + state_size_, "the tracker's slots are too small");
        const arhost_frame frame = video_->at(input, command);
        arhost_track_request request{};
        request.struct_size = sizeof request;
        request.frame = &frame;
        const std::byte *before = nullptr;
        if (command.state_generation != 0) {
            const std::span<std::byte> slot = memory.input(command.state_generation).slot(command.state_slot);
            require(command.state_is_of_solver_only ? slot.size() >= plugin_offset_ : slot.size() == output.size(),
                    "the slot of the tracker's state has another size");
            before = slot.data();
        }
        if (state_size_ > 0) {
            request.state_before = before && !command.state_is_of_solver_only ? before + plugin_offset_ : nullptr;
            request.state_after = output.data() + plugin_offset_;
            request.state_size = state_size_;
        }
        const std::byte *solver_before = before ? before + layout_->state_offset : nullptr;
        TargetSolver::Expectation expectation = solver_->expect(command.capture_ns, solver_before);
        request.search_everywhere = expectation.search_everywhere;
        request.expected = expectation.markers.data();
        request.expected_count = static_cast<std::uint32_t>(expectation.markers.size());
        reset(observations_);
        reset(poses_);
        arhost_tracker_result result{};
        result.struct_size = sizeof result;
        result.observations = observations_.data();
        result.poses = poses_.data();
        result.candidate_count = -1;
        const arhost_status status = tracker_.track(instance_, &request, &result);
        if (status != ARHOST_STATUS_OK)
            return status;
        result.observations = observations_.data(); // a plugin may have changed the pointers
        result.poses = poses_.data();
        auto *targets = reinterpret_cast<arhost_target *>(output.data() + TrackerSlot::targets_offset);
        auto *observations = reinterpret_cast<arhost_observation *>(output.data() + layout_->observations_offset);
        solver_->solve(result, expectation.search_everywhere, command.capture_ns, solver_before,
                       output.data() + layout_->state_offset,
                       {{targets, poses_.size()}, {observations, observations_.size()}});
        const std::uint32_t missed_count = solver_->move_missed_to_end(expectation, result);
        std::ranges::copy(std::as_bytes(std::span(expectation.markers)), output.data() + layout_->expected_offset);
        *reinterpret_cast<TrackerSlot::Header *>(output.data()) = {result.observation_count, request.expected_count,
                                                                   missed_count, request.search_everywhere,
                                                                   std::max(result.candidate_count, -1)};
        return status;
    }

    arhost_status stop() override { return tracker_.stop(instance_), ARHOST_STATUS_OK; }

private:
    // Sets the heights of pictures, which only the plugin knows.
    void scale_pictures(std::vector<Target> &targets) const {
        std::uint32_t index = 0;
        for (Target &target : targets)
            for (TargetMarker &marker : target.markers) {
                if (marker.family == "image")
                    for (const double aspect = aspect_of(tracker_, instance_, index);
                         auto &corner : marker.corners_mm)
                        corner[1] *= aspect;
                ++index;
            }
    }

    const arhost_tracker &tracker_;
    arhost_instance *instance_;
    std::optional<VideoFrame> video_;
    std::optional<TargetSolver> solver_;
    std::optional<TrackerSlot> layout_;
    std::vector<arhost_observation> observations_ = std::vector<arhost_observation>(ARHOST_MAX_OBSERVATIONS);
    std::vector<arhost_body_pose> poses_;
    std::uint64_t state_size_ = 0;    // size of the plugin's state
    std::uint64_t plugin_offset_ = 0; // offset of the plugin's state in a slot
};

class RaytracerService final : public Service {
public:
    RaytracerService(const Link &link, const arhost_host &host, const arhost_plugin &plugin,
                     arhost_instance *instance)
        : link_(link), host_(host), descriptor_(*plugin.descriptor),
          raytracer_(*static_cast<const arhost_raytracer *>(plugin.functions)), instance_(instance),
          supports_lenses_((plugin.descriptor->capabilities & ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION) != 0) {}

    arhost_status start(const messages::Setup &any, const std::vector<base::UniqueFd> &fds,
                        messages::Ready &ready) override {
        const auto &message = setup_of_kind<messages::RaytracerSetup>(any);
        ready.capabilities = scene::capabilities_of(descriptor_, raytracer_, instance_);
        require(!fds.empty(), "'create' was sent without the descriptor of the scene's arena");
        arena_ = SharedMemory::adopt(base::UniqueFd(::dup(fds[0].get()))).map(Access::read_only);
        require(arena_.bytes().size() >= sizeof(arhost_scene), "the scene's arena is too small");
        arhost_raytracer_setup setup{};
        setup.struct_size = sizeof setup;
        setup.width = width_ = message.width;
        setup.height = height_ = message.height;
        setup.scene = &arena_.as<arhost_scene>();
        if (ready.capabilities & ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES)
            form_ = message.form;
        setup.form = form_;
        setup.compositing = message.compositing;
        setup.intrinsics = &message.intrinsics;
        if (message.video_format && ready.capabilities & ARHOST_RAYTRACER_CAPABILITY_VIDEO)
            setup.video_format = &video_.emplace(*message.video_format).format();
        if (message.intrinsics.distortion != ARHOST_DISTORTION_NONE && !supports_lenses_) {
            require(!video_, "a plugin whose image is warped got video");
            warp_.emplace(message.intrinsics, form_,
                          [this](double fraction) { link_.progress(fraction, "computing the lens distortion"); });
            setup.intrinsics = &warp_->pinhole();
        }
        if (scene::is_moving(*setup.scene))
            motion_.emplace(*setup.scene);
        anchors_.resize(setup.scene->anchors.count);
        const std::uint64_t missing = scene::needed_capabilities(*setup.scene) & ~ready.capabilities;
        if (const std::string warning = scene::missing_capabilities_text(model::short_name(descriptor_.id), missing);
            !warning.empty())
            host_.log(&host_, ARHOST_SEVERITY_WARNING, warning.c_str());
        const arhost_status status = raytracer_.start(instance_, &setup);
        if (status == ARHOST_STATUS_OK)
            ready.state_size = state_size_ = state_size_of(raytracer_, instance_);
        return status;
    }

    arhost_status execute(const Command &command, const Memory &memory, Result &result) override {
        require(command.kind == CommandKind::render, "a ray tracer got a command other than render");
        const std::span<std::byte> output = memory.output.slot(command.slot);
        arhost_image image{};
        image.struct_size = sizeof image;
        const bool is_scaled = (descriptor_.capabilities & ARHOST_RAYTRACER_CAPABILITY_SCALED_IMAGES) != 0 && !warp_;
        image.width = is_scaled ? command.camera.intrinsics.width : width_;
        image.height = is_scaled ? command.camera.intrinsics.height : height_;
        image.stride = overlay_stride(image.width, form_);
        require(image.width <= width_ && image.height <= height_, "the image is larger than that of the setup");
        set_pixels(image, form_, output.data());
        const RaytracerSlot slot(width_, height_, form_);
        require(output.size() >= slot.byte_size(state_size_), "the image slots are too small");
        arhost_render_request request{};
        request.struct_size = sizeof request;
        request.max_samples = command.max_samples;
        request.shading_px = command.shading_px;
        request.sequence = command.sequence;
        request.time_s = command.time_s;
        request.camera = command.camera;
        arhost_motion motion{};
        if (motion_) {
            if (!anchors_.empty())
                read_anchors(memory.input(command.input_generation).slot(command.input_slot));
            motion = motion_->at(command.time_s, anchors_);
            request.motion = &motion;
        }
        arhost_frame video{};
        if (video_) {
            video = video_->at(memory.input(command.video_generation).slot(command.video_slot), command);
            request.video = &video;
        }
        if (state_size_ > 0) {
            if (command.state_generation != 0) {
                const std::span<std::byte> before = memory.input(command.state_generation).slot(command.state_slot);
                require(before.size() == output.size(), "the slot of the ray tracer's state has another size");
                request.state_before = before.data() + slot.state_offset;
            }
            request.state_after = output.data() + slot.state_offset;
            request.state_size = state_size_;
        }
        result.render.struct_size = sizeof result.render;
        if (!warp_)
            return raytracer_.render(instance_, &request, &image, &result.render);
        request.camera.intrinsics = warp_->pinhole();
        const arhost_image pinhole_image = warp_->pinhole_image();
        const arhost_status status = raytracer_.render(instance_, &request, &pinhole_image, &result.render);
        if (status == ARHOST_STATUS_OK) {
            warp_->warp(result.render, image);
            result.render.has_region = 0;
        }
        return status;
    }

    arhost_status stop() override { return raytracer_.stop(instance_), ARHOST_STATUS_OK; }

private:
    void read_anchors(std::span<const std::byte> slot) {
        require(slot.size() >= anchors_.size() * sizeof(AnchorPose), "the slots of anchors are too small");
        const auto *poses = reinterpret_cast<const AnchorPose *>(slot.data());
        for (std::size_t i = 0; i < anchors_.size(); ++i)
            anchors_[i] = {poses[i].is_visible != 0, glm::make_mat4(poses[i].world_from_anchor)};
    }

    const Link &link_;
    const arhost_host &host_;
    const arhost_descriptor &descriptor_;
    const arhost_raytracer &raytracer_;
    arhost_instance *instance_;
    bool supports_lenses_;
    arhost_image_form form_ = ARHOST_IMAGE_FORM_STRAIGHT;
    std::optional<VideoFrame> video_; // only if the plugin reads the video
    std::optional<LensWarp> warp_;    // only for a distorting lens that the plugin does not support
    Mapping arena_;
    std::optional<scene::MotionEvaluator> motion_; // only if objects move or deform
    std::vector<scene::Anchored> anchors_;
    std::uint32_t width_ = 0, height_ = 0;
    std::uint64_t state_size_ = 0;
};

class SinkService final : public Service {
public:
    SinkService(const arhost_plugin &plugin, arhost_instance *instance)
        : sink_(*static_cast<const arhost_sink *>(plugin.functions)), instance_(instance),
          capabilities_(plugin.descriptor->capabilities) {}

    arhost_status start(const messages::Setup &any, const std::vector<base::UniqueFd> &,
                        messages::Ready &ready) override {
        const auto &message = setup_of_kind<messages::SinkSetup>(any);
        if (sink_.capabilities)
            capabilities_ &= sink_.capabilities(instance_);
        ready.capabilities = capabilities_;
        arhost_sink_setup setup{};
        setup.struct_size = sizeof setup;
        setup.width = message.video_format.width;
        setup.height = message.video_format.height;
        setup.fps = message.fps;
        setup.first_sequence = message.first_sequence;
        setup.intrinsics = message.intrinsics ? &*message.intrinsics : nullptr;
        setup.video_format = &(video_format_ = message.video_format);
        setup.run_description = message.run_description.empty() ? nullptr : message.run_description.c_str();
        return sink_.start(instance_, &setup);
    }

    arhost_status execute(const Command &command, const Memory &memory, Result &) override {
        require(command.kind == CommandKind::write, "a sink got a command other than write");
        const std::span<std::byte> input = memory.input(command.input_generation).slot(command.input_slot);
        const OutputSlot slot(video_format_);
        require(input.size() >= slot.byte_size, "the output slots are too small");
        arhost_output output{};
        output.struct_size = sizeof output;
        output.stride = OutputSlot::stride(video_format_.width);
        output.width = video_format_.width;
        output.height = video_format_.height;
        output.bgr = as_pixels(input) + OutputSlot::image_offset;
        if (capabilities_ & ARHOST_SINK_CAPABILITY_VIDEO_INPUT) {
            const std::span<std::byte> video = input.subspan(slot.video_offset);
            for (std::uint32_t i = 0; i < video_format_.plane_count; ++i)
                output.video[i] = as_pixels(video) + video_format_.offset[i];
            if (video_format_.has_depth)
                output.depth_mm = as_depth(video.subspan(video_format_.depth_offset));
        }
        if (capabilities_ & ARHOST_SINK_CAPABILITY_OVERLAY_INPUT) {
            output.overlay_rgba = as_pixels(input) + slot.overlay_offset;
            output.overlay_stride = overlay_stride(video_format_.width);
        }
        arhost_record record = *reinterpret_cast<const arhost_record *>(input.data());
        record.targets = reinterpret_cast<const arhost_target *>(input.data() + OutputSlot::targets_offset);
        record.observations =
            reinterpret_cast<const arhost_observation *>(input.data() + OutputSlot::observations_offset);
        record.expected =
            reinterpret_cast<const arhost_expected_marker *>(input.data() + OutputSlot::expected_offset);
        output.record = &record;
        return sink_.write(instance_, &output);
    }

    bool wants_idle() const override { return sink_.idle != nullptr; }
    arhost_status idle() override { return sink_.idle(instance_); }
    arhost_status stop() override { return sink_.stop(instance_); }

private:
    const arhost_sink &sink_;
    arhost_instance *instance_;
    std::uint64_t capabilities_;
    arhost_frame_format video_format_{};
};

} // namespace

std::span<std::byte> Memory::Region::slot(std::uint32_t index) const {
    require(mapping && index < layout.count, "a command names an invalid slot");
    return layout.slot(mapping, index);
}

const Memory::Region &Memory::input(std::uint32_t generation) const {
    const auto found = inputs.find(generation);
    require(found != inputs.end(), "a command names memory that is not attached");
    return found->second;
}

std::unique_ptr<Service> make_service(const Link &link, const arhost_host &host, const arhost_plugin &plugin,
                                      arhost_instance *instance) {
    switch (plugin.descriptor->kind) {
    case ARHOST_KIND_SOURCE:
        return std::make_unique<SourceService>(*static_cast<const arhost_source *>(plugin.functions), instance);
    case ARHOST_KIND_TRACKER:
        return std::make_unique<TrackerService>(*static_cast<const arhost_tracker *>(plugin.functions), instance);
    case ARHOST_KIND_RAYTRACER:
        return std::make_unique<RaytracerService>(link, host, plugin, instance);
    default:
        return std::make_unique<SinkService>(plugin, instance);
    }
}

} // namespace arhost::worker
