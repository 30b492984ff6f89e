// SPDX-License-Identifier: Apache-2.0
//
// Renders images. An image usually needs one submission, whose commands are recorded once per target; with caustics
// of lamps, another one traces photons before. Images that take long are split into bands (bands.hpp).
#pragma once

#include "acceleration_structures.hpp"
#include "bands.hpp"
#include "camera_data.hpp"
#include "image_pipeline.hpp"
#include "layer_denoiser.hpp"
#include "raytracer_common/photon_map.hpp"
#include "raytracer_common/samples.hpp"
#include "raytracer_common/video.hpp"
#include "scene_data.hpp"

#include <functional>
#include <optional>
#include <vector>

namespace rt_vulkan {

struct Settings {
    std::uint32_t samples = 1;       // per pixel
    std::uint32_t light_samples = 4; // per shaded point and area light, environment or background
    bool accumulate = false;         // average over frames while the camera and scene are static
    bool single_path = false;        // glass spawns one random ray instead of two
    float max_radiance = 100;        // path integrator: bound of each sample; infinity: none
    std::uint32_t photons = 16384;   // path integrator: per frame and sample
    bool denoise = false;            // path integrator
    arhost::raytracer_common::View view = arhost::raytracer_common::View::picture; // else it needs `denoise`
    unsigned denoiser_threads = 0;                                                 // 0: one per processor
    std::optional<Bands::Milliseconds> max_band_time; // set by tests only; the default depends on the device
};

struct Rectangle {
    std::uint32_t x, y, width, height; // px
};

class Renderer {
public:
    Renderer(const arhost_raytracer_setup &setup, const Settings &settings, const arhost::Host &host,
             const PhysicalDevice &physical, const Shaders &shaders);

    // Returns a rectangle that contains all pixels that virtual objects affect; its width is 0 if there are none.
    // `motion` is NULL if nothing has moved since the last call, `video` if the frame under the overlay is unknown.
    // `sequence`: number of the frame, for the random numbers of the path integrator. `state`: of state_size() bytes;
    // without it, there is no denoising.
    Rectangle render(const arhost_camera &camera, const arhost_image &image, const arhost_motion *motion = nullptr,
                     const arhost_frame *video = nullptr, std::uint64_t sequence = 0,
                     const LayerDenoiser::StateSlots &state = {});
    std::uint64_t state_size() const { return denoiser_ ? denoiser_->state_size() : 0; }

    // Both functions change the images of later calls as if the renderer had been created with the new setting.
    // `full_samples`: number of samples of an image without a limit (arhost_render_request.max_samples).
    void set_samples(std::uint32_t samples, std::uint32_t full_samples);
    void set_light_samples(std::uint32_t samples);

