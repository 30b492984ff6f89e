// SPDX-License-Identifier: Apache-2.0
//
// The shaders of a path, compiled by the driver for a scene, and the command that runs them for each pixel.
#pragma once

#include "device.hpp"
#include "layout.hpp"
#include "shaders.hpp"

namespace rt_vulkan {

inline constexpr std::uint32_t group_side = 8; // of a compute shader's invocations

// Some of an image's rows, which a first one and their number tell.
struct Rows {
    std::uint32_t first, count;
    bool operator==(const Rows &) const = default;
};
// The constants that are pushed with them (shaders/scene.glsl).
inline constexpr std::uint32_t pushed_size = sizeof Rows::first;

class ImagePipeline {
public:
    // Compiles, which takes a while, unless the driver's result has been kept from an earlier time.
    ImagePipeline(const Device &device, const Shaders &shaders, VkPipelineLayout layout,
                  const Specialization &constants);

    void record(VkCommandBuffer commands, VkDescriptorSet set, std::uint32_t width, Rows rows) const;

private:
    void compile(const Shaders &shaders, std::span<const VkPipelineShaderStageCreateInfo> stages,
                 const PipelineCache &cache);
    void make_table();

    const Device &device_;
    VkPipelineLayout layout_;
    VkShaderStageFlags stage_flags_;
    Pipeline pipeline_;
    // Of the pipeline for ray tracing: its shader binding table.
    Buffer table_;
    VkStridedDeviceAddressRegionKHR generate_{}, miss_{}, hit_{};
};

} // namespace rt_vulkan
