// SPDX-License-Identifier: Apache-2.0
//
// The compiled shaders of a path, specialized for a scene, and the commands that run them for each pixel.
#pragma once

#include "device.hpp"
#include "layout.hpp"
#include "shaders.hpp"

namespace rt_vulkan {

inline constexpr std::uint32_t group_side = 8; // px; side of a compute work group, which is square

// A range of an image's rows.
struct Rows {
    std::uint32_t first, count;
    bool operator==(const Rows &) const = default;
};
// Size of the push constants in shaders/scene.glsl, bytes.
inline constexpr std::uint32_t push_constants_size = sizeof Rows::first;

class ImagePipeline {
public:
    // Compiles the shaders. This takes seconds unless the pipeline cache contains the result.
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
    Buffer binding_table_; // only on the path `pipeline`
    VkStridedDeviceAddressRegionKHR raygen_{}, miss_{}, hit_{};
};

} // namespace rt_vulkan