    const SceneData &scene() const { return scene_; }
    // Whether the device wrote the last image directly into the caller's memory.
    bool wrote_in_place() const { return wrote_in_place_; }
    std::uint64_t image_count() const { return image_count_; }
    double gpu_ms() const { return gpu_ms_; } // total GPU time of all images; 0 if the device has no timestamps
    std::uint64_t last_gpu_ns() const {
        return last_gpu_ns_;
    } // GPU time of the last image; 0 if the device has no timestamps
    // For benchmarks: the total time of copying images from device memory to their targets.
    double read_back_ms() const { return read_back_ms_; }
    // For benchmarks: records the commands that trace the last image, without copying it.
    void record_shader(VkCommandBuffer commands) const;
    const Submission &submission() const { return submission_; }

private:
    // The memory to which the device writes an image: either the caller's memory, imported into Vulkan, or a buffer
    // from which the host copies the image (`pixels` is NULL).
    struct Target {
        std::byte *pixels = nullptr;
        std::uint32_t stride = 0;
        Buffer buffer;
        VkCommandBuffer commands = VK_NULL_HANDLE;
        Rows recorded{}; // the rows that `commands` trace
    };
    void make_rays(bool has_slopes);
    bool make_photon_buffers(std::uint32_t samples);
    std::size_t layers_size() const;
    void update_descriptor_set();
    void make_image_buffer(std::size_t image_size);
    void make_buffers(Path path);
    Buffer make_buffer(Binding binding, std::span<const Bytes> parts, std::size_t min_size,
                       VkBufferUsageFlags more_usage = 0);
    // The top-level acceleration structure, if any, is the last descriptor.
    std::uint32_t descriptor_count() const { return binding_count + (structures_ ? 1 : 0); }
    void make_descriptor_set(const Shaders &shaders);
    void write_descriptor_set();
    void make_pipeline(const Shaders &shaders, std::uint32_t max_depth);
    Target &target_for(const arhost_image &image);
    void record(Target &target, Rows rows) const;
    void record_preparation(VkCommandBuffer commands) const;
    VkCommandBuffer record_layers(const ImagePipeline &pipeline, Rows rows) const;
    void record_copy(VkCommandBuffer commands, const Buffer &to, std::span<const VkBufferCopy> regions) const;
    std::vector<VkBufferCopy> rows_of(const Target &target) const;
    void record_photons(Rows rows, bool is_last) const;
    void record_photon_map(std::size_t size) const;
    void check_cancelled() const;
    void write_frame();
    void trace(std::vector<VkCommandBuffer> commands, std::uint32_t row_count, Bands &bands,
               const std::function<VkCommandBuffer(Rows)> &record, const std::function<void(double)> &report);
    void trace_photons(std::vector<VkCommandBuffer> &commands, const std::function<void(double)> &report);
    void write_moving_parts();
    void set_lens();
    void set_video(const arhost_frame *video);
    void begin_denoising(const LayerDenoiser::StateSlots &state, const arhost_image &image,
                         const arhost_motion *motion, std::uint64_t sequence);
    Rectangle read_back(const Target &target, const arhost_image &image);
    void read_timestamps();

    arhost::Host host_;
    Settings settings_;
    std::uint32_t full_samples_; // per pixel of an image without a limit
    arhost_intrinsics intrinsics_;
    bool is_path_;               // has the path integrator
    std::uint32_t pixel_size_;   // bytes per pixel of the images
    VkPipelineStageFlags stage_; // pipeline stage in which the shaders run
    Device device_;
    Submission submission_;
    SceneData scene_;
    std::uint32_t ray_dimensions_ = 2;
    std::vector<arhost::raytracer_common::Sample> samples_; // sample positions of the current image
    Frame frame_{};
    std::array<Buffer, binding_count> buffers_;
    Buffer moving_; // staging buffer for the moving parts of all buffers
    arhost::raytracer_common::VideoImage video_image_;
    Buffer video_;                          // staging buffer for the video; empty if no image has one
    Buffer drawn_;                          // bounding rectangle of the drawn pixels, for the host
    Buffer photons_;                        // of the last image, for the host; empty without caustics
    std::optional<LayerDenoiser> denoiser_; // empty without denoising
    Buffer layers_;                         // of the last denoised image, for the host
    arhost::raytracer_common::PhotonMap photon_map_;
    std::optional<AccelerationStructures> structures_; // empty on the path `plain`
    QueryPool timestamps_;                             // empty if unsupported
    VkCommandBuffer start_timestamps_ = VK_NULL_HANDLE, preparation_ = VK_NULL_HANDLE,
                    photon_commands_ = VK_NULL_HANDLE, layer_commands_ = VK_NULL_HANDLE;
    Bands bands_, photon_bands_, tap_bands_;
    DescriptorSetLayout set_layout_;
    DescriptorPool pool_;
    VkDescriptorSet set_ = VK_NULL_HANDLE;
    PipelineLayout layout_;
    std::optional<ImagePipeline> pipeline_;
    std::optional<ImagePipeline> photon_pipeline_; // empty without caustics
    std::optional<ImagePipeline> tap_pipeline_;    // empty without denoising
    std::vector<Target> targets_;
    bool imports_ = true; // false once an import of host memory has failed
    bool wrote_in_place_ = false;
    std::uint64_t image_count_ = 0;
    double gpu_ms_ = 0, read_back_ms_ = 0;
    std::uint64_t last_gpu_ns_ = 0;

    // State of the option `accumulate`: the number of samples so far, and their camera (empty if the sums are
    // invalid).
    std::uint32_t history_samples_ = 0;
    std::optional<arhost_camera> history_camera_;
};

} // namespace rt_vulkan
