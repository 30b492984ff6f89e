// SPDX-License-Identifier: Apache-2.0
//
// A path's shaders, as they lie beside the plugin.
#pragma once

#include "instance.hpp"

#include <cstdint>
#include <filesystem>
#include <vector>

namespace rt_vulkan {

struct Shader {
    VkShaderStageFlagBits stage;
    std::vector<std::uint32_t> words; // SPIR-V
};

struct Shaders {
    Path path;
    std::vector<Shader> stages;

    VkShaderStageFlags stage_flags() const;
    // The step of the device's work that they run in.
    VkPipelineStageFlags pipeline_stage() const;
};

// A path's shaders, as they lie in `folder`; throws, naming the file, where one is missing or no SPIR-V.
Shaders read_shaders(const std::filesystem::path &folder, Path path);

} // namespace rt_vulkan
