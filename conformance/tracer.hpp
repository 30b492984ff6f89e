// SPDX-License-Identifier: Apache-2.0
// Runs a ray tracer on a scene.
#pragma once

#include "conformance/picture.hpp"
#include "conformance/plugin_library.hpp"
#include "conformance/scenes.hpp"
#include "conformance/test.hpp"
#include "scene/arena_builder.hpp"

#include <chrono>
#include <optional>

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
bool has_capability(Context &context, std::uint32_t capability);
// Throws Skip unless the ray tracer declares the capability. `name`: without ARHOST_CAPABILITY_.
void need_capability(Context &context, std::uint32_t capability, const char *name);

// Sets the option `samples`, if the ray tracer has it, to 16 samples per pixel.
Settings many_samples(Context &context);

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
                             const arhost_motion *motion = nullptr);

    // Of later requests; 0: no limit.
    void limit_samples(std::uint32_t max_samples) { max_samples_ = max_samples; }
    // Starts if necessary. Throws Failure unless it succeeds.
    Picture render(const arhost_camera &camera, const arhost_motion *motion = nullptr, std::uint8_t fill = 0);

    Instance &instance() { return instance_; }
    const arhost_render_info &info() const { return info_; }        // of the last render
    std::chrono::nanoseconds duration() const { return duration_; } // duration of the last render

private:
    Instance instance_;
    std::optional<SealedScene> scene_; // must stay valid from start to stop
    const arhost_raytracer &functions_;
    std::optional<arhost_intrinsics> started_;
    std::optional<Picture> slot_; // the same memory for all images from start to stop
    arhost_render_info info_{};
    std::uint32_t max_samples_ = 0;
    std::chrono::nanoseconds duration_{};
};

} // namespace arhost::conformance
