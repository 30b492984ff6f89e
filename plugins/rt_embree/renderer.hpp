// SPDX-License-Identifier: Apache-2.0
//
// From a camera to an image: which tiles are worth tracing, and who traces them.
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
    std::uint32_t samples = 1; // a pixel
    unsigned threads = 0;      // 0: one a processor
    bool robust = false;
    std::int32_t light_samples = 4; // shadow rays to an extended light, from each sample
    bool accumulate = false;        // average over frames while the camera stands still
    bool one_path = false;          // glass sends one ray on, chosen at random, in place of two
    std::string instruction_set = "auto";
};

// A thread's scratch memory.
class ScratchMemory {
public:
    explicit ScratchMemory(std::uint32_t max_depth);
    Scratch &operator*() { return scratch_; }

private:
    std::vector<float> numbers_;
    std::vector<WaitingRays> waiting_;
    Scratch scratch_{};
};

class Renderer {
public:
    Renderer(const arhost_raytracer_setup &setup, const Settings &settings, const arhost::Host &host);

    // Returns the part of the image that holds all alpha above 0; empty: x1 <= x0. `motion` may be NULL:
    // everything is where it was.
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
    std::uint32_t samples_a_frame_;
    std::vector<arhost::raytracer_common::Sample> samples_; // of this frame
    EmbreeScene scene_;
    std::vector<ScratchMemory> scratch_; // one a thread
    std::int32_t light_samples_;
    bool one_path_;

    // Of accumulation: what has been summed up so far, and for which camera.
    std::vector<float> history_; // empty where frames stand alone
    std::uint32_t history_samples_ = 0;
    std::optional<arhost_camera> still_camera_;
};

// The kernel of that name, or with "auto" the widest that this processor can run.
Kernel choose_kernel(const std::string &instruction_set);

} // namespace rt_embree
