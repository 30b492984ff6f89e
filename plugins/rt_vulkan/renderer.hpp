// SPDX-License-Identifier: Apache-2.0
//
// From a camera to an image: at once, by commands that are recorded once for each place that images go to, or one
// band of rows after another where that takes long.
#pragma once

#include "acceleration.hpp"
#include "bands.hpp"
#include "pipeline.hpp"
#include "raytracer_common/samples.hpp"
#include "scene_data.hpp"
#include "view.hpp"

#include <optional>
#include <vector>

namespace rt_vulkan {

struct Settings {
    std::uint32_t samples = 1;                       // a pixel
    std::uint32_t light_samples = 4;                 // shadow rays to an extended light, from each sample
    bool accumulate = false;                         // average over frames while the camera stands still
    bool one_path = false;                           // glass sends one ray on, chosen at random, in place of two
    std::optional<Bands::Milliseconds> longest_band; // for tests; none: as the device asks
};

struct Rectangle {
    std::uint32_t x, y, width, height; // px
};

class Renderer {
public:
    Renderer(const arhost_raytracer_setup &setup, const Settings &settings, const arhost::Host &host,
             const Instance &instance, const PhysicalDevice &physical, const Shaders &shaders);

    // Returns the part of the image that holds all alpha above 0; empty: width 0. `motion` may be NULL.
    Rectangle render(const arhost_camera &camera, const arhost_image &image, const arhost_motion *motion = nullptr);

    const SceneData &scene() const { return scene_; }
    // Whether the last image was written to its place by the device itself.
    bool wrote_in_place() const { return wrote_in_place_; }
    std::uint64_t image_count() const { return image_count_; }
    double gpu_ms() const { return gpu_ms_; }                  // of all images; 0 where the device has no clock
    std::uint64_t last_gpu_ns() const { return last_gpu_ns_; } // of the last image; likewise
    // For benchmarks. Of all images: the way from the device's memory to the place that they go to.
    double read_back_ms() const { return read_back_ms_; }
    // The shader alone, as of the last image: nothing is copied.
    void record_shader(VkCommandBuffer commands) const;
    const Submission &submission() const { return submission_; }

private:
    // Where images go: an image's memory itself, or memory of ours (rgba NULL).
    struct Target {
        std::uint8_t *rgba = nullptr;
        std::uint32_t stride = 0;
        Buffer buffer;
        VkCommandBuffer commands = VK_NULL_HANDLE;
        Rows recorded{}; // what they trace
    };
    void make_buffers(const arhost_intrinsics &intrinsics, Path path);
    Buffer make_buffer(Binding binding, std::span<const Bytes> parts, std::size_t least_size,
                       VkBufferUsageFlags further_usage = 0);
    void make_set(const Shaders &shaders);
    void make_pipeline(const Shaders &shaders, std::uint32_t max_depth);
    Target &target_of(const arhost_image &image);
    void record(Target &target, Rows rows) const;
    void record_preparation(VkCommandBuffer commands) const;
    void record_copy(const Target &target) const;
    void trace(std::vector<VkCommandBuffer> commands, Target &target);
    void write_moving_parts();
    Rectangle read_back(const Target &target, const arhost_image &image);

    arhost::Host host_;
    Settings settings_;
    arhost_intrinsics intrinsics_;
    VkPipelineStageFlags stage_; // of the device's work, which the shaders run in
    Device device_;
    Submission submission_;
    SceneData scene_;
    std::uint32_t ray_dimensions_ = 2;
    std::vector<arhost::raytracer_common::Sample> samples_; // of an image
    Frame frame_{};
    std::array<Buffer, binding_count> buffers_;
    Buffer moving_;                            // what the host writes of what moves, part by part
    Buffer read_;                              // the part that is drawn
    std::optional<Acceleration> acceleration_; // none on the plain path
    QueryPool clock_;                          // none where the device has none
    VkCommandBuffer start_clock_ = VK_NULL_HANDLE;
    Bands bands_;
    DescriptorSetLayout set_layout_;
    DescriptorPool pool_;
    VkDescriptorSet set_ = VK_NULL_HANDLE;
    PipelineLayout layout_;
    std::optional<ImagePipeline> pipeline_;
    std::vector<Target> targets_;
    bool imports_ = true; // until the device refuses
    bool wrote_in_place_ = false;
    std::uint64_t image_count_ = 0;
    double gpu_ms_ = 0, read_back_ms_ = 0;
    std::uint64_t last_gpu_ns_ = 0;

    // Of accumulation: how much has been summed up so far, and for which camera.
    std::uint32_t history_samples_ = 0;
    std::optional<arhost_camera> still_camera_;
};

} // namespace rt_vulkan
