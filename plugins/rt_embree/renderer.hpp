// SPDX-License-Identifier: Apache-2.0
//
// Renders an image for a camera: selects the visible tiles and distributes them over threads.
#pragma once

#include "embree_scene.hpp"
#include "ray_table.hpp"
#include "thread_pool.hpp"

#include <arhost-cpp/plugin.hpp>

#include <optional>
#include <string>
#include <vector>

namespace rt_embree {

struct Settings {
    std::uint32_t samples = 1; // per pixel
    unsigned threads = 0;      // 0: one per processor
    bool robust = false;
    std::int32_t light_samples = 4; // shadow rays per ray and area light
    bool accumulate = false;        // average over frames while camera and scene are static
    bool single_path = false;       // glass spawns one random ray instead of two
    std::string instruction_set = "auto";
};

// Owns a thread's `Scratch`.
class ScratchMemory {
public:
    explicit ScratchMemory(std::uint32_t max_depth);
    Scratch &operator*() { return scratch_; }

private:
    std::vector<float> storage_;
    std::vector<RayQueue> queues_;
    Scratch scratch_{};
};

class Renderer {
public:
    Renderer(const arhost_raytracer_setup &setup, const Settings &settings, const arhost::Host &host);

    // Returns a rectangle that contains all non-zero alphas; empty: x1 <= x0. `motion` may be NULL: nothing has
    // moved.
    Rectangle render(const arhost_camera &camera, const arhost_image &image, const arhost_motion *motion = nullptr);
    const EmbreeScene &scene() const { return scene_; }

    const char *kernel_name() const { return kernel_.name; }
    unsigned thread_count() const { return threads_.thread_count(); }

private:
    arhost::Host host_;
    arhost_intrinsics intrinsics_;
    Kernel kernel_;
    ThreadPool threads_;
    RayTable ray_table_;
    std::uint32_t samples_per_frame_;
    std::vector<arhost::raytracer_common::Sample> samples_; // of this frame
    EmbreeScene scene_;
    std::vector<ScratchMemory> scratch_; // one per thread
    std::int32_t light_samples_;
    bool single_path_;

    // Accumulation: sample sums so far, and the camera they belong to.
    std::vector<float> history_; // empty unless accumulating
    std::uint32_t history_samples_ = 0;
    std::optional<arhost_camera> history_camera_;
};

// The named kernel, or for "auto" the widest that this processor supports. Throws Failure if unsupported.
Kernel choose_kernel(const std::string &instruction_set);

} // namespace rt_embree
