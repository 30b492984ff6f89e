// SPDX-License-Identifier: Apache-2.0
//
// A path's compiled shaders, specialized for a scene, and the command that runs them for each pixel.
#pragma once

#include "device.hpp"
#include "layout.hpp"
#include "shaders.hpp"

namespace rt_vulkan {

inline constexpr std::uint32_t group_side = 8; // px; work groups of the compute shaders are square

// A range of an image's rows.
struct Rows {
    std::uint32_t first, count;
    bool operator==(const Rows &) const = default;
};
// The push constants of shaders/scene.glsl.
inline constexpr std::uint32_t push_constants_size = sizeof Rows::first;

class ImagePipeline {
public:
    // Compiles for seconds, unless the pipeline cache has the driver's result.
    ImagePipeline(const Device &device, const Shaders &shaders, VkPipelineLayout layout,
                  const Specialization &constants);

    void record(VkCommandBuffer commands, VkDescriptorSet set, std::uint32_t width, Rows rows) const;

private:
    void compile(Path path, std::span<const VkPipelineShaderStageCreateInfo> stages, const PipelineCache &cache);
    void make_binding_table();

    const Device &device_;
    VkPipelineLayout layout_;
    VkShaderStageFlags stage_flags_;
    Pipeline pipeline_;
    Buffer binding_table_; // of `pipeline` only
    VkStridedDeviceAddressRegionKHR raygen_{}, miss_{}, hit_{};
};

} // namespace rt_vulkan
