// SPDX-License-Identifier: Apache-2.0
//
// The compiled shaders of each path and integrator, embedded in the plugin.
#pragma once

#include "instance.hpp"

#include <arhost/scene.h>

#include <cstdint>
#include <span>
#include <vector>

namespace rt_vulkan {

struct Shader {
    VkShaderStageFlagBits stage;
    std::span<const std::uint32_t> words; // SPIR-V
};

struct Shaders {
    Path path;
    std::vector<Shader> stages; // on the path `pipeline`: raygen, miss, closest hit, any hit, intersection

    VkShaderStageFlags stage_flags() const;
    VkPipelineStageFlags pipeline_stage() const; // the stage in which the shaders run, for barriers
};

Shaders shaders_of(Path path, arhost_integrator integrator = ARHOST_INTEGRATOR_WHITTED);
Shaders photon_shaders_of(Path path);
Shaders tap_shaders_of(Path path);

} // namespace rt_vulkan
