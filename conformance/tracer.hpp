// SPDX-License-Identifier: Apache-2.0
// Runs a ray tracer on a scene.
#pragma once

#include "conformance/guarded_memory.hpp"
#include "conformance/picture.hpp"
#include "conformance/plugin_library.hpp"
#include "conformance/scenes.hpp"
#include "conformance/test.hpp"
#include "conformance/video.hpp"
#include "scene/arena_builder.hpp"

#include <chrono>
#include <memory>
#include <optional>
#include <vector>

namespace arhost::conformance {

// A scene in read-only memory, like the host's: writes crash.
class SealedScene {
public:
    explicit SealedScene(scene::ArenaBuilder builder);
    ~SealedScene();
    SealedScene(SealedScene &&other) noexcept
        : memory_(std::exchange(other.memory_, nullptr)), size_(std::exchange(other.size_, 0)) {}
    SealedScene &operator=(SealedScene &&) = delete;
    const arhost_scene &get() const { return *static_cast<const arhost_scene *>(memory_); }

private:
    void *memory_;
    std::size_t size_;
};

// Whether the ray tracer declares the capability.
bool has_capability(Context &context, std::uint64_t capability);
// Throws Skip unless the ray tracer declares the capability. `name`: without ARHOST_RAYTRACER_CAPABILITY_.
void need_capability(Context &context, std::uint64_t capability, const char *name);

// Sets the option `samples` of the ray tracer, if it has it.
Settings with_samples(Context &context, int samples);
inline Settings many_samples(Context &context) {
    return with_samples(context, 16);
}

// Renders straight images for blending in sRGB, without video, unless told otherwise.
class Tracer {
public:
    Tracer(Context &context, scene::ArenaBuilder builder, Settings overrides = {});
    ~Tracer() { stop(); }
    Tracer(const Tracer &) = delete;
    Tracer &operator=(const Tracer &) = delete;

    arhost_status try_start(const arhost_intrinsics &intrinsics);
    void start(const arhost_intrinsics &intrinsics); // throws Failure unless it succeeds
    void stop();
    void change_scene(scene::ArenaBuilder builder); // stops
    arhost_status try_render(const arhost_camera &camera, Picture &picture, arhost_render_info &info,
                             const arhost_motion *motion = nullptr) {
        return try_render(camera, straight_slot_, picture, info, motion);
    }

    // Of later requests; 0: no limit.
    void limit_samples(std::uint32_t max_samples) { max_samples_ = max_samples; }
    // `shading_px` of later requests.
    void set_shading(std::uint32_t shading_px) { shading_px_ = shading_px; }
    void set_sequence(std::uint64_t sequence) { sequence_ = sequence; }
    // Of later setups, so that requests may be smaller. Without this, a setup has the size of the request.
    void set_full_size(const arhost_intrinsics &intrinsics) { full_size_ = intrinsics; }
    // Of later images; stops if it differs.
    void set_compositing(arhost_compositing compositing);
    // Of later requests, until it is changed; nullptr: none. Stops if the format differs.
    void set_video(const Video *video);
    // The next calls of render get `state` as their state_before, or NULL if it is empty, and `sequence`; before a
    // call, state_after is filled with `filler`.
    void set_state(const std::vector<std::byte> &state, std::uint64_t sequence, std::byte filler = std::byte{0xa5});
    std::uint64_t state_size() const { return state_size_; } // 0 before the start
    std::vector<std::byte> state_after() const;              // of the last render
    // Starts if necessary. Throws Failure unless it succeeds.
    Picture render(const arhost_camera &camera, const arhost_motion *motion = nullptr, std::uint8_t fill = 0);
    LinearPicture render_linear(const arhost_camera &camera, std::uint8_t fill = 0);

    Instance &instance() { return instance_; }
    const arhost_render_info &info() const { return info_; }        // of the last render
    std::chrono::nanoseconds duration() const { return duration_; } // duration of the last render

private:
    template <class Image>
    arhost_status try_render(const arhost_camera &camera, std::optional<Image> &slot, Image &picture,
                             arhost_render_info &info, const arhost_motion *motion);
    template <class Image>
    void render(const arhost_camera &camera, std::optional<Image> &slot, Image &picture, const arhost_motion *motion);

    Instance instance_;
    std::optional<SealedScene> scene_; // must stay valid from start to stop
    const arhost_raytracer &functions_;
    std::optional<arhost_intrinsics> started_, full_size_;
    arhost_image_form form_ = ARHOST_IMAGE_FORM_STRAIGHT;
    arhost_compositing compositing_ = ARHOST_COMPOSITING_SRGB;
    const Video *video_ = nullptr;
    // The same memory for all images from start to stop.
    std::optional<Picture> straight_slot_;
    std::optional<LinearPicture> linear_slot_;
    arhost_render_info info_{};
    std::uint32_t max_samples_ = 0, shading_px_ = 0;
    std::uint64_t sequence_ = 0, state_size_ = 0, state_before_size_ = 0;
    std::byte state_filler_{0xa5};
    std::unique_ptr<GuardedMemory> state_before_, state_after_; // null: none
    std::chrono::nanoseconds duration_{};
};

} // namespace arhost::conformance
