// SPDX-License-Identifier: Apache-2.0
//
// Renders images: in one submission, whose commands are recorded once per target, or band by band if that takes long.
#pragma once

#include "acceleration_structures.hpp"
#include "bands.hpp"
#include "pipeline.hpp"
#include "raytracer_common/samples.hpp"
#include "scene_data.hpp"
#include "view.hpp"

#include <optional>
#include <vector>

namespace rt_vulkan {

struct Settings {
    std::uint32_t samples = 1;                        // per pixel
    std::uint32_t light_samples = 4;                  // shadow rays to an extended light, per sample
    bool accumulate = false;                          // average over frames while the camera stands still
    bool one_path = false;                            // glass follows one randomly chosen ray instead of both
    std::optional<Bands::Milliseconds> max_band_time; // for tests; default: depends on the device
};

struct Rectangle {
    std::uint32_t x, y, width, height; // px
};

class Renderer {
public:
    Renderer(const arhost_raytracer_setup &setup, const Settings &settings, const arhost::Host &host,
             const PhysicalDevice &physical, const Shaders &shaders);

    // Returns the bounding box of the pixels with alpha above 0; width 0 if there are none. `motion` may be NULL.
    Rectangle render(const arhost_camera &camera, const arhost_image &image, const arhost_motion *motion = nullptr);

    const SceneData &scene() const { return scene_; }
    // Whether the device wrote the last image directly into the caller's memory.
    bool wrote_in_place() const { return wrote_in_place_; }
    std::uint64_t image_count() const { return image_count_; }
    double gpu_ms() const { return gpu_ms_; }                  // of all images; 0 without timestamps
    std::uint64_t last_gpu_ns() const { return last_gpu_ns_; } // of the last image; 0 without timestamps
    // For benchmarks: the time of copying all images from device memory to their targets.
    double read_back_ms() const { return read_back_ms_; }
    // For benchmarks: records the last image's shader without copies.
    void record_shader(VkCommandBuffer commands) const;
    const Submission &submission() const { return submission_; }

private:
    // Where the device writes an image: the caller's imported memory, or a buffer (rgba NULL) that the host copies.
    struct Target {
        std::uint8_t *rgba = nullptr;
        std::uint32_t stride = 0;
        Buffer buffer;
        VkCommandBuffer commands = VK_NULL_HANDLE;
        Rows recorded{}; // which `commands` trace
    };
    void make_buffers(const arhost_intrinsics &intrinsics, Path path);
    Buffer make_buffer(Binding binding, std::span<const Bytes> parts, std::size_t min_size,
                       VkBufferUsageFlags more_usage = 0);
    void make_descriptor_set(const Shaders &shaders);
    void make_pipeline(const Shaders &shaders, std::uint32_t max_depth);
    Target &target_for(const arhost_image &image);
    void record(Target &target, Rows rows) const;
    void record_preparation(VkCommandBuffer commands) const;
    void record_copy(const Target &target) const;
    void trace(std::vector<VkCommandBuffer> commands, Target &target);
    void write_moving_parts();
    Rectangle read_back(const Target &target, const arhost_image &image);

    arhost::Host host_;
    Settings settings_;
    arhost_intrinsics intrinsics_;
    VkPipelineStageFlags stage_; // that runs the shaders
    Device device_;
    Submission submission_;
    SceneData scene_;
    std::uint32_t ray_dimensions_ = 2;
    std::vector<arhost::raytracer_common::Sample> samples_; // of an image
    Frame frame_{};
    std::array<Buffer, binding_count> buffers_;
    Buffer moving_;                                    // staging of the moving parts, one after another
    Buffer drawn_;                                     // the bounding box of drawn pixels
    std::optional<AccelerationStructures> structures_; // none on the plain path
    QueryPool timestamps_;                             // none if unsupported
    VkCommandBuffer start_timestamps_ = VK_NULL_HANDLE;
    Bands bands_;
    DescriptorSetLayout set_layout_;
    DescriptorPool pool_;
    VkDescriptorSet set_ = VK_NULL_HANDLE;
    PipelineLayout layout_;
    std::optional<ImagePipeline> pipeline_;
    std::vector<Target> targets_;
    bool imports_ = true; // until an import fails
    bool wrote_in_place_ = false;
    std::uint64_t image_count_ = 0;
    double gpu_ms_ = 0, read_back_ms_ = 0;
    std::uint64_t last_gpu_ns_ = 0;

    // Of accumulation: the samples so far, and their camera.
    std::uint32_t history_samples_ = 0;
    std::optional<arhost_camera> history_camera_;
};

} // namespace rt_vulkan
